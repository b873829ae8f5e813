//! A checksum of the contents: CRC-32 of IEEE 802.3.
//!
//! *Design.* Half a byte at a time, by a table of 64 bytes: the card takes longer than that.

use crate::bytes::Block;

/// What it is so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Checksum(u32);

impl Checksum {
    pub(crate) const fn new() -> Self {
        Self(u32::MAX)
    }

    pub(crate) fn add(&mut self, block: &Block) {
        for &byte in block {
            self.0 ^= u32::from(byte);
            for _ in 0..2 {
                let half = TABLE.get((self.0 & 0xF) as usize).copied().unwrap_or(0);
                self.0 = self.0 >> 4 ^ half;
            }
        }
    }
}

const TABLE: [u32; 16] = {
    /// The polynomial, the lowest power in the highest bit.
    const POLYNOMIAL: u32 = 0xEDB8_8320;
    let mut table = [0; 16];
    let mut half = 0;
    let mut rest: &mut [u32] = &mut table;
    while let Some((entry, behind)) = rest.split_first_mut() {
        let mut sum: u32 = half;
        let mut bit = 0;
        while bit < 4 {
            sum = sum >> 1 ^ if sum & 1 == 1 { POLYNOMIAL } else { 0 };
            bit += 1;
        }
        *entry = sum;
        half += 1;
        rest = behind;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_crc_that_everyone_has() {
        // By `python3 -c 'import zlib; print(hex(zlib.crc32(bytes(i * 7 % 251 for i in range(512)))))'`.
        let block = core::array::from_fn(|at| (at * 7 % 251) as u8);
        let mut sum = Checksum::new();
        sum.add(&block);
        assert_eq!(!sum.0, CRC_OF_ZLIB);
    }

    const CRC_OF_ZLIB: u32 = 0xD3AC_1C26;
}
