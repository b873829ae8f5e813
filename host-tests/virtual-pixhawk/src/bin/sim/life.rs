//! One board in real time.
//!
//! *Purpose.* [`Life::live`] runs a board as the host's clock runs and reports what a person wants
//! to know.
//!
//! *Design.* At each whole second of the world the board is stopped and the models that its firmware
//! publishes are read out of its memory ([`Pixhawk::clock`]), at a moment that is known to the ns:
//! UTC by the board less UTC in the world is its error. All boards are stopped at the same moments,
//! so the difference of two errors is what two aircraft would disagree by.
//!
//! *Limits.* A reading is good to 24 ns. It is taken up to 16 µs after the second; the error is that
//! of its own moment. In the paper's variants a reader on the board has the time of the last tick, up
//! to a tick older than this.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::thread;
use std::time::{Duration, Instant};

use console::{Ending, Event, Report, Sample, Status};
use timebase::ClockState;
use virtual_pixhawk::{ClockReading, Connector, Gaps, Pixhawk, Visits};
use world::WorldNanos;

use crate::serial_port::SerialPort;

/// How often a board is brought to the present.
const STEP: Duration = Duration::from_millis(1);
const SECOND: u64 = 1_000_000_000;
/// Cycles of the core, and instructions at full load, in a µs.
const CYCLES_PER_US: u128 = 168;

/// A board under power.
pub struct Life {
    /// Which one, counted from 0.
    pub index: usize,
    /// The board.
    pub board: Pixhawk,
    /// Who is on its MAVLink port.
    pub visits: Visits,
    /// Its MAVLink port.
    pub mavlink_port: u16,
    /// What its USB is on this host, if a cable is in.
    pub usb: Option<SerialPort>,
    /// True UTC at power-up, in ns since 1970.
    pub utc_at_start_ns: i64,
    /// How long it is to run; `None` is until it is asked to end.
    pub duration: Option<Duration>,
    /// A status line has come: the firmware has started all that it has.
    pub is_up: bool,
}

impl Life {
    /// Runs the board until its time is over or `asked_to_end`.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn live(
        mut self,
        started: Instant,
        reports: &Sender<(usize, Report)>,
        asked_to_end: &AtomicBool,
    ) -> anyhow::Result<Ending> {
        let mut behind = Duration::ZERO;
        let mut seconds = 0;
        loop {
            let present = started.elapsed();
            behind = behind.max(present.saturating_sub(since_power(self.board.now())));
            let goal = self.duration.map_or(present, |end| present.min(end));
            let goal = WorldNanos(u64::try_from(goal.as_nanos())?);
            while self.board.now() < goal {
                let next_second = WorldNanos((seconds + 1) * SECOND);
                self.board.run_to(goal.min(next_second))?;
                if let Some(port) = &mut self.usb {
                    port.exchange(&mut self.board)?;
                }
                self.report(reports)?;
                if self.board.now() >= next_second {
                    seconds += 1;
                    // The wires keep what the board has sent until it is taken: nobody asks here.
                    for connector in Connector::ALL {
                        self.board.take_received(connector)?;
                    }
                    let (at_s, sample) = (seconds, self.sample()?);
                    self.send(reports, Report::Sample { at_s, sample });
                }
            }
            let is_over = self.duration.is_some_and(|end| present >= end);
            if is_over || asked_to_end.load(Ordering::Relaxed) {
                return self.end(behind);
            }
            thread::sleep(STEP.saturating_sub(started.elapsed().saturating_sub(present)));
        }
    }

    /// Reports what is new since the board stood last.
    fn report(&mut self, reports: &Sender<(usize, Report)>) -> anyhow::Result<()> {
        for logged in self.board.take_log()? {
            let (at, line) = (since_power(logged.at), logged.line);
            self.is_up |= Status::parse(&line.text).is_some();
            self.send(reports, Report::Log { at, line });
        }
        let (came, left) = self.visits.take();
        let came = (0..came).map(|_| Event::ClientConnected);
        for event in came.chain((0..left).map(|_| Event::ClientLeft)) {
            let at = since_power(self.board.now());
            self.send(reports, Report::Event { at, event });
        }
        Ok(())
    }

    /// What the clock shows now.
    fn sample(&mut self) -> anyhow::Result<Sample> {
        match self.board.clock() {
            Ok(clock) => Ok(sample(&clock, self.utc_at_start_ns)),
            Err(error) if self.is_up => Err(error),
            // Before the firmware has started its clock there is none to read.
            Err(_) => Ok(Sample::UNSET),
        }
    }

    fn send(&self, reports: &Sender<(usize, Report)>, report: Report) {
        // A screen that is gone wants no reports.
        drop(reports.send((self.index, report)));
    }

    fn end(mut self, behind: Duration) -> anyhow::Result<Ending> {
        let ran = since_power(self.board.now());
        let cycles = ran.as_micros() * CYCLES_PER_US;
        let busy = u128::from(self.board.instructions()?) * 1_000_000;
        let load = busy.checked_div(cycles).unwrap_or_default();
        let gaps = self.board.gaps()?;
        Ok(Ending {
            mavlink_port: self.mavlink_port,
            ran,
            cpu_load_ppm: Some(u64::try_from(load)?),
            behind: Some(behind),
            damaged_log_frames: self.board.damaged_log_frames()?,
            gaps: (gaps != Gaps::default()).then(|| format!("{gaps:?}")),
        })
    }
}

fn since_power(at: WorldNanos) -> Duration {
    Duration::from_nanos(at.0)
}

/// A reading less the true time at its moment.
fn sample(clock: &ClockReading, utc_at_start_ns: i64) -> Sample {
    let ClockReading { at, reading, .. } = clock;
    let true_utc_ns = utc_at_start_ns + at.0.cast_signed();
    let is_set = reading.state != ClockState::Unset;
    Sample {
        state: reading.state,
        offset_ns: is_set.then_some(reading.utc.0 - true_utc_ns),
        uncertainty_ns: reading.uncertainty_ns,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use timebase::Cycles;
    use utc_clock::{Reading, UtcNanos};

    #[test]
    fn a_sample_is_the_reading_less_the_true_time_of_its_moment() {
        let clock = |state| ClockReading {
            at: WorldNanos(2_000_001_975),
            cycles: Cycles(336_000_331),
            reading: Reading {
                utc: UtcNanos(1_795_320_002_000_001_950),
                state,
                uncertainty_ns: 410,
                leap_seconds_known: true,
            },
        };
        let start_ns = 1_795_320_000_000_000_000;
        let expected = Sample {
            state: ClockState::Set,
            offset_ns: Some(-25),
            uncertainty_ns: 410,
        };
        assert_eq!(sample(&clock(ClockState::Set), start_ns), expected);
        let unset = sample(&clock(ClockState::Unset), start_ns);
        assert_eq!(unset.offset_ns, None);
    }
}
