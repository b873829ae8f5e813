//! The bootloader's checksum.
//!
//! *Design.* The reflected polynomial 0xEDB88320 as in zlib's CRC-32, but begun with 0 and not inverted
//! at the end. It covers all of the flash behind the bootloader, whatever the image's length: what
//! is not programmed is 0xFF.

/// The polynomial, reflected.
const POLYNOMIAL: u32 = 0xEDB8_8320;

/// The remainders of all bytes.
const REMAINDERS: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < table.len() {
        let mut remainder = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            let lowest = remainder & 1;
            remainder = (remainder >> 1) ^ (POLYNOMIAL * lowest);
            bit += 1;
        }
        table[byte] = remainder;
        byte += 1;
    }
    table
};

/// The checksum of `bytes`, followed by as many erased bytes as make `room` of them.
#[must_use]
pub fn crc32(bytes: &[u8], room: usize) -> u32 {
    let erased = room.saturating_sub(bytes.len());
    let all = bytes.iter().chain(std::iter::repeat_n(&0xFF, erased));
    all.fold(0, |crc, &byte| {
        REMAINDERS[usize::from(byte ^ crc as u8)] ^ (crc >> 8)
    })
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
