//! A line that damages what it carries.
//!
//! *Purpose.* Lost, flipped and foreign bytes, and silence, around any
//! [`Talker`].
//!
//! *Design.* A wrapper: the talker behind it knows nothing of it. Chance is
//! seeded; what was done is counted.
//!
//! *Limits.* Only what the board receives is damaged. A burst stays one burst: the
//! bytes after a lost or foreign one move up or back by its time on the line,
//! and the next burst waits until they are through. [`Talker::truth`] has what
//! the talker sent, arrived or not.

use core::ops::Range;

use crate::talker::{Sent, Talker, Transmission, WorldNanos};

/// What a [`Line`] does to bytes; each probability is that of one byte.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Damage {
    /// Where its chance comes from.
    pub seed: u64,
    /// The probability that a byte is lost.
    pub drop: f64,
    /// The probability that one of its bits is flipped.
    pub flip: f64,
    /// The probability that a foreign byte comes before it.
    pub insert: f64,
    /// Bursts that would begin in here are lost whole.
    pub silence: Option<Range<WorldNanos>>,
}

/// What a [`Line`] has done so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Damages {
    /// Bytes lost.
    pub dropped: u64,
    /// Bytes with a flipped bit.
    pub flipped: u64,
    /// Foreign bytes.
    pub inserted: u64,
    /// Bursts lost whole.
    pub silenced: u64,
}

/// A line with damage around the talker `T`.
#[derive(Clone, Debug)]
pub struct Line<T> {
    talker: T,
    damage: Damage,
    rng: fastrand::Rng,
    done: Damages,
    line_free: WorldNanos,
}

impl<T: Talker> Line<T> {
    /// `talker`, received through `damage`.
    #[must_use]
    pub fn new(talker: T, damage: Damage) -> Self {
        let rng = fastrand::Rng::with_seed(damage.seed);
        Self {
            talker,
            damage,
            rng,
            done: Damages::default(),
            line_free: WorldNanos::default(),
        }
    }

    /// What it has done so far.
    #[must_use]
    pub const fn done(&self) -> Damages {
        self.done
    }

    /// The talker behind it.
    #[must_use]
    pub const fn talker(&self) -> &T {
        &self.talker
    }

    fn spoil(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut spoilt = Vec::with_capacity(bytes.len());
        for &byte in bytes {
            if self.rng.f64() < self.damage.insert {
                spoilt.push(self.rng.u8(..));
                self.done.inserted += 1;
            }
            if self.rng.f64() < self.damage.drop {
                self.done.dropped += 1;
            } else if self.rng.f64() < self.damage.flip {
                spoilt.push(byte ^ (1 << self.rng.u8(..8)));
                self.done.flipped += 1;
            } else {
                spoilt.push(byte);
            }
        }
        spoilt
    }
}

impl<T: Talker> Talker for Line<T> {
    fn next_event(&self) -> Option<WorldNanos> {
        self.talker.next_event()
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        loop {
            let sent = self.talker.poll(now)?;
            let silent = self.damage.silence.as_ref();
            if silent.is_some_and(|silence| silence.contains(&sent.start)) {
                self.done.silenced += 1;
                continue;
            }
            let spoilt = Transmission {
                start: sent.start.max(self.line_free),
                bytes: self.spoil(&sent.bytes),
                baud: sent.baud,
            };
            self.line_free = spoilt.end();
            return Some(spoilt);
        }
    }

    fn handle_bytes(&mut self, now: WorldNanos, baud: u32, bytes: &[u8]) {
        self.talker.handle_bytes(now, baud, bytes);
    }

    fn truth(&self) -> &[Sent] {
        self.talker.truth()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Port, Receiver, ReceiverSettings};

    const NOON_NS: i64 = 1_795_348_800_000_000_000;

    fn line(damage: Damage) -> Line<Receiver> {
        let mut settings = ReceiverSettings::new(NOON_NS);
        settings.port = Port::CONFIGURED;
        Line::new(Receiver::new(settings), damage)
    }

    /// All bursts of the first `seconds`.
    fn receive(talker: &mut impl Talker, seconds: u64) -> Vec<Transmission> {
        let mut received = Vec::new();
        while let Some(at) = talker.next_event()
            && at < WorldNanos(seconds * 1_000_000_000)
        {
            received.extend(talker.poll(at));
        }
        received
    }

    #[test]
    fn no_damage_changes_nothing() {
        let mut undamaged = line(Damage::default());
        let mut bare = undamaged.talker.clone();
        assert_eq!(receive(&mut undamaged, 10), receive(&mut bare, 10));
        assert_eq!(undamaged.done(), Damages::default());
    }

    #[test]
    fn damage_is_as_likely_as_asked_and_the_same_again() {
        let damage = Damage {
            seed: 7,
            drop: 0.01,
            flip: 0.02,
            insert: 0.03,
            silence: None,
        };
        let mut damaged = line(damage.clone());
        let received = receive(&mut damaged, 200);
        // 1000 frames of 100 bytes; five standard deviations to either side.
        let Damages {
            dropped,
            flipped,
            inserted,
            ..
        } = damaged.done();
        assert!(dropped.abs_diff(1_000) < 160, "{dropped}");
        assert!(flipped.abs_diff(2_000) < 225, "{flipped}");
        assert!(inserted.abs_diff(3_000) < 270, "{inserted}");
        let bytes: usize = received.iter().map(|sent| sent.bytes.len()).sum();
        assert_eq!(bytes as u64, 100_000 - 100 + inserted - dropped);
        assert!(received.is_sorted_by(|one, next| one.end() <= next.start));
        assert_eq!(receive(&mut line(damage), 200), received);
    }

    #[test]
    fn silence_swallows_whole_bursts() {
        let second = |s: u64| WorldNanos(s * 1_000_000_000);
        let mut silent = line(Damage {
            silence: Some(second(2)..second(5)),
            ..Damage::default()
        });
        let received = receive(&mut silent, 10);
        assert!(
            received
                .iter()
                .all(|sent| sent.start < second(2) || sent.start >= second(5))
        );
        assert_eq!(silent.done().silenced, 15);
        assert_eq!(received.len() + 15, silent.truth().len());
    }
}
