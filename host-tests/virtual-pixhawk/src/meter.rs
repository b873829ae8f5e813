//! What the core executes, counted instruction by instruction.
//!
//! *Purpose.* Interrupts by vector, the instructions that each takes, the
//! instructions inside calls of named functions, and a profile by address: all of
//! the very image that is flashed.
//!
//! *Design.* `rigless` counts the instructions retired, which is the time that the
//! core was not asleep, but not what they were spent on. It lets a board wrap its
//! processor, though, and promises that a run is the same however it is cut. So
//! [`Meter`] wraps it and, while it is on, runs one instruction at a time. Before
//! each, a stretch of no instructions lets a pending exception be entered; then the
//! program counter and IPSR show what is executed and on whose behalf. Activations of exceptions are kept on a stack, and each has its own stack
//! of watched calls, so that an interrupt in the middle of a function is not charged
//! to it. Off, the processor runs as if it were not wrapped.
//!
//! *Limits.* One instruction counts one, as everywhere on this board; the about 12
//! cycles to enter an exception and the 10 to leave it are none, as are wait states.
//! A function that the compiler has inlined has no address to watch. Metered virtual
//! time costs about a microsecond of the host's for each instruction.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::emulator::ProcessorConstructor;

use crate::crystal::CrystalStart;
use crate::flash::{APPLICATION, APPLICATION_MAX};
use crate::image::{Firmware, Symbol};
use crate::probe::Probe;
use crate::sections::Sections;
use crate::stepping::{Moment, Observer, Origin, Stepping, Traffic};
use crate::tally::Tally;

/// What was counted while a meter was on.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    /// Instructions executed, all of them: the time not spent asleep.
    pub instructions: u64,
    /// Of these, in no exception.
    pub in_thread: u64,
    /// By exception number (15 is SysTick, 16 + n interrupt n): its activations and
    /// their own instructions, without those of exceptions that preempted them.
    pub exceptions: BTreeMap<u16, Tally>,
    /// By the name with which it was watched: its calls and their instructions, with
    /// those of everything that it called and without those of interrupts.
    pub functions: BTreeMap<String, Tally>,
    /// By the same name: the exceptions on whose behalf it was called, 0 for none.
    pub callers: BTreeMap<String, BTreeSet<u16>>,
    sections: Sections,
    /// How often the instruction at each halfword of the application was executed.
    executed: Vec<u64>,
    /// The same under PRIMASK.
    executed_masked: Vec<u64>,
}

/// The sum of `executed`, counts by halfword, in `place`.
fn inside(executed: &[u64], place: Symbol) -> u64 {
    let (Some(first), Some(last)) = (
        halfword(place.address),
        halfword(place.address + place.size),
    ) else {
        return 0;
    };
    executed.iter().take(last).skip(first).sum()
}

/// Adds `retired` instructions at `halfword` to counts by halfword.
fn add(executed: &mut Vec<u64>, halfword: usize, retired: u64) {
    if executed.len() <= halfword {
        executed.resize(halfword + 1, 0);
    }
    executed[halfword] += retired;
}

impl Profile {
    /// Instructions executed at addresses inside `place`, without those of what is
    /// called from there.
    #[must_use]
    pub fn inside(&self, place: Symbol) -> u64 {
        inside(&self.executed, place)
    }

    /// Of these, the instructions executed while every interrupt was masked.
    #[must_use]
    pub fn inside_masked(&self, place: Symbol) -> u64 {
        inside(&self.executed_masked, place)
    }

    /// The sections under PRIMASK, by the function in which they begin; the longest first.
    #[must_use]
    pub fn masked<'a>(&self, firmware: &'a Firmware) -> Vec<(&'a str, Tally)> {
        let mut sections: Vec<_> = self
            .sections
            .masked
            .iter()
            .map(|(&from, &tally)| (firmware.function_at(from).unwrap_or("?"), tally))
            .collect();
        sections.sort_by_key(|&(name, tally)| (std::cmp::Reverse(tally.most), name));
        sections
    }

    /// From an interrupt's request to the first instruction of its handler, by exception number.
    #[must_use]
    pub const fn entries(&self) -> &BTreeMap<u16, Tally> {
        &self.sections.entries
    }

    /// From an interrupt's request to the reading of the time in its handler, by exception number.
    #[must_use]
    pub const fn stamps(&self) -> &BTreeMap<u16, Tally> {
        &self.sections.stamps
    }

    /// The functions of `firmware` with the instructions executed inside each,
    /// most first.
    #[must_use]
    pub fn by_function<'a>(&self, firmware: &'a Firmware) -> Vec<(&'a str, u64)> {
        let mut functions: Vec<_> = firmware
            .symbols()
            .map(|(name, place)| (name, self.inside(place)))
            .filter(|&(_, instructions)| instructions > 0)
            .collect();
        functions.sort_by_key(|&(name, instructions)| (std::cmp::Reverse(instructions), name));
        functions
    }
}

/// A call of a watched function that has not returned.
#[derive(Clone, Debug)]
struct Call {
    function: String,
    returns_to: u32,
    sp: u32,
    since: u64,
}

/// One activation of an exception, or the thread.
#[derive(Clone, Debug, Default)]
struct Activation {
    exception: u16,
    /// SP as its first instruction found it.
    sp: u32,
    instructions: u64,
    calls: Vec<Call>,
}

/// Which halfword of the application's flash `address` is.
fn halfword(address: u32) -> Option<usize> {
    let offset = address.checked_sub(APPLICATION)?;
    (offset < APPLICATION_MAX).then_some(offset as usize / 2)
}

