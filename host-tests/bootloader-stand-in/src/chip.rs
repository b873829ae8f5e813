//! The chip that it runs on.

use core::convert::Infallible;
use core::ptr;

use bootloader_stand_in::{APPLICATION, Board, is_bootable, serve};
use cortex_m::asm;
use cortex_m::peripheral::{NVIC, SCB};
use stm32f4xx_hal::pac::{self, Interrupt};

use crate::usb::Usb;

/// In the RTC's first backup register: stay.
const STAY: u32 = 0xB007_B007;
/// How long an upload is waited for while USB is plugged.
const PATIENCE_MS: u32 = 5_000;
/// From the answer to BOOT to the start of the application.
const LEAVE_MS: u32 = 100;

/// The unique id, the flash's size in KB, and the one-time programmable memory (RM0090, chapter 39 and
/// 3.8).
const UNIQUE_ID: u32 = 0x1FFF_7A10;
const FLASH_KB: u32 = 0x1FFF_7A22;
const ONE_TIME: u32 = 0x1FFF_7800;

/// The flash's sectors behind the first: their number as SNB has it, and their size (RM0090, table 6).
const SECTORS: [(u8, u32); 23] = {
    let mut sectors = [(0, 0); 23];
    let mut nth = 1;
    while nth < 24 {
        let size = match nth % 12 {
            0..=3 => 16 << 10,
            4 => 64 << 10,
            _ => 128 << 10,
        };
        // SNB has a gap of four numbers between the banks.
        let number = if nth < 12 { nth } else { nth + 4 };
        sectors[nth - 1] = (number as u8, size);
        nth += 1;
    }
    sectors
};

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    asm::udf()
}

#[cortex_m_rt::entry]
fn main() -> ! {
    cortex_m::interrupt::disable();
    let Some(chip) = pac::Peripherals::take() else {
        asm::udf()
    };
    let is_asked = take_request(&chip);
    let mut board = Pixhawk::start(chip);
    let is_plugged = board.is_plugged();
    if is_asked || is_plugged || !is_bootable(&board) {
        loop {
            let patience_ms = (!is_asked && is_bootable(&board)).then_some(PATIENCE_MS);
            // The line cannot be gone.
            let Ok(()) = serve(&mut board, patience_ms);
            if is_bootable(&board) {
                break;
            }
        }
        board.wait(LEAVE_MS);
    }
    board.leave()
}

/// Whether the application has asked for the bootloader; it is told once.
fn take_request(chip: &pac::Peripherals) -> bool {
    chip.RCC.apb1enr().modify(|_, w| w.pwren().enabled());
    let is_asked = chip.RTC.bkpr(0).read().bits() == STAY;
    if is_asked {
        chip.PWR.cr().modify(|_, w| w.dbp().set_bit());
        chip.RTC.bkpr(0).reset();
        chip.PWR.cr().modify(|_, w| w.dbp().clear_bit());
    }
    chip.RCC.apb1enr().modify(|_, w| w.pwren().disabled());
    is_asked
}

/// The interrupts that end a wait.
const WAKING: [Interrupt; 4] = [
    Interrupt::USART2,
    Interrupt::TIM2,
    Interrupt::FLASH,
    Interrupt::OTG_FS,
];

struct Pixhawk {
    chip: pac::Peripherals,
    usb: Usb,
    /// The last byte came over USB.
    is_on_usb: bool,
}

