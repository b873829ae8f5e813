//! The processor, run one instruction at a time under an observer.
//!
//! *Purpose.* [`Stepping`] is the processor that the board's machine module made;
//! while its [`Observer`] is on, that sees each instruction.
//!
//! *Design.* Everything is passed on, and nothing is changed on the way but
//! the length of a stretch: [`Processor`] promises the same run however it is cut.
//! The bus has to be wrapped as well, because it may let the processor go on past
//! its budget after an access.
//!
//! *Limits.* GDB is not served on this board, so what only a debugger needs is
//! left at the trait's defaults.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

use rigless::device::Level;
use rigless::emulator::{
    Access, AccessKind, Checked, CoreBus, DataModel, Error, Exit, HostCall, InterruptLine,
    Processor, Queued,
};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use crate::crystal::{CrystalStart, SlowCrystal, Starting};
use crate::flash_array::{FlashArray, Programming};
use crate::probe::Probe;

/// The numbers under which the processor shows its registers (GDB's, for Cortex-M).
const SP: usize = 13;
const LR: usize = 14;
const XPSR: usize = 16;
const PRIMASK: usize = 36;
/// The bits of xPSR that name the exception that is active.
const IPSR: u32 = 0x1ff;

/// What the core is about to execute, and on whose behalf.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    pub(crate) pc: u32,
    pub(crate) ipsr: u16,
    /// PRIMASK: no interrupt can come.
    pub(crate) is_masked: bool,
}

/// What goes over the core's bus and its interrupt lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Traffic {
    /// An instruction read this address.
    Read(u64),
    /// A peripheral drives its interrupt line.
    Line(u16, Level),
}

/// The registers that show where a call or an exception came from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Origin {
    pub(crate) sp: u32,
    pub(crate) lr: u32,
}

/// Sees each instruction while it is on.
pub(crate) trait Observer: Debug + Send {
    /// Whether it wants to see instructions.
    fn is_on(&self) -> bool;

    /// The instruction at `moment` comes next. `origin` reads registers: it is to be called only
    /// where a call or an exception may begin or end.
    fn before(&mut self, moment: Moment, origin: impl Fn() -> Origin);

    /// `retired` instructions were executed at `moment`: one, or none if it faulted.
    fn after(&mut self, moment: Moment, retired: u64);

    /// It went over the bus after the instructions that were seen so far, or with the last of them.
    fn on_traffic(&mut self, traffic: Traffic);
}

/// A processor with its observer.
#[derive(Debug)]
pub(crate) struct Stepping<O> {
    inner: Box<dyn Processor>,
    observer: Arc<Mutex<O>>,
    probe: Probe,
    /// The flash, if the core may change it.
    flash: Option<FlashArray>,
    /// The crystal, if it does not start at once.
    crystal: Option<SlowCrystal>,
}

impl<O> Stepping<O> {
    pub(crate) fn new(
        inner: Box<dyn Processor>,
        observer: Arc<Mutex<O>>,
        probe: Probe,
        programs_flash: bool,
        crystal: CrystalStart,
    ) -> Self {
        Self {
            inner,
            observer,
            probe,
            flash: programs_flash.then(FlashArray::default),
            crystal: SlowCrystal::new(crystal),
        }
    }

    fn register(&self, number: usize) -> u32 {
        let bytes = self.inner.gdb_register(number).unwrap_or_default();
        bytes.first_chunk().copied().map_or(0, u32::from_le_bytes)
    }

    fn moment(&self) -> Moment {
        Moment {
            // The part's addresses are 32 bits wide.
            pc: self.inner.pc() as u32,
            ipsr: (self.register(XPSR) & IPSR) as u16,
            is_masked: self.register(PRIMASK) & 1 != 0,
        }
    }

    fn origin(&self) -> Origin {
        Origin {
            sp: self.register(SP),
            lr: self.register(LR),
        }
    }
}

impl<O: Observer> Stepping<O> {
    fn run_observed(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        let observer = Arc::clone(&self.observer);
        let mut observer = observer.lock().unwrap_or_else(PoisonError::into_inner);
        if !observer.is_on() {
            drop(observer);
            return self.inner.run(budget, bus);
        }
        let mut bus = OneAtATime {
            bus,
            traffic: Vec::new(),
        };
        let mut retired = 0;
        while retired < u64::from(budget) {
            let (exit, _) = self.inner.run(0, &mut bus);
            bus.show(&mut *observer);
            if exit != Exit::Budget {
                return (exit, retired);
            }
            let moment = self.moment();
            observer.before(moment, || self.origin());
            let (exit, one) = self.inner.run(1, &mut bus);
            observer.after(moment, one);
            bus.show(&mut *observer);
            retired += one;
            if exit != Exit::Budget {
                return (exit, retired);
            }
        }
        (Exit::Budget, retired)
    }
}

