//! What a simulated receiver makes of configuration frames.
//!
//! *Purpose.* A receiver acts on what it is configured to, by messages or by keys as its
//! generation does, refuses what it does not know, and has memory that survives a restart.
//!
//! *Design.* Two copies of everything that can be configured: what counts now, and what is stored.
//! CFG-CFG copies parts of the first to the second; CFG-VALSET writes to each layer that it names. A frame of
//! keys counts whole or not at all.
//!
//! *Limits.* UART1 only. Battery-backed RAM and flash are one. CFG-CFG saves ports, messages and
//! navigation; it neither clears nor loads. Of CFG-NAV5, CFG-INF and their keys nothing shows.

use std::collections::BTreeMap;

use crate::model::Model;
use crate::pulse::{PulsePort, Widths};
use crate::settings::{LeftOn, Port, ReceiverSettings};
use crate::ubx;

/// The shortest navigation period that is accepted, in ms (M8: 18 Hz).
const PERIOD_MIN_MS: u16 = 55;

/// The bits of the protocols in CFG-PRT's masks.
pub(crate) const UBX: u8 = 0x01;
const NMEA: u8 = 0x02;
const RTCM3: u8 = 0x20;

/// The first and the last key of the time pulse's group that are understood: without their size.
const PULSE_KEYS: core::ops::RangeInclusive<u32> = 0x0005_0002..=0x0005_0030;

/// What can be configured.
#[derive(Clone, Debug)]
struct Stored {
    port: Port,
    left_on: Vec<LeftOn>,
    widths: Widths,
    pulse_keys: BTreeMap<u32, u32>,
}

/// The configuration; see the [module](self).
#[derive(Clone, Debug)]
pub(crate) struct Configuration {
    model: Model,
    refuses: Vec<(u8, u8)>,
    refuses_keys: Vec<u32>,
    now: Stored,
    saved: Stored,
    pulse_port: PulsePort,
}

impl Configuration {
    pub(crate) fn new(settings: &ReceiverSettings) -> Self {
        let now = Stored {
            port: settings.port,
            left_on: settings.left_on.clone(),
            widths: Widths {
                unlocked_ns: settings.pulse.unlocked_width_ns,
                locked_ns: settings.pulse.width_ns,
            },
            pulse_keys: BTreeMap::new(),
        };
        Self {
            model: settings.model,
            refuses: settings.refuses.clone(),
            refuses_keys: settings.refuses_keys.clone(),
            saved: now.clone(),
            now,
            pulse_port: PulsePort::new(&settings.pulse),
        }
    }

    pub(crate) const fn port(&self) -> Port {
        self.now.port
    }

    pub(crate) const fn saved_port(&self) -> Port {
        self.saved.port
    }

    pub(crate) fn left_on(&self) -> &[LeftOn] {
        &self.now.left_on
    }

    pub(crate) fn pulse_port(&self) -> PulsePort {
        self.pulse_port.clone()
    }

    /// Only what is stored survives.
    pub(crate) fn restart(&mut self) {
        self.now = self.saved.clone();
        self.pulse_port.set(self.now.widths);
    }

    /// Accepts or refuses one frame of class CFG.
    pub(crate) fn configure(&mut self, id: u8, payload: &[u8]) -> bool {
        let subject = match (id, payload) {
            (0x01, &[class, id, ..]) => (class, id),
            _ => (0x06, id),
        };
        let accepted = match id {
            _ if self.refuses.contains(&subject) => false,
            0x8a => self.model.takes_keys() && self.set_keys(payload),
            _ => self.model.takes_messages() && self.take_message(id, payload),
        };
        self.pulse_port.set(self.now.widths);
        accepted
    }

    fn take_message(&mut self, id: u8, payload: &[u8]) -> bool {
        match (id, payload) {
            (0x00, payload) => self.set_port(payload),
            (0x01, &[class, id, every]) | (0x01, &[class, id, _, every, _, _, _, _]) => {
                let is_known = (class, id) != ubx::NAV_PVT || self.model.nav_pvt_len().is_some();
                if is_known {
                    self.now.set_message((class, id), every);
                }
                is_known
            }
            (0x08, &[low, high, _, _, _, _]) => {
                self.now.set_period(u16::from_le_bytes([low, high]))
            }
            (0x09, payload) => self.save(payload),
            (0x02, payload) => payload.len() == 10,
            (0x24, payload) => payload.len() == 36,
            (0x31, payload) => self.set_pulse(payload),
            _ => false,
        }
    }

