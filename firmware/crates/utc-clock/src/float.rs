//! Arithmetic between whole ns and `f32` that costs little on a core with 32-bit floats.
//!
//! *Design.* The core converts words of 32 bits in one instruction, and 64 bits in a call of some
//! forty. `libm` takes a square root bit by bit, and the core's own instruction is out of reach without
//! `unsafe`.

/// `whole` as an `f32`: the nearest one below 2³², one step beside it at most above.
#[inline]
pub(crate) fn float(whole: i64) -> f32 {
    const HIGH: f32 = (1_u64 << 32) as f32;
    let size = whole.unsigned_abs();
    let size = (size >> 32) as u32 as f32 * HIGH + size as u32 as f32;
    if whole < 0 { -size } else { size }
}

/// The whole number nearest to `x`; beyond 64 bits the end of their range.
#[inline(never)]
pub(crate) fn whole(x: f32) -> i64 {
    let rounded = libm::rintf(x);
    let short = rounded as i32;
    if short == i32::MIN || short == i32::MAX {
        rounded as i64
    } else {
        short.into()
    }
}

/// The square root, at most 3 · 10⁻⁷ of it too great and 10⁻⁷ too small; 0 of what is not above 0.
#[inline(never)] // Many places ask for one: it may be called.
pub(crate) fn sqrt(x: f32) -> f32 {
    // Half of the exponent, within 4 % of the root, and Heron's rule, which squares half of that.
    const HALF_BIAS: u32 = 0x1fbb_67a9;
    if x > 0.0 && x < f32::INFINITY {
        let root = f32::from_bits((x.to_bits() >> 1) + HALF_BIAS);
        let root = 0.5 * (root + x / root);
        0.5 * (root + x / root)
    } else {
        x.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_that_of_libm() {
        for bits in (f32::MIN_POSITIVE.to_bits()..f32::INFINITY.to_bits()).step_by(997) {
            let x = f32::from_bits(bits);
            let exact = libm::sqrt(f64::from(x));
            let off = f64::from(sqrt(x)) / exact - 1.0;
            assert!((-1e-7..3e-7).contains(&off), "{x}: {off}");
        }
        assert_eq!(sqrt(0.0), 0.0);
        assert_eq!(sqrt(-1.0), 0.0);
        assert_eq!(sqrt(f32::NAN), 0.0);
        assert_eq!(sqrt(f32::INFINITY), f32::INFINITY);
    }

    #[test]
    fn conversions_are_those_of_the_language() {
        for shift in 0..63 {
            for off in [-1, 0, 1] {
                for value in [(1_i64 << shift) + off, -(1_i64 << shift) + off] {
                    let exact = value as f32;
                    let off = (float(value) - exact).abs();
                    let most = if value.unsigned_abs() >> 32 == 0 {
                        0.0
                    } else {
                        exact.abs() * f32::EPSILON
                    };
                    assert!(off <= most, "{value}: {off}");
                    let x = exact;
                    assert_eq!(whole(x), libm::rintf(x) as i64);
                    assert_eq!(whole(x * 0.3), libm::rintf(x * 0.3) as i64);
                }
            }
        }
        assert_eq!(whole(f32::MAX), i64::MAX);
        assert_eq!(whole(f32::NAN), 0);
    }
}
