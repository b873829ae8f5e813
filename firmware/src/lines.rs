//! The serial lines, with their UARTs, rings and interrupts: the receiver at UART4, MAVLink at USART2
//! and USART3 (the connectors GPS, TELEM1 and TELEM2 of a Pixhawk 1).

use cortex_m::peripheral::NVIC;
use stm32f4xx_hal::gpio::{PA0, PA1, PD5, PD6, PD8, PD9};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{Interrupt, UART4, USART2, USART3};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::Serial;
use timebase::{Stamp, StampedByte};

use crate::drivers::ring::Ring;
use crate::drivers::uart::{INCOMING, Incoming, Line, Reader, Writer};
use crate::settings;

/// What an incoming ring holds before anything has come.
const NO_BYTES: [StampedByte; INCOMING] = [StampedByte {
    stamp: Stamp(0),
    byte: 0,
}; INCOMING];

/// A line over the given UART, whose outgoing ring holds `$outgoing` bytes.
macro_rules! line {
    ($name:ident, $uart:ident, $outgoing:literal) => {
        static $name: Line = {
            static INCOMING: Incoming = Incoming::new(NO_BYTES);
            static OUTGOING: Ring<[u8; $outgoing]> = Ring::new([0; $outgoing]);
            // SAFETY: the rings are named nowhere else. The UART is consumed by `start`.
            unsafe { Line::new($uart::ptr().cast(), Interrupt::$uart, &INCOMING, &OUTGOING) }
        };
    };
}

// Room for the longest configuration frame.
line!(GNSS, UART4, 128);
// Room for a second's broadcasts and the answers to a flood of requests.
line!(TELEM1, USART2, 1024);
line!(TELEM2, USART3, 1024);

/// The tasks' ends of the lines.
pub struct Lines {
    /// The receiver's.
    pub gnss: (Reader, Writer),
    /// TELEM1's.
    pub telem1: (Reader, Writer),
    /// TELEM2's.
    pub telem2: (Reader, Writer),
}

/// Starts the lines, once. A connector with nothing in it would pick up noise, so a resistor holds each receiving
/// pin at the level of an idle line. The time runs already, and the interrupts have their priorities.
pub fn start(
    (uart4, usart2, usart3): (UART4, USART2, USART3),
    gps_pins: (PA0, PA1),
    telem1_pins: (PD5, PD6),
    telem2_pins: (PD8, PD9),
    rcc: &mut Rcc,
) -> Lines {
    // Changing a pin's function leaves its resistor.
    let gps_pins = (gps_pins.0, gps_pins.1.into_pull_up_input());
    let telem1_pins = (telem1_pins.0, telem1_pins.1.into_pull_up_input());
    let telem2_pins = (telem2_pins.0, telem2_pins.1.into_pull_up_input());
    let gnss = Serial::<_, u8>::new(uart4, gps_pins, settings::GPS_BAUD.bps(), rcc);
    let telem1 = Serial::<_, u8>::new(usart2, telem1_pins, settings::MAVLINK_BAUD.bps(), rcc);
    let telem2 = Serial::<_, u8>::new(usart3, telem2_pins, settings::MAVLINK_BAUD.bps(), rcc);
    if gnss.is_err() || telem1.is_err() || telem2.is_err() {
        panic!(
            "{} or {} Bd cannot be made from the bus clock",
            settings::GPS_BAUD,
            settings::MAVLINK_BAUD
        );
    }
    for interrupt in [Interrupt::UART4, Interrupt::USART2, Interrupt::USART3] {
        // SAFETY: the rings that the handlers use exist since compile time.
        unsafe { NVIC::unmask(interrupt) };
    }
    let clock_hz = rcc.clocks.pclk1().raw();
    let open = |line: &'static Line| match line.open(clock_hz) {
        Some(ends) => ends,
        None => panic!("a line was opened twice"),
    };
    Lines {
        gnss: open(&GNSS),
        telem1: open(&TELEM1),
        telem2: open(&TELEM2),
    }
}

/// Wakes each task whose ring has bytes worth waking it for.
pub fn wake_readers() {
    GNSS.wake_reader();
    TELEM1.wake_reader();
    TELEM2.wake_reader();
}

#[interrupt]
fn UART4() {
    // SAFETY: this is the line's one handler.
    unsafe { GNSS.on_interrupt() }
}

#[interrupt]
fn USART2() {
    // SAFETY: this is the line's one handler.
    unsafe { TELEM1.on_interrupt() }
}

#[interrupt]
fn USART3() {
    // SAFETY: this is the line's one handler.
    unsafe { TELEM2.on_interrupt() }
}
