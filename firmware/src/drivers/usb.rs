//! MAVLink's USB: a serial port (CDC-ACM) on OTG_FS, packets stamped as they arrive.
//!
//! *Purpose.* [`Port`] is what a link reads from and writes to; [`Device`] answers the host's questions.
//!
//! *Design.* The stack is `embassy-usb` over `embassy-usb-synopsys-otg`. Its handler is called from ours, which
//! stamps before it: while it stands at the head of the receive FIFO, a packet for the data endpoint is
//! seen without being taken. The endpoint has room for one packet and answers NAK until that has been read, so
//! the stamp belongs to the packet that is read next. It is read in a section that keeps our handler
//! out.
//!
//! A packet is accepted when the cost of those before it is paid for ([`Allowance`]): what reading, serving and
//! answering took, counted three times, has to have passed since. So a host that floods the port has a third of the core, the bus holds
//! back what is too much, and nothing of it is lost.
//!
//! | queue | filled by | drained by | when full |
//! |---|---|---|---|
//! | packet, 64 bytes | the handler | the task, when its cost is paid for and an answer has room | the bus waits (NAK) |
//! | outbox, 1024 bytes | the task, whole frames | the task, a packet when the one before has left | the frame is refused and counted |
//!
//! *Limits.* A packet's stamp is that of its last bit, and the host's frames are 1 ms: what a request has
//! waited in the host stands in no stamp. The last packet before an unplug may be lost. A host that does not read for
//! [`STALLED`] loses answers, as on a serial line. Everything but the handler runs on one executor.

use core::future::{Future, poll_fn};
use core::mem::MaybeUninit;
use core::pin::pin;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use core::task::{Context, Poll};

use cortex_m::peripheral::NVIC;
use embassy_futures::select::select;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::Timer;
use embassy_usb::class::cdc_acm::{self, CdcAcmClass};
use embassy_usb::{Builder, UsbDevice};
use embassy_usb_synopsys_otg::otg_v1::Otg;
use embassy_usb_synopsys_otg::otg_v1::vals::Pktstsd;
use embassy_usb_synopsys_otg::{Config, Driver, OtgInstance, PhyType, StateStorage, on_interrupt};
use stm32f4xx_hal::gpio::{PA9, PA11, PA12};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{Interrupt, OTG_FS_GLOBAL};
use stm32f4xx_hal::rcc::{Enable as _, Rcc, Reset as _};
use timebase::{CORE_HZ, Cycles, Stamp};

use super::outbox::Outbox;
use super::time;
use super::uart::LineErrors;
use crate::{board, masks, priorities, settings};

/// pid.codes' vendor, and its first product for tests: until a product is assigned.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;

/// Bytes of a packet: the most that a bulk endpoint at full speed has.
const PACKET: usize = 64;

/// Words of the FIFOs' memory (RM0090, section 34.13), and of those the ones beside the packets that are
/// received: for three SETUPs, a packet's status, and the ends of transfers.
const FIFO_WORDS: u16 = 320;
const EXTRA_WORDS: u16 = 30;

/// Turnaround time for an AHB of 32 MHz or more (RM0090, table 200).
const TURNAROUND: u8 = 6;

/// Bytes of frames that may wait for the host.
const OUTBOX: usize = 1_024;

/// The endpoint on which the host sends: the first that the class asks for.
const DATA: u8 = 1;

/// Reads of a register that follows within some cycles of the bus.
const FLAG_READS: u32 = 10_000;

/// Looks, a ms apart, for the device's mode: it comes within 25 ms (RM0090, section 34.16.2).
const MODE_LOOKS: u32 = 100;

/// What is left of an event on the bus after this time, nobody looks after. \[ms\]
const UNATTENDED_MS: u64 = 20;

/// Bytes of the chip's unique id.
const UNIQUE_ID_LEN: usize = 12;

/// What a packet costs beside its reading and serving, in cycles: its interrupts, the wake-up when the one before is
/// paid for, and the task's look at every link. Measured, with all answers read, and rounded up for 1.6
/// cycles an instruction.
const RECEIVING: u64 = 4_500;
/// The same of a packet that is sent.
const SENDING: u64 = 3_000;

/// Work that is paid for in advance while nothing comes, with its price, in cycles: 1 ms.
const CREDIT: u64 = CORE_HZ as u64 / 1_000;

/// Work counts so many times: the port has a third of the core.
const PRICE: u64 = 3;

/// A host that reads nothing for this time, in cycles, does not keep the port from reading: 1 s.
const STALLED: u64 = CORE_HZ as u64;

