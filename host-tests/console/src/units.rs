//! Times in the unit that fits their size.
//!
//! *Purpose.* A person compares 61 ms with 46 µs at a glance, and 61030000 ns with 46000 ns only
//! by counting digits.
//!
//! *Design.* A difference has a sign and four digits, a magnitude has none and three. Whole ns
//! stay whole.
//!
//! *Limits.* Above 9999 s the digits that are left out are written as zeros.

/// The units, from the smallest: the power of ten of its size in ns, and its name.
const UNITS: [(u32, &str); 4] = [(0, "ns"), (3, "µs"), (6, "ms"), (9, "s")];

/// `ns` with its sign, four digits and a unit, as in `−61.03 ms`.
#[must_use]
pub fn difference(ns: i64) -> String {
    format!("{}{}", sign(ns), rounded(ns.unsigned_abs(), 4))
}

/// `ns` without a sign, with three digits and a unit, as in `46.2 µs`.
#[must_use]
pub fn magnitude(ns: u64) -> String {
    rounded(ns, 3)
}

/// The sign that `value` is written with: `+`, `−`, or none for 0.
#[must_use]
pub const fn sign(value: i64) -> &'static str {
    match value.signum() {
        0 => "",
        1 => "+",
        _ => "−",
    }
}

/// `ns` with `digits` digits, in the largest unit that leaves one before the point.
fn rounded(ns: u64, digits: u32) -> String {
    let dropped = places(ns).saturating_sub(digits);
    let step = 10_u64.pow(dropped);
    let ns = ns.saturating_add(step / 2) / step * step;
    let places = places(ns);
    let fitting = UNITS.iter().rev().find(|&&(power, _)| power < places);
    let &(power, unit) = fitting.unwrap_or(&UNITS[0]);
    let decimals = (digits + power).saturating_sub(places).min(power) as usize;
    format!(
        "{:.decimals$} {unit}",
        ns as f64 / 10_f64.powi(power as i32)
    )
}

/// How many digits `number` has.
fn places(number: u64) -> u32 {
    number.checked_ilog10().map_or(1, |log| log + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_has_four_digits_in_the_unit_that_fits() {
        for (ns, text) in [
            (0, "0 ns"),
            (28, "+28 ns"),
            (-999, "−999 ns"),
            (1_000, "+1.000 µs"),
            (-46_250, "−46.25 µs"),
            (-61_030_000, "−61.03 ms"),
            (999_949_999, "+999.9 ms"),
            (999_950_000, "+1.000 s"),
            (3_261_585_000, "+3.262 s"),
            (12_345_600_000_000, "+12350 s"),
            (i64::MIN, "−9223000000 s"),
        ] {
            assert_eq!(difference(ns), text, "{ns}");
        }
    }

    #[test]
    fn a_magnitude_has_three_digits_and_no_sign() {
        for (ns, text) in [
            (0, "0 ns"),
            (45, "45 ns"),
            (1_234, "1.23 µs"),
            (46_249, "46.2 µs"),
            (121_636_079, "122 ms"),
            (999_499, "999 µs"),
            (999_500, "1.00 ms"),
            (4_294_967_295, "4.29 s"),
        ] {
            assert_eq!(magnitude(ns), text, "{ns}");
        }
    }
}
