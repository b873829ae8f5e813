//! What a receiver sends that we do not use.
//!
//! *Purpose.* A receiver may have messages in its flash that fill the line: raw data at 5 Hz is more
//! than 115200 baud carry, and everything behind it comes seconds late. This keeps what was received,
//! and says what to switch off next.
//!
//! *Design.* What a receiver may have in its flash is known beforehand ([`IN_ADVANCE`]) and is asked to be off
//! once. A receiver that refuses may not know the message at all, so that is not reported: whether it
//! goes on shows when it comes. For what comes there is a table of [`KINDS`] kinds. A kind that is received [`RECEIVED`] times is asked to be off, at most
//! [`ASKED`] times with [`PAUSE`] between, since what waits in the receiver's queue still comes. One that
//! the receiver refuses, or that goes on, is reported once and left alone.
//!
//! *Limits.* A header is taken at its word, without its checksum: what noise invents is not received
//! twice before it gives its place to others, and to switch it off harms nothing.

use timebase::Cycles;

use crate::config::Setting;

/// So many kinds are kept.
const KINDS: usize = 8;

/// What is received so often is no accident.
const RECEIVED: u8 = 2;

/// A kind is asked to be off so often.
const ASKED: u8 = 3;

/// What is switched off before it comes, in this order: the notices; the raw data, which fill a line; then what
/// PX4's and ArduPilot's drivers switch on (`PX4-GPSDrivers`, `ubx.cpp`; `AP_GPS_UBLOX.h`), which save it in
/// the flash; and what u-center shows.
const IN_ADVANCE: [Unwanted; 19] = [
    Unwanted::Ubx { class: INF, id: 0 },
    // RXM-RAWX, -SFRBX, -MEASX.
    Unwanted::Ubx {
        class: RXM,
        id: 0x15,
    },
    Unwanted::Ubx {
        class: RXM,
        id: 0x13,
    },
    Unwanted::Ubx {
        class: RXM,
        id: 0x14,
    },
    // NAV-SAT, -SVINFO, -POSLLH, -STATUS, -DOP, -SOL, -VELNED, -TIMEGPS, -TIMEUTC, -CLOCK, -SBAS.
    Unwanted::Ubx {
        class: NAV,
        id: 0x35,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x30,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x02,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x03,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x04,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x06,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x12,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x20,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x21,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x22,
    },
    Unwanted::Ubx {
        class: NAV,
        id: 0x32,
    },
    // NAV-TIMELS, which is polled.
    Unwanted::Ubx {
        class: NAV,
        id: 0x26,
    },
    // MON-HW, -HW2, and TIM-TM2.
    Unwanted::Ubx {
        class: MON,
        id: 0x09,
    },
    Unwanted::Ubx {
        class: MON,
        id: 0x0b,
    },
    Unwanted::Ubx {
        class: TIM,
        id: 0x03,
    },
];

const NAV: u8 = 0x01;
const RXM: u8 = 0x02;
const INF: u8 = 0x04;
const MON: u8 = 0x0a;
const TIM: u8 = 0x0d;

/// From one time to the next, in cycles: 10 s, longer than any queue that was seen.
pub(crate) const PAUSE: u64 = Cycles::from_micros(10_000_000).0;

/// A kind of message that we do not use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unwanted {
    /// Sentences of NMEA.
    Nmea,
    /// A message of UBX.
    Ubx {
        /// Its class.
        class: u8,
        /// Its id.
        id: u8,
    },
}

impl Unwanted {
    /// What switches it off; `None` for answers, which come for the asking.
    const fn off(self) -> Option<Setting> {
        match self {
            Self::Nmea => Some(Setting::Port),
            Self::Ubx { class: INF, .. } => Some(Setting::Notices),
            Self::Ubx {
                class: 0x05 | 0x06, ..
            } => None,
            Self::Ubx { class, id } => Some(Setting::Off { class, id }),
        }
    }
}

/// What is known of a kind.
#[derive(Clone, Copy, Debug)]
struct Kind {
    what: Unwanted,
    /// Times that it was received since it was last asked to be off.
    received: u8,
    /// When it was received last.
    at: Cycles,
    asked: u8,
    /// What is received before was on its way already.
    counts_from: Cycles,
    is_reported: bool,
}

impl Kind {
    /// It is asked to be off once more.
    const fn handle_asked(&mut self, now: Cycles) {
        self.asked = self.asked.saturating_add(1);
        self.received = 0;
        self.counts_from = now.plus(PAUSE);
    }
}

