//! Time since boot: SysTick, its witness TIM5, and embassy's time driver.
//!
//! *Purpose.* [`now`] and [`stamp`] for everything that happens; timers for the tasks.
//!
//! *Design.* The arithmetic is `timebase::tick`'s; here are its registers and words. The tick interrupt
//! moves the anchor and compares its low word with the alarm. When that is due it pends PendSV, which
//! searches the queue of timers at a lower priority. The alarm is never more than a millisecond away,
//! because PendSV also looks into the rings of the serial lines; so 32 bits are enough for the
//! comparison. A timer is late by a tick at most, and by the way to its task. It is never early,
//! because it is compared with the time itself.
//!
//! The witness looks after the alarm besides: its compare register is [`MISSED`] ahead, and is moved on
//! by each alarm. When the counter comes there, tick or alarm have stopped, and its interrupt ends the run.
//!
//! *Limits.* embassy's ticks are µs. Before [`start`] its time is 0.

use core::arch::{asm, naked_asm};
use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use core::task::Waker;

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{NVIC, SCB, SYST};
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;
use stm32f4xx_hal::pac::{Interrupt, TIM5};
use stm32f4xx_hal::rcc::{Enable as _, Rcc, Reset as _};
use timebase::tick::{self, CounterPair, Word};
use timebase::{CORE_HZ, Cycles, Stamp};

use crate::settings::VARIANT;
use crate::{board, fault, masks, priorities};

/// The longest time from alarm to alarm, and so for bytes in a ring before their task is woken, in
/// cycles: 1 ms.
const SERVICE: u32 = CORE_HZ / 1_000;

/// An alarm has not come for so long when it counts as stopped, in counts of the witness: 50 ms, half of what
/// the LED may take to show it.
const MISSED: u32 = CORE_HZ / 20 / board::WITNESS_RATIO;

/// From tick to tick, in cycles.
pub const TICK_PERIOD: u32 = CORE_HZ / 1_000_000 * VARIANT.tick_us();

/// The counters, SysTick and TIM5.
struct Registers;

/// The words of the time, and behind them when the alarm is due.
#[used] // Keeps them together: one address for all, where a tick and a reading would take several.
static WORDS: [AtomicU32; ALARM + 1] = [const { AtomicU32::new(0) }; ALARM + 1];
const ALARM: usize = 4;
static STARTED: AtomicBool = AtomicBool::new(false);

impl CounterPair for Registers {
    const PERIOD: u32 = TICK_PERIOD;
    const RATIO: u32 = board::WITNESS_RATIO;

    #[inline(always)]
    fn read_pair(&self) -> (u32, u32) {
        board::read_pair(|| self.read_witness(), SYST::get_current)
    }

    #[inline(always)]
    fn read_witness(&self) -> u32 {
        // SAFETY: reading the count has no side effect on its owner.
        unsafe { (*TIM5::ptr()).cnt().read().bits() }
    }

    #[inline(always)]
    fn load(&self, word: Word) -> u32 {
        WORDS[word as usize].load(Relaxed)
    }

    #[inline(always)]
    fn store(&self, word: Word, value: u32) {
        WORDS[word as usize].store(value, Relaxed);
    }

    #[inline(always)]
    fn masked<R>(&self, section: impl FnOnce() -> R) -> R {
        // As `cortex_m::interrupt::free`, less its branch and its barrier: nothing here depends on
        // a pending interrupt being taken before the next line.
        let before: u32;
        // SAFETY: masks interrupts, and puts back what was found, so that a caller that had them
        // masked still has them masked. Both are barriers to the compiler.
        unsafe { asm!("mrs {}, PRIMASK", "cpsid i", out(reg) before, options(nostack)) };
        let result = section();
        // SAFETY: as above.
        unsafe { asm!("msr PRIMASK, {}", in(reg) before, options(nostack)) };
        result
    }
}

const _: () = assert!(Registers::PERIOD.is_multiple_of(Registers::RATIO));

/// Why the clock did not start.
#[derive(Clone, Copy)]
pub enum NotStarted {
    /// SHPR3 does not read back as it was written, for SysTick.
    Priority {
        /// What was written.
        wanted: u8,
        /// What was read back.
        found: u8,
    },
    /// The witness counts at another rate than the board's file says: a bootloader may have left
    /// the timers' clock doubled (RCC_DCKCFGR, TIMPRE), and every lost tick would be made good wrongly.
    Ratio {
        /// Its counts in [`RATIO_TICKS`] ticks, as they have to be.
        wanted: u32,
        /// As they are.
        found: u32,
    },
}

