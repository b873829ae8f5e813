//! TELEM1's RTS: the radio learns that this side takes whatever it sends.
//!
//! *Design.* The pin is the radio's CTS. It is held by a resistor alone while the radio starts
//! ([`bring_up`](crate::bring_up)), because a level that is driven then can leave a SiK radio in its
//! bootloader; after that it is driven low, because the incoming ring is always emptied.

use embassy_time::Timer;
use stm32f4xx_hal::gpio::{Input, PD4, PinState};

/// A radio has started after this time. \[ms\]
const RADIO_STARTS_MS: u64 = 200;

/// Drives the pin once, on the low executor.
#[embassy_executor::task]
pub async fn run(pin: PD4<Input>) {
    Timer::after_millis(RADIO_STARTS_MS).await;
    pin.into_push_pull_output_in_state(PinState::Low);
}
