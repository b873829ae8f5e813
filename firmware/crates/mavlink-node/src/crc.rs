//! CRC-16/MCRF4XX, byte by byte and over a window of a stream.
//!
//! *Purpose.* MAVLink's checksum, and the checksum of any window of a stream
//! from two values of one running register, without going through the window.
//!
//! *Design.* The register is linear over GF(2). Two registers that read the same
//! n bytes differ, afterwards, by their first difference moved through n zero
//! bytes: `crc(window) = running_end ^ zeros(n, running_start ^ INIT)`. `zeros`
//! is a product with a constant matrix, done by nibbles: one table set for the
//! multiples of eight bytes, one for the rest.
//!
//! *Limits.* [`zeros`] covers n up to [`MAX_ZEROS`].

/// The register before the first byte.
pub const INIT: u16 = 0xffff;

/// The longest run of zero bytes that [`zeros`] knows.
pub const MAX_ZEROS: usize = 8 * EIGHTS + 7;

/// The register after one more byte (polynomial 0x1021, reflected: the shift
/// form of MAVLink's `checksum.h`).
#[must_use]
#[inline]
pub const fn step(register: u16, byte: u8) -> u16 {
    // Sums of shifts, because the core shifts within its exclusive or.
    let mut t = register as u32 ^ byte as u32;
    t = (t ^ (t << 4)) & 0xff;
    ((register as u32 >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4)) as u16
}

/// The register after all of `bytes`.
#[must_use]
pub fn over(register: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(register, |r, &byte| step(r, byte))
}

/// The register after `count` zero bytes; `count` at most [`MAX_ZEROS`], any
/// more are left out.
#[must_use]
#[inline]
pub fn zeros(count: usize, register: u16) -> u16 {
    let coarse = BY_EIGHT
        .get(count / 8)
        .map_or(register, |map| map.of(register));
    BY_ONE.get(count % 8).map_or(coarse, |map| map.of(coarse))
}

/// How many multiples of eight zero bytes have a table: enough for the longest
/// window that the framer looks at.
const EIGHTS: usize = 5;

/// By index: how far 0, 8, 16 … zero bytes move a register.
static BY_EIGHT: [Map; EIGHTS + 1] = Map::multiples(8);

/// By index: how far 0, 1, 2 … 7 zero bytes move a register.
static BY_ONE: [Map; 8] = Map::multiples(1);

/// A linear map of the register: for each nibble, lowest first, what each of
/// its values adds.
#[derive(Clone, Copy)]
struct Map([[u16; 16]; 4]);

#[expect(
    clippy::indexing_slicing,
    reason = "the indices are remainders by the lengths"
)]
impl Map {
    /// The maps of 0, `bytes`, 2 · `bytes` … zero bytes.
    const fn multiples<const N: usize>(bytes: usize) -> [Self; N] {
        let mut maps = [Self([[0; 16]; 4]); N];
        let mut index = 0;
        while index < N {
            let mut entry = 0;
            while entry < 64 {
                let (nibble, value) = (entry / 16, entry % 16);
                let mut register = (value << (4 * nibble)) as u16;
                let mut left = index * bytes;
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
    fn zeros_equals_single_steps_for_every_register_and_count() {
        for register in 0..=u16::MAX {
            let mut expected = register;
            for count in 0..=MAX_ZEROS {
                assert_eq!(
                    zeros(count, register),
                    expected,
                    "{count} from {register:#x}"
                );
                expected = step(expected, 0);
            }
        }
    }

    #[test]
    fn a_window_follows_from_the_registers_at_its_ends() {
        let stream: [u8; 60] = core::array::from_fn(|i| (i * 73 + 5) as u8);
        for start in 0..15 {
            for end in start..start + MAX_ZEROS.min(45) {
                let (before, at_end) = (over(INIT, &stream[..start]), over(INIT, &stream[..end]));
                assert_eq!(
                    at_end ^ zeros(end - start, before ^ INIT),
                    over(INIT, &stream[start..end])
                );
            }
        }
    }
}
