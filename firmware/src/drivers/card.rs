//! The memory card: found, and its blocks read and written.
//!
//! *Purpose.* [`Card::find`] brings a card up, [`Card::read`] and [`Card::write`] move blocks, each
//! with a bounded number of attempts.
//!
//! *Design.* The start-up of the SD Physical Layer Simplified Specification, 4.2, with a limit for a
//! card that never becomes ready. It is for cards of the first version (no answer to CMD8, blocks
//! addressed by bytes) and of the second. After a failed attempt the card is found again before the
//! next, so that nothing of the failure is left on either side; if it is another card then, by its
//! identification, it is refused. A card that is still busy after the time that it may take is not
//! reset in the middle of its work: that is the end of the attempts. What failed is counted by kind.
//!
//! *Limits.* The slot has no contact that detects a card: an empty one is silent. Write protection is
//! read from the card (CSD), since the slot's sliding contact is not wired either. All cards take
//! four lines, as 4.7.4 requires.

use super::sdio::{BLOCK, BusError, Sdio, within};

/// Attempts at a block.
const ATTEMPTS: u32 = 3;

/// The longest time for a card to become ready (4.2.3). [µs]
const READY_US: u32 = 1_000_000;

/// The longest time for a card to be busy with a block that it took: 250 ms, and 500 ms from 32 GB
/// on (4.6.2.2). [µs]
const BUSY_US: u32 = 500_000;

/// Commands (4.7.4).
mod command {
    pub(super) const GO_IDLE: u8 = 0;
    pub(super) const ALL_SEND_CID: u8 = 2;
    pub(super) const SEND_ADDRESS: u8 = 3;
    pub(super) const SET_BUS_WIDTH: u8 = 6;
    pub(super) const SELECT: u8 = 7;
    pub(super) const SEND_IF_COND: u8 = 8;
    pub(super) const SEND_CSD: u8 = 9;
    pub(super) const SEND_STATUS: u8 = 13;
    pub(super) const SET_BLOCK_LENGTH: u8 = 16;
    pub(super) const READ_BLOCK: u8 = 17;
    pub(super) const WRITE_BLOCK: u8 = 24;
    pub(super) const SEND_OP_COND: u8 = 41;
    pub(super) const APPLICATION: u8 = 55;
}

/// Argument of SEND_IF_COND: 2.7 to 3.6 V, and a pattern that the card returns (4.3.13).
const IF_COND: u32 = 0x1AA;

/// Argument of SEND_OP_COND: 3.2 to 3.4 V.
const VOLTAGES: u32 = 0x0030_0000;

/// In that argument: the host knows cards of the second version. In the answer: the card's blocks are
/// addressed by number (4.2.3.1).
const HIGH_CAPACITY: u32 = 1 << 30;

/// In the answer to SEND_OP_COND: the card has powered up.
const IS_READY: u32 = 1 << 31;

/// Argument of SET_BUS_WIDTH.
const FOUR_LINES: u32 = 0b10;

/// In a card's status (4.10.1): everything that is an error.
const ERRORS: u32 = 0xFDFF_E008;

/// One of these errors: the block is write-protected.
const WP_VIOLATION: u32 = 1 << 26;

/// In a card's status: the state of its state machine, and whether its buffer is free.
const STATE_AND_READY: u32 = 0xF << 9 | 1 << 8;

/// The state alone, and that of a card that is at work on a block.
const STATE: u32 = 0xF << 9;
const PROGRAMS: u32 = 7 << 9;

/// These of a card that waits for a command.
const WAITS: u32 = 4 << 9 | 1 << 8;

/// Why a block did not come through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CardError {
    /// The bus failed.
    Bus(BusError),
    /// The card refused; its status.
    Refused(u32),
    /// The card was busy for too long.
    Busy,
    /// The card is write-protected.
    WriteProtected,
    /// The card is another one than at first.
    Changed,
    /// There is no such block.
    Beyond,
}

