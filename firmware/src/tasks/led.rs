//! The amber LED tells the clock's state to whoever looks at the board.
//!
//! | state | the LED |
//! |---|---|
//! | unset | five flashes a second |
//! | set | a short flash a second |
//! | holdover | a long flash a second |

use embassy_time::Timer;
use stm32f4xx_hal::gpio::{ErasedPin, OpenDrain, Output, PinState};
use utc_clock::ClockState;

use crate::drivers::time;
use crate::shared;

/// Runs for ever, on the patient executor.
#[embassy_executor::task]
pub async fn run(mut led: ErasedPin<Output<OpenDrain>>) {
    loop {
        let (lit_ms, dark_ms) = match shared::reading_at(time::now()).state {
            ClockState::Unset => (100, 100),
            ClockState::Set => (50, 950),
            ClockState::Holdover => (500, 500),
        };
        // One await in the loop: each brings the whole of a timer.
        for (state, for_ms) in [(PinState::Low, lit_ms), (PinState::High, dark_ms)] {
            led.set_state(state);
            Timer::after_millis(for_ms).await;
        }
    }
}
