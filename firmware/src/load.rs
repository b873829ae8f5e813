//! The load that is built in with `PIXCLOCK_LOAD`: a synthetic flight stack, for tests.
//!
//! *Purpose.* Keeps the core busy as PX4 does ([`flight_load`] says when, for how long and at which level), and
//! measures how late an interrupt at its level comes.
//!
//! *Design.* TIM2 counts at 84 MHz. Its interrupt, at [`priorities::LOAD`], keeps the core busy itself with
//! what stands there, and gives the rest to three software interrupts, one a level, each with a queue. A
//! masked section belongs to the highest of them and raises BASEPRI to [`priorities::LOAD`], as NuttX
//! does in its critical sections, and never PRIMASK. Busy is a loop of so many rounds as take the time on this
//! core, measured once: so it is the core's own time, and what interrupts it makes it longer, as with any code.
//!
//! The probe is a timer of its own, TIM3, at the same priority: its counter runs on from the compare,
//! so that its handler reads there how late it is, and then draws when the next event comes.
//!
//! | queue | filled by | drained by | when full |
//! |---|---|---|---|
//! | `TASKS`, three of 127 pieces each: at 80 % a level that waits 55 ms for the longest of all gets 40 | TIM2's interrupt, at most one a due piece | the level's software interrupt | the piece is left out and counted |
//! | `MASKED`, 63 sections: 3.5 ms at 80 % bring 50 | the same | the highest level's interrupt, also between the slices of a task | the same |
//!
//! *Limits.* The loop is measured where it lies in flash, with what the prefetch makes of it there. TIM2's
//! count wraps after 51 s, twice what the load allows between two looks.

use core::arch::asm;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use cortex_m::peripheral::NVIC;
use flight_load::{COUNTS_PER_US, FlightLoad, Lateness, Level};
use heapless::spsc::{Consumer, Producer, Queue};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{Interrupt, TIM2, TIM3};
use stm32f4xx_hal::rcc::{Enable as _, Rcc, Reset as _};

use crate::{image_words, masks, priorities, settings};

/// The software interrupts of the levels, those of the first CAN, which this firmware has no use for.
const LEVELS: [(Interrupt, u8); 3] = [
    (Interrupt::CAN1_TX, priorities::LOAD_ABOVE),
    (Interrupt::CAN1_RX0, priorities::LOAD_BETWEEN),
    (Interrupt::CAN1_RX1, priorities::LOAD_BELOW),
];

/// What finding and handing out a piece takes itself, in counts: 2.5 µs, of the emulator's core. It is taken off each
/// piece, so that the load takes what was asked for.
const OF_A_PIECE: u32 = 5 * COUNTS_PER_US / 2;

/// The longest stretch of a task without a look for masked sections, in counts: 20 µs.
const SLICE: u32 = 20 * COUNTS_PER_US;

/// Rounds of the loop in 2¹⁶ counts.
static ROUNDS: AtomicU32 = AtomicU32::new(0);

/// Pieces that found their queue full. For a probe.
static LOAD_LEFT_OUT: AtomicU32 = AtomicU32::new(0);

/// How late the probe's events came: [`Lateness`], word by word. For a probe.
static LOAD_LATENESS: [AtomicU32; 7] = [const { AtomicU32::new(0) }; 7];

