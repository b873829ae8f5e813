//! A file of other people's firmware, made by hand.

use upload::Px4File;

/// What other people's firmware says at its start.
pub(super) const GREETING: &[u8] = b"other people's firmware\n";

/// Other people's firmware: it sends its greeting over TELEM1 and stops.
pub(super) fn others() -> Px4File {
    const RCC_AHB1ENR: u32 = 0x4002_3830;
    const RCC_APB1ENR: u32 = 0x4002_3840;
    const GPIOD_MODER: u32 = 0x4002_0C00;
    const GPIOD_AFRL: u32 = 0x4002_0C20;
    const USART2: u32 = 0x4000_4400;
    const VECTORS: usize = 0x40;
    let mut code = Vec::new();
    for (address, value) in [
        (RCC_AHB1ENR, 1 << 3),
        (RCC_APB1ENR, 1 << 17),
        (GPIOD_AFRL, 0x0770_0000),
        (GPIOD_MODER, 0x2800),
        // 16 MHz / 139; UE and TE.
        (USART2 + 8, 139),
        (USART2 + 12, 1 << 13 | 1 << 3),
    ] {
        store(&mut code, address, value);
    }
    for &byte in GREETING {
        load(&mut code, 0, USART2);
        // ldr r2, [r0]; lsls r2, r2, #24; bpl to the ldr: until TXE.
        code.extend([0x6802, 0x0612, 0xD5FC]);
        store(&mut code, USART2 + 4, byte.into());
    }
    // b to itself
    code.push(0xE7FE);
    let mut bytes = vec![0; VECTORS];
    bytes[..4].copy_from_slice(&0x2001_0000_u32.to_le_bytes());
    bytes[4..8].copy_from_slice(&(0x0800_4000 + VECTORS as u32 + 1).to_le_bytes());
    bytes.extend(code.into_iter().flat_map(u16::to_le_bytes));
    // More, so that it takes many commands.
    let mut random = fastrand::Rng::with_seed(17);
    bytes.resize_with(5_000, || random.u8(..));
    Px4File {
        image_maxsize: 1_032_192,
        ..Px4File::new(bytes)
    }
}

/// str of `value` to `address`, by r0 and r1.
fn store(code: &mut Vec<u16>, address: u32, value: u32) {
    load(code, 0, address);
    load(code, 1, value);
    code.push(0x6001);
}

/// movw and movt (ARMv7-M A7.7.76, A7.7.79).
fn load(code: &mut Vec<u16>, register: u16, value: u32) {
    for (opcode, half) in [(0xF240, value as u16), (0xF2C0, (value >> 16) as u16)] {
        code.push(opcode | (half >> 1 & 0x400) | half >> 12);
        code.push((half << 4 & 0x7000) | register << 8 | half & 0xFF);
    }
}
