//! CRC-16/MCRF4XX, byte by byte and over a window of a stream.
//!
//! *Purpose.* MAVLink's checksum, and the checksum of any window of a stream
//! from two values of one running register, without reading the window again.
//!
//! *Design.* The register is linear over GF(2). After two registers have read the
//! same n bytes, they differ by their first difference moved through n zero
//! bytes: `crc(window) = running_end ^ zeros(n, running_start ^ INIT)`. `zeros`
//! is a product with a constant matrix, done by nibbles, with a table for every
//! second n.
//!
//! *Limits.* [`zeros`] is for n from [`MIN_ZEROS`] to [`MAX_ZEROS`], with 2.5 KB of
//! tables; [`many_zeros`] is for more.

/// The register before the first byte.
pub const INIT: u16 = 0xffff;

/// The shortest run of zero bytes that [`zeros`] knows.
pub const MIN_ZEROS: usize = 8;

/// The longest run of zero bytes that [`zeros`] knows.
pub const MAX_ZEROS: usize = MIN_ZEROS + 2 * MAPS.len() - 2;

/// The register after one more byte (polynomial 0x1021, reflected: the shift
/// form of MAVLink's `checksum.h`).
#[must_use]
#[inline]
pub const fn step(register: u16, byte: u8) -> u16 {
    // Sums of shifts, because the core can shift an operand of its exclusive or.
    let r = register as u32;
    let t = r ^ byte as u32;
    let t = (t ^ (t << 4)) & 0xff;
    ((((r >> 8) & 0xff) ^ (t << 8)) ^ (t << 3) ^ (t >> 4)) as u16
}

/// The register after all of `bytes`.
#[must_use]
pub fn over(register: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(register, |r, &byte| step(r, byte))
}

/// The register after `count` zero bytes, [`MIN_ZEROS`] to [`MAX_ZEROS`]; the
/// register as it is for any other count.
#[must_use]
#[inline]
pub fn zeros(count: usize, register: u16) -> u16 {
    // The counts that noise can cause most often have a table of their own: those of MAVLink 1,
    // which are even below 32 and odd above.
    let doubled = count + count / 32;
    let Some(map) = MAPS.get((doubled / 2).wrapping_sub(MIN_ZEROS / 2)) else {
        return register;
    };
    let one_more = doubled % 2 == 1;
    map.of(if one_more {
        step(register, 0)
    } else {
        register
    })
}

/// The same for any count from [`MIN_ZEROS`] on.
#[must_use]
pub fn many_zeros(mut count: usize, mut register: u16) -> u16 {
    while count > MAX_ZEROS {
        register = zeros(MAX_ZEROS / 2, register);
        count -= MAX_ZEROS / 2;
    }
    zeros(count, register)
}

/// The maps of 8, 10 … 30, 31, 33 … 45 zero bytes.
static MAPS: [Map; 20] = Map::every_second(MIN_ZEROS);

/// A linear map of the register: for each nibble, lowest first, the sum that each of its values
/// adds.
#[derive(Clone, Copy)]
struct Map([[u16; 16]; 4]);

#[expect(
    clippy::indexing_slicing,
    reason = "the indices are remainders by the lengths"
)]
impl Map {
    /// The maps of `first`, `first` + 2, `first` + 4 … zero bytes, one less from 32
    /// on.
    const fn every_second<const N: usize>(first: usize) -> [Self; N] {
        let mut maps = [Self([[0; 16]; 4]); N];
        let mut index = 0;
        while index < N {
            let mut entry = 0;
            while entry < 64 {
                let (nibble, value) = (entry / 16, entry % 16);
                let mut register = (value << (4 * nibble)) as u16;
                let mut left = first + 2 * index;
                left -= left / 32;
                while left > 0 {
                    register = step(register, 0);
                    left -= 1;
                }
                maps[index].0[nibble][value] = register;
                entry += 1;
            }
            index += 1;
        }
        maps
    }

    #[inline]
    fn of(&self, register: u16) -> u16 {
        let Self([a, b, c, d]) = self;
        let r = usize::from(register);
        a[r & 15] ^ b[(r >> 4) & 15] ^ c[(r >> 8) & 15] ^ d[(r >> 12) & 15]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_of_the_catalogue() {
        // "123456789" in the catalogue of parametrised CRC algorithms.
        assert_eq!(over(INIT, b"123456789"), 0x6f91);
    }

    #[test]
    fn zeros_equals_single_steps_for_every_register() {
        for register in 0..=u16::MAX {
            let mut expected = over(register, &[0; MIN_ZEROS]);
            for count in MIN_ZEROS..=3 * MAX_ZEROS {
                let known = [zeros, many_zeros].map(|zeros| zeros(count, register));
                let [at_once, any] = [
                    if count <= MAX_ZEROS {
                        known[0]
                    } else {
                        expected
                    },
                    known[1],
                ];
                assert_eq!([at_once, any], [expected; 2], "{count} from {register:#x}");
                expected = step(expected, 0);
            }
        }
    }

    #[test]
    fn a_window_follows_from_the_registers_at_its_ends() {
        let stream: [u8; 60] = core::array::from_fn(|i| (i * 73 + 5) as u8);
        for start in 0..15 {
            for end in start + MIN_ZEROS..=start + MAX_ZEROS {
                let (before, at_end) = (over(INIT, &stream[..start]), over(INIT, &stream[..end]));
                assert_eq!(
                    at_end ^ zeros(end - start, before ^ INIT),
                    over(INIT, &stream[start..end])
                );
            }
        }
    }
}
