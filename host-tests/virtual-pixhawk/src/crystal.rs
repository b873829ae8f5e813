//! How the crystal starts.
//!
//! *Purpose.* The emulator has HSERDY at once, with a crystal and without one: code that waits for it
//! would never be seen waiting. [`Starting`] is the run's bus on which it comes when the crystal does.
//!
//! *Limits.* Without HSERDY the PLL locks all the same, and the core keeps its rate.

use rigless::emulator::{Access, AccessKind, Checked, CoreBus, InterruptLine, Queued};
use rigless::time::VirtualNanos;

/// RCC_CR, and its bits (RM0090, 7.3.1).
const CR: u64 = 0x4002_3800;
const HSEON: u64 = 1 << 16;
const HSERDY: u64 = 1 << 17;

/// When the crystal is ready, from the moment at which it is turned on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CrystalStart {
    /// As it is on the emulator.
    #[default]
    AtOnce,
    /// Later. \[ns\]
    After(u64),
    /// It is broken, or off the board.
    Never,
}

/// A crystal that does not start at once.
#[derive(Debug)]
pub(crate) struct SlowCrystal {
    start: CrystalStart,
    turned_on: Option<VirtualNanos>,
}

impl SlowCrystal {
    pub(crate) fn new(start: CrystalStart) -> Option<Self> {
        (start != CrystalStart::AtOnce).then_some(Self {
            start,
            turned_on: None,
        })
    }

    /// The part was reset, and the crystal is off.
    pub(crate) const fn reset(&mut self) {
        self.turned_on = None;
    }

    fn is_ready(&self, now: VirtualNanos) -> bool {
        match (self.turned_on, self.start) {
            (None, _) | (_, CrystalStart::Never) => false,
            (Some(_), CrystalStart::AtOnce) => true,
            (Some(since), CrystalStart::After(takes)) => now.0 >= since.0 + takes,
        }
    }
}

/// The run's bus, with a crystal that takes its time.
pub(crate) struct Starting<'a> {
    bus: &'a mut dyn CoreBus,
    crystal: &'a mut SlowCrystal,
}

impl<'a> Starting<'a> {
    pub(crate) const fn new(bus: &'a mut dyn CoreBus, crystal: &'a mut SlowCrystal) -> Self {
        Self { bus, crystal }
    }
}

impl CoreBus for Starting<'_> {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        let answer = self.bus.access(access, from_code);
        if access.address != CR {
            return answer;
        }
        if access.kind == AccessKind::Write {
            let is_on = access.value & HSEON != 0;
            let since = self.crystal.turned_on.unwrap_or(access.virtual_time);
            self.crystal.turned_on = is_on.then_some(since);
            return answer;
        }
        if self.crystal.is_ready(access.virtual_time) {
            answer
        } else {
            answer.map(|value| value & !HSERDY)
        }
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.bus.time(instructions)
    }

    fn queued(&mut self) -> Vec<Queued> {
        self.bus.queued()
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        self.bus.carry_on(instructions, event)
    }

    fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64> {
        self.bus.acknowledge(line, instructions)
    }

    fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked> {
        self.bus.read_checked(access, report)
    }

    fn write_checked(&mut self, access: Access) -> Option<bool> {
        self.bus.write_checked(access)
    }

    fn stops_before(&mut self, access: &Access) -> bool {
        self.bus.stops_before(access)
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.bus.send_trace(bytes);
    }
}
