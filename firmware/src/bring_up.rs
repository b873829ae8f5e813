//! From reset to a board whose time runs and whose lines are open.
//!
//! *Design.* First what a bootloader may have left running is stopped ([`board::take_over`]); the core's
//! own state was set by [`reset`](crate::reset). Power for the connectors first, so that the receiver and the telemetry radio start while
//! this does; then clocks, the time, priorities, interrupts, and last what is stamped or may interrupt. What
//! cannot be brought up ends the start with its reason in the log.

use cortex_m::peripheral::NVIC;
use sample_log::SampleLog;
use stm32f4xx_hal::gpio::{Input, PD4, PD12, PinState};
use stm32f4xx_hal::pac::{self, Interrupt};
use stm32f4xx_hal::prelude::*;

use crate::board::CrystalStart;
use crate::drivers::card::Card;
use crate::drivers::led::Led;
use crate::drivers::pulse::{self, Pulse};
use crate::drivers::sdio::{Pins, Sdio};
use crate::drivers::time::{self, NotStarted};
use crate::drivers::usb::{self, Device, Port};
use crate::drivers::{backup, freeze, watchdog};
use crate::lines::{self, Lines};
use crate::{board, executors, fault, priorities, sample_memory};

/// What the tasks use of a board.
pub struct Hardware {
    /// The receiver's line, and MAVLink's two.
    pub lines: Lines,
    /// The receiver's time pulse, on AUX5.
    pub pulse: Pulse,
    /// The log of a test, empty.
    pub samples: SampleLog<'static>,
    /// The slot of the SD card.
    pub card: Option<Card>,
    /// The USB device, and its port.
    pub usb: Option<(Device, Port)>,
    /// The amber LED.
    pub led: Led,
    /// RTS of TELEM1 and of TELEM2, held high by resistors.
    pub ready: (PD4<Input>, PD12<Input>),
    /// How the crystal has started.
    pub crystal: CrystalStart,
}

/// Brings the board up, once.
pub fn bring_up() -> Hardware {
    let (Some(mut core), Some(chip)) = (cortex_m::Peripherals::take(), pac::Peripherals::take())
    else {
        panic!("the board was brought up twice");
    };
    board::take_over(&chip.RCC);
    freeze::with_the_core();
    watchdog::start();
    backup::open();
    let mut rcc = chip.RCC.constrain();
    let gpioa = chip.GPIOA.split(&mut rcc);
    let gpiod = chip.GPIOD.split(&mut rcc);
    // A radio's CTS has a level before the radio has power, but none that is driven.
    let ready = (
        gpiod.pd4.into_pull_up_input(),
        gpiod.pd12.into_pull_up_input(),
    );
    // nVDD_5V_PERIPH_EN feeds the receiver and the telemetry radios.
    let _powered = gpioa.pa8.into_push_pull_output_in_state(PinState::Low);
    let Ok((mut rcc, crystal)) = board::clocks(rcc) else {
        fault::crystal_failed()
    };
    let gpioc = chip.GPIOC.split(&mut rcc);
    let gpioe = chip.GPIOE.split(&mut rcc);

    match time::start(core.SYST, &mut core.SCB, chip.TIM5, &mut rcc) {
        Ok(()) => {}
        Err(NotStarted::Priority { wanted, found }) => {
            panic!("SysTick has priority {found}, not {wanted}")
        }
        Err(NotStarted::Ratio { wanted, found }) => {
            panic!("TIM5 counts {found} in a ms of SysTick, not {wanted}")
        }
    }
    set_priorities(&mut core.NVIC);
    // SAFETY: every interrupt that is enabled has its handler and its priority.
    unsafe { cortex_m::interrupt::enable() };
    let lines = lines::start(
        (chip.UART4, chip.USART2, chip.USART3),
        (gpioa.pa0, gpioa.pa1),
        (gpiod.pd5, gpiod.pd6),
        (gpiod.pd8, gpiod.pd9),
        &mut rcc,
    );
    let pulse = pulse::start(chip.TIM4, gpiod.pd13, &mut rcc);
    #[cfg(loaded)]
    crate::load::start(chip.TIM2, chip.TIM3, &mut core.NVIC, &mut rcc);
    let card = board::HAS_CARD_SLOT.then(|| {
        let pins = Pins {
            data: (gpioc.pc8, gpioc.pc9, gpioc.pc10, gpioc.pc11),
            clock: gpioc.pc12,
            command: gpiod.pd2,
        };
        Card::new(Sdio::new(chip.SDIO, chip.DMA2, pins, &mut rcc))
    });
    let usb = board::HAS_USB.then(|| {
        let pins = usb::Pins {
            data: (gpioa.pa11, gpioa.pa12),
            vbus: gpioa.pa9,
        };
        usb::start(chip.OTG_FS_GLOBAL, pins, &mut rcc)
    });
    // SAFETY: this runs once, since the peripherals can be taken once.
    let samples = unsafe { sample_memory::samples() };
    Hardware {
        lines,
        pulse,
        samples,
        card,
        usb,
        led: Led::new(gpioe.pe12),
        ready,
        crystal,
    }
}

/// Gives each interrupt its place in [`priorities`]; SysTick and PendSV have theirs.
fn set_priorities(nvic: &mut NVIC) {
    for (interrupt, priority) in [
        (Interrupt::TIM5, priorities::WATCH),
        (Interrupt::UART4, priorities::SERIAL),
        (Interrupt::USART2, priorities::SERIAL),
        (Interrupt::USART3, priorities::SERIAL),
        (Interrupt::OTG_FS, priorities::USB),
        (Interrupt::TIM4, priorities::PULSE),
        (executors::HIGH_INTERRUPT, priorities::EXECUTOR_HIGH),
        (executors::LOW_INTERRUPT, priorities::EXECUTOR_LOW),
        #[cfg(loaded)]
        (executors::MAVLINK_INTERRUPT, priorities::EXECUTOR_MAVLINK),
    ] {
        // SAFETY: none of these interrupts is enabled yet, and no critical section depends on
        // priorities.
        unsafe { nvic.set_priority(interrupt, priority) };
    }
}
