//! The SD card's slot, and cards with what can be wrong with them.
//!
//! *Purpose.* A [`Card`] holds an image that a test has made and reads afterwards, or is a file, which
//! it changes in place. It can be write-protected, slow, noisy, damaged on the way at a given block, it can
//! take blocks and keep nothing, and it can be pulled and put in.
//!
//! *Design.* The card itself is rigless's: its states, its commands, its blocks. Around it stands
//! what that one has not: the second version of the specification (CMD8, and blocks addressed by
//! number, reported as they should be), a start-up that takes time, a busy time after each written
//! block, write protection, and [`Fault`]s at the nth block. A damaged answer is made of one that
//! is too long, which the interface takes for a failed checksum.
//!
//! *Limits.* Blocks that are read are there at once, where a real card takes some 100 µs. A busy
//! time begins with the first command after its block.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};

use rigless::chip::Timeline;
use rigless::chip::memory_card::MemoryCard;
use rigless::chip::sd::{self, Answer, BLOCK, Outcome, command};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

/// How long a card starts up, and how long it is busy after a block, in ns: of the order of what
/// cards take.
const START_UP_NS: u64 = 20_000_000;
const BUSY_NS: u64 = 300_000;

/// SD Physical Layer Simplified Specification: CMD8 echoes (4.9.6), high capacity and ready in the
/// conditions (5.1), temporary write protection in the CSD's last word (5.3), and of the status
/// (4.10.1) violation, illegal command, and a card that programs.
const IF_COND: u32 = 0xFFF;
const HIGH_CAPACITY: u32 = 1 << 30;
const IS_READY: u32 = 1 << 31;
const TMP_WRITE_PROTECT: u32 = 1 << 12;
const WP_VIOLATION: u32 = 1 << 26;
const ILLEGAL_COMMAND: u32 = 1 << 22;
const PROGRAMS: u32 = 7 << 9;

/// Which way a block goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Transfer {
    /// From the card.
    Read,
    /// To the card.
    Write,
}

/// What can go wrong with a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Its checksum fails.
    Damaged,
    /// It does not come, or is not taken.
    Lost,
    /// The answer to its command is damaged.
    AnswerDamaged,
    /// The card falls out of the slot in front of it.
    Pulled,
    /// The card takes it, and is busy with it for this long, in ms.
    Busy(u64),
}

/// An SD card.
pub struct Card {
    card: MemoryCard,
    /// Where its blocks are, if they are not in memory.
    file: Option<File>,
    /// The block that a command named last.
    addressed: u32,
    blocks: usize,
    is_first_version: bool,
    is_write_protected: bool,
    serial: u32,
    busy_ns: u64,
    /// The same after the block that it took last.
    busy_next_ns: u64,
    faults: BTreeMap<(Transfer, u64), Fault>,
    /// Each this many blocks one is damaged, each way; none at 0.
    noisy_each: u64,
    keeps_nothing: bool,
    transfers: [u64; 2],
    fault: Option<Fault>,
    is_application: bool,
    ready: VirtualNanos,
    busy_until: VirtualNanos,
    has_taken: bool,
}

impl Card {
    /// A card of the second version that holds `image`, whole blocks of 512 bytes.
    #[must_use]
    pub fn holding(image: &[u8]) -> Self {
        Self::with(MemoryCard::holding(image), image.len() / BLOCK)
    }

    /// The same of the first version.
    #[must_use]
    pub fn of_first_version(image: &[u8]) -> Self {
        Self::holding(image).as_first_version()
    }

    /// Makes it one of the first version, which is addressed by bytes; a multiple of 512 blocks, and
    /// from 2²¹ on of 1 024, 2²² (2 GB) at most.
    #[must_use]
    pub const fn as_first_version(mut self) -> Self {
        self.is_first_version = true;
        self
    }

    /// A card of the second version whose blocks are those of a file of any size, open to be read and
    /// written, in place. Up to the next 512 KB, of which such a card has a whole number, it reads as 0.
    ///
    /// # Errors
    ///
    /// The file is empty, larger than a card can be, or has no size.
    pub fn on_file(mut file: File) -> io::Result<Self> {
        /// Blocks in the unit of a card's size (CSD version 2.0, 5.3.3), and units of the largest one.
        const UNIT: u64 = 1_024;
        const UNITS_MAX: u64 = 1 << 22;
        let bytes = file.seek(SeekFrom::End(0))?;
        let units = bytes.div_ceil(UNIT * BLOCK as u64);
        if !(1..=UNITS_MAX).contains(&units) {
            return Err(io::Error::other("a card has 1 byte to 2 TB"));
        }
        let blocks = usize::try_from(units * UNIT).map_err(io::Error::other)?;
        Ok(Self {
            file: Some(file),
            ..Self::with(MemoryCard::empty(blocks), blocks)
        })
    }

