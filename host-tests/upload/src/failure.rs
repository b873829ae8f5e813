//! Why an upload ended, in words that say what to do.

use std::error::Error;
use std::fmt;

/// What an upload does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Waits for a bootloader to answer.
    Connecting,
    /// Asks what the board is.
    Identifying,
    /// Has the flash erased.
    Erasing,
    /// Sends the image.
    Programming,
    /// Compares checksums.
    Checking,
    /// Has the board boot.
    Booting,
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Connecting => "connecting",
            Self::Identifying => "identifying",
            Self::Erasing => "erasing",
            Self::Programming => "programming",
            Self::Checking => "checking",
            Self::Booting => "booting",
        })
    }
}

/// Why an upload did not come to its end. Nothing of the board's flash has changed before
/// [`Phase::Erasing`]; after that the board stays in its bootloader, and the next upload succeeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// No bootloader has answered.
    NoBootloader,
    /// The bootloader has stopped answering.
    Silent(Phase),
    /// What the bootloader has sent is no answer.
    Garbled(Phase),
    /// The bootloader has refused a command, with this status.
    Refused(Phase, u8),
    /// The chip is one that the bootloader does not program.
    BadSilicon,
    /// It speaks a protocol that is not known here.
    Protocol(u32),
    /// The image is for another kind of board.
    WrongBoard {
        /// The id of the board that is there.
        board: u32,
        /// The id of the boards that the image is for.
        image: u32,
    },
    /// The image does not fit.
    TooLarge {
        /// Bytes of the image.
        size: usize,
        /// Bytes that the board has for it.
        room: u32,
    },
    /// The image has no vectors that the bootloader would boot.
    NotBootable,
    /// What is in the flash is not the image.
    Damaged {
        /// The image's checksum.
        image: u32,
        /// The flash's.
        flash: u32,
    },
}

/// Said where the flash may be half written.
const AGAIN: &str = "the board stays in its bootloader; run the upload again";

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoBootloader => f.write_str(
                "no bootloader answers: unplug the board's USB and all other power, plug it in \
                 again, and see that nothing else uses the port",
            ),
            Self::Silent(phase @ (Phase::Connecting | Phase::Identifying)) => {
                write!(
                    f,
                    "the bootloader stopped answering while {phase}; run the upload again"
                )
            }
            Self::Silent(phase) => {
                write!(f, "the bootloader stopped answering while {phase}: {AGAIN}")
            }
            Self::Garbled(phase) => write!(
                f,
                "what came back while {phase} is no answer of a bootloader: see that nothing else \
                 uses the port, and run the upload again"
            ),
            Self::Refused(phase, status) => write!(
                f,
                "the bootloader refused with status {status:#04x} while {phase}: {AGAIN}"
            ),
            Self::BadSilicon => f.write_str(
                "the chip is a revision that the bootloader does not program: nothing was changed",
            ),
            Self::Protocol(protocol) => write!(
                f,
                "the bootloader speaks protocol {protocol}, and 4 or 5 is known here: nothing was \
                 changed"
            ),
            Self::WrongBoard { board, image } => write!(
                f,
                "the image is for boards with the id {image}, and this board's is {board}: nothing \
                 was changed; take a file for this board, or power it off and on"
            ),
            Self::TooLarge { size, room } => write!(
                f,
                "the image has {size} bytes, and this board has room for {room}: nothing was changed"
            ),
            Self::NotBootable => f.write_str(
                "the image does not begin with vectors that the bootloader would boot: nothing was \
                 changed; take another file",
            ),
            Self::Damaged { image, flash } => write!(
                f,
                "the flash's checksum is {flash:#010x}, the image's {image:#010x}, so it is not \
                 booted: {AGAIN}"
            ),
        }
    }
}

impl Error for Failure {}
