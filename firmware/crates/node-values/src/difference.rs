//! A time in words, for people.
//!
//! *Design.* With its sign, three digits and the unit that fits, in ASCII as a STATUSTEXT has to be:
//! `+3.26 ms`. Whole ns stay whole, and so do seconds from 100 on.

use timebase::divide;

use crate::text::Text;

/// `ns` as a person compares it, as in `+3.26 ms`.
#[must_use]
pub fn difference(ns: i64) -> Text<24> {
    let size = ns.unsigned_abs();
    // In thousandths of the unit, but for ns.
    let (thousandths, unit) = match size {
        0..1_000 => (size * 1_000, "ns"),
        1_000..999_500 => (size, "us"),
        999_500..999_500_000 => (divide::<1_000>(size), "ms"),
        _ => (divide::<1_000_000>(size), "s"),
    };
    let (digits, decimals) = match thousandths {
        0..9_995 if size >= 1_000 => (divide::<10>(thousandths + 5), 2),
        9_995..99_950 if size >= 1_000 => (divide::<100>(thousandths + 50), 1),
        _ => (divide::<1_000>(thousandths + 500), 0),
    };
    let mut text = Writer::default();
    text.push(if ns < 0 { b'-' } else { b'+' });
    text.number(digits, decimals);
    text.push(b' ');
    unit.bytes().for_each(|byte| text.push(byte));
    Text::new(text.bytes)
}

#[derive(Default)]
struct Writer {
    bytes: [u8; 24],
    len: usize,
}

impl Writer {
    fn push(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(self.len) {
            *place = byte;
            self.len += 1;
        }
    }

    /// A number without its point, of which that many digits are decimals.
    fn number(&mut self, number: u64, decimals: usize) {
        let mut digits = [0; 20];
        let (mut rest, mut len) = (number, 0);
        for place in digits.iter_mut().rev() {
            if rest == 0 && len > decimals {
                break;
            }
            let tens = divide::<10>(rest);
            *place = b'0' + (rest - tens * 10) as u8;
            rest = tens;
            len += 1;
        }
        let first = digits.len() - len;
        for (left, &digit) in (0..len).rev().zip(digits.iter().skip(first)) {
            self.push(digit);
            if left == decimals && decimals > 0 {
                self.push(b'.');
            }
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString as _;

    use super::*;

    #[test]
    fn a_time_has_three_digits_and_the_unit_that_fits() {
        for (ns, text) in [
            (0, "+0 ns"),
            (7, "+7 ns"),
            (-999, "-999 ns"),
            (1_000, "+1.00 us"),
            (-113_797, "-114 us"),
            (99_949, "+99.9 us"),
            (99_950, "+100 us"),
            (999_499, "+999 us"),
            (999_500, "+1.00 ms"),
            (3_261_585, "+3.26 ms"),
            (-9_994_999, "-9.99 ms"),
            (9_995_000, "+10.0 ms"),
            (999_500_000, "+1.00 s"),
            (-1_000_000_000, "-1.00 s"),
            (18_000_000_000, "+18.0 s"),
            (619_315_200_000_000_000, "+619315200 s"),
            (i64::MIN, "-9223372037 s"),
            (i64::MAX, "+9223372037 s"),
        ] {
            assert_eq!(difference(ns).as_str().to_string(), text);
        }
    }
}