impl From<BusError> for CardError {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

/// What went wrong since boot, by kind. Each field wraps.
#[derive(Clone, Copy, Debug, Default)]
pub struct CardErrors {
    /// Commands without an answer, those to an empty slot included.
    pub silent: u32,
    /// Answers and blocks that were damaged.
    pub crc: u32,
    /// Blocks that did not come, or were not taken, in time; cards that were busy for too long.
    pub timeout: u32,
    /// Times that the FIFO overflowed or ran empty, or the DMA failed.
    pub fifo: u32,
    /// Times that the card refused.
    pub refused: u32,
}

/// A card that was brought up.
struct Found {
    identification: [u32; 4],
    /// The card's address, in the upper half of the word.
    address: u32,
    has_high_capacity: bool,
    is_protected: bool,
    blocks: u32,
}

/// The slot, and the card in it.
pub struct Card {
    bus: Sdio,
    found: Option<Found>,
    errors: CardErrors,
}

impl Card {
    /// The slot; whether a card is in it is not known.
    pub const fn new(bus: Sdio) -> Self {
        Self {
            bus,
            found: None,
            errors: CardErrors {
                silent: 0,
                crc: 0,
                timeout: 0,
                fifo: 0,
                refused: 0,
            },
        }
    }

    /// Brings up the card that is in the slot.
    ///
    /// # Errors
    ///
    /// [`BusError::Silent`] when there is none; otherwise why it cannot be used.
    pub fn find(&mut self) -> Result<(), CardError> {
        self.found = None;
        self.attempt(|_, _| Ok(()))
    }

    /// Takes the clock from the card; it has to be found again before its next use.
    pub fn release(&mut self) {
        self.found = None;
        self.bus.stop();
    }

    /// The card's size, in blocks of 512 bytes.
    pub fn blocks(&self) -> u32 {
        self.found.as_ref().map_or(0, |found| found.blocks)
    }

    /// Whether the card is write-protected.
    pub fn is_write_protected(&self) -> bool {
        self.found.as_ref().is_some_and(|found| found.is_protected)
    }

    /// What went wrong so far.
    pub const fn errors(&self) -> CardErrors {
        self.errors
    }

    /// Reads a block.
    ///
    /// # Errors
    ///
    /// The last attempt's.
    pub fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), CardError> {
        self.attempt(|bus, found| {
            bus.receive(command::READ_BLOCK, found.place(number)?, accept, block)?;
            wait(bus, found)
        })
    }

    /// Writes a block; it is on the card when this returns.
    ///
    /// # Errors
    ///
    /// The last attempt's.
    pub fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), CardError> {
        self.attempt(|bus, found| {
            if found.is_protected {
                return Err(CardError::WriteProtected);
            }
            match bus.transmit(command::WRITE_BLOCK, found.place(number)?, accept, block) {
                // The interface has waited for as long as the card may take.
                Err(CardError::Bus(BusError::DataTimeout)) if is_busy(bus, found) => {
                    Err(CardError::Busy)
                }
                other => other.and_then(|()| wait(bus, found)),
            }
        })
    }

    /// Repeats `act` until it succeeds, on a card that is found again after each failure.
    fn attempt(
        &mut self,
        mut act: impl FnMut(&mut Sdio, &Found) -> Result<(), CardError>,
    ) -> Result<(), CardError> {
        let mut card = self.found.take();
        let known = card.as_ref().map(|found| found.identification);
        let mut attempts = 0;
        loop {
            attempts += 1;
            let error = match card.take().map_or_else(|| self.find_again(known), Ok) {
                Ok(found) => match act(&mut self.bus, &found) {
                    Ok(()) => {
                        self.found = Some(found);
                        return Ok(());
                    }
                    Err(error) => error,
                },
                Err(error) => error,
            };
            self.count(error);
            let is_final = matches!(
                error,
                CardError::WriteProtected
                    | CardError::Changed
                    | CardError::Beyond
                    | CardError::Busy
            );
            if is_final || attempts == ATTEMPTS {
                return Err(error);
            }
        }
    }

    /// Brings up the card with the identification `known`; with `None`, any card.
    fn find_again(&mut self, known: Option<[u32; 4]>) -> Result<Found, CardError> {
        let found = bring_up(&mut self.bus)?;
        match known {
            Some(known) if known != found.identification => Err(CardError::Changed),
            _ => Ok(found),
        }
    }

    #[inline(never)]
    fn count(&mut self, error: CardError) {
        let counter = match error {
            CardError::Bus(BusError::Silent) => &mut self.errors.silent,
            CardError::Bus(BusError::Crc) => &mut self.errors.crc,
            CardError::Bus(BusError::DataTimeout) | CardError::Busy => &mut self.errors.timeout,
            CardError::Bus(BusError::Fifo) => &mut self.errors.fifo,
            _ => &mut self.errors.refused,
        };
        *counter = counter.wrapping_add(1);
    }
}