    /// CFG-PRT as an answer to its poll.
    pub(crate) fn port_payload(&self) -> Option<[u8; 20]> {
        let port = &self.now.port;
        let mut payload = [0; 20];
        payload[..8].copy_from_slice(&[1, 0, 0, 0, 0xc0, 0x08, 0, 0]);
        payload[8..12].copy_from_slice(&port.baud.to_le_bytes());
        payload[12] = port.protocols_in;
        payload[14] = if port.ubx { UBX } else { 0 } | if port.nmea { NMEA } else { 0 };
        self.model.takes_messages().then_some(payload)
    }

    /// CFG-PRT: the speed and the protocols.
    fn set_port(&mut self, payload: &[u8]) -> bool {
        let &[1, _, _, _, _, _, _, _, b0, b1, b2, b3, into, _, out, _, ..] = payload else {
            return false;
        };
        let accepted =
            payload.len() == 20 && self.now.set_baud(u32::from_le_bytes([b0, b1, b2, b3]));
        if accepted {
            self.now.port.protocols_in = into;
            (self.now.port.ubx, self.now.port.nmea) = (out & UBX != 0, out & NMEA != 0);
        }
        accepted
    }

    /// CFG-CFG: what counts now is stored.
    fn save(&mut self, payload: &[u8]) -> bool {
        let ([0, 0, 0, 0, what, 0, 0, 0, 0, 0, 0, 0] | [0, 0, 0, 0, what, 0, 0, 0, 0, 0, 0, 0, _]) =
            payload
        else {
            return false;
        };
        let (now, saved) = (&self.now, &mut self.saved);
        let old = saved.port;
        if what & 0x01 != 0 {
            saved.port = Port {
                baud: now.port.baud,
                protocols_in: now.port.protocols_in,
                ubx: now.port.ubx,
                nmea: now.port.nmea,
                ..old
            };
        }
        if what & 0x02 != 0 {
            saved.left_on.clone_from(&now.left_on);
            saved.port.nav_pvt_every = now.port.nav_pvt_every;
            saved.port.tim_tp_every = now.port.tim_tp_every;
        }
        if what & 0x08 != 0 {
            saved.port.period_ms = now.port.period_ms;
        }
        true
    }

    /// CFG-TP5: the widths of the pulse, of a second's period and given in µs.
    fn set_pulse(&mut self, payload: &[u8]) -> bool {
        let Some(payload) = payload.first_chunk::<32>() else {
            return false;
        };
        let word = |at: usize| {
            let word = [at, at + 1, at + 2, at + 3].map(|at| payload[at]);
            u32::from_le_bytes(word)
        };
        // isLength and lockedOtherSet, and isFreq not.
        if word(28) & 0x1c != 0x14 || word(12) != 1_000_000 {
            return false;
        }
        self.now.widths = Widths {
            unlocked_ns: u64::from(word(16)) * 1_000,
            locked_ns: u64::from(word(20)) * 1_000,
        };
        true
    }

    /// CFG-VALSET.
    fn set_keys(&mut self, payload: &[u8]) -> bool {
        let &[0, layers, 0, 0, ref rest @ ..] = payload else {
            return false;
        };
        let Some(pairs) = pairs(rest) else {
            return false;
        };
        if layers & !0x07 != 0 || layers == 0 || pairs.len() > 64 {
            return false;
        }
        let (mut now, mut saved) = (self.now.clone(), self.saved.clone());
        for (key, value) in pairs {
            let is_refused = self.refuses_keys.contains(&key);
            let is_known = |stored: &mut Stored| stored.set_key(self.model, key, value);
            if is_refused
                || (layers & 0x01 != 0 && !is_known(&mut now))
                || (layers & 0x06 != 0 && !is_known(&mut saved))
            {
                return false;
            }
        }
        (self.now, self.saved) = (now, saved);
        true
    }
}

