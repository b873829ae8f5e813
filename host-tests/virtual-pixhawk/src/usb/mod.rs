//! The board's USB: OTG_FS and a host beside it.
//!
//! *Purpose.* [`Part`] is the STM32F427 with a model of OTG_FS, which `rigless` has not; [`Host`] is what the
//! cable leads to.
//!
//! *Design.* The part's four blocks of OTG_FS become windows of one model, by exchanging their slots on the bus:
//! their tables have no rows for the FIFOs. Before the part resets they are exchanged back. Whatever touches the model
//! ends with [`Usb::settle`], which brings the host to the moment, sets the interrupt line, and names the next event.
//!
//! *Limits.* The clock's gate is looked at here; with the clock off the block is not mapped. Both
//! models have their own.

mod core;
mod host;

use std::num::NonZeroU64;
use std::ops::{Deref, DerefMut};

use rigless::device::{DeviceContext, ErasedDevice, RegisterFile, RequestChange, ResetCause};
use rigless::mcu::Mcu;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::rcc::{Register, ahb2enr};
use rigless::soc::{Bus, RegisterSpec, Width, Window};
use rigless::time::{EventId, VirtualNanos};

use self::core::Core;
pub use self::host::{Host, Transfer};

/// The blocks of OTG_FS, as the part names them.
const BLOCKS: [&str; 4] = [
    "OTG_FS_GLOBAL",
    "OTG_FS_HOST",
    "OTG_FS_DEVICE",
    "OTG_FS_PWRCLK",
];
const BASE: u64 = 0x5000_0000;
const SIZE: NonZeroU64 = NonZeroU64::new(0x4_0000).expect("it is not 0");
/// OTG_FS's interrupt (RM0090, table 62).
const LINES: &[u16] = &[67];

/// The model, and the host.
#[derive(Debug)]
pub(crate) struct Usb {
    core: Core,
    host: Host,
    is_high: bool,
}

impl Usb {
    /// Brings the host to the moment, the line to its level, and names the next event.
    fn settle(&mut self, context: &mut DeviceContext<'_>) {
        let now = context.now().0;
        let mut rounds = 0;
        loop {
            if self.core.take_change() {
                self.host.handle_change(now);
            }
            match self.host.next(&self.core) {
                Some(at) if at <= now && rounds < 64 => self.host.act(now, &mut self.core),
                Some(at) => {
                    context.schedule(VirtualNanos(at.max(now + 1)));
                    break;
                }
                None => break,
            }
            rounds += 1;
        }
        let is_high = self.core.interrupts();
        if is_high != self.is_high {
            self.is_high = is_high;
            if is_high {
                context.raise(0);
            } else {
                context.lower(0);
            }
        }
    }
}

impl ErasedDevice for Usb {
    fn layout(&self) -> &'static [RegisterSpec] {
        &[]
    }

    fn read(&mut self, _: usize, _: &mut RegisterFile, _: &mut DeviceContext<'_>) -> Option<u64> {
        None
    }

    fn write(&mut self, _: usize, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_event(&mut self, _: EventId, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.settle(context);
    }

    fn on_request(&mut self, _: RequestChange, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_clock(&mut self, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn poll(&mut self, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.settle(context);
    }

    fn reset(&mut self) {
        self.core.restart();
    }

    fn on_access(&mut self, _: u64, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_refused(&mut self, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn read_window(&mut self, offset: u64, width: Width, context: &mut DeviceContext<'_>) -> u64 {
        let value = self.core.read(offset);
        if value.is_none() || width != Width::W32 {
            context.tell(
                "window",
                "a register that OTG_FS's model does not know is read",
            );
        }
        self.settle(context);
        u64::from(value.unwrap_or(0))
    }

    fn write_window(
        &mut self,
        offset: u64,
        width: Width,
        value: u64,
        context: &mut DeviceContext<'_>,
    ) {
        if !self.core.write(offset, value as u32) || width != Width::W32 {
            context.tell(
                "window",
                "a register that OTG_FS's model does not know is written",
            );
        }
        self.settle(context);
    }
}

/// The part with its USB.
#[derive(Debug)]
pub(crate) struct Part {
    stm: Stm32f427,
    usb: Usb,
    /// Where the blocks stand on the bus, and what stood there before.
    slots: [(usize, Bus); BLOCKS.len()],
    clocks: usize,
}

impl Part {
    /// `stm` with `host` at its connector.
    pub(crate) fn new(stm: Stm32f427, host: Host) -> anyhow::Result<Self> {
        let bus = stm.bus();
        let clocks = bus.slot("RCC")?;
        let window = |name| -> anyhow::Result<(usize, Bus)> {
            let mut donor = Bus::builder(bus.cpu(), &[], []).build()?;
            donor.add_window(Window::new(name, BASE, SIZE).raising(LINES))?;
            Ok((bus.slot(name)?, donor))
        };
        let [global, as_host, device, power] = BLOCKS;
        let slots = [
            window(global)?,
            window(as_host)?,
            window(device)?,
            window(power)?,
        ];
        let mut part = Self {
            stm,
            usb: Usb {
                core: Core::new(),
                host,
                is_high: false,
            },
            slots,
            clocks,
        };
        part.exchange();
        Ok(part)
    }

    /// Puts the windows in, or the part's own blocks.
    fn exchange(&mut self) {
        for (slot, donor) in &mut self.slots {
            std::mem::swap(donor.slot_mut(0), self.stm.bus_mut().slot_mut(*slot));
        }
    }

    /// Has `act` do something with the host at `now`.
    pub(crate) fn with_host<T>(
        &mut self,
        now: VirtualNanos,
        act: impl FnOnce(&mut Host) -> T,
    ) -> T {
        let result = act(&mut self.usb.host);
        self.settle(now);
        result
    }

    /// The bus is suspended, or resumed.
    pub(crate) fn suspend(&mut self, now: VirtualNanos, is_suspended: bool) {
        let Usb { core, host, .. } = &mut self.usb;
        host.suspend(core, is_suspended, now.0);
        self.settle(now);
    }

    fn settle(&mut self, now: VirtualNanos) {
        let (global, _) = &self.slots[0];
        let (_, mut context) = self.stm.bus_mut().drive(now, *global);
        self.usb.settle(&mut context);
    }

    fn is_clocked(&self) -> bool {
        let registers = self.stm.bus().slots()[self.clocks].registers();
        ahb2enr::OTGFSEN.is_set(registers.get(Register::Ahb2enr))
    }
}

impl Deref for Part {
    type Target = Stm32f427;

    fn deref(&self) -> &Stm32f427 {
        &self.stm
    }
}

impl DerefMut for Part {
    fn deref_mut(&mut self) -> &mut Stm32f427 {
        &mut self.stm
    }
}

impl Mcu for Part {
    fn bus(&self) -> &Bus {
        self.stm.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.stm.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.exchange();
        self.stm.reset(at, cause);
        self.exchange();
        self.usb.core.restart();
        self.usb.is_high = false;
        self.settle(at);
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.stm.poll(now);
        let is_due = self.usb.host.next(&self.usb.core);
        if is_due.is_some_and(|at| at <= now.0) {
            self.settle(now);
        }
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        if self.slots.iter().any(|(window, _)| *window == slot) {
            let is_clocked = self.is_clocked();
            let usb: Option<&mut dyn ErasedDevice> = is_clocked.then_some(&mut self.usb);
            return (self.stm.bus_mut(), usb);
        }
        self.stm.split(slot)
    }
}
