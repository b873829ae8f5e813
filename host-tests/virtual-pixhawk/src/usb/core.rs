//! OTG_FS as a device, register by register.
//!
//! *Purpose.* What a driver writes and reads (RM0090, section 34.16), and how the core answers a host's tokens.
//!
//! *Design.* A token is answered at once by the state of its endpoint; the interrupt line is what GINTSTS and
//! GINTMSK say. Where the manual leaves room, drivers that run on real chips decide: an OUT endpoint stays
//! enabled after its transfer and answers NAK, and one whose DOEPTSIZ is 0 takes a packet.
//!
//! *Limits.* No data toggles, no isochronous transfers, no handshake of the global NAKs, no remote wake-up. FIFOs do
//! not overlap whatever their places are.

use std::collections::VecDeque;

/// Endpoints of either direction.
const ENDPOINTS: usize = 4;

/// Bits of GINTSTS, in the order of the manual.
const OTGINT: u32 = 1 << 2;
const RXFLVL: u32 = 1 << 4;
const USBSUSP: u32 = 1 << 11;
const USBRST: u32 = 1 << 12;
const ENUMDNE: u32 = 1 << 13;
const IEPINT: u32 = 1 << 18;
const OEPINT: u32 = 1 << 19;
const SRQINT: u32 = 1 << 30;
const WKUPINT: u32 = 1 << 31;

/// Bits of DIEPCTL and DOEPCTL.
const USBAEP: u32 = 1 << 15;
const NAKSTS: u32 = 1 << 17;
const STALL: u32 = 1 << 21;
const CNAK: u32 = 1 << 26;
const SNAK: u32 = 1 << 27;
const EPDIS: u32 = 1 << 30;
const EPENA: u32 = 1 << 31;
/// What is kept as it is written: size, type, FIFO, and both above.
const KEPT: u32 = 0x7FF | USBAEP | 0b11 << 18 | STALL | 0xF << 22;

/// Bits of DIEPINT and DOEPINT.
const XFRC: u32 = 1 << 0;
const EPDISD: u32 = 1 << 1;
const STUP: u32 = 1 << 3;
const TXFE: u32 = 1 << 7;

/// PKTSTS of GRXSTSP.
const OUT_DATA: u32 = 2;
const OUT_DONE: u32 = 3;
const SETUP_DONE: u32 = 4;
const SETUP_DATA: u32 = 6;

/// How a device answers a token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// With these bytes, or having taken those of the host.
    Ack(Vec<u8>),
    /// Not now.
    Nak,
    /// Never.
    Stall,
    /// Not at all.
    Silence,
}

#[derive(Debug, Default)]
struct Endpoint {
    control: u32,
    interrupts: u32,
    size: u32,
    /// Words that wait for the host.
    fifo: VecDeque<u32>,
    fifo_place: u32,
}

impl Endpoint {
    /// Writes the control register; `is_zero` is the endpoint that is always active.
    fn write_control(&mut self, value: u32, is_zero: bool) {
        let state = self.control & (NAKSTS | EPENA);
        let mut kept = value & KEPT;
        if is_zero {
            // The stall of endpoint 0 is taken back by a SETUP alone.
            kept |= USBAEP | self.control & STALL;
        }
        self.control = kept | state;
        if value & CNAK != 0 {
            self.control &= !NAKSTS;
        }
        if value & SNAK != 0 {
            self.control |= NAKSTS;
        }
        if value & EPENA != 0 {
            self.control |= EPENA;
        }
        if value & EPDIS != 0 && self.control & EPENA != 0 {
            self.control &= !EPENA;
            self.interrupts |= EPDISD;
        }
    }

    const fn is(&self, bits: u32) -> bool {
        self.control & bits == bits
    }
}

/// An entry of the receive FIFO.
#[derive(Debug)]
struct Received {
    endpoint: usize,
    status: u32,
    bytes: Vec<u8>,
}

impl Received {
    fn register(&self) -> u32 {
        self.endpoint as u32 | (self.bytes.len() as u32) << 4 | self.status << 17
    }

    fn words(&self) -> u32 {
        1 + self.bytes.len().div_ceil(4) as u32
    }
}

