//! The time pulse: edges timed by TIM4, as cycles since boot.
//!
//! *Purpose.* From the pin of the pulse to [`PulseEdge`]s for the GNSS task: a rising edge to
//! [`UNKNOWN_NS`], however late the task is and however the wire rings.
//!
//! *Design.* A rising edge starts the counter of TIM4 (trigger mode, RM0090, section 18.3.14), and the edges
//! behind it, which a metre of unterminated wire makes for some 100 ns, change nothing. A capture
//! would have the last of them, and a filter would be restarted by each: with 95 ns and more it would
//! move the edge by an unknown time. The interrupt reads counter and SysTick side by side, which says
//! when the counter started ([`timebase::capture`]); an edge for which that is not clear is counted and
//! not passed on. So nothing measured once has to stay true: a debugger that halts one of the counters
//! spoils one pulse.
//!
//! A falling edge says how long the pulse was, to which its handler's lateness matters nothing: it
//! is stamped as of the interrupt.
//!
//! The interrupt disables itself at each edge, and the alarm enables it again ([`enable`]): so a wire that
//! bounces, or that nothing drives, costs one interrupt a millisecond and no more. A pull-down
//! keeps it quiet.
//!
//! | queue | filled by | drained by | when full |
//! |---|---|---|---|
//! | edges, 8 | the handler, ≤ 2 at each alarm, commonly 2 a second | the GNSS task, at once | the edge is lost and counted |
//!
//! *Limits.* The handler has to run within 780 µs of an edge, when the counter ends its one round and
//! stands at 0. What can delay it is the longest masked section, and what stands above it in
//! [`priorities`](crate::priorities): some µs together. Of edges closer together than the alarms only
//! the first of each direction is used. The wire carries 3.3 V.

use core::hint::black_box;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use cortex_m::peripheral::NVIC;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use stm32f4xx_hal::gpio::{PD13, Pull};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::tim3::RegisterBlock;
use stm32f4xx_hal::pac::{Interrupt, TIM4};
use stm32f4xx_hal::rcc::{Enable as _, Rcc, Reset as _};
use timebase::capture::{RATIO, Start, UNKNOWN_NS};
use timebase::{Cycles, Polarity, PulseEdge};

use super::time;

/// TIM4 on PD13 (DS9484, alternate functions).
const AF: u8 = 2;

/// RM0090, section 18.4.
mod bits {
    /// SR is cleared by writing 0, unmoved by 1.
    pub(super) const SR_CC1IF: u32 = 1 << 1;
    pub(super) const SR_CC2IF: u32 = 1 << 2;
    pub(super) const SR_TIF: u32 = 1 << 6;
    pub(super) const SR_CC1OF: u32 = 1 << 9;
    pub(super) const SR_CC2OF: u32 = 1 << 10;
    /// TS: the filtered input of channel 2, whose edges the trigger takes. SMS 0: they do nothing.
    pub(super) const SMCR_DISARMED: u32 = 0b110 << 4;
    /// SMS: the trigger starts the counter.
    pub(super) const SMCR_ARMED: u32 = SMCR_DISARMED | 0b110;
}

/// How often the counters are read in turn for an edge, five readings each time.
const READINGS: usize = 4;

/// From [`PulseEdge::at`] of a rise to the edge at most: what the readings and the pin's synchroniser
/// leave open. \[ns\]
pub const AT_MOST_OFF_NS: u32 = UNKNOWN_NS;

/// What came over the wire of the pulse. Each field wraps.
#[derive(Clone, Copy, Debug, Default)]
pub struct EdgeCounters {
    /// Edges that the GNSS task was given.
    pub queued: u32,
    /// Times that at least one more followed before the next alarm: bounces, noise.
    pub followed: u32,
    /// Rises that were not passed on, because the readings did not say when they came.
    pub unclear: u32,
    /// Edges that found the queue full.
    pub queue_full: u32,
}

/// The task's end, of which there is one.
pub struct Pulse(());

static EDGES: Channel<CriticalSectionRawMutex, PulseEdge, 8> = Channel::new();
/// The last rise that was passed on, the low word of its cycles: for a probe.
static LAST_RISE: AtomicU32 = AtomicU32::new(0);
/// An edge was captured, and the alarm has not come since.
static IS_DISABLED: AtomicBool = AtomicBool::new(false);
static QUEUED: AtomicU32 = AtomicU32::new(0);
static FOLLOWED: AtomicU32 = AtomicU32::new(0);
static UNCLEAR: AtomicU32 = AtomicU32::new(0);
static QUEUE_FULL: AtomicU32 = AtomicU32::new(0);

/// Starts the timing of `pin`'s edges, rising and falling. The time runs already, and the interrupt has
/// its priority.
pub fn start(tim4: TIM4, pin: PD13, rcc: &mut Rcc) -> Pulse {
    pin.into_alternate::<AF>().internal_resistor(Pull::Down);
    TIM4::enable(rcc);
    TIM4::reset(rcc);
    // SAFETY: 01 connects channel 2 to its own pin, 10 channel 1 to the same; no filter, no
    // prescaler.
    tim4.ccmr1_input()
        .write(|w| unsafe { w.cc2s().bits(0b01).cc1s().bits(0b10) });
    tim4.arr().write(|w| w.arr().set(u16::MAX));
    // Channel 1 captures the falling edges.
    tim4.ccer()
        .write(|w| w.cc2e().set_bit().cc1e().set_bit().cc1p().set_bit());
    arm(registers());
    // SAFETY: the handler uses nothing but this timer and the statics above.
    unsafe { NVIC::unmask(Interrupt::TIM4) };
    Pulse(())
}

