//! The two serial lines that every board has, with their rings and interrupts.

use heapless::spsc::Queue;
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{Interrupt, UART4, USART2};

use crate::drivers::uart::{Incoming, Line};

/// A line over the given UART: so many bytes, less one, may wait to leave.
macro_rules! line {
    ($name:ident, $uart:ident, $outgoing:literal) => {
        pub(super) static $name: Line = {
            static INCOMING: Incoming = Incoming::new();
            static mut OUTGOING: Queue<u8, $outgoing> = Queue::new();
            // SAFETY: the rings are named nowhere else, so that this is the only use of the one and
            // the only split of the other. The UART is ours: its peripheral is consumed by `init`.
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

// A configuration frame; a second's broadcasts and the answers to a flood of requests.
line!(GNSS, UART4, 128);
line!(MAVLINK, USART2, 1024);

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