/// Whether `lr` is what the core writes there as it enters an exception (ARMv7-M
/// B1.5.8).
const fn is_exc_return(lr: u32) -> bool {
    lr >= 0xffff_ffe0
}

/// The state of counting.
#[derive(Clone, Debug, Default)]
pub(crate) struct Count {
    on: bool,
    profile: Profile,
    entries: BTreeMap<u32, String>,
    /// Where the handler of each exception begins, by its number.
    handlers: Vec<u32>,
    /// The thread, and on it the exceptions that are active; the last one runs.
    activations: Vec<Activation>,
    /// The exception of the last instruction.
    running: u16,
}

impl Observer for Count {
    fn is_on(&self) -> bool {
        self.on
    }

    fn before(&mut self, moment: Moment, origin: impl Fn() -> Origin) {
        self.follow_exceptions(moment, &origin);
        let Some(running) = self.activations.last_mut() else {
            return;
        };
        while let Some(call) = running
            .calls
            .pop_if(|call| call.returns_to == moment.pc && origin().sp >= call.sp)
        {
            let spent = running.instructions - call.since;
            self.profile
                .functions
                .entry(call.function)
                .or_default()
                .add(spent);
        }
        if let Some(function) = self.entries.get(&moment.pc) {
            let Origin { sp, lr } = origin();
            self.profile
                .callers
                .entry(function.clone())
                .or_default()
                .insert(moment.ipsr);
            running.calls.push(Call {
                function: function.clone(),
                returns_to: lr & !1,
                sp,
                since: running.instructions,
            });
        }
    }

    fn after(&mut self, moment: Moment, retired: u64) {
        self.profile.instructions += retired;
        self.running = moment.ipsr;
        let executed = self.profile.instructions;
        self.profile.sections.after(moment, retired, executed);
        if moment.ipsr == 0 {
            self.profile.in_thread += retired;
        }
        if let Some(halfword) = halfword(moment.pc) {
            add(&mut self.profile.executed, halfword, retired);
            if moment.is_masked {
                add(&mut self.profile.executed_masked, halfword, retired);
            }
        }
        if let Some(running) = self.activations.last_mut() {
            running.instructions += retired;
        }
    }

    fn on_traffic(&mut self, traffic: Traffic) {
        let executed = self.profile.instructions;
        self.profile
            .sections
            .on_traffic(traffic, self.running, executed);
    }
}

impl Count {
    /// Brings the activations up to date with IPSR.
    fn follow_exceptions(&mut self, moment: Moment, origin: &impl Fn() -> Origin) {
        let handler = self.handlers.get(usize::from(moment.ipsr));
        if moment.ipsr == 0 {
            self.end_until(|_| false);
            if self.activations.is_empty() {
                self.activations.push(Activation::default());
            }
        } else if handler == Some(&moment.pc) && is_exc_return(origin().lr) {
            // It was just entered. Behind a tail-chained one SP is where the one
            // before found it, in a nested one below.
            let sp = origin().sp;
            self.end_until(|last| last.sp > sp);
            self.activations.push(Activation {
                exception: moment.ipsr,
                sp,
                ..Activation::default()
            });
        } else {
            self.end_until(|last| last.exception == moment.ipsr);
        }
    }

    /// Ends activations from the innermost on, up to the one that `goes_on`; never
    /// the thread.
    fn end_until(&mut self, goes_on: impl Fn(&Activation) -> bool) {
        while self.activations.len() > 1 && !self.activations.last().is_some_and(&goes_on) {
            self.end_activation();
        }
    }

    fn end_activation(&mut self) {
        if let Some(ended) = self.activations.pop() {
            self.profile
                .exceptions
                .entry(ended.exception)
                .or_default()
                .add(ended.instructions);
        }
    }
}

/// Counts instructions; off until it is started.
#[derive(Clone, Debug, Default)]
pub(crate) struct Meter(Arc<Mutex<Count>>);

impl Meter {
    /// `constructor`, whose processor this meter can look at, and `probe` reach, and which may change its
    /// flash and has such a crystal.
    pub(crate) fn around(
        &self,
        constructor: ProcessorConstructor,
        probe: Probe,
        programs_flash: bool,
        crystal: CrystalStart,
    ) -> ProcessorConstructor {
        let count = Arc::clone(&self.0);
        Arc::new(move |endian| {
            let processor = constructor(endian)?;
            Ok(Box::new(Stepping::new(
                processor,
                Arc::clone(&count),
                probe.clone(),
                programs_flash,
                crystal,
            )))
        })
    }

    fn count(&self) -> MutexGuard<'_, Count> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins to count from nothing, with calls of `functions` watched.
    pub(crate) fn start(&self, firmware: &Firmware, functions: &[&str]) -> anyhow::Result<()> {
        let mut entries = BTreeMap::new();
        for &function in functions {
            entries.insert(firmware.symbol(function)?.address, function.to_owned());
        }
        let handlers = (0..)
            .map_while(|exception| Some(firmware.vector(exception)? & !1))
            .collect();
        *self.count() = Count {
            on: true,
            profile: Profile::default(),
            entries,
            handlers,
            activations: Vec::new(),
            running: 0,
        };
        Ok(())
    }

    /// Ends counting. A call that has not ended yet, like one that sleeps, is in no
    /// tally.
    pub(crate) fn stop(&self) -> Profile {
        let mut count = self.count();
        count.on = false;
        std::mem::take(&mut count.profile)
    }
}
