//! The amber LED shows the clock's state.
//!
//! | state | the LED |
//! |---|---|
//! | unset | five flashes a second |
//! | set | a short flash a second |
//! | holdover | a long flash a second |

use embassy_time::Timer;
use timebase::ClockState;

use crate::clock;
use crate::drivers::led::Led;
use crate::drivers::time;

/// Runs forever, on the low executor.
#[embassy_executor::task]
pub async fn run(mut led: Led) {
    loop {
        let (lit_ms, dark_ms) = match clock::reading_at(time::now()).state {
            ClockState::Unset => (100, 100),
            ClockState::Set => (50, 950),
            ClockState::Holdover => (500, 500),
            ClockState::Unproved => (950, 50),
        };
        // One await in the loop: each brings the whole of a timer.
        for (is_lit, for_ms) in [(true, lit_ms), (false, dark_ms)] {
            led.set_lit(is_lit);
            Timer::after_millis(for_ms).await;
        }
    }
}