impl Pixhawk {
    fn start(chip: pac::Peripherals) -> Self {
        chip.RCC
            .ahb1enr()
            .modify(|_, w| w.gpioaen().enabled().gpioden().enabled());
        chip.RCC
            .apb1enr()
            .modify(|_, w| w.usart2en().enabled().tim2en().enabled());
        // PD5 and PD6 are USART2's in alternate function 7.
        chip.GPIOD
            .afrl()
            .modify(|_, w| w.afrl5().af7().afrl6().af7());
        chip.GPIOD
            .moder()
            .modify(|_, w| w.moder5().alternate().moder6().alternate());
        // 16 MHz / 139 = 115 108 Bd.
        chip.USART2
            .brr()
            .write(|w| w.div_mantissa().set(8).div_fraction().set(11));
        chip.USART2.cr1().write(|w| {
            w.ue()
                .enabled()
                .te()
                .enabled()
                .re()
                .enabled()
                .rxneie()
                .enabled()
        });
        // An update each ms.
        chip.TIM2.psc().write(|w| w.psc().set(15));
        chip.TIM2.arr().write(|w| w.arr().set(999));
        chip.TIM2.dier().write(|w| w.uie().enabled());
        // PA11 and PA12 are OTG_FS's in alternate function 10.
        chip.GPIOA
            .afrh()
            .modify(|_, w| w.afrh11().af10().afrh12().af10());
        chip.GPIOA
            .moder()
            .modify(|_, w| w.moder11().alternate().moder12().alternate());
        chip.RCC.ahb2enr().modify(|_, w| w.otgfsen().enabled());
        let Some(usb) = Usb::start() else { asm::udf() };
        for interrupt in WAKING {
            // SAFETY: PRIMASK is set, so no handler runs.
            unsafe { NVIC::unmask(interrupt) };
        }
        Self {
            chip,
            usb,
            is_on_usb: false,
        }
    }

    /// Whether USB's supply is there: at PA9, or as OTG_FS senses it.
    fn is_plugged(&self) -> bool {
        let is_sensed = self.chip.OTG_FS_GLOBAL.gotgctl().read().bsvld().bit();
        is_sensed || self.chip.GPIOA.idr().read().idr9().is_high()
    }

    /// Counts ms from now on.
    fn begin_ms(&self) {
        let timer = &self.chip.TIM2;
        timer.cr1().reset();
        timer.cnt().reset();
        timer.egr().write(|w| w.ug().update());
        timer.sr().reset();
        NVIC::unpend(Interrupt::TIM2);
        timer.cr1().write(|w| w.cen().enabled());
    }

    /// Whether a ms has passed since the last one that was taken.
    fn take_ms(&self) -> bool {
        let has_passed = self.chip.TIM2.sr().read().uif().is_update_pending();
        if has_passed {
            self.chip.TIM2.sr().reset();
            NVIC::unpend(Interrupt::TIM2);
        }
        has_passed
    }

    /// Waits; what a host asks meanwhile is answered, and what is left of an answer leaves.
    fn wait(&mut self, ms: u32) {
        self.begin_ms();
        for _ in 0..ms {
            while !self.take_ms() {
                self.usb.poll();
                NVIC::unpend(Interrupt::OTG_FS);
                asm::wfi();
            }
        }
    }

    fn erase_sector(&self, number: u8) {
        let flash = &self.chip.FLASH;
        self.unlock();
        flash.cr().modify(|_, w| {
            // SAFETY: a sector of this chip, behind the bootloader's.
            unsafe { w.snb().bits(number) };
            w.ser().set_bit().psize().psize32().eopie().set_bit()
        });
        // A ms that has passed, or a host that asks, would end each wait at once, and the erase would be one of looks
        // alone.
        NVIC::mask(Interrupt::OTG_FS);
        self.chip.TIM2.cr1().reset();
        self.chip.TIM2.sr().reset();
        NVIC::unpend(Interrupt::TIM2);
        flash.cr().modify(|_, w| w.strt().set_bit());
        while flash.sr().read().bsy().bit() {
            asm::wfi();
        }
        // Each flag is cleared by a 1.
        flash.sr().write(|w| w.eop().clear_bit_by_one());
        NVIC::unpend(Interrupt::FLASH);
        // SAFETY: PRIMASK is set, so no handler runs.
        unsafe { NVIC::unmask(Interrupt::OTG_FS) };
        flash.cr().write(|w| w.lock().set_bit());
    }

    fn unlock(&self) {
        if self.chip.FLASH.cr().read().lock().bit() {
            for key in [0x4567_0123, 0xCDEF_89AB] {
                // SAFETY: the two keys (RM0090, 3.6.1).
                self.chip.FLASH.keyr().write(|w| unsafe { w.bits(key) });
            }
        }
    }

