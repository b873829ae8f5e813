//! RTS of the telemetry connectors: a radio learns that this side takes whatever it sends.
//!
//! *Design.* Each pin is its radio's CTS. It is held by a resistor alone while the radio starts
//! ([`bring_up`](crate::bring_up)), because a level that is driven then can leave a SiK radio in its
//! bootloader; after that it is driven low, because the incoming ring is always emptied.

use embassy_time::Timer;
use stm32f4xx_hal::gpio::{Input, PD4, PD12, PinState};

/// A radio has started after this time. \[ms\]
const RADIO_STARTS_MS: u64 = 200;

/// Drives the pins once, on the low executor.
#[embassy_executor::task]
pub async fn run(pins: (PD4<Input>, PD12<Input>)) {
    let (telem1, telem2) = pins;
    Timer::after_millis(RADIO_STARTS_MS).await;
    telem1.into_push_pull_output_in_state(PinState::Low);
    telem2.into_push_pull_output_in_state(PinState::Low);
}