/// Enables the interrupt of the next edge; the alarm calls it. Edges that came since the last one are
/// ignored: they may be bounces, and when they came is not known.
#[inline]
pub fn enable() {
    const CAPTURED: u32 = bits::SR_CC1IF | bits::SR_CC2IF | bits::SR_CC1OF | bits::SR_CC2OF;
    if !IS_DISABLED.load(Relaxed) {
        return;
    }
    IS_DISABLED.store(false, Relaxed);
    let tim4 = registers();
    if tim4.sr().read().bits() & CAPTURED != 0 {
        count(&FOLLOWED);
    }
    arm(tim4);
}

/// Makes the counter stand at 0 until a rise starts it. One that comes meanwhile starts nothing and
/// is not passed on.
fn arm(tim4: &RegisterBlock) {
    // SAFETY: TS is the same as in every other write.
    tim4.smcr()
        .write(|w| unsafe { w.bits(bits::SMCR_DISARMED) });
    // One round, and the counter stands again.
    tim4.cr1().write(|w| w.opm().enabled());
    tim4.cnt().reset();
    tim4.sr().reset();
    // SAFETY: as above; the trigger starts the counter.
    tim4.smcr().write(|w| unsafe { w.bits(bits::SMCR_ARMED) });
    tim4.dier().write(|w| w.cc1ie().enabled().tie().enabled());
}

impl Pulse {
    /// Waits until there is an edge.
    pub async fn wait(&mut self) {
        EDGES.ready_to_receive().await;
    }

    /// The oldest edge that was not taken yet.
    pub fn take(&mut self) -> Option<PulseEdge> {
        EDGES.try_receive().ok()
    }

    /// What has come over the wire so far.
    pub fn counters(&self) -> EdgeCounters {
        EdgeCounters {
            queued: QUEUED.load(Relaxed),
            followed: FOLLOWED.load(Relaxed),
            unclear: UNCLEAR.load(Relaxed),
            queue_full: QUEUE_FULL.load(Relaxed),
        }
    }
}

/// An edge came.
#[interrupt]
fn TIM4() {
    let tim4 = registers();
    // First, so that the request is gone when the handler returns.
    tim4.dier().reset();
    IS_DISABLED.store(true, Relaxed);
    let seen = tim4.sr().read().bits();
    // What comes from now on is a follower. Over-captures are, too: they stay.
    // SAFETY: clears these and leaves the others.
    tim4.sr()
        .write(|w| unsafe { w.bits(!(seen & (bits::SR_CC1IF | bits::SR_CC2IF))) });
    let now = time::now();
    let rise = (seen & bits::SR_TIF != 0).then(|| started_at(tim4));
    let has_fallen = seen & bits::SR_CC1IF != 0;
    match rise {
        None if has_fallen => push_edge(now, Polarity::Fall),
        None => {}
        Some(None) => count(&UNCLEAR),
        Some(Some(rise)) => {
            // A fall before the start was captured at 0.
            let fell_after = RATIO.cast_unsigned() * u32::from(tim4.ccr1().read().ccr().bits());
            if has_fallen && fell_after == 0 {
                push_edge(rise, Polarity::Fall);
            }
            // SAFETY: this handler alone writes it. Volatile, else nobody seems to read it.
            unsafe { LAST_RISE.as_ptr().write_volatile(rise.stamp().0) };
            push_edge(rise, Polarity::Rise);
            if has_fallen && fell_after != 0 {
                push_edge(rise.plus(fell_after.into()), Polarity::Fall);
            }
        }
    }
}

/// When the edge came that started the counter; `None` if that is not clear.
#[inline(never)]
fn started_at(tim4: &RegisterBlock) -> Option<Cycles> {
    let reference = time::Reference::new();
    let mut start = Start::UNKNOWN;
    // Not unrolled: once a second, room matters more.
    for _ in 0..black_box(READINGS) {
        let ([first, second, third], [one, other]) =
            time::in_turn(|| tim4.cnt().read().cnt().bits());
        let (one, other) = (reference.until(one), reference.until(other));
        start.count_then_time(first, one);
        start.time_then_count(one, second);
        start.count_then_time(second, other);
        start.time_then_count(other, third);
    }
    start.edge(reference.at)
}

/// Gives an edge to the GNSS task.
#[inline(never)]
fn push_edge(at: Cycles, polarity: Polarity) {
    match EDGES.try_send(PulseEdge { at, polarity }) {
        Ok(()) => count(&QUEUED),
        Err(_) => count(&QUEUE_FULL),
    }
}

fn registers() -> &'static RegisterBlock {
    // SAFETY: the timer is this module's, and this is called after `start` only.
    unsafe { &*TIM4::ptr() }
}

fn count(counter: &AtomicU32) {
    // The handler and the alarm have one priority: neither preempts the other.
    counter.store(counter.load(Relaxed).wrapping_add(1), Relaxed);
}
