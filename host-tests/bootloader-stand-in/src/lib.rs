//! A stand-in for PX4's bootloader: its protocol, on any board.
//!
//! *Purpose.* Uploads are tested against something that behaves as the bootloader of a Pixhawk 1 does.
//! [`serve`] answers commands until the application is to be started.
//!
//! *Design.* Written from a description of the protocol (its table is in `docs/hardware.md`), not from
//! PX4's source: nothing of that is here. It blocks, as the original does, because its limits are
//! those of a loop that waits for one byte after the other. Whatever is written, the application's
//! first word is kept back until BOOT: an upload that was cut off is never booted.
//!
//! *Limits.* Protocol 5, board 9, revision 0. SET_DELAY is always refused, as it is for an application
//! without a signature.
#![cfg_attr(target_os = "none", no_std)]
#![forbid(unsafe_code)]

/// Where the application begins.
pub const APPLICATION: u32 = 0x0800_4000;

/// An erased word.
const ERASED: u32 = u32::MAX;

const INSYNC: u8 = 0x12;
const OK: u8 = 0x10;
const FAILED: u8 = 0x11;
const INVALID: u8 = 0x13;
const END: u8 = 0x20;

/// The most that PROG_MULTI carries, in bytes.
const PIECE_MAX: usize = 252;

/// What the bootloader runs on.
pub trait Board {
    /// Why nothing more can be received or sent: the plug is out.
    type Gone;

    /// The next byte, waited for so many ms; forever without a limit.
    ///
    /// # Errors
    ///
    /// There will be no byte any more.
    fn receive(&mut self, within_ms: Option<u32>) -> Result<Option<u8>, Self::Gone>;

    /// Sends a byte.
    ///
    /// # Errors
    ///
    /// Nothing can be sent any more.
    fn send(&mut self, byte: u8) -> Result<(), Self::Gone>;

    /// Erases all sectors of the application that are not blank.
    fn erase(&mut self);

    /// Programs a word at this offset from [`APPLICATION`].
    fn program(&mut self, offset: u32, word: u32);

    /// The word at this offset from [`APPLICATION`].
    fn word(&self, offset: u32) -> u32;

    /// The application's flash, in bytes.
    fn room(&self) -> u32;

    /// Word `vector` of the application's vector table, 7 to 10.
    fn vector(&self, vector: u32) -> u32 {
        self.word(4 * vector)
    }

    /// The word at this offset of the chip's unique id.
    fn serial(&self, offset: u32) -> u32;

    /// The word at this offset of the one-time programmable memory.
    fn one_time(&self, offset: u32) -> u32;

    /// DBGMCU_IDCODE.
    fn chip(&self) -> u32;
}

/// Whether the application can be started: its first word is programmed, and its reset vector points
/// into its flash.
pub fn is_bootable(board: &impl Board) -> bool {
    let flash = APPLICATION..APPLICATION + board.room();
    board.word(0) != ERASED && flash.contains(&board.word(4))
}

/// How a command ended.
enum End {
    /// Done.
    Done,
    /// It could not be done.
    Failed,
    /// It was no such command, or not the time for it: everything begins anew.
    Invalid,
}

/// What has happened since the beginning, or since a command was invalid.
#[derive(Clone, Copy, Default)]
struct State {
    synced: bool,
    identified: bool,
    erased: bool,
    programmed: bool,
    checked: bool,
}

/// Serves commands until one says that the application is to be started, or until `patience_ms` pass
/// without any; without a limit it waits forever.
///
/// # Errors
///
/// The board's line is gone.
pub fn serve<B: Board>(board: &mut B, patience_ms: Option<u32>) -> Result<(), B::Gone> {
    let mut session = Session {
        board,
        state: State::default(),
        offset: 0,
        first: ERASED,
    };
    let mut patience_ms = patience_ms;
    loop {
        let Some(opcode) = session.board.receive(patience_ms)? else {
            return Ok(());
        };
        let Some(end) = session.command(opcode)? else {
            continue;
        };
        let status = match end {
            End::Done => OK,
            End::Failed => FAILED,
            End::Invalid => INVALID,
        };
        if status == INVALID {
            session.state = State::default();
        } else {
            patience_ms = None;
        }
        session.board.send(INSYNC)?;
        session.board.send(status)?;
        if opcode == 0x30 && status == OK {
            return Ok(());
        }
    }
}

struct Session<'a, B> {
    board: &'a mut B,
    state: State,
    /// Where PROG_MULTI goes on.
    offset: u32,
    /// The application's first word, which is not programmed yet.
    first: u32,
}