/// The core.
#[derive(Debug)]
pub(super) struct Core {
    global: u32,
    usb: u32,
    reset: u32,
    pending: u32,
    mask: u32,
    otg: u32,
    receive_size: u32,
    general: u32,
    device: u32,
    device_control: u32,
    in_mask: u32,
    out_mask: u32,
    all_mask: u32,
    empty_mask: u32,
    power: u32,
    is_suspended: bool,
    has_speed: bool,
    vbus: bool,
    ins: [Endpoint; ENDPOINTS],
    outs: [Endpoint; ENDPOINTS],
    received: VecDeque<Received>,
    /// Words of the entry that was popped last.
    popped: VecDeque<u32>,
    /// An endpoint may answer another way than before.
    has_changed: bool,
}

impl Core {
    /// As it is after a reset, without a cable.
    pub(super) fn new() -> Self {
        let zero = || Endpoint {
            control: USBAEP,
            ..Endpoint::default()
        };
        Self {
            global: 0,
            usb: 0x0A00,
            reset: 0,
            pending: 0,
            mask: 0,
            otg: 0,
            receive_size: 0x80,
            general: 0,
            device: 0,
            device_control: 0,
            in_mask: 0,
            out_mask: 0,
            all_mask: 0,
            empty_mask: 0,
            power: 0,
            is_suspended: false,
            has_speed: false,
            vbus: false,
            ins: [
                zero(),
                Endpoint::default(),
                Endpoint::default(),
                Endpoint::default(),
            ],
            outs: [
                zero(),
                Endpoint::default(),
                Endpoint::default(),
                Endpoint::default(),
            ],
            received: VecDeque::new(),
            popped: VecDeque::new(),
            has_changed: false,
        }
    }

    /// The reset of the peripheral; the cable stays.
    pub(super) fn restart(&mut self) {
        let vbus = self.vbus;
        *self = Self::new();
        self.vbus = vbus;
    }

    /// Whether its interrupt line is high.
    pub(super) fn interrupts(&self) -> bool {
        self.global & 1 != 0 && self.gintsts() & self.mask != 0
    }

    /// Whether an endpoint may answer another way than at the last call.
    pub(super) fn take_change(&mut self) -> bool {
        std::mem::take(&mut self.has_changed)
    }

    /// Whether it holds D+ up: it has power, senses VBUS, and is not told to disconnect.
    pub(super) const fn is_connected(&self) -> bool {
        let sensed = self.vbus && self.general & 1 << 19 != 0 || self.general & 1 << 21 != 0;
        self.general & 1 << 16 != 0
            && sensed
            && self.device_control & 1 << 1 == 0
            && self.global & 1 != 0
    }

    /// Whether there is a cable, as far as it has been told.
    pub(super) const fn has_vbus(&self) -> bool {
        self.vbus
    }

    /// Its address on the bus.
    pub(super) const fn address(&self) -> u32 {
        self.device >> 4 & 0x7F
    }

    pub(super) fn set_vbus(&mut self, vbus: bool) {
        if vbus != self.vbus {
            self.vbus = vbus;
            if vbus {
                self.pending |= SRQINT;
            } else {
                // SEDET: the session has ended.
                self.otg |= 1 << 2;
                self.is_suspended = false;
            }
        }
    }

    pub(super) fn begin_reset(&mut self) {
        self.pending |= USBRST;
        self.is_suspended = false;
        self.device &= !(0x7F << 4);
    }

    pub(super) fn end_reset(&mut self) {
        self.pending |= ENUMDNE;
        self.has_speed = true;
    }

    pub(super) fn suspend(&mut self) {
        self.pending |= USBSUSP;
        self.is_suspended = true;
    }

    pub(super) fn resume(&mut self) {
        self.pending |= WKUPINT;
        self.is_suspended = false;
    }

    /// A SETUP, which is always taken.
    pub(super) fn setup(&mut self, bytes: [u8; 8]) {
        self.ins[0].control = self.ins[0].control & !STALL | NAKSTS;
        self.outs[0].control = self.outs[0].control & !STALL | NAKSTS;
        self.receive(0, SETUP_DATA, bytes.to_vec());
        self.receive(0, SETUP_DONE, Vec::new());
    }

