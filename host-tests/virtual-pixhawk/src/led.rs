//! The amber LED, seen from outside.

use crate::run::Pixhawk;

/// GPIOE's output data (RM0090 8.4.6); the LED is at PE12 and lit when that is low.
const GPIOE_ODR: u64 = 0x4002_1000 + 0x14;
const ODR12: u32 = 1 << 12;

impl Pixhawk {
    /// Whether the LED is lit now.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn is_led_lit(&mut self) -> anyhow::Result<bool> {
        Ok(self.peek(GPIOE_ODR)? & ODR12 == 0)
    }
}