/// What the interrupts share; each of its parts has one user.
struct Shared {
    load: Option<FlightLoad>,
    given: Option<[Producer<'static, u32>; 4]>,
    masked: Option<Consumer<'static, u32>>,
    tasks: [Option<Consumer<'static, u32>>; 3],
    /// The probe's own chance.
    chance: u32,
}

static mut SHARED: Shared = Shared {
    load: None,
    given: None,
    masked: None,
    tasks: [None, None, None],
    chance: 1,
};

/// Starts the load and its probe, once. The time runs already.
pub fn start(tim2: TIM2, tim3: TIM3, nvic: &mut NVIC, rcc: &mut Rcc) {
    static mut MASKED: Queue<u32, 64> = Queue::new();
    static mut TASKS: [Queue<u32, 128>; 3] = [Queue::new(), Queue::new(), Queue::new()];
    let Ok(load) = settings::LOAD.parse() else {
        panic!("the build has let a load pass that there is not");
    };
    TIM2::enable(rcc);
    TIM2::reset(rcc);
    tim2.cr1().write(|w| w.cen().enabled());
    measure_the_loop(&tim2);
    // SAFETY: bring-up calls this once, and none of the interrupts that use these is enabled yet.
    unsafe {
        let (masked, masked_end) = (*(&raw mut MASKED)).split();
        let [above, between, below] = (*(&raw mut TASKS)).each_mut().map(Queue::split);
        let shared = &mut *(&raw mut SHARED);
        shared.given = Some([masked, above.0, between.0, below.0]);
        shared.masked = Some(masked_end);
        shared.tasks = [Some(above.1), Some(between.1), Some(below.1)];
        let seed = image_words::load_seed();
        shared.chance = seed | 1;
        shared.load = Some(FlightLoad::new(load, seed, tim2.cnt().read().bits()));
    }
    start_probe(&tim3, rcc);
    let timers = [
        (Interrupt::TIM2, priorities::LOAD),
        (Interrupt::TIM3, priorities::LOAD),
    ];
    for (interrupt, priority) in LEVELS.into_iter().chain(timers) {
        // SAFETY: none of them is enabled yet, and their handlers' words are there.
        unsafe {
            nvic.set_priority(interrupt, priority);
            NVIC::unmask(interrupt);
        }
    }
    tim2.dier().write(|w| w.cc1ie().enabled());
    NVIC::pend(Interrupt::TIM2);
}

/// The log's line about it, with the priorities as they stand in the registers.
pub fn log_identity() {
    defmt::info!(
        "load {=str}, seed {=u32}: interrupts {=u8:#04x}, tasks {=u8:#04x}, {=u8:#04x} and {=u8:#04x}, GNSS {=u8:#04x}, MAVLink {=u8:#04x}",
        settings::LOAD,
        image_words::load_seed(),
        NVIC::get_priority(Interrupt::TIM2),
        NVIC::get_priority(Interrupt::CAN1_TX),
        NVIC::get_priority(Interrupt::CAN1_RX0),
        NVIC::get_priority(Interrupt::CAN1_RX1),
        NVIC::get_priority(crate::executors::HIGH_INTERRUPT),
        NVIC::get_priority(crate::executors::MAVLINK_INTERRUPT)
    );
}

/// Pieces that found their queue full.
pub fn left_out() -> u32 {
    LOAD_LEFT_OUT.load(Relaxed)
}

/// Times the loop, shorter than a tick, and takes the least: what interrupted it made the others longer.
fn measure_the_loop(tim2: &TIM2) {
    const TRIED: u32 = 100;
    let mut least = u32::MAX;
    for _ in 0..8 {
        let before = tim2.cnt().read().bits();
        rounds(TRIED);
        least = least.min(tim2.cnt().read().bits().wrapping_sub(before));
    }
    ROUNDS.store((TRIED << 16) / least.max(1), Relaxed);
}

/// Keeps the core busy for that long, if nothing interrupts.
fn keep_busy(counts: u32) {
    let wanted = (u64::from(counts) * u64::from(ROUNDS.load(Relaxed))) >> 16;
    rounds(wanted as u32);
}

#[inline(never)]
fn rounds(wanted: u32) {
    if wanted == 0 {
        return;
    }
    // Long, so that an emulator has little to do for it.
    // SAFETY: counts a register down and touches nothing else.
    unsafe {
        asm!(
            "2: subs {0}, #1",
            ".rept 30",
            "nop",
            ".endr",
            "bne 2b",
            inout(reg) wanted => _,
            options(nomem, nostack)
        );
    }
}

/// TIM2's interrupt: what is due.
#[interrupt]
fn TIM2() {
    // SAFETY: this handler alone uses the load and the queues' near ends.
    let (load, given) = unsafe { (&mut *(&raw mut SHARED.load), &mut *(&raw mut SHARED.given)) };
    let (Some(load), Some(given)) = (load, given) else {
        return;
    };
    // SAFETY: the timer is this module's.
    let tim2 = unsafe { &*TIM2::ptr() };
    loop {
        tim2.sr().write(|w| w.cc1if().clear());
        while let Some(job) = load.poll(tim2.cnt().read().bits()) {
            let [masked, above, between, below] = given;
            let counts = job.counts.saturating_sub(OF_A_PIECE);
            let ((interrupt, _), queue) = match job.level {
                Level::Interrupt => {
                    keep_busy(counts);
                    continue;
                }
                Level::Masked => (LEVELS[0], masked),
                Level::Above => (LEVELS[0], above),
                Level::Between => (LEVELS[1], between),
                Level::Below => (LEVELS[2], below),
            };
            match queue.enqueue(counts) {
                Ok(()) => NVIC::pend(interrupt),
                Err(_) => count(&LOAD_LEFT_OUT),
            }
        }
        let due = load.poll_timeout();
        tim2.ccr1().write(|w| w.ccr().set(due));
        // A compare that has passed meanwhile would come in 51 s.
        if due.wrapping_sub(tim2.cnt().read().bits()).cast_signed() > 0 {
            return;
        }
    }
}

#[interrupt]
fn CAN1_TX() {
    run_tasks(0);
}

#[interrupt]
fn CAN1_RX0() {
    run_tasks(1);
}

#[interrupt]
fn CAN1_RX1() {
    run_tasks(2);
}

/// Runs what waits at a level. The highest has the masked sections, between its slices and by themselves.
fn run_tasks(level: usize) {
    // SAFETY: each level's handler alone uses its far end, and the highest that of the masked sections; none
    // makes a reference to what others use.
    let (tasks, mut masked) = unsafe {
        let tasks = &mut *(&raw mut SHARED.tasks[level]);
        let masked = (level == 0).then(|| &mut *(&raw mut SHARED.masked));
        (tasks, masked)
    };
    let mut run_masked = || {
        if let Some(Some(masked)) = &mut masked {
            while let Some(counts) = masked.dequeue() {
                masks::up_to(priorities::LOAD, || keep_busy(counts));
            }
        }
    };
    run_masked();
    while let Some(mut counts) = tasks.as_mut().and_then(Consumer::dequeue) {
        while counts > 0 {
            let slice = counts.min(SLICE);
            keep_busy(slice);
            counts -= slice;
            run_masked();
        }
    }
}

/// The probe's events are so far apart, in counts, from the least on: 500 to 1500 µs. That is of no period of
/// anybody, and longer than the longest stretch, in which a second event would not be counted.
const PROBE_EVERY: (u32, u32) = (500 * COUNTS_PER_US, 1_000 * COUNTS_PER_US);

/// One round of the probe's counter is what lateness may be at most: 65 536 counts of 12 MHz are 5.4 ms.
const PROBE_PRESCALER: u16 = 7 - 1;

/// Counts of the probe to the µs.
const PROBE_PER_US: u32 = COUNTS_PER_US / 7;

fn start_probe(tim3: &TIM3, rcc: &mut Rcc) {
    TIM3::enable(rcc);
    TIM3::reset(rcc);
    tim3.psc().write(|w| w.psc().set(PROBE_PRESCALER));
    // The prescaler takes effect at the next update; this is one.
    tim3.egr().write(|w| w.ug().update());
    tim3.ccr1().write(|w| w.ccr().set(u16::MAX.into()));
    tim3.sr().reset();
    tim3.dier().write(|w| w.cc1ie().enabled());
    tim3.cr1().write(|w| w.cen().enabled());
}

/// The probe's interrupt: how late it is, and when the next one comes.
#[interrupt]
fn TIM3() {
    // SAFETY: the timer is this module's.
    let tim3 = unsafe { &*TIM3::ptr() };
    let now = tim3.cnt().read().bits() as u16;
    let late = now.wrapping_sub(tim3.ccr1().read().bits() as u16);
    let bucket = Lateness::bucket(u32::from(late).div_ceil(PROBE_PER_US));
    if let Some(events) = LOAD_LATENESS.get(bucket) {
        count(events);
    }
    // SAFETY: this handler alone uses the probe's chance.
    let chance = unsafe { &mut *(&raw mut SHARED.chance) };
    // Numerical Recipes' generator (Knuth, Lewis); the upper bits are good.
    *chance = chance.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let (least, span) = PROBE_EVERY;
    let drawn = (u64::from(*chance) * u64::from(span)) >> 32;
    let ahead = (least + drawn as u32) / 7;
    let next = now.wrapping_add(ahead as u16);
    tim3.ccr1().write(|w| w.ccr().set(next.into()));
    tim3.sr().write(|w| w.cc1if().clear());
}

fn count(counter: &AtomicU32) {
    // Each counter has one writer, or writers of one priority.
    counter.store(counter.load(Relaxed).wrapping_add(1), Relaxed);
}
