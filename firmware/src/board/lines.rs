//! The two serial lines that every board has, with their rings and interrupts.

use heapless::spsc::Queue;
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{Interrupt, UART4, USART2};
use timebase::StampedByte;

use crate::drivers::uart::Line;

/// A line over the given UART: rings of so many bytes, less one, each way.
macro_rules! line {
    ($name:ident, $uart:ident, incoming: $incoming:literal, outgoing: $outgoing:literal) => {
        pub(super) static $name: Line = {
            static mut INCOMING: Queue<StampedByte, $incoming> = Queue::new();
            static mut OUTGOING: Queue<u8, $outgoing> = Queue::new();
            // SAFETY: the rings are named nowhere else, so that this is their only
            // split. The UART is ours: its peripheral is consumed by `init`.
            #[expect(static_mut_refs, reason = "split once, here, at compile time")]
            unsafe {
                Line::new(
                    $uart::ptr().cast(),
                    Interrupt::$uart,
                    INCOMING.split_const(),
                    OUTGOING.split_const(),
                )
            }
        };
    };
}

// A task empties its ring within 6 ms. The room is for one that is held up: 22 ms at
// 115200.
line!(GNSS, UART4, incoming: 256, outgoing: 256);
line!(MAVLINK, USART2, incoming: 256, outgoing: 1024);

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
