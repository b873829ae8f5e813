//! A serial line: bytes stamped as they arrive, bytes that wait to leave.
//!
//! *Purpose.* Between a UART's interrupt and a task stand two rings; this module has both, and the
//! interrupt's handler.
//!
//! *Design.* The handler stamps a byte, stores it and wakes no task. The alarm looks into the rings
//! once a millisecond ([`Line::wake_reader`]), and wakes the task when the line pauses or many bytes
//! wait. The stamps make that delay harmless. Each end of a ring has one owner: the handler owns
//! its ends in [`Line`]; [`Line::open`] gives the other ends to a task, once.
//!
//! | ring | filled by | drained by | when full |
//! |---|---|---|---|
//! | incoming, 256 | the handler, ≤ 11.5 bytes a ms at 115200 | the task, within 12 ms | the byte is lost and counted |
//! | outgoing | the task, whole frames | the handler, as the line takes them | the frame is refused and counted |
//!
//! The incoming ring is emptied as a whole, in place ([`ring`](super::ring)).
//!
//! *Limits.* The F4's UARTs have no FIFO: interrupts masked for longer than a byte (87 µs at 115200)
//! lose one, counted as an overrun. Bytes with a framing error are dropped; a noisy byte is kept,
//! since checksums judge it.

use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering::Relaxed};
use core::task::{Context, Poll};

use cortex_m::peripheral::NVIC;
use embassy_sync::waitqueue::AtomicWaker;
use stm32f4xx_hal::pac::Interrupt;
use stm32f4xx_hal::pac::usart1::RegisterBlock;
use timebase::{CORE_HZ, Stamp, StampedByte};

use super::ring::Ring;
use super::time;
use crate::settings::VARIANT;

/// SR and CR1 of RM0090, sections 30.6.1 and 30.6.4.
mod bits {
    pub(super) const SR_FE: u16 = 1 << 1;
    pub(super) const SR_NF: u16 = 1 << 2;
    pub(super) const SR_ORE: u16 = 1 << 3;
    pub(super) const SR_ERRORS: u16 = SR_FE | SR_NF | SR_ORE;
    pub(super) const SR_RXNE: u16 = 1 << 5;
    pub(super) const SR_TC: u16 = 1 << 6;
    pub(super) const SR_TXE: u16 = 1 << 7;
    pub(super) const CR1_RE: u16 = 1 << 2;
    pub(super) const CR1_RXNEIE: u16 = 1 << 5;
    pub(super) const CR1_TXEIE: u16 = 1 << 7;
}

/// The room of the incoming ring: 22 ms at 115200, for a task that is late.
pub const INCOMING: usize = 256;

/// With this many bytes in the ring the task is woken although the line does not pause: 11 ms at
/// 115200.
const WORTH_WAKING: usize = 128;

/// From look to look of PX4 1.9, in cycles: 1 ms.
const LOOK_EVERY: u32 = CORE_HZ / 1_000;

/// The incoming ring of a line. It is beside the line and not in it because it is all zeros at first,
/// and so takes no flash.
pub type Incoming = Ring<[StampedByte; INCOMING]>;

/// What went wrong on a line, by kind.
#[derive(Clone, Copy, Debug, Default)]
pub struct LineErrors {
    /// Bytes that came before the last one was read: at least one was lost each time.
    pub overrun: u32,
    /// Bytes without a stop bit: a wrong rate, a break, a bad wire. Dropped.
    pub framing: u32,
    /// Bytes whose samples disagreed. Kept.
    pub noise: u32,
    /// Bytes that found the incoming ring full. Lost.
    pub incoming_full: u32,
    /// Frames that found too little room in the outgoing ring. Not sent.
    pub outgoing_full: u32,
}

/// One UART with its two rings.
pub struct Line {
    registers: *const RegisterBlock,
    interrupt: Interrupt,
    incoming: &'static Incoming,
    outgoing: &'static Ring<[u8]>,
    is_open: AtomicBool,
    reader: AtomicWaker,
    /// How many bytes waited at the last call of [`Self::wake_reader`].
    waiting: AtomicUsize,
    /// When the last look for bytes in PX4's manner was.
    looked: AtomicU32,
    counters: [AtomicU32; 5],
}

#[derive(Clone, Copy)]
enum Kind {
    Overrun,
    Framing,
    Noise,
    IncomingFull,
    OutgoingFull,
}

// SAFETY: only `on_interrupt` fills `incoming` and drains `outgoing`, and its contract keeps it to one
// interrupt; the one `Reader` drains the first, the one `Writer` fills the second. Everything else is atomic.
unsafe impl Sync for Line {}