    fn with(card: MemoryCard, blocks: usize) -> Self {
        Self {
            card,
            file: None,
            addressed: 0,
            blocks,
            is_first_version: false,
            is_write_protected: false,
            serial: 0,
            busy_ns: BUSY_NS,
            busy_next_ns: BUSY_NS,
            faults: BTreeMap::new(),
            noisy_each: 0,
            keeps_nothing: false,
            transfers: [0; 2],
            fault: None,
            is_application: false,
            ready: VirtualNanos(0),
            busy_until: VirtualNanos(0),
            has_taken: false,
        }
    }

    /// Write-protects it.
    #[must_use]
    pub const fn write_protected(mut self) -> Self {
        self.is_write_protected = true;
        self
    }

    /// Gives it a serial number: cards that have none are taken for one and the same.
    #[must_use]
    pub const fn with_serial(mut self, serial: u32) -> Self {
        self.serial = serial;
        self
    }

    /// Makes it busy for so long after each block that it takes.
    #[must_use]
    pub const fn busy_for_ns(mut self, ns: u64) -> Self {
        self.busy_ns = ns;
        self
    }

    /// Damages one of so many blocks, each way.
    #[must_use]
    pub const fn noisy(mut self, each: u64) -> Self {
        self.noisy_each = each;
        self
    }

    /// Has it take blocks as a good card does, and stay as it was.
    #[must_use]
    pub const fn keeping_nothing(mut self) -> Self {
        self.keeps_nothing = true;
        self
    }

    /// Has something go wrong with the `nth` block that is read, or written, from 0 on.
    #[must_use]
    pub fn fault(mut self, transfer: Transfer, nth: u64, fault: Fault) -> Self {
        self.faults.insert((transfer, nth), fault);
        self
    }

    /// Blocks that were asked for and given to it so far.
    #[must_use]
    pub const fn transfers(&self, transfer: Transfer) -> u64 {
        self.transfers[transfer as usize]
    }

    /// The block that is asked for, if it is a file's.
    fn read_file(&mut self, block: &mut [u8]) -> io::Result<()> {
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        block.fill(0);
        file.seek(SeekFrom::Start(u64::from(self.addressed) * BLOCK as u64))?;
        let mut rest = &mut *block;
        while !rest.is_empty() {
            match file.read(rest)? {
                0 => break,
                count => rest = rest.split_at_mut(count).1,
            }
        }
        Ok(())
    }

    /// The block that is given, if it is for a file.
    fn write_file(&mut self, block: &[u8]) -> io::Result<()> {
        let Some(file) = self.file.as_mut().filter(|_| !self.keeps_nothing) else {
            return Ok(());
        };
        file.seek(SeekFrom::Start(u64::from(self.addressed) * BLOCK as u64))?;
        file.write_all(block)
    }

    /// All that it holds in memory.
    #[must_use]
    pub fn image(&self) -> Vec<u8> {
        (0..self.blocks)
            .flat_map(|block| self.card.stored(block))
            .collect()
    }

    /// Its CSD, where that of rigless's card is `csd`.
    fn described(&self, mut csd: [u32; 4]) -> [u32; 4] {
        if self.is_first_version {
            // 5.3.2: C_SIZE + 1 times 2⁹ blocks, with C_SIZE_MULT at 7 and READ_BL_LEN at 9; C_SIZE has
            // 12 bits, and beyond them READ_BL_LEN is 10, as it is of 2 GB.
            let longer = u32::from(self.blocks > 1 << 21);
            let size = (self.blocks >> 9 >> longer) as u32 - 1;
            csd[0] = 0x000E_0032;
            csd[1] = 0x5B50_0000 | (9 + longer) << 16 | size >> 2;
            csd[2] = size << 30 | 7 << 15;
        }
        if self.is_write_protected {
            csd[3] |= TMP_WRITE_PROTECT;
        }
        csd
    }

    fn begins(&mut self, transfer: Transfer) {
        let nth = &mut self.transfers[transfer as usize];
        self.fault = self.faults.remove(&(transfer, *nth));
        *nth += 1;
        if self.fault.is_none() && self.noisy_each > 0 && nth.is_multiple_of(self.noisy_each) {
            self.fault = Some(Fault::Damaged);
        }
    }

    /// What it answers while it programs the block that it took last; none once that is over.
    fn answer_busy(&mut self, index: u8, now: VirtualNanos) -> Option<Answer> {
        if std::mem::take(&mut self.has_taken) {
            self.busy_until = VirtualNanos(now.0 + self.busy_next_ns);
        }
        let is_busy = now < self.busy_until && index != command::GO_IDLE_STATE;
        let error = match index {
            command::SEND_STATUS => 0,
            _ => ILLEGAL_COMMAND,
        };
        is_busy.then_some(Answer::Short(PROGRAMS | error))
    }