    /// OUT with a packet.
    pub(super) fn output(&mut self, endpoint: usize, bytes: &[u8]) -> Answer {
        let used: u32 = self.received.iter().map(Received::words).sum();
        let needed = 2 + bytes.len().div_ceil(4) as u32;
        let has_room = used + needed <= self.receive_size;
        let out = &mut self.outs[endpoint];
        if !out.is(USBAEP) {
            return Answer::Silence;
        }
        if out.is(STALL) {
            return Answer::Stall;
        }
        if out.is(NAKSTS) || !out.is(EPENA) || !has_room {
            return Answer::Nak;
        }
        out.control |= NAKSTS;
        self.receive(endpoint, OUT_DATA, bytes.to_vec());
        self.receive(endpoint, OUT_DONE, Vec::new());
        Answer::Ack(Vec::new())
    }

    /// IN.
    pub(super) fn input(&mut self, endpoint: usize) -> Answer {
        let ep = &mut self.ins[endpoint];
        if !ep.is(USBAEP) {
            return Answer::Silence;
        }
        if ep.is(STALL) {
            return Answer::Stall;
        }
        let len = (ep.size & 0x7_FFFF).min(64) as usize;
        if ep.is(NAKSTS) || !ep.is(EPENA) || ep.fifo.len() < len.div_ceil(4) {
            return Answer::Nak;
        }
        let words = ep.fifo.drain(..len.div_ceil(4));
        let mut bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
        bytes.truncate(len);
        let packets = (ep.size >> 19 & 0x3FF).saturating_sub(1);
        ep.size = packets << 19 | ((ep.size & 0x7_FFFF) - len as u32);
        if packets == 0 {
            ep.control &= !EPENA;
            ep.interrupts |= XFRC;
        }
        Answer::Ack(bytes)
    }

    fn receive(&mut self, endpoint: usize, status: u32, bytes: Vec<u8>) {
        self.received.push_back(Received {
            endpoint,
            status,
            bytes,
        });
    }

    fn gintsts(&self) -> u32 {
        let all = self.daint() & self.all_mask;
        let levels = [
            (OTGINT, self.otg != 0),
            (RXFLVL, !self.received.is_empty()),
            (IEPINT, all & 0xFFFF != 0),
            (OEPINT, all >> 16 != 0),
        ];
        let high = levels.into_iter().filter(|(_, is_high)| *is_high);
        self.pending | high.map(|(bit, _)| bit).sum::<u32>()
    }

    fn diepint(&self, nth: usize) -> u32 {
        let empty = if self.ins[nth].fifo.is_empty() {
            TXFE
        } else {
            0
        };
        self.ins[nth].interrupts | empty
    }

    fn daint(&self) -> u32 {
        (0..ENDPOINTS).fold(0, |all, nth| {
            let empty = if self.empty_mask >> nth & 1 != 0 {
                TXFE
            } else {
                0
            };
            let has_in = self.diepint(nth) & (self.in_mask & !TXFE | empty) != 0;
            let has_out = self.outs[nth].interrupts & self.out_mask != 0;
            all | u32::from(has_in) << nth | u32::from(has_out) << (16 + nth)
        })
    }

    /// A read at `offset`; none where there is no register that is known here.
    pub(super) fn read(&mut self, offset: u64) -> Option<u32> {
        Some(match offset {
            // BSVLD.
            0x000 => u32::from(self.vbus) << 19,
            0x004 => self.otg,
            0x008 => self.global,
            0x00C => self.usb,
            // AHBIDL.
            0x010 => self.reset | 1 << 31,
            0x014 => self.gintsts(),
            0x018 => self.mask,
            0x01C => self.received.front().map_or(0, Received::register),
            0x020 => self.pop(),
            0x024 => self.receive_size,
            0x028 => self.ins[0].fifo_place,
            0x038 => self.general,
            0x03C => 0x1200,
            // GHWCFG4, which is in no manual.
            0x050 => 0,
            0x104 | 0x108 | 0x10C => self.ins[(offset - 0x100) as usize / 4].fifo_place,
            0x800 => self.device,
            0x804 => self.device_control,
            0x808 => u32::from(self.is_suspended) | if self.has_speed { 0b11 << 1 } else { 0 },
            0x810 => self.in_mask,
            0x814 => self.out_mask,
            0x818 => self.daint(),
            0x81C => self.all_mask,
            0x834 => self.empty_mask,
            0x900..0xA00 | 0xB00..0xC00 => return self.read_endpoint(offset),
            0xE00 => self.power,
            0x1000..0x2000 => self.popped.pop_front().unwrap_or(0),
            _ => return None,
        })
    }