impl<O: Observer> Processor for Stepping<O> {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        self.probe.apply(&mut *self.inner, &*bus);
        if let Some(flash) = self.flash.take() {
            let ran = self.run_observed(budget, &mut Programming::new(bus, &flash));
            self.flash = Some(flash);
            ran
        } else if let Some(mut crystal) = self.crystal.take() {
            let ran = self.run_observed(budget, &mut Starting::new(bus, &mut crystal));
            self.crystal = Some(crystal);
            ran
        } else {
            self.run_observed(budget, bus)
        }
    }

    fn retired(&self) -> u64 {
        self.inner.retired()
    }

    fn ask(&mut self, queued: Queued) {
        if let Queued::Line(line, level) = queued {
            let mut observer = self.observer.lock().unwrap_or_else(PoisonError::into_inner);
            if observer.is_on() {
                observer.on_traffic(Traffic::Line(line.index(), level));
            }
        }
        self.inner.ask(queued);
    }

    fn maps(&self, start: u64, length: u64) -> bool {
        self.inner.maps(start, length)
    }

    fn page_size(&self) -> u64 {
        self.inner.page_size()
    }

    unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        self.probe.handle_map(start, length, host);
        if let Some(flash) = &self.flash {
            flash.note(start, length, host);
        }
        // SAFETY: the caller's promise is passed on as it is, and `inner` is dropped
        // with `self`.
        unsafe { self.inner.map(start, length, host, writable) };
    }

    fn boot(&mut self, table: u64, read: &dyn Fn(u64, Width) -> Option<u64>) {
        self.inner.boot(table, read);
    }

    fn reset(&mut self) {
        if let Some(crystal) = &mut self.crystal {
            crystal.reset();
        }
        self.inner.reset();
    }

    fn take_reset_request(&mut self) -> bool {
        self.inner.take_reset_request()
    }

    fn next_event(&self) -> Option<VirtualNanos> {
        self.inner.next_event()
    }

    fn on_event(&mut self, now: VirtualNanos) {
        self.inner.on_event(now);
    }

    fn waiting(&self) -> bool {
        self.inner.waiting()
    }

    fn pc(&self) -> u64 {
        self.inner.pc()
    }

    fn add_breakpoint(&mut self, address: u64) -> bool {
        self.inner.add_breakpoint(address)
    }

    fn remove_breakpoint(&mut self, address: u64) {
        self.inner.remove_breakpoint(address);
    }

    fn pass_breakpoint(&mut self, address: u64) {
        self.inner.pass_breakpoint(address);
    }

    fn gdb_register(&self, number: usize) -> Option<Vec<u8>> {
        self.inner.gdb_register(number)
    }

    fn data_model(&self) -> DataModel {
        self.inner.data_model()
    }

    fn byte_order(&self, address: u64) -> Endian {
        self.inner.byte_order(address)
    }

    fn save(&self) -> Vec<u8> {
        self.inner.save()
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.inner.load(bytes)
    }

    fn check_reads(&mut self, every: bool) {
        self.inner.check_reads(every);
    }

    fn check_words(&mut self, words: &[u64]) {
        self.inner.check_words(words);
    }

    fn host_call(&self, read: &mut dyn FnMut(u64, Width) -> Option<u64>) -> Option<HostCall> {
        self.inner.host_call(read)
    }

    fn answer_host_call(&mut self, answer: Option<u64>) {
        self.inner.answer_host_call(answer);
    }
}

/// The run's bus, which never lets the processor go on past its budget.
struct OneAtATime<'a> {
    bus: &'a mut dyn CoreBus,
    /// What has gone over it and was not shown yet.
    traffic: Vec<Traffic>,
}

impl OneAtATime<'_> {
    /// Shows what has gone over it.
    fn show(&mut self, observer: &mut impl Observer) {
        for traffic in self.traffic.drain(..) {
            observer.on_traffic(traffic);
        }
    }
}

impl CoreBus for OneAtATime<'_> {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        if access.kind == AccessKind::Read && from_code {
            self.traffic.push(Traffic::Read(access.address));
        }
        self.bus.access(access, from_code)
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.bus.time(instructions)
    }

    fn queued(&mut self) -> Vec<Queued> {
        let queued = self.bus.queued();
        let lines = queued.iter().filter_map(|queued| match *queued {
            Queued::Line(line, level) => Some(Traffic::Line(line.index(), level)),
            _ => None,
        });
        self.traffic.extend(lines);
        queued
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