    /// What it answers in place of rigless's card; none where that one answers.
    fn answer_first(&mut self, index: u8, argument: u32, now: VirtualNanos) -> Option<Answer> {
        match index {
            command::GO_IDLE_STATE => self.ready = VirtualNanos(now.0 + START_UP_NS),
            command::SEND_IF_COND if self.is_first_version => return Some(Answer::None),
            command::SEND_IF_COND => return Some(Answer::Short(argument & IF_COND)),
            command::READ_SINGLE_BLOCK => self.begins(Transfer::Read),
            command::WRITE_BLOCK if self.is_write_protected => {
                return Some(Answer::Short(WP_VIOLATION));
            }
            command::WRITE_BLOCK => self.begins(Transfer::Write),
            _ => {}
        }
        let is_damaged = self.fault == Some(Fault::AnswerDamaged);
        is_damaged.then(|| {
            self.fault = None;
            Answer::Long([0; 4])
        })
    }

    /// The argument of a command as rigless's card takes it, in blocks.
    const fn argument(&self, index: u8, argument: u32) -> u32 {
        match index {
            command::READ_SINGLE_BLOCK | command::WRITE_BLOCK if self.is_first_version => {
                argument / BLOCK as u32
            }
            _ => argument,
        }
    }

    /// The answer of rigless's card with what this one has beside it.
    fn completed(
        &self,
        index: u8,
        is_application: bool,
        now: VirtualNanos,
        answer: Answer,
    ) -> Answer {
        match answer {
            Answer::Short(mut conditions)
                if is_application && index == command::SD_SEND_OP_COND =>
            {
                if now < self.ready {
                    conditions &= !IS_READY;
                } else if !self.is_first_version {
                    conditions |= HIGH_CAPACITY;
                }
                Answer::Short(conditions)
            }
            Answer::Long(csd) if index == command::SEND_CSD => Answer::Long(self.described(csd)),
            // 5.2: the serial number is in bits 24 to 55.
            Answer::Long([first, second, third, last]) if index == command::ALL_SEND_CID => {
                let (high, low) = (self.serial >> 8, self.serial << 24);
                Answer::Long([first, second, third ^ high, last ^ low])
            }
            other => other,
        }
    }
}

impl fmt::Debug for Card {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Card")
            .field("blocks", &self.blocks)
            .field("transfers", &self.transfers)
            .finish_non_exhaustive()
    }
}

/// The slot, with a card or without one.
#[derive(Debug, Default)]
pub(crate) struct Slot(pub(crate) Option<Card>);

impl Store for Slot {}

impl sd::Card for Slot {
    fn command(&mut self, index: u8, argument: u32, context: &mut Timeline<'_, '_>) -> Answer {
        let Some(card) = &mut self.0 else {
            return Answer::None;
        };
        let now = context.now();
        if let Some(answer) = card.answer_busy(index, now) {
            card.is_application = index == command::APP_CMD;
            return answer;
        }
        let is_application = std::mem::replace(&mut card.is_application, index == command::APP_CMD);
        if let Some(answer) = card.answer_first(index, argument, now) {
            return answer;
        }
        if card.fault == Some(Fault::Pulled) {
            self.0 = None;
            return Answer::None;
        }
        let argument = card.argument(index, argument);
        if let command::READ_SINGLE_BLOCK | command::WRITE_BLOCK = index {
            card.addressed = argument;
        }
        let answer = card.card.command(index, argument, context);
        card.completed(index, is_application, now, answer)
    }

    fn read(&mut self, block: &mut [u8]) -> Outcome {
        let Some(card) = &mut self.0 else {
            return Outcome::Ended;
        };
        match card.fault.take() {
            Some(Fault::Lost) => Outcome::Ended,
            Some(Fault::Damaged) => {
                card.card.read(block);
                block.fill(0x5A);
                Outcome::Corrupt
            }
            _ => match card.card.read(block) {
                Outcome::Whole if card.read_file(block).is_err() => Outcome::Ended,
                outcome => outcome,
            },
        }
    }

    fn write(&mut self, block: &[u8]) -> Outcome {
        let Some(card) = &mut self.0 else {
            return Outcome::Ended;
        };
        match card.fault.take() {
            Some(Fault::Lost) => Outcome::Ended,
            // It throws a damaged block away.
            Some(Fault::Damaged) => Outcome::Corrupt,
            _ if card.write_file(block).is_err() => Outcome::Ended,
            fault => {
                card.has_taken = true;
                card.busy_next_ns = match fault {
                    Some(Fault::Busy(ms)) => ms * 1_000_000,
                    _ => card.busy_ns,
                };
                if card.keeps_nothing {
                    let old = card.card.stored(card.addressed as usize);
                    return card.card.write(&old);
                }
                card.card.write(block)
            }
        }
    }
}