/// Ticks during which the witness is compared with SysTick at the start: 1 ms and more.
const RATIO_TICKS: u32 = 1_000_u32.div_ceil(VARIANT.tick_us()) + 1;

/// Starts the witness, and SysTick at [`priorities::TICK`].
///
/// # Errors
///
/// [`NotStarted`]; no tick comes then.
pub fn start(mut syst: SYST, scb: &mut SCB, tim5: TIM5, rcc: &mut Rcc) -> Result<(), NotStarted> {
    start_witness(&tim5, rcc);
    // SAFETY: the priorities are those of the table; no critical section depends on priorities.
    unsafe {
        scb.set_priority(SystemHandler::SysTick, priorities::TICK);
        scb.set_priority(SystemHandler::PendSV, priorities::ALARM);
    }
    let found = SCB::get_priority(SystemHandler::SysTick);
    if found != priorities::TICK {
        return Err(NotStarted::Priority {
            wanted: priorities::TICK,
            found,
        });
    }
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(Registers::PERIOD - 1);
    syst.clear_current();
    syst.enable_counter();
    if board::HAS_CONSTANT_CLOCKS {
        check_ratio(&mut syst)?;
    }
    tick::start(&Registers);
    // From here on every wrap has its interrupt, or is found by the witness.
    STARTED.store(true, Relaxed);
    syst.enable_interrupt();
    // Where the counters stop, as QEMU's do, a late alarm means nothing.
    if board::HAS_CONSTANT_CLOCKS {
        expect_alarm();
        tim5.sr().reset();
        tim5.dier().write(|w| w.cc1ie().enabled());
        // SAFETY: the handler uses nothing that anybody else has.
        unsafe { NVIC::unmask(Interrupt::TIM5) };
    }
    Ok(())
}

fn start_witness(tim5: &TIM5, rcc: &mut Rcc) {
    TIM5::enable(rcc);
    TIM5::reset(rcc);
    tim5.psc().write(|w| w.psc().set(board::WITNESS_PRESCALER));
    // The prescaler takes effect at the next update; this is one.
    tim5.egr().write(|w| w.ug().update());
    tim5.cr1().write(|w| w.cen().enabled());
}

/// Holds the witness against SysTick for a ms.
fn check_ratio(syst: &mut SYST) -> Result<(), NotStarted> {
    /// What the looks at the end of a tick may be apart, in counts: some dozen instructions.
    const APART: u32 = 64;
    let wanted = RATIO_TICKS * (Registers::PERIOD / Registers::RATIO);
    let mut at_wrap = || {
        // COUNTFLAG is cleared by its reading.
        while !syst.has_wrapped() {}
        Registers.read_witness()
    };
    let before = at_wrap();
    let mut after = before;
    for _ in 0..RATIO_TICKS {
        after = at_wrap();
    }
    let found = after.wrapping_sub(before);
    if found.abs_diff(wanted) > APART {
        return Err(NotStarted::Ratio { wanted, found });
    }
    Ok(())
}

/// Time since boot.
#[inline(always)]
pub fn now() -> Cycles {
    tick::now(&Registers)
}

/// The last tick that has passed, whether it had an interrupt or not.
pub fn last_tick() -> Cycles {
    tick::last_tick(&Registers)
}

/// The time since boot in whole ticks, as NuttX has it: the ticks whose interrupt came. What SysTick pends
/// while it waits is one interrupt, however many periods pass.
pub fn counted_ticks() -> Cycles {
    tick::counted_ticks(&Registers)
}

/// The low word of the time since boot, for interrupts.
#[inline(always)]
pub fn stamp() -> Stamp {
    tick::stamp(&Registers)
}

/// A moment, and what SysTick showed then.
pub struct Reference {
    /// The moment.
    pub at: Cycles,
    down_count: u32,
}

impl Reference {
    /// This moment, or up to a tick later.
    pub fn new() -> Self {
        let (now, down_count) = Registers.masked(|| (now(), SYST::get_current()));
        Self {
            at: tick::first_showing(down_count, Registers::PERIOD, now),
            down_count,
        }
    }

    /// How long after it, less than a tick, SysTick showed `down_count`, in cycles.
    pub fn until(&self, down_count: u32) -> i32 {
        let past = self.down_count.wrapping_sub(down_count).cast_signed();
        if past < 0 {
            past + Registers::PERIOD.cast_signed()
        } else {
            past
        }
    }
}

