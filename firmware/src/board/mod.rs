//! The boards: what `main` is given, and how it comes up.
//!
//! *Design.* Pins, lines and interrupts are those of the Pixhawk 1 (PX4
//! `boards/px4/fmu-v2`, ArduPilot `hwdef/fmuv3`) on every board; a board's file
//! has its clocks, and how its two counters stand to each other. Exactly one of
//! them is in an image.

use cortex_m::peripheral::{NVIC, SCB};
use sample_log::SampleLog;
use stm32f4xx_hal::gpio::{ErasedPin, OpenDrain, Output, PinState};
use stm32f4xx_hal::pac::{self, Interrupt, TIM5};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Enable as _, Reset as _};
use stm32f4xx_hal::serial::Serial;

use crate::drivers::card::Card;
use crate::drivers::pulse::{self, Pulse};
use crate::drivers::sdio::{Pins, Sdio};
use crate::drivers::time;
use crate::drivers::uart::{Reader, Writer};
use crate::{priorities, settings};

mod lines;
mod spare;
#[cfg_attr(feature = "pixhawk1", path = "pixhawk1.rs")]
#[cfg_attr(feature = "qemu", path = "qemu.rs")]
mod this;

pub use lines::wake_readers;
pub use this::{NAME, WITNESS_RATIO, read_pair};

/// The MAVLink line, in Bd.
const MAVLINK_BAUD: u32 = 115_200;

/// The interrupts that the executors run in: those of the camera interface and the
/// second CAN, which this firmware has no use for.
pub const EXECUTOR_HIGH: Interrupt = Interrupt::DCMI;
/// See [`EXECUTOR_HIGH`].
pub const EXECUTOR_LOW: Interrupt = Interrupt::CAN2_TX;

/// Everything that the tasks use of a board.
pub struct Board {
    /// The receiver's line.
    pub gnss: (Reader, Writer),
    /// The MAVLink line.
    pub mavlink: (Reader, Writer),
    /// The receiver's time pulse, on AUX5.
    pub pulse: Pulse,
    /// The log of a test, empty.
    pub samples: SampleLog<'static>,
    /// The slot of the SD card.
    pub card: Option<Card>,
    /// The amber LED, lit when low.
    pub led: ErasedPin<Output<OpenDrain>>,
}

/// Brings the board up: power for the connectors first, then clocks, pins, lines
/// and the tick. Stops with its reason in the log when that cannot be done.
pub fn init() -> Board {
    let (Some(mut core), Some(chip)) = (cortex_m::Peripherals::take(), pac::Peripherals::take())
    else {
        defmt::panic!("the board was brought up twice");
    };
    let mut rcc = chip.RCC.constrain();
    let gpioa = chip.GPIOA.split(&mut rcc);
    // nVDD_5V_PERIPH_EN: feeds the receiver and the telemetry radio. They start up
    // while we do.
    let _powered = gpioa.pa8.into_push_pull_output_in_state(PinState::Low);
    let mut rcc = this::clocks(rcc);

    let gpiod = chip.GPIOD.split(&mut rcc);
    let gpioe = chip.GPIOE.split(&mut rcc);
    let (gps, telem1) = ((gpioa.pa0, gpioa.pa1), (gpiod.pd5, gpiod.pd6));
    let gnss = Serial::<_, u8>::new(chip.UART4, gps, settings::GPS_BAUD.bps(), &mut rcc);
    let mavlink = Serial::<_, u8>::new(chip.USART2, telem1, MAVLINK_BAUD.bps(), &mut rcc);
    if gnss.is_err() || mavlink.is_err() {
        defmt::panic!(
            "{} or {} Bd cannot be made from the bus clock",
            settings::GPS_BAUD,
            MAVLINK_BAUD
        );
    }

    TIM5::enable(&mut rcc);
    TIM5::reset(&mut rcc);
    chip.TIM5
        .psc()
        .write(|w| w.psc().set(this::WITNESS_PRESCALER));
    // The prescaler counts from the next update on; this is one.
    chip.TIM5.egr().write(|w| w.ug().update());
    chip.TIM5.cr1().write(|w| w.cen().enabled());

    if let Err(refused) = time::start(core.SYST, &mut core.SCB, chip.TIM5) {
        defmt::panic!("SysTick did not get its priority: {}", refused);
    }
    for (interrupt, priority) in [
        (Interrupt::UART4, priorities::SERIAL),
        (Interrupt::USART2, priorities::SERIAL),
        (Interrupt::TIM4, priorities::PULSE),
        (EXECUTOR_HIGH, priorities::EXECUTOR_HIGH),
        (EXECUTOR_LOW, priorities::EXECUTOR_LOW),
    ] {
        // SAFETY: the priorities are those of the table; nothing is unmasked yet.
        unsafe { core.NVIC.set_priority(interrupt, priority) };
    }
    for interrupt in [Interrupt::UART4, Interrupt::USART2] {
        // SAFETY: the rings that their handlers use exist since compile time.
        unsafe { NVIC::unmask(interrupt) };
    }

    let pulse = pulse::start(chip.TIM4, gpiod.pd13, &mut rcc);
    let clock_hz = rcc.clocks.pclk1().raw();
    let (Some(gnss), Some(mavlink)) = (lines::GNSS.open(clock_hz), lines::MAVLINK.open(clock_hz))
    else {
        defmt::panic!("a line was opened twice");
    };
    let led = gpioe
        .pe12
        .into_open_drain_output_in_state(PinState::High)
        .erase();
    let gpioc = chip.GPIOC.split(&mut rcc);
    let card = this::HAS_CARD_SLOT.then(|| {
        let pins = Pins {
            data: (gpioc.pc8, gpioc.pc9, gpioc.pc10, gpioc.pc11),
            clock: gpioc.pc12,
            command: gpiod.pd2,
        };
        Card::new(Sdio::new(chip.SDIO, chip.DMA2, pins, &mut rcc))
    });
    // SAFETY: nobody comes here a second time, since the peripherals are taken once.
    let samples = unsafe { spare::samples() };
    Board {
        gnss,
        mavlink,
        pulse,
        samples,
        card,
        led,
    }
}

/// SCR.SLEEPONEXIT (ARM DUI 0553A, section 4.3.6): the core goes back to sleep as the last interrupt
/// returns, without a step at thread level.
const SLEEP_ON_EXIT: u32 = 1 << 1;

/// Thread level leaves everything to the interrupts until one of them calls [`wake_thread`] because
/// `is_wanted` has become true.
pub fn sleep_until(is_wanted: impl Fn() -> bool) {
    while !is_wanted() {
        // What wants us between the question and the bit would be slept over, so that both are one
        // step. An interrupt that comes meanwhile ends the wait and runs as soon as it may.
        critical_section::with(|_| {
            if !is_wanted() {
                // SAFETY: nothing is lost by sleeping on.
                unsafe { (*SCB::PTR).scr.modify(|scr| scr | SLEEP_ON_EXIT) };
                cortex_m::asm::wfi();
            }
        });
    }
}

/// Thread level goes on when the interrupts are through. From any interrupt.
pub fn wake_thread() {
    critical_section::with(|_| {
        // SAFETY: thread level sleeps in `sleep_until` and asks again.
        unsafe { (*SCB::PTR).scr.modify(|scr| scr & !SLEEP_ON_EXIT) };
    });
}
