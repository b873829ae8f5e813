//! The sample log, between those who fill it and those who read it.
//!
//! *Design.* The MAVLink task records, freezes and clears; the card is written at thread level, and
//! a log over MAVLink by the MAVLink task. Each touches it under a critical section, for one record at
//! a time. A frozen log does not change, so that a file may be made of it piece by piece.

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use sample_log::{Sample, SampleLog, Test, csv};

use crate::board;

/// Somebody wants the log on the card.
static SAVE_WANTED: AtomicBool = AtomicBool::new(false);

/// Whether the log is to be written to the card.
pub fn is_save_wanted() -> bool {
    SAVE_WANTED.load(Relaxed)
}

/// The log is going to be written now.
pub fn begin_save() {
    SAVE_WANTED.store(false, Relaxed);
}

/// The board's log.
pub static SAMPLES: Samples = Samples(Mutex::new(Cell::new(None)));

/// A log that several may use.
pub struct Samples(Mutex<CriticalSectionRawMutex, Cell<Option<SampleLog<'static>>>>);

impl Samples {
    /// Brings the memory. Before that the log has no room.
    pub fn open(&self, log: SampleLog<'static>) {
        self.0.lock(|cell| cell.set(Some(log)));
    }

    /// Does something short with the log.
    pub fn with<R>(&self, act: impl FnOnce(&mut SampleLog<'static>) -> R) -> R {
        self.0.lock(|cell| {
            let mut log = cell
                .take()
                .unwrap_or_else(|| SampleLog::new(&mut [], &mut []));
            let result = act(&mut log);
            cell.set(Some(log));
            result
        })
    }

    /// Samples in it.
    pub fn len(&self) -> u32 {
        self.with(|log| log.len())
    }

    /// Makes a stretch of its file, see [`csv::read`].
    pub fn read(&self, offset: u32, out: &mut [u8]) -> usize {
        csv::read(offset, out, self.len(), |index| self.get(index))
    }

    /// A test begins or ends; at its end the log is written to the card.
    pub fn handle_test(&self, test: Test) {
        self.with(|log| log.handle_test(test));
        if test == Test::Ends {
            SAVE_WANTED.store(true, Relaxed);
            board::wake_thread();
        }
    }

    fn get(&self, index: u32) -> Option<Sample> {
        self.with(|log| log.get(index))
    }
}
