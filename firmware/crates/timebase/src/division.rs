//! Division by a constant without dividing.
//!
//! *Purpose.* On this core a division of 64 bits is a library call of hundreds of instructions;
//! times are converted from one unit to another all the time.
//!
//! *Design.* Let `D = 2^z · d` with `d` odd and `2^k < d < 2^(k + 1)`, and let `m` be `n / 2^z`
//! rounded down. The quotient is the upper part of `m · r`, where `r` is `2^(64 + k) / d` rounded
//! up, by `e / d` with `e < d`. So `m · r / 2^(64 + k)` is more than `m / d` by
//! `m · e / 2^(64 + k) / d`. Since `m < 2^63` and `e < 2^(k + 1)`, that is less than `1 / d`, which
//! is too little to reach the next whole number: the result is exact for every `n`.
//!
//! *Limits.* Even divisors that are no powers of two: 10, 168, 1 000 and 10⁹ are.

/// `n / D`, rounded down: four multiplications of 32 bits.
#[must_use]
#[inline]
pub const fn divide<const D: u64>(n: u64) -> u64 {
    const {
        assert!(
            D.is_multiple_of(2) && !D.is_power_of_two(),
            "see the module's limits"
        );
    };
    let shift = const { D.trailing_zeros() };
    let bits = const { (D >> D.trailing_zeros()).ilog2() };
    let reciprocal = const {
        let odd = D >> D.trailing_zeros();
        ((1_u128 << (u64::BITS + odd.ilog2())).div_ceil(odd as u128)) as u64
    };
    multiply_high(n >> shift, reciprocal) >> bits
}

/// The upper 64 bits of a product of 128.
const fn multiply_high(a: u64, b: u64) -> u64 {
    let (a_low, a_high) = (a & 0xffff_ffff, a >> 32);
    let (b_low, b_high) = (b & 0xffff_ffff, b >> 32);
    let low = a_low * b_low;
    let middle = a_high * b_low + (low >> 32);
    let middle_low = a_low * b_high + (middle & 0xffff_ffff);
    a_high * b_high + (middle >> 32) + (middle_low >> 32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every quotient's edges that `u64` has for a divisor, the powers of two, and what lies
    /// between.
    fn dividends(divisor: u64) -> impl Iterator<Item = u64> {
        let edges = (0..64).flat_map(move |bit| {
            let power = 1_u64 << bit;
            let multiple = power / divisor * divisor;
            [
                power - 1,
                power,
                power + 1,
                multiple,
                multiple.wrapping_sub(1),
            ]
        });
        let last = u64::MAX / divisor * divisor;
        let mut state = 1_u64;
        let scattered = (0..100_000).map(move |_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let n = state >> (state % 61);
            n - n % divisor * (state >> 63)
        });
        edges.chain(scattered).chain([last - 1, last, u64::MAX])
    }

    fn is_exact<const D: u64>() {
        for n in dividends(D) {
            assert_eq!(divide::<D>(n), n / D, "{n} / {D}");
        }
    }

    #[test]
    fn a_quotient_is_the_floor_of_a_division() {
        is_exact::<6>();
        is_exact::<10>();
        is_exact::<168>();
        is_exact::<1_000>();
        is_exact::<1_000_000_000>();
        is_exact::<{ u64::MAX - 1 }>();
    }
}