impl Line {
    /// A line over the UART at `registers`, whose handler `interrupt` calls
    /// [`Self::on_interrupt`], with its incoming ring and the ends of its outgoing one.
    ///
    /// # Safety
    ///
    /// No other line has `incoming` or `outgoing`. `registers` is a U(S)ART of the chip that no other code writes
    /// to once the line is open. (UART4's registers are those of a USART without the synchronous and
    /// flow-control bits, which stay 0 here.)
    pub const unsafe fn new(
        registers: *const RegisterBlock,
        interrupt: Interrupt,
        incoming: &'static Incoming,
        outgoing: &'static Ring<[u8]>,
    ) -> Self {
        Self {
            registers,
            interrupt,
            incoming,
            outgoing,
            is_open: AtomicBool::new(false),
            reader: AtomicWaker::new(),
            waiting: AtomicUsize::new(0),
            // Half a ms after the alarm's own look.
            looked: AtomicU32::new(LOOK_EVERY / 2),
            counters: [const { AtomicU32::new(0) }; 5],
        }
    }

    /// The task's ends of the rings, once, with the UART's interrupt sources on.
    /// `clock_hz` is what the UART's baud generator divides.
    pub fn open(&'static self, clock_hz: u32) -> Option<(Reader, Writer)> {
        if self.is_open.swap(true, Relaxed) {
            return None;
        }
        self.change_cr1(|cr1| cr1 | bits::CR1_RXNEIE);
        Some((
            Reader { line: self },
            Writer {
                line: self,
                clock_hz,
            },
        ))
    }

    /// The UART's interrupt handler.
    ///
    /// # Safety
    ///
    /// To be called from that one handler only.
    #[inline(always)]
    pub unsafe fn on_interrupt(&self) {
        let registers = self.registers();
        let status = registers.sr().read().bits();
        if status & (bits::SR_RXNE | bits::SR_ORE) == 0 {
            return self.send();
        }
        // A byte to send can wait: its request stands, and brings us back at once.
        let stamp = time::stamp();
        let byte = registers.dr().read().bits() as u8;
        if status & bits::SR_ERRORS == 0 || self.is_usable(status) {
            // SAFETY: this handler alone fills the ring.
            if !unsafe { self.incoming().push(StampedByte { stamp, byte }) } {
                self.count(Kind::IncomingFull);
            }
            if VARIANT.is_papers() {
                self.look_as_px4(stamp);
            }
        }
    }

    /// Gives the UART bytes as long as it takes them, and disables its interrupt when there are
    /// none left.
    #[inline(always)]
    fn send(&self) {
        let registers = self.registers();
        while registers.sr().read().bits() & bits::SR_TXE != 0 {
            // SAFETY: this handler alone drains the ring.
            let Some(byte) = (unsafe { self.outgoing.pop() }) else {
                return self.change_cr1(|cr1| cr1 & !bits::CR1_TXEIE);
            };
            // SAFETY: every value is a byte to send.
            registers.dr().write(|w| unsafe { w.bits(u16::from(byte)) });
        }
    }

    /// Counts the errors in the status register; whether the byte can be used.
    #[cold]
    #[inline(never)]
    fn is_usable(&self, status: u16) -> bool {
        for (bit, kind) in [
            (bits::SR_ORE, Kind::Overrun),
            (bits::SR_FE, Kind::Framing),
            (bits::SR_NF, Kind::Noise),
        ] {
            if status & bit != 0 {
                self.count(kind);
            }
        }
        status & bits::SR_FE == 0 && status & bits::SR_RXNE != 0
    }

    /// Wakes the reading task when it is worth it: when [`WORTH_WAKING`] bytes wait, or when some do
    /// and no more have come since the last call. To be called once a millisecond. In the paper's
    /// variants it wakes the task when any bytes wait, see [`Self::look_as_px4`].
    #[inline]
    pub fn wake_reader(&self) {
        let waiting = self.incoming().len();
        if waiting == 0 {
            return;
        }
        let has_paused = self.waiting.load(Relaxed) == waiting;
        self.waiting.store(waiting, Relaxed);
        if VARIANT.is_papers() || has_paused || waiting >= WORTH_WAKING {
            self.reader.wake();
        }
    }

    /// PX4 1.9 looks into its DMA's buffer once a millisecond, by a timer other than the tick's,
    /// and wakes the task that polls (`boards/px4/fmu-v2/src/init.c`, `stm32_serial_dma_poll`). Here
    /// the alarm does it, and between the ticks the first byte after each full period.
    fn look_as_px4(&self, stamp: Stamp) {
        let since = stamp.0.wrapping_sub(self.looked.load(Relaxed));
        if since >= LOOK_EVERY {
            let looked = stamp.0.wrapping_sub(since % LOOK_EVERY);
            self.looked.store(looked, Relaxed);
            self.reader.wake();
        }
    }

