//! A sample, and the 16 bytes in which it is kept.
//!
//! *Design.* Four words: the board's time in two, the PING's time since the first one's, and a word
//! with 24 bits of sequence number, two of state and six of uncertainty. The uncertainty is coded
//! by its logarithm, in steps of √2, rounded up, so that an interval that holds UTC still does.

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
    /// Half the width of the interval that is meant to hold UTC, in ns; `u32::MAX` if that is
    /// unknown.
    pub uncertainty_ns: u32,
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

/// The code of an uncertainty beyond 2³¹ ns, or of none that is known.
const UNKNOWN: u32 = 63;

impl Record {
    /// Memory without a sample: zeros, so that it takes no flash.
    pub const EMPTY: Self = Self([0; 4]);

    /// Packs a sample; the first PING of the log was sent at `first_us`.
    #[must_use]
    pub(crate) fn pack(sample: &Sample, first_us: u64) -> Self {
        let board = sample.board_ns.cast_unsigned();
        Self([
            board as u32,
            (board >> 32) as u32,
            sample.ping_us.wrapping_sub(first_us) as u32,
            sample.sequence & SEQUENCE_MASK
                | sample.state.bits() << STATE_SHIFT
                | code(sample.uncertainty_ns) << UNCERTAINTY_SHIFT,
        ])
    }

    /// The sample, with what the record has of it.
    #[must_use]
    pub(crate) const fn unpack(self, first_us: u64) -> Sample {
        let Self([low, high, since_first_us, rest]) = self;
        Sample {
            board_ns: (low as u64 | (high as u64) << 32).cast_signed(),
            ping_us: first_us.wrapping_add(since_first_us as u64),
            sequence: rest & SEQUENCE_MASK,
            state: match ClockState::from_bits(rest >> STATE_SHIFT & 3) {
                Some(state) => state,
                None => ClockState::Holdover,
            },
            uncertainty_ns: least_of(rest >> UNCERTAINTY_SHIFT),
        }
    }
}

/// The least code whose value is `ns` or more.
const fn code(ns: u32) -> u32 {
    // The even code at or below it, and then up by one or two.
    let even = 2 * (u32::BITS - (ns >> 1).leading_zeros());
    let mut code = even;
    while code < UNKNOWN && least_of(code) < ns {
        code += 1;
    }
    code
}

/// The value of a code, in ns: 2^(code / 2), rounded up.
const fn least_of(code: u32) -> u32 {
    /// √2 · 2³¹, rounded up.
    const ROOT: u64 = 3_037_000_500;
    let whole = code / 2;
    if code >= UNKNOWN {
        u32::MAX
    } else if code.is_multiple_of(2) {
        1 << whole
    } else {
        (((ROOT << whole) + (1 << 31) - 1) >> 31) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_16_bytes() {
        assert_eq!(size_of::<Record>(), 16);
    }

    #[test]
    fn an_uncertainty_is_rounded_up_by_less_than_half_of_it() {
        let probes = (0..32).flat_map(|bit| [-1, 0, 1].map(|by| (1_i64 << bit) + by));
        for ns in probes.chain([5, 11, 1_000, 65_432, 235_511_199]) {
            let ns = u32::try_from(ns.min(1 << 31)).unwrap();
            let kept = least_of(code(ns));
            assert!(kept >= ns, "{ns}: {kept}");
            let most = f64::from(ns.max(1)) * f64::sqrt(2.0) + 1.0;
            assert!(f64::from(kept) <= most, "{ns}: {kept}");
        }
        assert_eq!(least_of(code(0)), 1);
        assert_eq!(least_of(code(u32::MAX)), u32::MAX);
        assert_eq!(least_of(code((1 << 31) + 1)), u32::MAX);
    }

    #[test]
    fn the_value_of_a_code_has_that_code() {
        for code_kept in 0..=UNKNOWN {
            // 1 ns and 2 ns have neighbours that round to the same.
            let ns = least_of(code_kept);
            assert_eq!(least_of(code(ns)), ns);
        }
    }

    #[test]
    fn what_goes_in_comes_out() {
        for state in [ClockState::Unset, ClockState::Set, ClockState::Holdover] {
            let sample = Sample {
                board_ns: 1_795_309_322_961_327_001,
                ping_us: 1_795_309_322_000_000 + u64::from(u32::MAX),
                sequence: 0xff_ffff,
                state,
                uncertainty_ns: 1 << 27,
            };
            let first_us = 1_795_309_322_000_000;
            assert_eq!(Record::pack(&sample, first_us).unpack(first_us), sample);
        }
    }
}
