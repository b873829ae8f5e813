//! The log of a test, between the code that fills it and the code that reads it.
//!
//! | queue | filled by | drained by | when full |
//! |---|---|---|---|
//! | [`SAMPLES`] | the MAVLink task, one sample for each PING that it answered | read over MAVLink by the MAVLink task, or to the card by thread level, until the next test begins | the newest sample is dropped and counted |
//!
//! *Design.* Everyone touches the log under a critical section, for one record at a time. A frozen log
//! does not change, so that its file can be made in pieces.

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use sample_log::{Sample, SampleLog, Test, csv};

use crate::thread;

/// The log is to be written to the card.
static SAVE_WANTED: AtomicBool = AtomicBool::new(false);

/// A save that runs is to end.
static STOP_WANTED: AtomicBool = AtomicBool::new(false);

/// A save runs, or is about to.
static IS_SAVING: AtomicBool = AtomicBool::new(false);

/// Whether the log is to be written to the card.
pub fn is_save_wanted() -> bool {
    SAVE_WANTED.load(Relaxed)
}

/// Whether a save that runs is to end.
pub fn is_stop_wanted() -> bool {
    STOP_WANTED.load(Relaxed)
}

/// The log is going to be written now.
pub fn begin_save() {
    IS_SAVING.store(true, Relaxed);
    SAVE_WANTED.store(false, Relaxed);
}

/// The save is over.
pub fn end_save() {
    IS_SAVING.store(false, Relaxed);
    STOP_WANTED.store(false, Relaxed);
}

/// The board's log.
pub static SAMPLES: Samples = Samples(Mutex::new(Cell::new(None)));

/// A log that code of every priority may use.
pub struct Samples(Mutex<CriticalSectionRawMutex, Cell<Option<SampleLog<'static>>>>);

impl Samples {
    /// Gives the log its memory. It has no room before.
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

    /// Samples in the log.
    pub fn len(&self) -> u32 {
        self.with(|log| log.len())
    }

    /// Makes a piece of the log's file, see [`csv::read`].
    pub fn read(&self, offset: u32, out: &mut [u8]) -> usize {
        csv::read(offset, out, self.len(), |index| self.get(index))
    }

    /// A test begins or ends; at its end the log is written to the card, unless that runs already.
    pub fn handle_test(&self, test: Test) {
        self.with(|log| log.handle_test(test));
        let is_saving = IS_SAVING.load(Relaxed);
        match test {
            Test::Begins => {}
            Test::Ends | Test::SavesAgain if is_saving => {}
            Test::Ends | Test::SavesAgain => {
                SAVE_WANTED.store(true, Relaxed);
                thread::wake();
            }
            Test::StopsSaving => {
                SAVE_WANTED.store(false, Relaxed);
                STOP_WANTED.store(is_saving, Relaxed);
            }
        }
    }

    fn get(&self, index: u32) -> Option<Sample> {
        self.with(|log| log.get(index))
    }
}