/// With so much room in the outbox a packet may be read: for the answers to the five requests that end in
/// it at most, of 40 bytes each, beside what a second's broadcasts take.
const ROOM_FOR_ANSWERS: usize = 200 + 256;

type Class = CdcAcmClass<'static, Driver<'static>>;

static STATE: StateStorage<4> = StateStorage::new();

/// When the packet came that is at [`DATA`], and whether it was seen at the FIFO's head.
static PACKET_CAME: AtomicU32 = AtomicU32::new(0);
static PACKET_SEEN: AtomicBool = AtomicBool::new(false);
/// That packet is from before a reset of the bus.
static PACKET_STALE: AtomicBool = AtomicBool::new(false);
/// When anything was received last.
static RECEIVED: AtomicU32 = AtomicU32::new(0);
/// A reset of the bus, or the end of the cable's supply.
static BUS: AtomicWaker = AtomicWaker::new();

/// Whether a host has sent something since boot.
pub fn has_received() -> bool {
    RECEIVED.load(Relaxed) != 0
}

/// The pins of the connector.
pub struct Pins {
    /// D− and D+.
    pub data: (PA11, PA12),
    /// 5 V while a cable is in.
    pub vbus: PA9,
}

/// What the stack keeps for as long as the board runs.
struct Memory {
    config: [u8; 96],
    bos: [u8; 16],
    control: [u8; 64],
    out: [u8; 2 * PACKET],
    outbox: [u8; OUTBOX],
    serial: [u8; 2 * UNIQUE_ID_LEN],
    class: cdc_acm::State<'static>,
}

static mut MEMORY: MaybeUninit<Memory> = MaybeUninit::uninit();

/// The memory of the one who had the peripheral, which there is once.
fn memory(_: OTG_FS_GLOBAL) -> &'static mut Memory {
    let place = &raw mut MEMORY;
    // SAFETY: nobody else names the place, and this is called once: the peripheral is gone then.
    let place = unsafe { &mut *place };
    place.write(Memory {
        config: [0; 96],
        bos: [0; 16],
        control: [0; 64],
        out: [0; 2 * PACKET],
        serial: [0; 2 * UNIQUE_ID_LEN],
        class: cdc_acm::State::new(),
        outbox: [0; OUTBOX],
    })
}

/// OTG_FS's registers.
fn registers() -> Otg {
    // SAFETY: the address is that of OTG_FS, whose layout this is (RM0090, section 34.16).
    unsafe { Otg::from_ptr(OTG_FS_GLOBAL::ptr().cast_mut().cast()) }
}

/// The chip's unique id in hexadecimal digits, into `text`.
fn serial_number(text: &mut [u8; 2 * UNIQUE_ID_LEN]) -> &str {
    const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    let id: [u8; UNIQUE_ID_LEN] = board::unique_id();
    for (digits, byte) in text.as_chunks_mut::<2>().0.iter_mut().zip(id) {
        *digits = [byte >> 4, byte & 0xF].map(|digit| DIGITS[usize::from(digit)]);
    }
    core::str::from_utf8(text).unwrap_or_default()
}

/// Starts OTG_FS, once; it connects when [`Device::run`] does.
pub fn start(otg: OTG_FS_GLOBAL, pins: Pins, rcc: &mut Rcc) -> (Device, Port) {
    let (minus, plus) = pins.data;
    minus.into_alternate::<10>();
    plus.into_alternate::<10>();
    pins.vbus.into_floating_input();
    OTG_FS_GLOBAL::enable(rcc);
    OTG_FS_GLOBAL::reset(rcc);
    reset_core();
    let memory = memory(otg);
    let instance = OtgInstance {
        regs: registers(),
        state: STATE.as_state(),
        fifo_depth_words: FIFO_WORDS,
        phy_type: PhyType::InternalFullSpeed,
        extra_rx_fifo_words: EXTRA_WORDS,
        calculate_trdt_fn: |_| TURNAROUND,
    };
    let mut config = Config::default();
    config.vbus_detection = true;
    let driver = Driver::new(&mut memory.out, instance, config);
    let mut config = embassy_usb::Config::new(VENDOR, PRODUCT);
    config.manufacturer = Some(settings::USB_MANUFACTURER);
    config.product = Some(settings::USB_PRODUCT);
    config.serial_number = Some(serial_number(&mut memory.serial));
    config.self_powered = true;
    // The rail for the connectors may hang on the cable's 5 V.
    config.max_power = 500;
    let mut builder = Builder::new(
        driver,
        config,
        &mut memory.config,
        &mut memory.bos,
        &mut [],
        &mut memory.control,
    );
    let class = CdcAcmClass::new(&mut builder, &mut memory.class, PACKET as u16);
    // SAFETY: what the handler uses exists since compile time; it has its priority.
    unsafe { NVIC::unmask(Interrupt::OTG_FS) };
    (
        Device(builder.build()),
        Port::new(class, &mut memory.outbox),
    )
}

