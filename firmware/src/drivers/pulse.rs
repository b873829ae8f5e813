//! The time pulse: edges captured by TIM4, as cycles since boot.
//!
//! *Purpose.* From the pin of the pulse to [`PulseMark`]s for the GNSS task, each exact to a count of
//! the timer, 11.9 ns, however late the task is.
//!
//! *Design.* Channel 2 of TIM4 captures rising edges in hardware, at the timer clock of 84 MHz and
//! without a filter: the shortest filter delays the capture by 95 ns and keeps out nothing that the
//! clock would not refuse. The interrupt only finds the round of the 16-bit counter
//! ([`timebase::capture`]) and wakes the task at once. It disables itself at each edge, and the alarm
//! enables it again ([`enable`]): so a wire that bounces, or that nothing drives, costs one interrupt
//! a millisecond and no more. A pull-down keeps it quiet.
//!
//! | queue | filled by | drained by | when full |
//! |---|---|---|---|
//! | edges, 4 | the handler, ≤ 1 at each alarm, commonly 1 a second | the GNSS task, at once | the edge is lost and counted |
//!
//! *Limits.* The handler has to run within 774 µs of an edge. What can delay it is the longest masked
//! section, some hundred instructions by rule, and what stands above it in
//! [`priorities`](crate::priorities): some µs together. Of edges closer together than the alarms only
//! the first is used. The wire carries 3.3 V.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use cortex_m::peripheral::NVIC;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use stm32f4xx_hal::gpio::{PD13, Pull};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::tim3::RegisterBlock;
use stm32f4xx_hal::pac::{Interrupt, TIM4};
use stm32f4xx_hal::rcc::{Enable as _, Rcc, Reset as _};
use timebase::capture::Phase;
use timebase::{Cycles, Polarity, PulseEdge};

use super::time;

/// TIM4 on PD13 (DS9484, alternate functions).
const AF: u8 = 2;

/// SR of RM0090, section 18.4.5: cleared by writing 0, unmoved by 1.
mod bits {
    pub(super) const SR_CC1IF: u32 = 1 << 1;
    pub(super) const SR_CC2IF: u32 = 1 << 2;
    pub(super) const SR_CC1OF: u32 = 1 << 9;
    pub(super) const SR_CC2OF: u32 = 1 << 10;
}

/// What came over the wire of the pulse. Each field wraps.
#[derive(Clone, Copy, Debug, Default)]
pub struct EdgeCounters {
    /// Edges that the GNSS task was given.
    pub queued: u32,
    /// Times that at least one more followed before the next alarm: bounces, noise.
    pub followed: u32,
    /// Edges that found the queue full.
    pub queue_full: u32,
}

/// The task's end, of which there is one.
pub struct Pulse(());

static EDGES: Channel<CriticalSectionRawMutex, PulseEdge, 8> = Channel::new();
static PHASE: AtomicU32 = AtomicU32::new(0);
/// An edge was captured, and the alarm has not come since.
static IS_DISABLED: AtomicBool = AtomicBool::new(false);
static QUEUED: AtomicU32 = AtomicU32::new(0);
static FOLLOWED: AtomicU32 = AtomicU32::new(0);
static QUEUE_FULL: AtomicU32 = AtomicU32::new(0);

/// Starts the capture of `pin`'s edges, rising and falling. The time runs already, and the interrupt has its
/// priority.
pub fn start(tim4: TIM4, pin: PD13, rcc: &mut Rcc) -> Pulse {
    pin.into_alternate::<AF>().internal_resistor(Pull::Down);
    TIM4::enable(rcc);
    TIM4::reset(rcc);
    // As in PWM input mode, but with the slave controller off: the counter runs free.
    // SAFETY: 01 connects channel 2 to its own pin, 10 channel 1 to the same; no filter, no
    // prescaler.
    tim4.ccmr1_input()
        .write(|w| unsafe { w.cc2s().bits(0b01).cc1s().bits(0b10) });
    tim4.arr().write(|w| w.arr().set(u16::MAX));
    // Channel 1 captures the falling edges.
    tim4.ccer()
        .write(|w| w.cc2e().set_bit().cc1e().set_bit().cc1p().set_bit());
    tim4.cr1().write(|w| w.cen().enabled());
    let (before, at, after) = time::between(|| tim4.cnt().read().cnt().bits());
    PHASE.store(Phase::measured(before, at, after).to_bits(), Relaxed);
    tim4.dier().write(|w| w.cc1ie().enabled().cc2ie().enabled());
    // SAFETY: the handler uses nothing but this timer and the statics above.
    unsafe { NVIC::unmask(Interrupt::TIM4) };
    Pulse(())
}

/// Enables the interrupt of the next edge; the alarm calls it. Edges that came since the last one are
/// ignored: they may be bounces, and the round of their count cannot be found any more.
#[inline]
pub fn enable() {
    const CAPTURED: u32 = bits::SR_CC1IF | bits::SR_CC2IF | bits::SR_CC1OF | bits::SR_CC2OF;
    if !IS_DISABLED.load(Relaxed) {
        return;
    }
    IS_DISABLED.store(false, Relaxed);
    let tim4 = registers();
    if tim4.sr().read().bits() & CAPTURED != 0 {
        // SAFETY: clears these and leaves the others.
        tim4.sr().write(|w| unsafe { w.bits(!CAPTURED) });
        count(&FOLLOWED);
    }
    tim4.dier().write(|w| w.cc1ie().enabled().cc2ie().enabled());
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
            queue_full: QUEUE_FULL.load(Relaxed),
        }
    }
}

/// An edge was captured.
#[interrupt]
fn TIM4() {
    let tim4 = registers();
    // First, so that the request is gone when the handler returns.
    tim4.dier().reset();
    IS_DISABLED.store(true, Relaxed);
    let captured = tim4.sr().read().bits();
    let phase = Phase::from_bits(PHASE.load(Relaxed));
    let now = time::now();
    let rise = (captured & bits::SR_CC2IF != 0).then(|| PulseEdge {
        at: phase.edge(tim4.ccr2().read().ccr().bits(), now),
        polarity: Polarity::Rise,
    });
    let fall = (captured & bits::SR_CC1IF != 0).then(|| PulseEdge {
        at: phase.edge(tim4.ccr1().read().ccr().bits(), now),
        polarity: Polarity::Fall,
    });
    let at = |edge: Option<PulseEdge>| edge.map_or(Cycles(u64::MAX), |edge| edge.at);
    let in_order = if at(fall) < at(rise) {
        [fall, rise]
    } else {
        [rise, fall]
    };
    for edge in in_order.into_iter().flatten() {
        match EDGES.try_send(edge) {
            Ok(()) => count(&QUEUED),
            Err(_) => count(&QUEUE_FULL),
        }
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