    /// What went wrong so far.
    pub fn errors(&self) -> LineErrors {
        let count = |kind: Kind| self.counters[kind as usize].load(Relaxed);
        LineErrors {
            overrun: count(Kind::Overrun),
            framing: count(Kind::Framing),
            noise: count(Kind::Noise),
            incoming_full: count(Kind::IncomingFull),
            outgoing_full: count(Kind::OutgoingFull),
        }
    }

    fn count(&self, kind: Kind) {
        // Each kind has one writer, so that no exclusive access is needed.
        let counter = &self.counters[kind as usize];
        counter.store(counter.load(Relaxed).wrapping_add(1), Relaxed);
    }

    #[inline(always)]
    const fn incoming(&self) -> &Ring<[StampedByte]> {
        self.incoming
    }

    #[inline(always)]
    fn registers(&self) -> &RegisterBlock {
        // SAFETY: `new`'s contract.
        unsafe { &*self.registers }
    }

    /// Changes CR1, which both the handler and a task do.
    fn change_cr1(&self, change: impl FnOnce(u16) -> u16) {
        critical_section::with(|_| {
            self.registers()
                .cr1()
                // SAFETY: only the bits above are changed.
                .modify(|r, w| unsafe { w.bits(change(r.bits())) });
        });
    }
}

/// The task's end of the incoming ring.
pub struct Reader {
    line: &'static Line,
}

impl Reader {
    /// Waits until bytes are there: see [`Line::wake_reader`].
    pub async fn wait(&mut self) {
        poll_fn(|context| self.poll_wait(context)).await;
    }

    /// The same, for a task that waits for more than one line.
    pub fn poll_wait(&mut self, context: &Context<'_>) -> Poll<()> {
        self.line.reader.register(context.waker());
        if self.line.incoming().len() == 0 {
            Poll::Pending
        } else {
            Poll::Ready(())
        }
    }

    /// How many bytes are there now.
    pub fn waiting(&self) -> usize {
        self.line.incoming().len()
    }

    /// Passes the bytes that are there now to `take`, in two pieces, and empties the ring.
    #[inline(always)]
    pub fn take(&mut self, take: impl FnMut(&[StampedByte])) {
        // SAFETY: there is one `Reader` of a line, and `take` cannot have it.
        unsafe { self.line.incoming().drain(take) };
    }

    /// What went wrong on the line so far.
    pub fn errors(&self) -> LineErrors {
        self.line.errors()
    }
}

/// The task's end of the outgoing ring.
pub struct Writer {
    line: &'static Line,
    clock_hz: u32,
}

impl Writer {
    /// Bytes that have not left the ring yet.
    pub fn waiting(&self) -> usize {
        self.line.outgoing.len()
    }

    /// Puts a whole frame into the ring, or none of it; whether there was room.
    pub fn send(&mut self, frame: &[u8]) -> bool {
        self.send_leaving(frame, 0)
    }

    /// The same, but `kept` bytes of the ring stay free for what must have room.
    #[inline(never)]
    pub fn send_leaving(&mut self, frame: &[u8], kept: usize) -> bool {
        let outgoing = self.line.outgoing;
        let room = outgoing.capacity() - outgoing.len();
        // SAFETY: there is one `Writer` of a line.
        if room < frame.len() + kept || !unsafe { outgoing.push_all(frame) } {
            self.line.count(Kind::OutgoingFull);
            return false;
        }
        self.line.change_cr1(|cr1| cr1 | bits::CR1_TXEIE);
        // A real UART raises its interrupt now, and QEMU's does from release 8 on. For older ones it
        // is raised here.
        NVIC::pend(self.line.interrupt);
        true
    }

    /// Whether everything has left the wire.
    pub fn is_idle(&self) -> bool {
        self.waiting() == 0 && self.line.registers().sr().read().bits() & bits::SR_TC != 0
    }

    /// Changes the rate of both directions; wait for [`Self::is_idle`] before. A byte that was on its way
    /// in is lost.
    pub fn set_baud(&mut self, baud: u32) {
        let divider = (self.clock_hz + baud / 2) / baud;
        let registers = self.line.registers();
        // A byte that is half in would be read at both rates.
        self.line.change_cr1(|cr1| cr1 & !bits::CR1_RE);
        // SAFETY: with 16-fold oversampling BRR is the divider in sixteenths
        // (RM0090, section 30.3.4); our rates give 182 to 4 375 at 42 MHz.
        registers.brr().write(|w| unsafe { w.bits(divider as u16) });
        self.line.change_cr1(|cr1| cr1 | bits::CR1_RE);
    }
}
