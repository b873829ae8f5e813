//! The bootloader's checksum.
//!
//! *Design.* The reflected polynomial 0xEDB88320 as in zlib's CRC-32, but begun with 0 and not inverted
//! at the end. It covers all of the flash behind the bootloader, whatever the image's length: what
//! is not programmed is 0xFF.

use crc::{Algorithm, Crc};

/// The bootloader's own among the many CRC-32.
const ALGORITHM: Algorithm<u32> = Algorithm {
    width: 32,
    poly: 0x04C1_1DB7,
    init: 0,
    refin: true,
    refout: true,
    xorout: 0,
    check: 0x2DFD_2D88,
    residue: 0,
};
const CRC: Crc<u32> = Crc::<u32>::new(&ALGORITHM);

/// The checksum of `bytes`, followed by as many erased bytes as make `room` of them.
#[must_use]
pub fn crc32(bytes: &[u8], room: usize) -> u32 {
    let mut digest = CRC.digest();
    digest.update(bytes);
    digest.update(&vec![0xFF; room.saturating_sub(bytes.len())]);
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bootloaders_vectors() {
        let ramp: Vec<u8> = (0..=255).collect();
        assert_eq!(crc32(b"123456789", 0), 0x2DFD_2D88);
        assert_eq!(crc32(&ramp, 1_032_192), 0xA37F_C4B2);
        assert_eq!(crc32(&ramp, 2_080_768), 0x5837_A08F);
        assert_eq!(crc32(&[], 1_032_192), 0x8DC8_6B7A);
        assert_eq!(crc32(&[], 2_080_768), 0xC07B_7311);
    }
}
