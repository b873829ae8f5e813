//! The two serial lines, with their UARTs, rings and interrupts: the receiver at UART4, MAVLink at
//! USART2 (the connectors GPS and TELEM1 of a Pixhawk 1).

use cortex_m::peripheral::NVIC;
use heapless::spsc::Queue;
use stm32f4xx_hal::gpio::{PA0, PA1, PD5, PD6};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{Interrupt, UART4, USART2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::Serial;

use crate::drivers::uart::{Incoming, Line, Reader, Writer};
use crate::settings;

/// A line over the given UART, whose outgoing ring holds one byte less than `$outgoing`.
macro_rules! line {
    ($name:ident, $uart:ident, $outgoing:literal) => {
        static $name: Line = {
            static INCOMING: Incoming = Incoming::new();
            static mut OUTGOING: Queue<u8, $outgoing> = Queue::new();
            // SAFETY: the rings are named nowhere else, so that this is the only use of the first
            // and the only split of the second. The UART is consumed by `start`.
            #[expect(static_mut_refs, reason = "split once, here, at compile time")]
            unsafe {
                Line::new(
                    $uart::ptr().cast(),
                    Interrupt::$uart,
                    &INCOMING,
                    OUTGOING.split_const(),
                )
            }
        };
    };
}

// Room for the longest configuration frame.
line!(GNSS, UART4, 128);
// Room for a second's broadcasts and the answers to a flood of requests.
line!(MAVLINK, USART2, 1024);

/// The tasks' ends of the lines.
pub struct Lines {
    /// The receiver's.
    pub gnss: (Reader, Writer),
    /// MAVLink's.
    pub mavlink: (Reader, Writer),
}

/// Starts both lines, once. A connector with nothing in it would pick up noise, so a resistor holds each receiving
/// pin at the level of an idle line. The time runs already, and the interrupts have their priorities.
pub fn start(
    (uart4, usart2): (UART4, USART2),
    gps_pins: (PA0, PA1),
    telem1_pins: (PD5, PD6),
    rcc: &mut Rcc,
) -> Lines {
    // Changing a pin's function leaves its resistor.
    let gps_pins = (gps_pins.0, gps_pins.1.into_pull_up_input());
    let telem1_pins = (telem1_pins.0, telem1_pins.1.into_pull_up_input());
    let gnss = Serial::<_, u8>::new(uart4, gps_pins, settings::GPS_BAUD.bps(), rcc);
    let mavlink = Serial::<_, u8>::new(usart2, telem1_pins, settings::MAVLINK_BAUD.bps(), rcc);
    if gnss.is_err() || mavlink.is_err() {
        panic!(
            "{} or {} Bd cannot be made from the bus clock",
            settings::GPS_BAUD,
            settings::MAVLINK_BAUD
        );
    }
    for interrupt in [Interrupt::UART4, Interrupt::USART2] {
        // SAFETY: the rings that the handlers use exist since compile time.
        unsafe { NVIC::unmask(interrupt) };
    }
    let clock_hz = rcc.clocks.pclk1().raw();
    let (Some(gnss), Some(mavlink)) = (GNSS.open(clock_hz), MAVLINK.open(clock_hz)) else {
        panic!("a line was opened twice");
    };
    Lines { gnss, mavlink }
}

/// Wakes each task whose ring has bytes worth waking it for.
pub fn wake_readers() {
    GNSS.wake_reader();
    MAVLINK.wake_reader();
}

#[interrupt]
fn UART4() {
    // SAFETY: this is the line's one handler.
    unsafe { GNSS.on_interrupt() }
}

#[interrupt]
fn USART2() {
    // SAFETY: this is the line's one handler.
    unsafe { MAVLINK.on_interrupt() }
}
