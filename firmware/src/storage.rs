//! Thread level: the log of a test goes to the SD card, at the end of the test.
//!
//! *Design.* This may block, so it stands below every interrupt. The card is searched for at each use,
//! so it may have been put in a moment before; its contents are the business of [`card_file`]. If the
//! card fails in any way, the log stays in memory, and the same command tries again. The file's time is
//! the clock's, in UTC. A save is reported each 5 s, can be stopped, and ends by itself within a minute:
//! its blocks are counted against a deadline that leaves room for the last one.

use card_file::{BLOCK, Disk, DiskError};
use sample_log::csv;
use timebase::{CivilTime, ClockState, Cycles};

use crate::clock_events::{self, ClockEvent};
use crate::drivers::card::{Card, CardError};
use crate::drivers::sdio::BusError;
use crate::drivers::time;
use crate::not_saved::NotSaved;
use crate::reports::{CARD, CardReport};
use crate::samples::{self, SAMPLES};
use crate::{clock, thread};

/// No block begins later than this: a minute, less the 5 s that three attempts at one can take.
const LIMIT: Cycles = Cycles::from_micros(55_000_000);

/// From one word about a save to the next.
const REPORTED_EVERY: Cycles = Cycles::from_micros(5_000_000);

/// Runs forever.
pub fn run(mut slot: Option<Card>) -> ! {
    loop {
        thread::sleep_until(samples::is_save_wanted);
        samples::begin_save();
        let began = time::now();
        let saved = slot
            .as_mut()
            .map_or(Err(NotSaved::NoSlot), |card| save(card, began));
        let took_us = Cycles(time::now().0.wrapping_sub(began.0)).as_micros();
        if let Some(card) = &slot {
            CARD.set(CardReport {
                errors: card.errors(),
                not_saved: saved.err(),
            });
        }
        let event = match saved {
            Ok((file, samples)) => {
                defmt::info!(
                    "the log is saved: file {=u16}, samples {=u32}, took {=u64} us",
                    file,
                    samples,
                    took_us
                );
                SAMPLES.with(|log| {
                    // Unless the next test has begun since.
                    if log.is_frozen() {
                        log.handle_saved();
                    }
                });
                ClockEvent::Saved { file, samples }
            }
            Err(why) => {
                defmt::warn!("the log is not saved: {}, took {=u64} us", why, took_us);
                ClockEvent::NotSaved(why)
            }
        };
        samples::end_save();
        clock_events::push(event);
    }
}

/// Writes the log to the card in the slot, and returns the number of the file and its samples.
#[inline(never)]
fn save(card: &mut Card, began: Cycles) -> Result<(u16, u32), NotSaved> {
    let samples = SAMPLES.len();
    let saved = match card.find() {
        Err(CardError::Bus(BusError::Silent)) => Err(NotSaved::NoCard),
        Err(_) => Err(NotSaved::Card(card_file::NotSaved::Failed)),
        Ok(()) if card.is_write_protected() => {
            Err(NotSaved::Card(card_file::NotSaved::WriteProtected))
        }
        Ok(()) => {
            let mut timed = Timed {
                card,
                began,
                reported: began,
            };
            card_file::save(&mut timed, csv::file_len(samples), &mut read_frozen, utc())
                .map(|file| (file, samples))
                .map_err(NotSaved::from)
        }
    };
    card.release();
    saved
}

/// Makes a piece of the log's file; of no length once a new test has begun.
#[inline(never)]
fn read_frozen(offset: u32, out: &mut [u8]) -> usize {
    let made = SAMPLES.read(offset, out);
    if SAMPLES.with(|log| log.is_frozen()) {
        made
    } else {
        0
    }
}

fn utc() -> Option<CivilTime> {
    let reading = clock::reading_at(time::now());
    match reading.state {
        ClockState::Unset => None,
        ClockState::Set | ClockState::Holdover | ClockState::Unproved => reading.utc.to_civil(),
    }
}

/// A card that has a minute.
struct Timed<'a> {
    card: &'a mut Card,
    began: Cycles,
    reported: Cycles,
}

impl Timed<'_> {
    /// Before each block.
    #[inline(never)]
    fn go_on(&mut self) -> Result<(), DiskError> {
        let now = time::now();
        let is_over = |since: Cycles, limit: Cycles| now.0.wrapping_sub(since.0) >= limit.0;
        if samples::is_stop_wanted() {
            return Err(DiskError::Stopped);
        }
        if is_over(self.began, LIMIT) {
            return Err(DiskError::TooSlow);
        }
        if is_over(self.reported, REPORTED_EVERY) {
            self.reported = self.reported.plus(REPORTED_EVERY.0);
            let for_s = Cycles(self.reported.0.wrapping_sub(self.began.0)).as_micros() / 1_000_000;
            clock_events::push(ClockEvent::Saving { for_s });
        }
        Ok(())
    }
}

impl Disk for Timed<'_> {
    fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError> {
        self.go_on()?;
        self.card.read(number, block).map_err(disk_error)
    }

    fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError> {
        self.go_on()?;
        self.card.write(number, block).map_err(disk_error)
    }

    fn blocks(&self) -> u32 {
        self.card.blocks()
    }
}

fn disk_error(error: CardError) -> DiskError {
    match error {
        CardError::Bus(BusError::Silent) => DiskError::Gone,
        CardError::Changed => DiskError::Swapped,
        CardError::WriteProtected => DiskError::WriteProtected,
        CardError::Beyond => DiskError::Beyond,
        CardError::Bus(_) | CardError::Refused(_) | CardError::Busy => DiskError::Failed,
    }
}
