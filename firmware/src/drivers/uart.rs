//! A serial line: bytes stamped as they arrive, bytes that wait to leave.
//!
//! *Purpose.* Between a UART's interrupt and a task stand two rings; this module
//! has both, and the interrupt's handler.
//!
//! *Design.* The handler stamps a byte, stores it and wakes nobody: the alarm looks into the rings
//! once a millisecond ([`Line::wake_reader`]), and wakes the task when the line pauses or much has
//! come. The stamps make that delay harmless. Each end of a ring has one owner: the handler owns
//! the ends in [`Line`]; [`Line::open`] hands the other ends to a task, once.
//!
//! | ring | filled by | drained by | when full |
//! |---|---|---|---|
//! | incoming | the handler, ≤ 11.5 bytes a ms at 115200 | the task, within 12 ms | the byte is lost and counted |
//! | outgoing | the task, whole frames | the handler, as the line takes them | the frame is refused and counted |
//!
//! The incoming ring is emptied as a whole, under a critical section of some hundred
//! instructions: byte by byte, a lock-free queue costs the task more for each than
//! finding frames in them.
//!
//! *Limits.* The F4's UARTs have no FIFO: interrupts masked for longer than a byte
//! (87 µs at 115200) cost one, counted as an overrun. Bytes with a framing error
//! are dropped; a noisy byte is kept, since checksums judge it.

use core::cell::{Cell, UnsafeCell};
use core::future::poll_fn;
use core::sync::atomic::{AtomicU32, AtomicUsize, Ordering::Relaxed};
use core::task::Poll;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embassy_sync::waitqueue::AtomicWaker;
use heapless::Deque;
use heapless::spsc::{Consumer, Producer};
use stm32f4xx_hal::pac::Interrupt;
use stm32f4xx_hal::pac::usart1::RegisterBlock;
use timebase::{CORE_HZ, Stamp, StampedByte};

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
    pub(super) const CR1_RXNEIE: u16 = 1 << 5;
    pub(super) const CR1_TXEIE: u16 = 1 << 7;
}

/// The incoming ring: 22 ms at 115200, for a task that is held up.
pub const INCOMING: usize = 256;

/// So many bytes wake a task though the line is still talking: 11 ms at 115200.
const WORTH_WAKING: usize = 128;

/// From look to look of PX4 1.9, in cycles: 1 ms.
const LOOK_EVERY: u32 = CORE_HZ / 1_000;

/// The incoming ring of a line, beside it rather than in it: all zeros at first, it
/// takes no flash.
pub struct Incoming(UnsafeCell<Deque<StampedByte, INCOMING>>);

// SAFETY: only its `Line` reaches into it, as told there.
unsafe impl Sync for Incoming {}

impl Incoming {
    /// An empty one.
    pub const fn new() -> Self {
        Self(UnsafeCell::new(Deque::new()))
    }
}

/// What went wrong on a line, by kind.
#[derive(Clone, Copy, Debug, Default)]
pub struct LineErrors {
    /// Bytes that came before the last one was taken: at least one was lost each time.
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
    outgoing: UnsafeCell<Consumer<'static, u8>>,
    end: Mutex<Cell<Option<Producer<'static, u8>>>>,
    reader: AtomicWaker,
    /// How many bytes waited at the last call of [`Self::wake_reader`].
    waiting: AtomicUsize,
    /// When it was last looked for bytes as PX4 does it.
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

// SAFETY: `outgoing` is touched by `on_interrupt` alone, which its contract keeps to
// one interrupt; `incoming` by it, and under critical sections that it cannot
// preempt; everything else is atomic or behind a mutex.
unsafe impl Sync for Line {}

impl Line {
    /// A line over the UART at `registers`, whose handler `interrupt` calls
    /// [`Self::on_interrupt`], with its incoming ring and the ends of its outgoing one.
    ///
    /// # Safety
    ///
    /// No other line has `incoming`. `registers` is a U(S)ART of the chip that nobody
    /// else writes to once the line is open. (UART4's registers are those of a USART without the
    /// synchronous and flow-control bits, which stay 0 here.)
    pub const unsafe fn new(
        registers: *const RegisterBlock,
        interrupt: Interrupt,
        incoming: &'static Incoming,
        outgoing: (Producer<'static, u8>, Consumer<'static, u8>),
    ) -> Self {
        Self {
            registers,
            interrupt,
            incoming,
            outgoing: UnsafeCell::new(outgoing.1),
            end: Mutex::new(Cell::new(Some(outgoing.0))),
            reader: AtomicWaker::new(),
            waiting: AtomicUsize::new(0),
            // Between two ticks of a ms.
            looked: AtomicU32::new(LOOK_EVERY / 2),
            counters: [const { AtomicU32::new(0) }; 5],
        }
    }