    fn read_endpoint(&self, offset: u64) -> Option<u32> {
        let nth = (offset >> 5 & 7) as usize;
        let is_in = offset < 0xB00;
        let endpoint = if is_in {
            self.ins.get(nth)?
        } else {
            self.outs.get(nth)?
        };
        Some(match offset & 0x1F {
            0x00 => endpoint.control,
            0x08 if is_in => self.diepint(nth),
            0x08 => endpoint.interrupts,
            0x10 => endpoint.size,
            0x18 if is_in => (endpoint.fifo_place >> 16).saturating_sub(endpoint.fifo.len() as u32),
            _ => return None,
        })
    }

    fn pop(&mut self) -> u32 {
        let Some(entry) = self.received.pop_front() else {
            return 0;
        };
        let interrupt = match entry.status {
            SETUP_DONE => STUP,
            OUT_DONE => XFRC,
            _ => 0,
        };
        self.outs[entry.endpoint].interrupts |= interrupt;
        if !entry.bytes.is_empty() {
            self.popped = entry
                .bytes
                .chunks(4)
                .map(|chunk| {
                    let mut word = [0; 4];
                    word[..chunk.len()].copy_from_slice(chunk);
                    u32::from_le_bytes(word)
                })
                .collect();
        }
        entry.register()
    }

    /// A write at `offset`; whether there is a register that is known here.
    pub(super) fn write(&mut self, offset: u64, value: u32) -> bool {
        self.has_changed = true;
        match offset {
            0x000 | 0x028 | 0x104 | 0x108 | 0x10C | 0x024 => self.write_size(offset, value),
            0x004 => self.otg &= !value,
            0x008 => self.global = value,
            0x00C => self.usb = value,
            0x010 => self.write_reset(value),
            0x014 => self.pending &= !value,
            0x018 => self.mask = value,
            0x038 => self.general = value,
            0x800 => self.device = value,
            0x804 => self.device_control = value,
            0x810 => self.in_mask = value,
            0x814 => self.out_mask = value,
            0x81C => self.all_mask = value,
            0x834 => self.empty_mask = value,
            0x900..0xA00 | 0xB00..0xC00 => return self.write_endpoint(offset, value),
            0xE00 => self.power = value,
            0x1000..0x5000 => self.ins[(offset >> 12) as usize - 1].fifo.push_back(value),
            _ => return false,
        }
        true
    }

    fn write_size(&mut self, offset: u64, value: u32) {
        match offset {
            0x024 => self.receive_size = value,
            0x028 => self.ins[0].fifo_place = value,
            0x104.. => self.ins[(offset - 0x100) as usize / 4].fifo_place = value,
            // GOTGCTL: overrides of what is sensed, which no driver of this chip uses.
            _ => {}
        }
    }

    fn write_reset(&mut self, value: u32) {
        self.reset = value & 0x1F << 6;
        if value & 1 != 0 {
            let (vbus, general, usb) = (self.vbus, self.general, self.usb);
            *self = Self::new();
            (self.vbus, self.general, self.usb) = (vbus, general, usb);
        }
        if value & 1 << 4 != 0 {
            self.received.clear();
            self.popped.clear();
        }
        if value & 1 << 5 != 0 {
            match (value >> 6 & 0x1F) as usize {
                0x10.. => self.ins.iter_mut().for_each(|ep| ep.fifo.clear()),
                nth => {
                    if let Some(endpoint) = self.ins.get_mut(nth) {
                        endpoint.fifo.clear();
                    }
                }
            }
        }
    }

    fn write_endpoint(&mut self, offset: u64, value: u32) -> bool {
        let nth = (offset >> 5 & 7) as usize;
        let endpoints = if offset < 0xB00 {
            &mut self.ins
        } else {
            &mut self.outs
        };
        let Some(endpoint) = endpoints.get_mut(nth) else {
            return false;
        };
        match offset & 0x1F {
            0x00 => endpoint.write_control(value, nth == 0),
            0x08 => endpoint.interrupts &= !value,
            0x10 => endpoint.size = value,
            _ => return false,
        }
        true
    }
}
