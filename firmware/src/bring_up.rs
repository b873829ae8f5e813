//! From reset to a board whose time runs and whose lines are open.
//!
//! *Design.* Power for the connectors first, so that the receiver and the telemetry radio start while
//! this does; then clocks, the time, priorities, and last what is stamped or may interrupt. What
//! cannot be brought up ends the start with its reason in the log.

use cortex_m::peripheral::NVIC;
use sample_log::SampleLog;
use stm32f4xx_hal::gpio::PinState;
use stm32f4xx_hal::pac::{self, Interrupt};
use stm32f4xx_hal::prelude::*;

use crate::drivers::card::Card;
use crate::drivers::led::Led;
use crate::drivers::pulse::{self, Pulse};
use crate::drivers::sdio::{Pins, Sdio};
use crate::drivers::time;
use crate::lines::{self, Lines};
use crate::{board, executors, priorities, sample_memory};

/// What the tasks use of a board.
pub struct Hardware {
    /// The receiver's line, and MAVLink's.
    pub lines: Lines,
    /// The receiver's time pulse, on AUX5.
    pub pulse: Pulse,
    /// The log of a test, empty.
    pub samples: SampleLog<'static>,
    /// The slot of the SD card.
    pub card: Option<Card>,
    /// The amber LED.
    pub led: Led,
}

/// Brings the board up, once.
pub fn bring_up() -> Hardware {
    let (Some(mut core), Some(chip)) = (cortex_m::Peripherals::take(), pac::Peripherals::take())
    else {
        defmt::panic!("the board was brought up twice");
    };
    let mut rcc = chip.RCC.constrain();
    let gpioa = chip.GPIOA.split(&mut rcc);
    // nVDD_5V_PERIPH_EN feeds the receiver and the telemetry radio.
    let _powered = gpioa.pa8.into_push_pull_output_in_state(PinState::Low);
    let mut rcc = board::clocks(rcc);
    let gpioc = chip.GPIOC.split(&mut rcc);
    let gpiod = chip.GPIOD.split(&mut rcc);
    let gpioe = chip.GPIOE.split(&mut rcc);

    if let Err(refused) = time::start(core.SYST, &mut core.SCB, chip.TIM5, &mut rcc) {
        defmt::panic!("SysTick did not get its priority: {}", refused);
    }
    set_priorities(&mut core.NVIC);
    let lines = lines::start(
        (chip.UART4, chip.USART2),
        (gpioa.pa0, gpioa.pa1),
        (gpiod.pd5, gpiod.pd6),
        &mut rcc,
    );
    let pulse = pulse::start(chip.TIM4, gpiod.pd13, &mut rcc);
    let card = board::HAS_CARD_SLOT.then(|| {
        let pins = Pins {
            data: (gpioc.pc8, gpioc.pc9, gpioc.pc10, gpioc.pc11),
            clock: gpioc.pc12,
            command: gpiod.pd2,
        };
        Card::new(Sdio::new(chip.SDIO, chip.DMA2, pins, &mut rcc))
    });
    // SAFETY: this runs once, since the peripherals can be taken once.
    let samples = unsafe { sample_memory::samples() };
    Hardware {
        lines,
        pulse,
        samples,
        card,
        led: Led::new(gpioe.pe12),
    }
}

/// Gives each interrupt its place in [`priorities`]; SysTick and PendSV have theirs.
fn set_priorities(nvic: &mut NVIC) {
    for (interrupt, priority) in [
        (Interrupt::UART4, priorities::SERIAL),
        (Interrupt::USART2, priorities::SERIAL),
        (Interrupt::TIM4, priorities::PULSE),
        (executors::HIGH_INTERRUPT, priorities::EXECUTOR_HIGH),
        (executors::LOW_INTERRUPT, priorities::EXECUTOR_LOW),
    ] {
        // SAFETY: none of these interrupts is enabled yet, and no critical section depends on
        // priorities.
        unsafe { nvic.set_priority(interrupt, priority) };
    }
}
