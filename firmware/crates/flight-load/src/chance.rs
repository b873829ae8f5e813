//! Chance from a seed: small enough for an interrupt.
//!
//! *Design.* Marsaglia's xorshift with 32 bits of state ("Xorshift RNGs", Journal of Statistical Software 8,
//! 2003: shifts of 13, 17, 5), whose first state is the seed mixed by the finaliser of `MurmurHash3`, so that
//! neighbouring seeds have nothing in common.
//!
//! *Limits.* For a load, not for statistics of high dimension and not for secrets.

/// A stream of chance.
#[derive(Clone, Copy, Debug)]
pub struct Chance(u32);

impl Chance {
    /// The stream number `stream` of `seed`.
    pub const fn new(seed: u32, stream: u32) -> Self {
        let mut mixed = mix(seed ^ mix(stream.wrapping_add(0x9E37_79B9)));
        if mixed == 0 {
            mixed = 1;
        }
        Self(mixed)
    }

    /// Any number of 32 bits but 0.
    pub const fn next(&mut self) -> u32 {
        let mut x = self.0;
        x ^= x << 13;
        x ^= x >> 17;
        x ^= x << 5;
        self.0 = x;
        x
    }

    /// Any number below `end`; 0 if that is 0.
    pub const fn below(&mut self, end: u32) -> u32 {
        ((self.next() as u64 * end as u64) >> 32) as u32
    }
}

const fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x85EB_CA6B);
    x ^= x >> 13;
    x = x.wrapping_mul(0xC2B2_AE35);
    x ^ x >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_drawn_is_even_and_other_streams_have_other_numbers() {
        let mut sum = 0_u64;
        let mut chance = Chance::new(1, 0);
        for _ in 0..100_000 {
            let drawn = chance.below(1_000);
            assert!(drawn < 1_000);
            sum += u64::from(drawn);
        }
        // A mean of 499.5, good to 0.9.
        assert!(sum.abs_diff(49_950_000) < 300_000, "{sum}");
        let first = |seed, stream| Chance::new(seed, stream).next();
        assert_ne!(first(1, 0), first(2, 0));
        assert_ne!(first(1, 0), first(1, 1));
        assert_eq!(first(7, 3), first(7, 3));
        assert_eq!(Chance::new(3, 3).below(0), 0);
    }
}