    /// The task's ends of the rings, once, with the UART's interrupt sources on.
    /// `clock_hz` is what the UART's baud generator divides.
    pub fn open(&'static self, clock_hz: u32) -> Option<(Reader, Writer)> {
        let outgoing = critical_section::with(|token| self.end.borrow(token).take())?;
        self.change_cr1(|cr1| cr1 | bits::CR1_RXNEIE);
        Some((
            Reader { line: self },
            Writer {
                line: self,
                outgoing,
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
            // SAFETY: who else uses the ring masks this handler meanwhile.
            let incoming = unsafe { &mut *self.incoming.0.get() };
            if incoming.push_back(StampedByte { stamp, byte }).is_err() {
                self.count(Kind::IncomingFull);
            }
            if VARIANT.is_papers() {
                self.look_as_px4(stamp);
            }
        }
    }

    /// Gives the UART bytes as long as it takes them, or stops asking when there
    /// are none left.
    #[inline(always)]
    fn send(&self) {
        let registers = self.registers();
        while registers.sr().read().bits() & bits::SR_TXE != 0 {
            // SAFETY: this handler is the ring's one consumer.
            let outgoing = unsafe { &mut *self.outgoing.get() };
            let Some(byte) = outgoing.dequeue() else {
                return self.change_cr1(|cr1| cr1 & !bits::CR1_TXEIE);
            };
            // SAFETY: every value is a byte to send.
            registers.dr().write(|w| unsafe { w.bits(u16::from(byte)) });
        }
    }

    /// Counts what the status register complains of; whether the byte is good for
    /// anything.
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

    /// Wakes the reading task when it is worth it: when [`WORTH_WAKING`] bytes wait,
    /// or when some do and no more have come since the last call. To be called once
    /// a millisecond. In the paper's variants when any do, see [`Self::look_as_px4`].
    #[inline]
    pub fn wake_reader(&self) {
        let waiting = self.with_incoming(|incoming| incoming.len());
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
    /// and wakes who polls (`boards/px4/fmu-v2/src/init.c`, `stm32_serial_dma_poll`). Here the
    /// alarm does it, and between the ticks the first byte after each full period.
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
    fn with_incoming<R>(&self, act: impl FnOnce(&mut Deque<StampedByte, INCOMING>) -> R) -> R {
        critical_section::with(|_| {
            // SAFETY: the handler and all others who could come here are masked.
            act(unsafe { &mut *self.incoming.0.get() })
        })
    }

    fn registers(&self) -> &RegisterBlock {
        // SAFETY: `new`'s contract.
        unsafe { &*self.registers }
    }

    /// Changes CR1, which the handler and a task both do.
    fn change_cr1(&self, change: impl FnOnce(u16) -> u16) {
        critical_section::with(|_| {
            self.registers()
                .cr1()
                // SAFETY: only the interrupt-enable bits above are changed.
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
        poll_fn(|context| {
            self.line.reader.register(context.waker());
            if self.line.with_incoming(|incoming| incoming.is_empty()) {
                Poll::Pending
            } else {
                Poll::Ready(())
            }
        })
        .await;
    }

    /// How many bytes are there now.
    pub fn waiting(&self) -> usize {
        self.line.with_incoming(|incoming| incoming.len())
    }

    /// Hands over the bytes that are there now, in two runs at most, with
    /// interrupts masked: `take` copies them and does no more.
    #[inline(always)]
    pub fn take(&mut self, mut take: impl FnMut(&[StampedByte])) {
        self.line.with_incoming(|incoming| {
            let (older, newer) = incoming.as_slices();
            take(older);
            take(newer);
            incoming.clear();
        });
    }

    /// What went wrong on the line so far.
    pub fn errors(&self) -> LineErrors {
        self.line.errors()
    }
}

/// The task's end of the outgoing ring.
pub struct Writer {
    line: &'static Line,
    outgoing: Producer<'static, u8>,
    clock_hz: u32,
}

impl Writer {
    /// Bytes that have not left the ring yet.
    pub fn waiting(&self) -> usize {
        self.outgoing.len()
    }

    /// Puts a whole frame into the ring, or none of it; whether there was room.
    #[inline(never)]
    pub fn send(&mut self, frame: &[u8]) -> bool {
        let room = self.outgoing.capacity() - self.outgoing.len();
        if room < frame.len() {
            self.line.count(Kind::OutgoingFull);
            return false;
        }
        for &byte in frame {
            // Room was found above, and only we fill it.
            let _ = self.outgoing.enqueue(byte);
        }
        self.line.change_cr1(|cr1| cr1 | bits::CR1_TXEIE);
        // A UART raises its interrupt now. QEMU's does so from release 8 on; before
        // that somebody else has to.
        NVIC::pend(self.line.interrupt);
        true
    }

    /// Whether everything has left the wire.
    pub fn is_idle(&self) -> bool {
        self.outgoing.is_empty() && self.line.registers().sr().read().bits() & bits::SR_TC != 0
    }

    /// Changes the rate of both directions; wait for [`Self::is_idle`] before.
    pub fn set_baud(&mut self, baud: u32) {
        let divider = (self.clock_hz + baud / 2) / baud;
        // SAFETY: with 16-fold oversampling BRR is the divider in sixteenths
        // (RM0090, section 30.3.4); our rates give 182 to 4 375 at 42 MHz.
        self.line
            .registers()
            .brr()
            .write(|w| unsafe { w.bits(divider as u16) });
    }
}
