//! The amber LED shows the clock's state.
//!
//! | state | the LED |
//! |---|---|
//! | unset | five flashes a second |
//! | set | a short flash a second |
//! | holdover | a long flash a second |
//! | second not proved | two short flashes a second |

use embassy_time::Timer;
use timebase::ClockState;

use crate::clock;
use crate::drivers::led::Led;
use crate::drivers::time;

/// Runs forever, on the low executor.
#[embassy_executor::task]
pub async fn run(mut led: Led) {
    loop {
        // Lit and dark in turn, in ms.
        let pattern: &[u16] = match clock::reading_at(time::now()).state {
            ClockState::Unset => &[100, 100],
            ClockState::Set => &[50, 950],
            ClockState::Holdover => &[500, 500],
            ClockState::Unproved => &[50, 200, 50, 700],
        };
        // One await in the loop: each brings the whole of a timer.
        let mut is_lit = true;
        for &for_ms in pattern {
            led.set_lit(is_lit);
            is_lit = !is_lit;
            Timer::after_millis(for_ms.into()).await;
        }
    }
}