    /// Starts the application in a chip that is as after a reset.
    fn leave(self) -> ! {
        let Self { chip, .. } = self;
        for interrupt in WAKING {
            NVIC::mask(interrupt);
            NVIC::unpend(interrupt);
        }
        chip.RCC
            .apb1rstr()
            .write(|w| w.usart2rst().reset().tim2rst().reset());
        chip.RCC.apb1rstr().reset();
        chip.RCC
            .ahb1rstr()
            .write(|w| w.gpioarst().reset().gpiodrst().reset());
        chip.RCC.ahb1rstr().reset();
        chip.RCC.ahb2rstr().write(|w| w.otgfsrst().reset());
        chip.RCC.ahb2rstr().reset();
        chip.RCC.ahb2enr().reset();
        chip.RCC.apb1enr().reset();
        chip.RCC.ahb1enr().reset();
        // SAFETY: the application has been found to have vectors; interrupts are as after a reset.
        unsafe {
            (*SCB::PTR).vtor.write(APPLICATION);
            cortex_m::interrupt::enable();
            asm::bootload(APPLICATION as *const u32)
        }
    }
}

/// The word at an address that the chip has memory at.
fn word_at(address: u32) -> u32 {
    // SAFETY: callers name flash, the one-time programmable memory, or the unique id. Volatile, since
    // programming changes it.
    unsafe { ptr::with_exposed_provenance::<u32>(address as usize).read_volatile() }
}

impl Board for Pixhawk {
    type Gone = Infallible;

    fn receive(&mut self, within_ms: Option<u32>) -> Result<Option<u8>, Infallible> {
        let mut left_ms = within_ms;
        self.begin_ms();
        loop {
            if self.chip.USART2.sr().read().rxne().bit() {
                let byte = self.chip.USART2.dr().read().dr().bits();
                NVIC::unpend(Interrupt::USART2);
                self.is_on_usb = false;
                return Ok(Some(byte as u8));
            }
            self.usb.poll();
            NVIC::unpend(Interrupt::OTG_FS);
            if let Some(byte) = self.usb.receive() {
                self.is_on_usb = true;
                return Ok(Some(byte));
            }
            if self.take_ms()
                && let Some(left) = &mut left_ms
            {
                // A limit of n ms ends between n and n + 1, as the original's does.
                match left.checked_sub(1) {
                    Some(fewer) => *left = fewer,
                    None => return Ok(None),
                }
            }
            asm::wfi();
        }
    }

    fn send(&mut self, byte: u8) -> Result<(), Infallible> {
        if self.is_on_usb {
            // A host that does not read loses answers.
            self.begin_ms();
            while !self.usb.send(byte) && !self.take_ms() {
                self.usb.poll();
            }
            self.usb.poll();
            return Ok(());
        }
        while !self.chip.USART2.sr().read().txe().bit() {}
        self.chip.USART2.dr().write(|w| w.dr().set(byte.into()));
        Ok(())
    }

    fn erase(&mut self) {
        let mut start = 0;
        for (number, size) in SECTORS {
            let is_blank = (start..start + size)
                .step_by(4)
                .all(|offset| self.word(offset) == u32::MAX);
            if !is_blank {
                self.erase_sector(number);
            }
            start += size;
            if start >= self.room() {
                break;
            }
        }
    }

    fn program(&mut self, offset: u32, word: u32) {
        let flash = &self.chip.FLASH;
        self.unlock();
        flash.cr().modify(|_, w| w.pg().set_bit().psize().psize32());
        let address = (APPLICATION + offset) as usize;
        // SAFETY: a word of the application's flash, which nothing refers to.
        unsafe { ptr::with_exposed_provenance_mut::<u32>(address).write_volatile(word) };
        asm::dsb();
        while flash.sr().read().bsy().bit() {}
        flash.cr().write(|w| w.lock().set_bit());
    }

    fn word(&self, offset: u32) -> u32 {
        word_at(APPLICATION + offset)
    }

    fn room(&self) -> u32 {
        match word_at(FLASH_KB & !3) >> 16 {
            2_048 => 2_080_768,
            _ => 1_032_192,
        }
    }

    fn serial(&self, offset: u32) -> u32 {
        word_at(UNIQUE_ID + offset.min(8))
    }

    fn one_time(&self, offset: u32) -> u32 {
        word_at(ONE_TIME + (offset & 0x1FC))
    }

    fn chip(&self) -> u32 {
        self.chip.DBGMCU.idcode().read().bits()
    }
}
