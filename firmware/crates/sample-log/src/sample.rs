//! A sample, and the 16 bytes in which it is kept.
//!
//! *Design.* Four words: the board's time in two, the PING's time since the first one's, and a word
//! with 24 bits of sequence number, two of state and six of uncertainty. The uncertainty is coded
//! by its logarithm, in steps of √2, rounded up, so that an interval that holds UTC still does: from
//! 1 ns to 2.1 s, and where the second is not proved from 0.54 s to 36 years. What is beyond that
//! is no knowledge of UTC, and is kept as unset.

use timebase::ClockState;

/// One PING, as the board received it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The board's time at the PING's arrival, in ns: UTC since 1970, or since boot while unset.
    pub board_ns: i64,
    /// The PING's own time, in µs of the sender's clock.
    pub ping_us: u64,
    /// The PING's number.
    pub sequence: u32,
    /// The state of the board's clock.
    pub state: ClockState,
    /// Half the width of the interval that is meant to hold UTC, in ns; [`u64::MAX`] while the
    /// clock is unset.
    pub uncertainty_ns: u64,
}

/// A sample as the log keeps it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Record([u32; 4]);

/// Bits of the sequence number that are kept.
const SEQUENCE_BITS: u32 = 24;
const SEQUENCE_MASK: u32 = (1 << SEQUENCE_BITS) - 1;
const STATE_SHIFT: u32 = SEQUENCE_BITS;
const UNCERTAINTY_SHIFT: u32 = STATE_SHIFT + 2;

/// The largest code, of 2³¹ units.
const MOST: u32 = 62;

/// The unit of an uncertainty is 2²⁹ ns where the second is not proved, and 1 ns elsewhere.
const UNPROVED_SHIFT: u32 = 29;

impl Record {
    /// Memory without a sample: zeros, so that it takes no flash.
    pub const EMPTY: Self = Self([0; 4]);

    /// Packs a sample; the first PING of the log was sent at `first_us`.
    #[must_use]
    pub(crate) fn pack(sample: &Sample, first_us: u64) -> Self {
        let board = sample.board_ns.cast_unsigned();
        let (state, code) = coded(sample.state, sample.uncertainty_ns);
        Self([
            board as u32,
            (board >> 32) as u32,
            sample.ping_us.wrapping_sub(first_us) as u32,
            sample.sequence & SEQUENCE_MASK
                | state.bits() << STATE_SHIFT
                | code << UNCERTAINTY_SHIFT,
        ])
    }

    /// The sample, with what the record has of it.
    #[must_use]
    pub(crate) const fn unpack(self, first_us: u64) -> Sample {
        let Self([low, high, since_first_us, rest]) = self;
        let state = match ClockState::from_bits(rest >> STATE_SHIFT & 3) {
            Some(state) => state,
            None => ClockState::Unset,
        };
        Sample {
            board_ns: (low as u64 | (high as u64) << 32).cast_signed(),
            ping_us: first_us.wrapping_add(since_first_us as u64),
            sequence: rest & SEQUENCE_MASK,
            state,
            uncertainty_ns: value(state, rest >> UNCERTAINTY_SHIFT),
        }
    }
}

/// The state as it is kept, and the code of its uncertainty. A clock whose uncertainty is too large
/// for its state claims less: that its second is not proved, and at last nothing.
fn coded(state: ClockState, ns: u64) -> (ClockState, u32) {
    let claims = match state {
        ClockState::Unset => &[][..],
        ClockState::Set | ClockState::Holdover => &[state, ClockState::Unproved],
        ClockState::Unproved => &[ClockState::Unproved],
    };
    let fitting = claims.iter().find_map(|&state| {
        let shift = shift(state);
        let units = ns.saturating_add((1 << shift) - 1) >> shift;
        Some((state, code(u32::try_from(units).ok()?)?))
    });
    fitting.unwrap_or((ClockState::Unset, 0))
}

/// The inverse: a code's value, in ns.
const fn value(state: ClockState, code: u32) -> u64 {
    match state {
        ClockState::Unset => u64::MAX,
        _ => (least_of(code) as u64) << shift(state),
    }
}

/// The unit of the uncertainties of a state is 2 to the power of this, in ns.
const fn shift(state: ClockState) -> u32 {
    match state {
        ClockState::Unproved => UNPROVED_SHIFT,
        ClockState::Unset | ClockState::Set | ClockState::Holdover => 0,
    }
}

/// The least code whose value is `units` or more; `None` beyond 2³¹.
const fn code(units: u32) -> Option<u32> {
    // The even code at or below it, and then up by one or two.
    let mut code = 2 * (u32::BITS - (units >> 1).leading_zeros());
    while code <= MOST {
        if least_of(code) >= units {
            return Some(code);
        }
        code += 1;
    }
    None
}

