//! The links by which a host asks a board.
//!
//! *Purpose.* [`Link`] says what lies between the moment at which a PING leaves the host's program and the board's
//! stamp, as far as that is known beforehand.
//!
//! *Design.* A serial line begins at once, and the stamp is that of the first byte: constant. USB moves bytes in
//! frames of 1 ms (USB 2.0, 5.12): a PING waits for the next one, and the stamp is that of its packet.
//!
//! *Limits.* What a hub or the host's driver adds is in no figure here.

use std::fmt;

use clap::ValueEnum;

/// A frame of USB at full speed. \[ns\]
pub const FRAME_NS: i64 = 1_000_000;
/// Ten bits at the board's own speed (42 MHz by 365, RM0090 30.3.4): from the start of a PING to the end of its first
/// byte. \[ns\]
const FIRST_BYTE_NS: i64 = 86_905;

/// A link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Link {
    /// TELEM1, a serial line at 115200
    Telem1,
    /// TELEM2, another one
    Telem2,
    /// The micro-USB connector, full speed
    Usb,
}

impl Link {
    /// Its name on a command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Telem1 => "telem1",
            Self::Telem2 => "telem2",
            Self::Usb => "usb",
        }
    }

    /// From a PING's leaving the host to its stamp, as far as that is constant. \[ns\]
    #[must_use]
    pub const fn constant_ns(self) -> i64 {
        match self {
            Self::Telem1 | Self::Telem2 => FIRST_BYTE_NS,
            Self::Usb => 0,
        }
    }

    /// What the host does not know of it. \[ns\]
    #[must_use]
    pub const fn unknown_ns(self) -> i64 {
        match self {
            Self::Telem1 | Self::Telem2 => 0,
            Self::Usb => FRAME_NS,
        }
    }
}

impl fmt::Display for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Telem1 => "TELEM1",
            Self::Telem2 => "TELEM2",
            Self::Usb => "USB",
        })
    }
}
