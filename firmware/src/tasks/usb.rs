//! The USB device: what the host asks it, and what happens on the bus.

use crate::drivers::usb::Device;

/// Runs forever, on the high executor, where the port is used too.
#[embassy_executor::task]
pub async fn run(device: Device) {
    device.run().await;
}
