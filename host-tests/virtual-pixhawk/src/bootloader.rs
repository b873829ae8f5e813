//! Stand-ins for the bootloaders that a Pixhawk 1 may have.
//!
//! *Purpose.* What a bootloader leaves of core, clocks and memory as it jumps to the application, in the
//! states that are known and in one that is worse.
//!
//! *Design.* One piece of code for all: it makes the stores of a list, with waits among them, overwrites
//! the memory that a bootloader has used, sets the core's registers and jumps, as the real ones do, to
//! what the application's second word says. What differs is the list. Sources: PX4-Bootloader (`bl.c`,
//! `main_f4.c`); ArduPilot `Tools/AP_Bootloader` (`jump_to_app`) with ChibiOS's `port_disable` and
//! `port_lock`, and its `hwdef/fmuv3`.
//!
//! *Limits.* The real ones wait, blink and speak before; of that nothing is to be seen here.

use crate::flash::{APPLICATION, FLASH};

/// What stands before the application.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bootloader {
    /// As PX4's leaves the board: as after a reset, but for VTOR.
    #[default]
    Px4,
    /// As ArduPilot's leaves it: interrupts masked twice, on the process stack, the PLL on, TIM5
    /// running, and USB's interrupt enabled and pending.
    ArduPilot,
    /// As none should leave it: every interrupt enabled and pending, SysTick running, faults masked,
    /// the regulator at its lowest scale, timers at another rate, VTOR at the bootloader.
    Hostile,
}

impl Bootloader {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Px4, Self::ArduPilot, Self::Hostile];

    /// Its code and its list, for the start of the flash.
    pub(crate) fn bytes(self) -> Vec<u8> {
        let State { stores, core, vtor } = self.state();
        let mut words = vec![STACK, (FLASH + 8) | 1];
        let code = CODE.as_chunks::<2>().0;
        words.extend(
            code.iter()
                .map(|&[low, high]| u32::from(high) << 16 | u32::from(low)),
        );
        for store in stores {
            let (address, value) = match *store {
                Store::Word(address, value) => (address, value),
                Store::Wait(address, bits) => (address + 1, bits),
            };
            words.extend([address, value]);
        }
        words.extend([0, 0]);
        words.extend(USED_MEMORY.as_flattened());
        words.extend([0, 0]);
        words.extend(core);
        words.extend([VTOR, vtor, APPLICATION]);
        words.into_iter().flat_map(u32::to_le_bytes).collect()
    }

    const fn state(self) -> State {
        match self {
            Self::Px4 => State {
                stores: &[],
                core: [0, 0, 0, 0],
                vtor: APPLICATION,
            },
            Self::ArduPilot => State {
                stores: ARDUPILOT,
                core: [1, 0x20, 0, PROCESS_STACK],
                vtor: APPLICATION,
            },
            Self::Hostile => State {
                stores: HOSTILE,
                core: [1, 0x10, 1, PROCESS_STACK],
                vtor: FLASH,
            },
        }
    }
}

/// What a bootloader leaves.
struct State {
    stores: &'static [Store],
    /// PRIMASK, BASEPRI, FAULTMASK, CONTROL.
    core: [u32; 4],
    vtor: u32,
}

/// A word that is stored, or bits of one that are waited for.
#[derive(Clone, Copy)]
enum Store {
    Word(u32, u32),
    Wait(u32, u32),
}

/// Its own stack: the end of the first SRAM.
const STACK: u32 = 0x2001_C000;

/// Memory that is overwritten: variables at the bottom of SRAM; a stack at the top of what QEMU has, too,
/// and one at the top of all.
const USED_MEMORY: [[u32; 2]; 3] = [
    [0x2000_0000, 0x2000_4000],
    [0x2001_E000, 0x2002_0000],
    [0x2002_E000, 0x2003_0000],
];

/// CONTROL.SPSEL.
const PROCESS_STACK: u32 = 2;

const VTOR: u32 = 0xE000_ED08;
const ISER: u32 = 0xE000_E100;
const ISPR: u32 = 0xE000_E200;
const RCC: u32 = 0x4002_3800;
const CR: u32 = RCC;
const PLLCFGR: u32 = RCC + 0x04;
const CFGR: u32 = RCC + 0x08;
const CIR: u32 = RCC + 0x0C;
const AHB2ENR: u32 = RCC + 0x34;
const APB1ENR: u32 = RCC + 0x40;
const APB2ENR: u32 = RCC + 0x44;
const DCKCFGR: u32 = RCC + 0x8C;
const PWR_CR: u32 = 0x4000_7000;
const FLASH_ACR: u32 = 0x4002_3C00;
const TIM5: u32 = 0x4000_0C00;