impl Found {
    /// What a block is addressed by: its number, or its first byte.
    fn place(&self, number: u32) -> Result<u32, CardError> {
        match number {
            _ if number >= self.blocks => Err(CardError::Beyond),
            _ if self.has_high_capacity => Ok(number),
            _ => number.checked_mul(BLOCK as u32).ok_or(CardError::Beyond),
        }
    }
}

/// Brings a card from power-up to the state in which blocks can be transferred.
fn bring_up(bus: &mut Sdio) -> Result<Found, CardError> {
    bus.start();
    bus.command_only(command::GO_IDLE)?;
    // A card of the first version does not answer, or refuses.
    let is_second = bus.command(command::SEND_IF_COND, IF_COND) == Ok(IF_COND);
    let capacity = if is_second { HIGH_CAPACITY } else { 0 };
    let conditions = within(READY_US, || {
        let answer = bus
            .command(command::APPLICATION, 0)
            .and_then(|_| bus.command_unchecked(command::SEND_OP_COND, VOLTAGES | capacity));
        match answer {
            Ok(conditions) if conditions & IS_READY == 0 => None,
            other => Some(other),
        }
    })
    .ok_or(CardError::Busy)??;
    let identification = bus.command_long(command::ALL_SEND_CID, 0)?;
    let address = bus.command(command::SEND_ADDRESS, 0)? & 0xFFFF_0000;
    let csd = bus.command_long(command::SEND_CSD, address)?;
    accept(bus.command(command::SELECT, address)?)?;
    accept(bus.command(command::APPLICATION, address)?)?;
    accept(bus.command(command::SET_BUS_WIDTH, FOUR_LINES)?)?;
    accept(bus.command(command::SET_BLOCK_LENGTH, BLOCK as u32)?)?;
    bus.speed_up();
    Ok(Found {
        identification,
        address,
        has_high_capacity: conditions & HIGH_CAPACITY != 0,
        is_protected: csd[3] & (0b11 << 12) != 0,
        blocks: blocks(&csd),
    })
}

/// The card's size in blocks of 512 bytes, from its CSD (5.3.2, 5.3.3).
const fn blocks(csd: &[u32; 4]) -> u32 {
    if csd[0] >> 30 == 1 {
        let size = (csd[1] & 0x3F) << 16 | csd[2] >> 16;
        return (size + 1).saturating_mul(1_024);
    }
    let size = (csd[1] & 0x3FF) << 2 | csd[2] >> 30;
    let multiplier = 1 << ((csd[2] >> 15 & 0b111) + 2);
    // The length of its own blocks: 2⁹ to 2¹¹ bytes.
    let of_512 = 1 << ((csd[1] >> 16 & 0xF).saturating_sub(9));
    (size + 1) * multiplier * of_512
}

/// Returns the error in a card's status, if there is one.
const fn accept(status: u32) -> Result<(), CardError> {
    if status & WP_VIOLATION != 0 {
        Err(CardError::WriteProtected)
    } else if status & ERRORS != 0 {
        Err(CardError::Refused(status))
    } else {
        Ok(())
    }
}

/// Whether the card is still at work on a block.
fn is_busy(bus: &mut Sdio, found: &Found) -> bool {
    bus.command(command::SEND_STATUS, found.address)
        .is_ok_and(|status| status & STATE == PROGRAMS)
}

/// Waits until the card is done with a block.
#[inline(never)]
fn wait(bus: &mut Sdio, found: &Found) -> Result<(), CardError> {
    within(BUSY_US, || {
        match bus.command(command::SEND_STATUS, found.address) {
            Ok(status) => match accept(status) {
                Ok(()) if status & STATE_AND_READY == WAITS => Some(Ok(())),
                Ok(()) if status & STATE >= WAITS & STATE => None,
                // It was not selected: it has lost its power, or is another one.
                Ok(()) => Some(Err(CardError::Refused(status))),
                error => Some(error),
            },
            Err(error) => Some(Err(error.into())),
        }
    })
    .ok_or(CardError::Busy)?
}
