//! What a receiver sends that we do not use.
//!
//! *Purpose.* A receiver may have messages in its flash that fill the line: raw data at 5 Hz is more
//! than 115200 baud carry, and everything behind it comes seconds late. This keeps what was received,
//! and says what to switch off next.
//!
//! *Design.* A table of [`KINDS`] kinds. A kind that is received [`RECEIVED`] times is asked to be off, at most
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
            Self::Ubx { class: 0x04, .. } => Some(Setting::Notices),
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

/// The kinds that were received.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    kinds: [Option<Kind>; KINDS],
    /// How many of them are used: all of them, which the compiler does not know, so that loops stay loops.
    used: usize,
}

impl Table {
    pub(crate) const fn new() -> Self {
        Self {
            kinds: [None; KINDS],
            used: KINDS,
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
                asked: 0,
                counts_from: Cycles::BOOT,
                is_reported: false,
            });
        }
    }

    /// The next to be switched off.
    pub(crate) fn poll_off(&mut self, now: Cycles) -> Option<Setting> {
        let is_due = |kind: &&mut Kind| kind.received >= RECEIVED && kind.asked < ASKED;
        let kind = self.kinds().iter_mut().flatten().find(is_due)?;
        kind.asked = kind.asked.saturating_add(1);
        kind.received = 0;
        kind.counts_from = now.plus(PAUSE);
        kind.what.off()
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
