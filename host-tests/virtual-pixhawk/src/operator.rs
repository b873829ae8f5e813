//! The emulator's controls while a board runs.
//!
//! *Purpose.* The driver that `rigless` calls at every stop: it brings the far ends of
//! the lines and of the pulse's wire to the moment, reads the log, and takes orders.
//!
//! *Design.* The run stops where a far end has something to do, and each ms of true
//! time to read the log; these moments do not depend on the orders, so neither does
//! the run. A far end that has something at a stop is asked by way of asking the run
//! to reach that very moment.
//!
//! *Limits.* Orders are taken only at the moment that the one before named.

use std::sync::mpsc::Receiver;

use console::{LogDecoder, LogLine};
use rigless::emulator::{Driver, Host, Settled, Stop};
use rigless::session::Session;
use rigless::soc::stm32f427::generated::usart6::{Register, cr1};
use rigless::time::VirtualNanos;
use world::WorldNanos;

use crate::board::{PORTS, Pixhawk1};
use crate::image::Firmware;
use crate::rtt::Rtt;
use crate::wire::{PortSetting, Wire};

/// How often the log is read, in ns.
const LOG_EVERY_NS: u64 = 1_000_000;

/// A line of the firmware's log, and when it was read from the board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Logged {
    /// The ms of true time at which it was read.
    pub at: WorldNanos,
    /// The line.
    pub line: LogLine,
}

/// What a stopped board can be asked.
pub(crate) type Order = Box<dyn FnOnce(&mut Stopped<'_>) + Send>;

/// A board that stands still.
pub(crate) struct Stopped<'a> {
    pub(crate) session: &'a mut Session<Pixhawk1>,
    pub(crate) host: &'a mut dyn Host,
    pub(crate) stop: Stop,
    pub(crate) log: &'a mut Log,
    pub(crate) next: Next,
}

/// What a board does after an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    Wait,
    RunTo(WorldNanos),
    End,
}

/// What has been read of the log.
#[derive(Debug)]
pub(crate) struct Log {
    rtt: Rtt,
    pub(crate) decoder: LogDecoder,
    pub(crate) lines: Vec<Logged>,
}

impl Log {
    pub(crate) fn new(firmware: &Firmware) -> anyhow::Result<Self> {
        Ok(Self {
            rtt: Rtt::new(firmware)?,
            decoder: LogDecoder::new(firmware.elf())?,
            lines: Vec::new(),
        })
    }

    fn read(&mut self, now: WorldNanos, host: &mut dyn Host) {
        // Memory that cannot be read has no log in it.
        let bytes = self.rtt.take(host).unwrap_or_default();
        let lines = self.decoder.push(&bytes).into_iter();
        self.lines
            .extend(lines.map(|line| Logged { at: now, line }));
    }
}

/// Drives the run: stops where the world needs it, and takes orders.
pub(crate) struct Operator {
    inbox: Receiver<Order>,
    log: Log,
    /// When the log is to be read next.
    log_due: WorldNanos,
    goal: WorldNanos,
}

impl Operator {
    /// One that reads `log` and waits for its first order before the first
    /// instruction.
    pub(crate) const fn new(inbox: Receiver<Order>, log: Log) -> Self {
        Self {
            inbox,
            log,
            log_due: WorldNanos(0),
            goal: WorldNanos(0),
        }
    }

    /// Brings the far ends to `now`; whether a port has to be asked again.
    fn prepare_wires(session: &mut Session<Pixhawk1>, now: WorldNanos) -> bool {
        let mut ask_now = false;
        for nth in PORTS {
            let board = session.board_mut();
            let (rcc, registers) = board.mcu.clocks();
            let clock_hz = rcc.pclk1(registers);
            let (port, registers) = board.mcu.serial_port(nth);
            let setting = port_setting(
                clock_hz,
                registers.get(Register::Brr),
                registers.get(Register::Cr1),
            );
            let Some(wire) = port.chip_mut::<Wire>() else {
                continue;
            };
            let prepared = wire.prepare(now, setting);
            ask_now |= prepared.ask_now;
            let errors = &mut port.errors_mut().framing;
            errors.per_million = if prepared.framing { 1_000_000 } else { 0 };
        }
        ask_now
    }

    /// The next moment after `now` at which the world needs the run to stop.
    fn next_stop(session: &mut Session<Pixhawk1>, now: WorldNanos) -> Option<WorldNanos> {
        let board = session.board_mut();
        let pulse = board.pulse.next_stop(now);
        PORTS
            .into_iter()
            .filter_map(|nth| board.wire(nth)?.next_stop(now))
            .chain(pulse)
            .min()
    }
}

/// How a port is set up: its speed (RM0090 30.3.4, 16 samples a bit) and whether UE
/// and RE are set.
fn port_setting(clock_hz: u64, brr: u64, cr1: u64) -> PortSetting {
    let baud = clock_hz.checked_div(brr).unwrap_or(0);
    PortSetting {
        baud: u32::try_from(baud).unwrap_or(0),
        listening: cr1::UE.is_set(cr1) && cr1::RE.is_set(cr1),
    }
}

impl Driver<Pixhawk1> for Operator {
    fn on_settled(
        &mut self,
        session: &mut Session<Pixhawk1>,
        _host: &mut dyn Host,
        settled: Settled,
    ) {
        let Settled::Stop(stop) = settled else {
            return;
        };
        let now = WorldNanos(stop.at.0);
        let next = if Self::prepare_wires(session, now) {
            Some(now)
        } else {
            Self::next_stop(session, now)
        };
        // To be asked to reach this very moment has the ports look once more.
        if let Some(next) = next
            && next.0 < session.until().0
        {
            session.run_until(VirtualNanos(next.0));
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Pixhawk1>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        let now = WorldNanos(stop.at.0);
        let Pixhawk1 { mcu, pulse, .. } = session.board_mut();
        pulse.prepare(now, mcu);
        // A core that does not sleep stops between two instructions, a little later than it was
        // asked to.
        let this_ms = WorldNanos(now.0 / LOG_EVERY_NS * LOG_EVERY_NS);
        let next_log = this_ms.plus(LOG_EVERY_NS);
        if now >= self.log_due {
            self.log.read(this_ms, host);
            self.log_due = next_log;
        }
        while now >= self.goal {
            // A holder that is gone takes the board's power with it.
            let order = self.inbox.recv().ok()?;
            let mut stopped = Stopped {
                session,
                host,
                stop,
                log: &mut self.log,
                next: Next::Wait,
            };
            order(&mut stopped);
            match stopped.next {
                Next::Wait => {}
                Next::RunTo(goal) => self.goal = goal,
                Next::End => return None,
            }
        }
        let next = Self::next_stop(session, now).into_iter();
        let next = next.chain([next_log, self.goal]).min()?;
        Some(VirtualNanos(next.0))
    }
}