/// A core after a reset, as a device, with its transceiver on and VBUS sensed at PA9.
fn reset_core() {
    let registers = registers();
    let wait_for = |is_there: &dyn Fn() -> bool| {
        // A core that does not follow never becomes a device, which `Device::run` finds.
        let _ = (0..FLAG_READS).any(|_| is_there());
    };
    wait_for(&|| registers.grstctl().read().ahbidl());
    registers.grstctl().write(|w| w.set_csrst(true));
    wait_for(&|| !registers.grstctl().read().csrst());
    registers.gusbcfg().write(|w| {
        w.set_fdmod(true);
        w.set_physel(true);
    });
    registers.gccfg_v1().modify(|w| {
        w.set_pwrdwn(true);
        w.set_vbusbsen(true);
    });
}

/// The device, as the host's control transfers see it.
pub struct Device(UsbDevice<'static, Driver<'static>>);

// SAFETY: what device and port share and is no atomic, a waker for changes of the control lines, the
// device alone uses; both run on one executor.
unsafe impl Send for Device {}

impl Device {
    /// Runs for ever, or returns if the core does not become a device.
    pub async fn run(mut self) {
        let mut looks = 0;
        while registers().gintsts().read().cmod() {
            looks += 1;
            if looks > MODE_LOOKS {
                defmt::warn!("OTG_FS does not become a device: no USB");
                return;
            }
            Timer::after_millis(1).await;
        }
        loop {
            // A control transfer that the host gave up keeps the stack from what happens on the bus. It
            // begins anew then.
            select(self.0.run(), is_unattended()).await;
        }
    }
}

/// Returns when an event on the bus has been left alone.
async fn is_unattended() {
    loop {
        poll_fn(|context| {
            BUS.register(context.waker());
            if is_bus_event() {
                Poll::Ready(())
            } else {
                Poll::Pending
            }
        })
        .await;
        Timer::after_millis(UNATTENDED_MS).await;
        if is_bus_event() {
            return;
        }
    }
}

/// Whether a reset of the bus, or its end, is to be looked after.
fn is_bus_event() -> bool {
    let pending = registers().gintsts().read();
    pending.usbrst() || pending.enumdne() || pending.otgint()
}

/// When the port may read again.
struct Allowance {
    /// What was read is paid for then.
    paid: Cycles,
}

impl Allowance {
    /// Work of so many cycles is over at `now`.
    fn charge(&mut self, took: u64, now: Cycles) {
        let from = self.paid.max(Cycles(now.0.saturating_sub(CREDIT)));
        self.paid = from.plus(PRICE * took);
    }
}

/// The task's end: packets in, frames out.
pub struct Port {
    receiver: cdc_acm::Receiver<'static, Driver<'static>>,
    outgoing: Outgoing,
    allowance: Allowance,
}

/// The way out.
pub struct Outgoing {
    sender: cdc_acm::Sender<'static, Driver<'static>>,
    outbox: Outbox,
    /// The last packet was a full one, and the host waits for one that is not.
    owes_end: bool,
    /// The host has configured the device, and a program has opened the port.
    is_open: bool,
    is_configured: bool,
    refused: u32,
    left: Cycles,
}

/// A packet, with when it came.
pub struct Packet {
    bytes: [u8; PACKET],
    len: usize,
    came: Stamp,
    began: Cycles,
}

impl Packet {
    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or_default()
    }

    /// When it came.
    pub const fn came(&self) -> Stamp {
        self.came
    }
}

// SAFETY: as for `Device`.
unsafe impl Send for Port {}

impl Port {
    fn new(class: Class, outbox: &'static mut [u8]) -> Self {
        let (sender, receiver) = class.split();
        Self {
            receiver,
            outgoing: Outgoing {
                sender,
                outbox: Outbox::new(outbox),
                owes_end: false,
                is_open: false,
                is_configured: false,
                refused: 0,
                left: Cycles(0),
            },
            allowance: Allowance { paid: Cycles(0) },
        }
    }

    /// The way out.
    pub const fn outgoing(&mut self) -> &mut Outgoing {
        &mut self.outgoing
    }

    /// Sends what waits, as far as the host takes it. The task is woken when it has.
    pub fn poll_send(&mut self, context: &mut Context<'_>) {
        if self.outgoing.poll_send(context) {
            self.allowance.charge(SENDING, self.outgoing.left);
        }
    }

