//! The samples of a test, in memory that is given.

use crate::{Record, Sample, csv};

/// The beginning or the end of a test, or what is to become of its log, as a client commands it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Test {
    /// It begins: the log is cleared and records.
    Begins,
    /// It ends: the log is frozen, so that its file can be read in pieces, and saved.
    Ends,
    /// The log of a test that has ended is saved once more.
    SavesAgain,
    /// A save that runs is to stop; the log stays as it is.
    StopsSaving,
}

/// What happened to a sample that was given to the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// It is in the log.
    Kept,
    /// It is in the log, and there is no room for a further one.
    Last,
    /// There was no room for it.
    Full,
    /// The log is frozen.
    Frozen,
}

/// The log: two pieces of memory, one after the other.
#[derive(Debug)]
pub struct SampleLog<'a> {
    older: &'a mut [Record],
    newer: &'a mut [Record],
    len: u32,
    first_ping_us: u64,
    missed: u32,
    is_frozen: bool,
    /// A test has begun by a command.
    has_begun: bool,
    is_saved: bool,
}

impl<'a> SampleLog<'a> {
    /// An empty log that fills `older` and then `newer`, of which it can use 2³² − 1 records.
    #[must_use]
    pub const fn new(older: &'a mut [Record], newer: &'a mut [Record]) -> Self {
        Self {
            older,
            newer,
            len: 0,
            first_ping_us: 0,
            missed: 0,
            is_frozen: false,
            has_begun: false,
            is_saved: false,
        }
    }

    /// Empties the log, and records from now on.
    pub const fn clear(&mut self) {
        self.len = 0;
        self.missed = 0;
        self.is_frozen = false;
        self.has_begun = false;
        self.is_saved = false;
    }

    /// Its file is on the card.
    pub const fn handle_saved(&mut self) {
        self.is_saved = true;
    }

    /// The number of samples that somebody has asked for and that are in no file yet.
    #[must_use]
    pub const fn unsaved(&self) -> u32 {
        if !self.is_saved && (self.has_begun || self.is_frozen) {
            self.len
        } else {
            0
        }
    }

    /// Records nothing more until [`Self::clear`].
    pub const fn freeze(&mut self) {
        self.is_frozen = true;
    }

    /// Does what a command about a test means for the log.
    pub const fn handle_test(&mut self, test: Test) {
        match test {
            Test::Begins => {
                self.clear();
                self.has_begun = true;
            }
            Test::Ends => self.freeze(),
            Test::SavesAgain | Test::StopsSaving => {}
        }
    }

    /// Keeps a sample, unless the log is frozen or full.
    pub fn record(&mut self, sample: &Sample) -> Kept {
        if self.is_frozen {
            return Kept::Frozen;
        }
        if self.len == 0 {
            self.first_ping_us = sample.ping_us;
        }
        let record = Record::pack(sample, self.first_ping_us);
        let Some(place) = self.place(self.len) else {
            self.missed = self.missed.wrapping_add(1);
            return Kept::Full;
        };
        *place = record;
        self.len += 1;
        if self.len < self.capacity() {
            Kept::Kept
        } else {
            Kept::Last
        }
    }

    /// A sample by its index, from 0 on.
    #[must_use]
    pub fn get(&self, index: u32) -> Option<Sample> {
        if index >= self.len {
            return None;
        }
        let index = index as usize;
        let record = match self.older.get(index) {
            Some(record) => record,
            None => self.newer.get(index.checked_sub(self.older.len())?)?,
        };
        Some(record.unpack(self.first_ping_us))
    }

    /// The number of samples in it.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "it would have no user")]
    pub const fn len(&self) -> u32 {
        self.len
    }

    /// The number of samples that it has room for.
    #[must_use]
    pub const fn capacity(&self) -> u32 {
        (self.older.len() + self.newer.len()) as u32
    }

    /// The number of samples that found it full since it was cleared; wraps.
    #[must_use]
    pub const fn missed(&self) -> u32 {
        self.missed
    }