/// Readings by `read` and of SysTick in turn, without an interrupt in between: one of SysTick after
/// each but the last. The pause lets a counter of half the rate show both of its halves.
#[inline]
pub fn in_turn<T>(read: impl Fn() -> T) -> ([T; 3], [u32; 2]) {
    Registers.masked(|| {
        let first = read();
        let one = SYST::get_current();
        cortex_m::asm::nop();
        let second = read();
        let other = SYST::get_current();
        let third = read();
        ([first, second, third], [one, other])
    })
}

/// Ticks that had no interrupt, because the one before still waited: made good in [`now`], not in
/// [`counted_ticks`].
pub fn lost_ticks() -> u32 {
    Registers.load(Word::LostTicks)
}

/// SysTick's handler, at [`priorities::TICK`]: as little as possible. What is rare is outlined, so that
/// the plain tick saves no registers.
#[unsafe(no_mangle)]
extern "C" fn SysTick() {
    match tick::on_tick(&Registers) {
        Some(anchor) if !is_alarm_due(anchor) => {}
        Some(_) => pend_alarm(),
        None => repair(),
    }
}

#[cold]
#[inline(never)]
fn repair() {
    if is_alarm_due(tick::repair(&Registers)) {
        pend_alarm();
    }
}

#[cold]
#[inline(never)]
fn pend_alarm() {
    SCB::set_pendsv();
}

#[inline(always)]
fn is_alarm_due(anchor: Stamp) -> bool {
    anchor
        .0
        .wrapping_sub(WORDS[ALARM].load(Relaxed))
        .cast_signed()
        >= 0
}

/// The next alarm has to come before the witness has counted [`MISSED`].
fn expect_alarm() {
    let by = Registers.read_witness().wrapping_add(MISSED);
    // SAFETY: the register is this module's, and only written whole.
    unsafe { (*TIM5::ptr()).ccr1().write(|w| w.ccr().bits(by)) };
}

/// The alarm has not come. With the place of the exception's frame: there it is seen what goes on instead.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn TIM5() {
    naked_asm!("mov r0, sp", "b {stopped}", stopped = sym fault::alarm_stopped)
}

/// Wakes what is due and sets the next alarm. PendSV calls it.
pub fn on_alarm() {
    expect_alarm();
    DRIVER.with_timers(|timers| {
        let now = now();
        if now >= timers.due {
            let next_us = timers.queue.next_expiration(now.as_micros());
            timers.due = Cycles::from_micros(next_us);
        }
        set_alarm(timers.due);
    });
}

/// Sets the alarm to when the first timer is `due`, or to the next ms.
fn set_alarm(due: Cycles) {
    let anchor = Registers.load(Word::AnchorLow);
    let until_due = due.since(now());
    let alarm = if until_due < i64::from(SERVICE) {
        due.stamp().0
    } else {
        anchor.wrapping_add(SERVICE)
    };
    WORDS[ALARM].store(alarm, Relaxed);
}

struct TimeDriver {
    timers: UnsafeCell<Timers>,
}

// SAFETY: the timers are reached through `with_timers` alone.
unsafe impl Sync for TimeDriver {}

impl TimeDriver {
    /// Lends the timers. The alarm and the tasks come here, nobody above them, and `act` wakes tasks
    /// but runs none.
    fn with_timers<R>(&self, act: impl FnOnce(&mut Timers) -> R) -> R {
        masks::up_to(priorities::ALARM, || {
            // SAFETY: everybody else who comes here is kept out.
            act(unsafe { &mut *self.timers.get() })
        })
    }
}

struct Timers {
    queue: Queue,
    /// Nothing in the queue is due before; something may be due later than this.
    due: Cycles,
}

embassy_time_driver::time_driver_impl!(static DRIVER: TimeDriver = TimeDriver {
    timers: UnsafeCell::new(Timers {
        queue: Queue::new(),
        due: Cycles(u64::MAX),
    }),
});

impl Driver for TimeDriver {
    fn now(&self) -> u64 {
        if STARTED.load(Relaxed) {
            now().as_micros()
        } else {
            0
        }
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        self.with_timers(|timers| {
            let is_new = timers.queue.schedule_wake(at, waker);
            let at = Cycles::from_micros(at);
            if is_new && at < timers.due {
                timers.due = at;
                set_alarm(at);
            }
        });
    }
}

defmt::timestamp!("{=u64:us}", DRIVER.now());