impl<B: Board> Session<'_, B> {
    /// Does the command that begins with `opcode`; none if there is no such command.
    fn command(&mut self, opcode: u8) -> Result<Option<End>, B::Gone> {
        let end = match opcode {
            // GET_SYNC
            0x21 => {
                let is_whole = self.ends(2)?;
                self.state.synced = true;
                done(is_whole)
            }
            0x22 => self.get_device()?,
            // CHIP_ERASE
            0x23 => {
                let State {
                    synced, identified, ..
                } = self.state;
                if self.ends(2)? && synced && identified {
                    self.board.erase();
                    (self.offset, self.first) = (0, ERASED);
                    self.state.erased = true;
                    End::Done
                } else {
                    End::Invalid
                }
            }
            0x27 => self.prog_multi()?,
            // GET_CRC
            0x29 => {
                if self.ends(2)? {
                    let crc = self.crc();
                    self.send_word(crc)?;
                    self.state.checked = true;
                    End::Done
                } else {
                    End::Invalid
                }
            }
            // GET_OTP, GET_SN
            0x2A | 0x2B => match self.argument()? {
                Some(offset) if self.ends(2)? => {
                    let word = match opcode {
                        0x2A => self.board.one_time(offset),
                        _ => self.board.serial(offset),
                    };
                    self.send_word(word)?;
                    End::Done
                }
                _ => End::Invalid,
            },
            // GET_CHIP
            0x2C => {
                if self.ends(2)? {
                    let chip = self.board.chip();
                    self.send_word(chip)?;
                    End::Done
                } else {
                    End::Invalid
                }
            }
            // SET_DELAY
            0x2D => {
                self.board.receive(Some(100))?;
                self.ends(2)?;
                End::Invalid
            }
            // GET_CHIP_DES
            0x2E => {
                let text = *b"STM32F42x,3";
                if self.ends(2)? {
                    self.send_word(text.len() as u32)?;
                    for byte in text {
                        self.board.send(byte)?;
                    }
                    End::Done
                } else {
                    End::Invalid
                }
            }
            0x30 => self.boot()?,
            _ => return Ok(None),
        };
        Ok(Some(end))
    }

    fn get_device(&mut self) -> Result<End, B::Gone> {
        let parameter = self.board.receive(Some(1_000))?;
        if !self.ends(2)? {
            return Ok(End::Invalid);
        }
        match parameter {
            Some(1) => self.send_word(5)?,
            Some(2) => self.send_word(9)?,
            Some(3) => self.send_word(0)?,
            Some(4) => {
                let room = self.board.room();
                self.send_word(room)?;
            }
            Some(5) => {
                for vector in 7..=10 {
                    let word = self.board.vector(vector);
                    self.send_word(word)?;
                }
            }
            _ => return Ok(End::Invalid),
        }
        self.state.identified = true;
        Ok(End::Done)
    }

    fn prog_multi(&mut self) -> Result<End, B::Gone> {
        let Some(count) = self.board.receive(Some(50))? else {
            return Ok(End::Invalid);
        };
        let count = usize::from(count);
        if count % 4 != 0 || count > PIECE_MAX || !self.state.erased {
            return Ok(End::Invalid);
        }
        let mut bytes = [0; PIECE_MAX];
        let piece = &mut bytes[..count];
        for byte in &mut *piece {
            let Some(received) = self.board.receive(Some(1_000))? else {
                return Ok(End::Invalid);
            };
            *byte = received;
        }
        if !self.ends(200)? || self.offset + count as u32 > self.board.room() {
            return Ok(End::Invalid);
        }
        for word in piece.as_chunks::<4>().0 {
            let word = u32::from_le_bytes(*word);
            if self.offset == 0 {
                self.first = word;
            } else {
                self.board.program(self.offset, word);
                if self.board.word(self.offset) != word {
                    return Ok(End::Failed);
                }
            }
            self.offset += 4;
        }
        self.state.programmed = true;
        Ok(End::Done)
    }

    fn boot(&mut self) -> Result<End, B::Gone> {
        let State {
            synced,
            identified,
            erased,
            programmed,
            checked,
        } = self.state;
        let is_time = synced && identified && (!erased || (programmed && checked));
        if !self.ends(1_000)? || !is_time {
            return Ok(End::Invalid);
        }
        if self.first != ERASED {
            self.board.program(0, self.first);
            if self.board.word(0) != self.first {
                return Ok(End::Failed);
            }
        }
        Ok(End::Done)
    }

    /// Whether the command ends within so many ms.
    fn ends(&mut self, within_ms: u32) -> Result<bool, B::Gone> {
        Ok(self.board.receive(Some(within_ms))? == Some(END))
    }

    /// A word of the command.
    fn argument(&mut self) -> Result<Option<u32>, B::Gone> {
        let mut word = [0; 4];
        for byte in &mut word {
            let Some(received) = self.board.receive(Some(100))? else {
                return Ok(None);
            };
            *byte = received;
        }
        Ok(Some(u32::from_le_bytes(word)))
    }

    fn send_word(&mut self, word: u32) -> Result<(), B::Gone> {
        word.to_le_bytes()
            .into_iter()
            .try_for_each(|byte| self.board.send(byte))
    }

    /// Over all of the application's flash, as it will be.
    fn crc(&self) -> u32 {
        let mut crc = 0_u32;
        for offset in (0..self.board.room()).step_by(4) {
            let word = match offset {
                0 if self.first != ERASED => self.first,
                _ => self.board.word(offset),
            };
            for byte in word.to_le_bytes() {
                crc ^= u32::from(byte);
                for _ in 0..2 {
                    crc = crc >> 4 ^ NIBBLES[(crc & 15) as usize];
                }
            }
        }
        crc
    }
}

const fn done(is_done: bool) -> End {
    if is_done { End::Done } else { End::Invalid }
}

/// Four steps of the reflected polynomial 0xEDB88320.
const NIBBLES: [u32; 16] = {
    let mut table = [0; 16];
    let mut index = 0;
    while index < 16 {
        let mut crc = index as u32;
        let mut step = 0;
        while step < 4 {
            crc = if crc & 1 != 0 {
                crc >> 1 ^ 0xEDB8_8320
            } else {
                crc >> 1
            };
            step += 1;
        }
        table[index] = crc;
        index += 1;
    }
    table
};