/// The kinds that were received.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    kinds: [Option<Kind>; KINDS],
    /// How many of them are used: all of them, which the compiler does not know, so that loops stay loops.
    used: usize,
    /// The next of [`IN_ADVANCE`].
    next: usize,
    /// Which of these were refused, a bit each.
    refused: u32,
}

const _: () = assert!(IN_ADVANCE.len() <= u32::BITS as usize);

impl Table {
    pub(crate) const fn new() -> Self {
        Self {
            kinds: [None; KINDS],
            used: KINDS,
            next: 0,
            refused: 0,
        }
    }

    fn kinds(&mut self) -> &mut [Option<Kind>] {
        self.kinds.get_mut(..self.used).unwrap_or_default()
    }

    /// Takes one that was received.
    pub(crate) fn handle(&mut self, now: Cycles, what: Unwanted) {
        if what.off().is_none() {
            return;
        }
        let found = self
            .kinds()
            .iter_mut()
            .flatten()
            .find(|kind| kind.what == what);
        if let Some(kind) = found {
            kind.at = now;
            if now >= kind.counts_from {
                kind.received = kind.received.saturating_add(1);
            }
            return;
        }
        let was_asked = self.was_asked_in_advance(what);
        // In a free place, or the one of what was not asked for and not received for the longest time.
        let may_go = |place: &&mut Option<Kind>| place.is_none_or(|kind| kind.asked == 0);
        let place = self
            .kinds()
            .iter_mut()
            .filter(may_go)
            .min_by_key(|place| place.map_or(Cycles::BOOT, |kind| kind.at));
        if let Some(place) = place {
            *place = Some(Kind {
                what,
                received: 1,
                at: now,
                asked: u8::from(was_asked),
                counts_from: Cycles::BOOT,
                is_reported: false,
            });
        }
    }

    /// The next to be switched off.
    pub(crate) fn poll_off(&mut self, now: Cycles) -> Option<Setting> {
        let is_due = |kind: &&mut Kind| kind.received >= RECEIVED && kind.asked < ASKED;
        let kind = self.kinds().iter_mut().flatten().find(is_due)?;
        kind.handle_asked(now);
        kind.what.off()
    }

    /// The next to be switched off before it has come: each once, which counts as the first time.
    pub(crate) fn poll_in_advance(&mut self, now: Cycles) -> Option<Setting> {
        loop {
            let what = *IN_ADVANCE.get(self.next)?;
            self.next = self.next.wrapping_add(1);
            match self
                .kinds()
                .iter_mut()
                .flatten()
                .find(|kind| kind.what == what)
            {
                Some(kind) if kind.asked > 0 => continue,
                Some(kind) => kind.handle_asked(now),
                None => {}
            }
            return what.off();
        }
    }

    /// A receiver that has restarted has again what is in its flash.
    pub(crate) const fn begin_again(&mut self) {
        (self.next, self.refused) = (0, 0);
    }

    /// The receiver has refused the last of [`Self::poll_in_advance`].
    pub(crate) const fn handle_refused_in_advance(&mut self) {
        self.refused |= 1_u32.unbounded_shl(self.next.wrapping_sub(1) as u32);
    }

    /// Whether the receiver has refused before to switch it off.
    pub(crate) fn was_refused_in_advance(&self, off: Setting) -> bool {
        let mut known = IN_ADVANCE.iter().zip(0..);
        known.any(|(what, bit)| what.off() == Some(off) && self.refused >> bit & 1 == 1)
    }

    fn was_asked_in_advance(&self, what: Unwanted) -> bool {
        let asked = IN_ADVANCE.get(..self.next).unwrap_or_default();
        asked.contains(&what)
    }

    /// The receiver has refused to switch it off.
    pub(crate) fn handle_refused(&mut self, setting: Setting) {
        for kind in self.kinds().iter_mut().flatten() {
            if kind.what.off() == Some(setting) {
                kind.asked = ASKED;
                kind.is_reported = true;
            }
        }
    }

    /// One that goes on although it was asked to be off, once.
    pub(crate) fn poll_stubborn(&mut self) -> Option<Setting> {
        let is_stubborn = |kind: &&mut Kind| {
            kind.received >= RECEIVED && kind.asked >= ASKED && !kind.is_reported
        };
        let kind = self.kinds().iter_mut().flatten().find(is_stubborn)?;
        kind.is_reported = true;
        kind.what.off()
    }
}