/// HSE and PLL on, 24 MHz / 24 * 336 / 2, and it is the system's clock: APB1 over 4, APB2 over 2.
const ARDUPILOT: &[Store] = &[
    Store::Word(CR, 0x0001_0083),
    Store::Wait(CR, 1 << 17),
    Store::Word(PLLCFGR, 0x0740_5418),
    Store::Word(FLASH_ACR, 0x705),
    Store::Word(CR, 0x0101_0083),
    Store::Wait(CR, 1 << 25),
    Store::Word(CFGR, 0x0000_9402),
    Store::Wait(CFGR, 0b10 << 2),
    Store::Word(AHB2ENR, 1 << 7),
    Store::Word(APB1ENR, 1 << 3),
    Store::Word(TIM5 + 0x28, 83),
    Store::Word(TIM5, 1),
    Store::Word(TIM5 + 0x0C, 1),
    // TIM5, USART2 and USART3; OTG_FS, pending.
    Store::Word(ISER + 4, 1 << 18 | 1 << 6 | 1 << 7),
    Store::Word(ISER + 8, 1 << 3),
    Store::Word(ISPR + 8, 1 << 3),
    Store::Word(APB1ENR, 0),
    Store::Word(APB2ENR, 0),
];

/// The same clocks by other factors, and everything else that can be in the way.
const HOSTILE: &[Store] = &[
    Store::Word(CR, 0x0001_0083),
    Store::Wait(CR, 1 << 17),
    Store::Word(PLLCFGR, 0x0740_3018),
    Store::Word(FLASH_ACR, 0x705),
    Store::Word(CR, 0x0101_0083),
    Store::Wait(CR, 1 << 25),
    Store::Word(CFGR, 0x0000_9482),
    Store::Wait(CFGR, 0b10 << 2),
    Store::Word(CIR, 0x0000_3F00),
    Store::Word(DCKCFGR, 1 << 24),
    Store::Word(APB1ENR, 1 << 28 | 1 << 3),
    Store::Word(PWR_CR, 0),
    Store::Word(TIM5 + 0x28, 6),
    Store::Word(TIM5, 1),
    Store::Word(ISER, u32::MAX),
    Store::Word(ISER + 4, u32::MAX),
    Store::Word(ISER + 8, u32::MAX),
    Store::Word(ISPR, u32::MAX),
    Store::Word(ISPR + 4, u32::MAX),
    Store::Word(ISPR + 8, u32::MAX),
    // SysTick: every 100 cycles, with its exception.
    Store::Word(0xE000_E014, 99),
    Store::Word(0xE000_E018, 0),
    Store::Word(0xE000_E010, 7),
    // ICSR: SysTick and PendSV are pending. AIRCR: no preemption. SCR: deep sleep, on exit, too. SHCSR:
    // all faults enabled.
    Store::Word(0xE000_ED04, 1 << 28 | 1 << 26),
    Store::Word(0xE000_ED0C, 0x05FA_0700),
    Store::Word(0xE000_ED10, 1 << 2 | 1 << 1),
    Store::Word(0xE000_ED24, 0b111 << 16),
];

/// The code, which is followed by the list: stores, a pair (0, 0), stretches of memory, another such
/// pair, and the last seven words.
const CODE: [u16; 46] = [
    0xB672, // cpsid i
    0xA416, // adr   r4, list
    0xCC03, // stores: ldm r4!, {r0, r1}
    0x2800, // cmp   r0, #0
    0xD009, // beq   memory
    0x07C2, // lsls  r2, r0, #31
    0xD401, // bmi   wait
    0x6001, // str   r1, [r0]
    0xE7F8, // b     stores
    0x3801, // wait: subs r0, #1
    0x6802, // again: ldr r2, [r0]
    0x400A, // ands  r2, r1
    0x428A, // cmp   r2, r1
    0xD1FB, // bne   again
    0xE7F2, // b     stores
    0xF04F, 0x325A, // memory: mov.w r2, #0x5A5A5A5A
    0x4613, // mov   r3, r2
    0xCC03, // next: ldm r4!, {r0, r1}
    0x2800, // cmp   r0, #0
    0xD004, // beq   jump
    0xC00C, // fill: stm r0!, {r2, r3}
    0xC00C, // stm   r0!, {r2, r3}
    0x4288, // cmp   r0, r1
    0xD3FB, // blo   fill
    0xE7F7, // b     next
    0xCC0F, // jump: ldm r4!, {r0, r1, r2, r3}
    0xCCE0, // ldm   r4!, {r5, r6, r7}
    0x602E, // str   r6, [r5]
    0xF380, 0x8810, // msr PRIMASK, r0
    0xF381, 0x8811, // msr BASEPRI, r1
    0xF382, 0x8813, // msr FAULTMASK, r2
    0x683D, // ldr   r5, [r7]
    0x687E, // ldr   r6, [r7, #4]
    0xF385, 0x8809, // msr PSP, r5
    0xF385, 0x8808, // msr MSP, r5
    0xF383, 0x8814, // msr CONTROL, r3
    0xF3BF, 0x8F6F, // isb
    0x4730, // bx    r6
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stand_in_fits_before_the_application_and_finds_its_list() {
        for bootloader in Bootloader::ALL {
            let bytes = bootloader.bytes();
            assert!(bytes.len() < (APPLICATION - FLASH) as usize);
            let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            assert_eq!((word(0), word(4)), (STACK, 0x0800_0009));
            // `adr` counts from the word behind its own next one.
            let adr = 8 + 2;
            let list = ((adr + 4) & !3) + 4 * usize::from(bytes[adr]);
            assert_eq!(list, 8 + 2 * CODE.len());
            assert_eq!(word(bytes.len() - 4), APPLICATION);
        }
    }
}