/// The keys and values of a CFG-VALSET; `None` if they do not fill it.
fn pairs(mut rest: &[u8]) -> Option<Vec<(u32, u32)>> {
    let mut pairs = Vec::new();
    while let Some((key, behind)) = rest.split_first_chunk::<4>() {
        let key = u32::from_le_bytes(*key);
        let size = match key >> 28 & 7 {
            1 | 2 => 1,
            3 => 2,
            4 => 4,
            _ => return None,
        };
        let (value, behind) = behind.split_at_checked(size)?;
        let value = value
            .iter()
            .rev()
            .fold(0, |sum, byte| sum << 8 | u32::from(*byte));
        pairs.push((key, value));
        rest = behind;
    }
    rest.is_empty().then_some(pairs)
}

impl Stored {
    fn set_baud(&mut self, baud: u32) -> bool {
        let accepted = (4_800..=921_600).contains(&baud);
        if accepted {
            self.port.baud = baud;
        }
        accepted
    }

    fn set_period(&mut self, period_ms: u16) -> bool {
        let accepted = period_ms >= PERIOD_MIN_MS;
        if accepted {
            self.port.period_ms = period_ms;
        }
        accepted
    }

    fn set_message(&mut self, message: (u8, u8), every: u8) {
        match message {
            ubx::NAV_PVT => self.port.nav_pvt_every = every,
            ubx::TIM_TP => self.port.tim_tp_every = every,
            message => {
                let mut left_on = self.left_on.iter_mut();
                if let Some(left) = left_on.find(|left| left.message == message) {
                    left.every = every;
                }
            }
        }
    }

    fn set_protocol_in(&mut self, protocol: u8, on: bool) {
        let without = self.port.protocols_in & !protocol;
        self.port.protocols_in = if on { without | protocol } else { without };
    }

    /// Whether it takes a key with its value.
    fn set_key(&mut self, model: Model, key: u32, value: u32) -> bool {
        let byte = value as u8;
        let on = value == 1;
        match key {
            0x4052_0001 => return self.set_baud(value),
            0x1073_0001 => self.set_protocol_in(UBX, on),
            0x1073_0002 => self.set_protocol_in(NMEA, on),
            0x1073_0004 if model.has_corrections() => self.set_protocol_in(RTCM3, on),
            0x1074_0001 => self.port.ubx = on,
            0x1074_0002 => self.port.nmea = on,
            0x1074_0004 => return model.has_corrections(),
            0x3021_0001 => return self.set_period(value as u16),
            0x3021_0002 | 0x2021_0003 | 0x2092_0002 | 0x2011_0021 | 0x2011_0011 => {}
            0x2091_0000..0x2092_0000 => {
                let Some(message) = message_of(key) else {
                    return false;
                };
                self.set_message(message, byte);
            }
            _ if PULSE_KEYS.contains(&(key & 0x0fff_ffff)) => {
                return self.set_pulse_key(key, value);
            }
            _ => return false,
        }
        true
    }

    /// A key of the time pulse. The widths count once all say what is understood.
    fn set_pulse_key(&mut self, key: u32, value: u32) -> bool {
        self.pulse_keys.insert(key, value);
        let has = |key: u32, wanted: u32| self.pulse_keys.get(&key) == Some(&wanted);
        let is_pulse_each_second = has(0x2005_0023, 0)
            && has(0x2005_0030, 1)
            && has(0x4005_0003, 1_000_000)
            && [0x07, 0x08, 0x09, 0x0a, 0x0b]
                .iter()
                .all(|low| has(0x1005_0000 | low, 1))
            && has(0x2005_000c, 0);
        let width = |key: u32| self.pulse_keys.get(&key).copied();
        if let (true, Some(unlocked_us), Some(locked_us)) =
            (is_pulse_each_second, width(0x4005_0004), width(0x4005_0005))
        {
            self.widths = Widths {
                unlocked_ns: u64::from(unlocked_us) * 1_000,
                locked_ns: u64::from(locked_us) * 1_000,
            };
        }
        true
    }
}

/// The message whose rate on UART1 a key is (F9 HPG 1.32 interface description).
fn message_of(key: u32) -> Option<(u8, u8)> {
    Some(match key & 0xffff {
        0x0007 => ubx::NAV_PVT,
        0x017e => ubx::TIM_TP,
        0x0016 => (0x01, 0x35),
        0x0061 => (0x01, 0x26),
        0x02a5 => (0x02, 0x15),
        0x0232 => (0x02, 0x13),
        0x0205 => (0x02, 0x14),
        0x01b5 => (0x0a, 0x09),
        0x035a => (0x0a, 0x38),
        _ => return None,
    })
}