    /// Whether it is frozen.
    #[must_use]
    pub const fn is_frozen(&self) -> bool {
        self.is_frozen
    }

    /// The time of the first sample, in ns of UTC since 1970; `None` while there is none, or if
    /// date and second were not proved then.
    #[must_use]
    pub fn began_ns(&self) -> Option<i64> {
        let first = self.get(0)?;
        first.state.is_proved().then_some(first.board_ns)
    }

    /// The length of its file, in bytes.
    #[must_use]
    pub const fn file_len(&self) -> u32 {
        csv::file_len(self.len)
    }

    /// Fills `out` with its file from `offset` on, see [`csv::read`].
    pub fn read_file(&self, offset: u32, out: &mut [u8]) -> usize {
        csv::read(offset, out, self.len, |index| self.get(index))
    }

    fn place(&mut self, index: u32) -> Option<&mut Record> {
        let index = index as usize;
        match index.checked_sub(self.older.len()) {
            None => self.older.get_mut(index),
            Some(index) => self.newer.get_mut(index),
        }
    }
}

#[cfg(test)]
mod tests {
    use timebase::ClockState;

    use super::*;

    fn sample(number: u32) -> Sample {
        Sample {
            board_ns: 1_000_000_000 + i64::from(number),
            ping_us: 77_000_000 + u64::from(number),
            sequence: number,
            state: ClockState::Set,
            uncertainty_ns: 64,
        }
    }

    #[test]
    fn it_fills_both_pieces_in_order_and_says_when_it_is_full() {
        let (mut older, mut newer) = ([Record::EMPTY; 3], [Record::EMPTY; 2]);
        let mut log = SampleLog::new(&mut older, &mut newer);
        assert_eq!((log.capacity(), log.get(0)), (5, None));
        let kept: [Kept; 7] = core::array::from_fn(|i| log.record(&sample(i as u32)));
        let full = [Kept::Last, Kept::Full, Kept::Full];
        assert_eq!(kept[..4], [Kept::Kept; 4]);
        assert_eq!(kept[4..], full);
        assert_eq!((log.len(), log.missed()), (5, 2));
        for index in 0..5 {
            assert_eq!(log.get(index), Some(sample(index)));
        }
        assert_eq!(log.get(5), None);
    }

    #[test]
    fn what_is_frozen_stays_until_it_is_cleared() {
        let mut memory = [Record::EMPTY; 4];
        let mut log = SampleLog::new(&mut memory, &mut []);
        log.record(&sample(1));
        log.handle_test(Test::Ends);
        assert_eq!(log.record(&sample(2)), Kept::Frozen);
        assert_eq!((log.len(), log.get(0)), (1, Some(sample(1))));
        log.handle_test(Test::Begins);
        assert_eq!((log.len(), log.get(0), log.is_frozen()), (0, None, false));
        assert_eq!(log.record(&sample(9)), Kept::Kept);
        assert_eq!(log.get(0), Some(sample(9)));
    }

    #[test]
    fn its_file_and_its_beginning_are_those_of_its_samples() {
        let mut memory = [Record::EMPTY; 2];
        let mut log = SampleLog::new(&mut memory, &mut []);
        assert_eq!(log.began_ns(), None);
        for state in [ClockState::Unset, ClockState::Unproved] {
            log.record(&Sample { state, ..sample(0) });
            assert_eq!(log.began_ns(), None, "{state}");
            log.clear();
        }
        log.record(&sample(7));
        assert_eq!(log.began_ns(), Some(sample(7).board_ns));
        let mut file = [0; 3 * csv::LINE];
        assert_eq!(log.read_file(0, &mut file), 2 * csv::LINE);
        assert_eq!(log.file_len() as usize, 2 * csv::LINE);
        assert_eq!(file[csv::LINE..2 * csv::LINE], csv::line(&sample(7)));
    }

    #[test]
    fn a_log_without_memory_is_full() {
        let mut log = SampleLog::new(&mut [], &mut []);
        assert_eq!(log.record(&sample(1)), Kept::Full);
        assert_eq!((log.len(), log.missed()), (0, 1));
    }
}