/// The value of a code, in units: 2^(code / 2), rounded up.
const fn least_of(code: u32) -> u32 {
    /// √2 · 2³¹, rounded up.
    const ROOT: u64 = 3_037_000_500;
    let code = if code > MOST { MOST } else { code };
    let whole = code / 2;
    if code.is_multiple_of(2) {
        1 << whole
    } else {
        (((ROOT << whole) + (1 << 31) - 1) >> 31) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The most that is kept of a clock whose second is not proved.
    const MOST_NS: u64 = 1 << 60;

    const STATES: [ClockState; 4] = [
        ClockState::Unset,
        ClockState::Set,
        ClockState::Holdover,
        ClockState::Unproved,
    ];

    fn kept(state: ClockState, uncertainty_ns: u64) -> (ClockState, u64) {
        let sample = Sample {
            board_ns: 0,
            ping_us: 0,
            sequence: 0,
            state,
            uncertainty_ns,
        };
        let Sample {
            state,
            uncertainty_ns,
            ..
        } = Record::pack(&sample, 0).unpack(0);
        (state, uncertainty_ns)
    }

    #[test]
    fn a_record_is_16_bytes() {
        assert_eq!(size_of::<Record>(), 16);
    }

    #[test]
    fn an_uncertainty_is_rounded_up_by_less_than_half_of_it() {
        let probes = (0..60).flat_map(|bit| [-1, 0, 1].map(|by| (1_i64 << bit) + by));
        let probes = probes.chain([5, 11, 1_000, 65_432, 235_511_199, 18_000_000_000]);
        for ns in probes.map(i64::cast_unsigned) {
            for (state, least, most) in [
                (ClockState::Set, 0, 1 << 31),
                (ClockState::Holdover, 0, 1 << 31),
                (ClockState::Unproved, 1 << 30, MOST_NS),
            ] {
                if !(least..=most).contains(&ns) {
                    continue;
                }
                let (kept_state, kept_ns) = kept(state, ns);
                assert_eq!(kept_state, state, "{ns}");
                assert!(kept_ns >= ns, "{state} {ns}: {kept_ns}");
                let unit = (1_u64 << shift(state)) as f64;
                let most = (ns.max(1) as f64 + unit) * f64::sqrt(2.0) + unit;
                assert!(kept_ns as f64 <= most, "{state} {ns}: {kept_ns}");
            }
        }
        assert_eq!(kept(ClockState::Set, 0), (ClockState::Set, 1));
    }

    #[test]
    fn no_largest_number_stands_for_a_set_clock() {
        for state in [ClockState::Set, ClockState::Holdover] {
            // 3 s claim no second.
            let (kept_state, ns) = kept(state, 3_000_000_000);
            assert_eq!(kept_state, ClockState::Unproved);
            assert!((3_000_000_000..5_000_000_000).contains(&ns), "{ns}");
        }
        for state in STATES {
            for ns in [MOST_NS + 1, u64::MAX - 1, u64::MAX] {
                assert_eq!(kept(state, ns), (ClockState::Unset, u64::MAX));
            }
            assert_eq!(kept(ClockState::Unset, 5), (ClockState::Unset, u64::MAX));
        }
        assert_eq!(
            kept(ClockState::Unproved, MOST_NS),
            (ClockState::Unproved, MOST_NS)
        );
        // Memory that nothing was written to.
        assert_eq!(Record::EMPTY.unpack(0).state, ClockState::Unset);
    }

    #[test]
    fn the_value_of_a_code_has_that_code() {
        for state in [ClockState::Set, ClockState::Unproved] {
            for code in 0..=MOST {
                // 1 and 2 units have neighbours that round to the same.
                let ns = value(state, code);
                assert_eq!(kept(state, ns), (state, ns));
            }
        }
    }

    #[test]
    fn what_goes_in_comes_out() {
        for state in STATES {
            let sample = Sample {
                board_ns: 1_795_309_322_961_327_001,
                ping_us: 1_795_309_322_000_000 + u64::from(u32::MAX),
                sequence: 0xff_ffff,
                state,
                uncertainty_ns: match state {
                    ClockState::Unset => u64::MAX,
                    ClockState::Set | ClockState::Holdover => 1 << 27,
                    ClockState::Unproved => 1 << 34,
                },
            };
            let first_us = 1_795_309_322_000_000;
            assert_eq!(Record::pack(&sample, first_us).unpack(first_us), sample);
        }
    }
}