    /// The packet that is there, if it may be read now. The task is woken when one is there, or when it may.
    /// [`Self::served`] has to follow.
    pub fn poll_packet(&mut self, context: &mut Context<'_>) -> Option<Packet> {
        let now = time::now();
        if now < self.allowance.paid {
            let at_us = self.allowance.paid.as_micros() + 1;
            embassy_time_driver::schedule_wake(at_us, context.waker());
            return None;
        }
        let out = &mut self.outgoing;
        if out.outbox.room() < ROOM_FOR_ANSWERS && now < out.left.plus(STALLED) {
            return None;
        }
        let mut packet = Packet {
            bytes: [0; PACKET],
            len: 0,
            came: Stamp(0),
            began: now,
        };
        let read = masks::up_to(priorities::USB, || {
            let read = pin!(self.receiver.read_packet(&mut packet.bytes)).poll(context);
            packet.came = Stamp(if PACKET_SEEN.load(Relaxed) {
                PACKET_CAME.load(Relaxed)
            } else {
                RECEIVED.load(Relaxed)
            });
            if read.is_ready() {
                PACKET_SEEN.store(false, Relaxed);
            }
            read
        });
        out.is_configured = !matches!(read, Poll::Ready(Err(_)));
        match read {
            Poll::Ready(Ok(len)) => {
                // What a host has sent before a reset would be served with a stamp of then.
                packet.len = if PACKET_STALE.swap(false, Relaxed) {
                    0
                } else {
                    len
                };
                Some(packet)
            }
            Poll::Ready(Err(_)) | Poll::Pending => None,
        }
    }

    /// `packet` has been served.
    pub fn served(&mut self, packet: &Packet) {
        let now = time::now();
        let took = now.since(packet.began).max(0).cast_unsigned();
        self.allowance.charge(took + RECEIVING, now);
    }

    /// What went wrong: frames that had no room.
    pub fn errors(&self) -> LineErrors {
        LineErrors {
            outgoing_full: self.outgoing.refused,
            ..LineErrors::default()
        }
    }
}

impl Outgoing {
    /// Whether a program may read what is sent: the port is open and the bus awake.
    pub const fn is_open(&self) -> bool {
        self.is_open
    }

    /// Bytes that wait for the host.
    pub const fn waiting(&self) -> usize {
        self.outbox.len()
    }

    /// Puts a whole frame into the outbox, or none of it, and leaves `kept` bytes free; whether there was room.
    pub fn send_leaving(&mut self, frame: &[u8], kept: usize) -> bool {
        let is_taken = self.outbox.room() >= frame.len() + kept && self.outbox.push(frame);
        if !is_taken {
            self.refused = self.refused.wrapping_add(1);
        }
        is_taken
    }

    /// Whether a packet has begun to leave.
    fn poll_send(&mut self, context: &mut Context<'_>) -> bool {
        self.look();
        let chunk = self.outbox.front(PACKET);
        if chunk.is_empty() && !self.owes_end {
            return false;
        }
        let write = pin!(self.sender.write_packet(chunk)).poll(context);
        match write {
            Poll::Pending => false,
            Poll::Ready(Ok(())) => {
                let len = chunk.len();
                self.owes_end = len == PACKET;
                self.outbox.drop_front(len);
                self.left = time::now();
                true
            }
            Poll::Ready(Err(_)) => {
                self.forget();
                false
            }
        }
    }

    /// Looks whether the port is open. What was for the program before is not for the next.
    fn look(&mut self) {
        let is_open =
            self.is_configured && self.sender.dtr() && !registers().dsts().read().suspsts();
        if !self.is_configured || (self.is_open && !self.sender.dtr()) {
            self.forget();
        }
        self.is_open = is_open;
    }

    fn forget(&mut self) {
        self.outbox.clear();
        self.owes_end = false;
    }
}

#[interrupt]
fn OTG_FS() {
    let registers = registers();
    let pending = registers.gintsts().read();
    if pending.rxflvl() {
        let stamp = time::stamp();
        RECEIVED.store(stamp.0, Relaxed);
        let head = registers.grxstsr().read();
        if head.epnum() == DATA && head.pktstsd() == Pktstsd::OUT_DATA_RX {
            PACKET_CAME.store(stamp.0, Relaxed);
            PACKET_SEEN.store(true, Relaxed);
        }
    }
    if pending.usbrst() || pending.otgint() {
        PACKET_STALE.store(PACKET_SEEN.load(Relaxed), Relaxed);
        BUS.wake();
    }
    // SAFETY: this is OTG_FS's one handler, and the state is that of its driver.
    unsafe { on_interrupt(registers, &STATE.as_state()) };
}
