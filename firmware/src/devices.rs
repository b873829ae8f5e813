//! What this board has: each device's id and how it is, as the parameters say it.
//!
//! *Limits.* What one task or thread level last reported: at most a second old. The card is known from its last use.

use device_id::{Condition, DeviceId, DeviceType};
use ubx_link::Finding;
use utc_clock::Source;

use crate::drivers::usb;
use crate::reports::{CARD, GNSS};

/// The receiver's line, UART4, is `ttyS3` under PX4.
const GPS_LINE: u8 = 3;
/// A receiver of u-blox that does not say which.
const UBLOX: u8 = 0xA5;

/// The receiver, and how it is.
#[inline(never)]
pub fn receiver() -> (DeviceId, Condition) {
    let finding = GNSS.get().map(|report| report.receiver.finding);
    let (device_type, condition) = match finding {
        None | Some(Finding::Searching | Finding::Silent) => (UBLOX, Condition::Unknown),
        Some(Finding::Unnamed) => (UBLOX, Condition::Works),
        Some(Finding::Used(identity)) => (identity.px4_device_type(), Condition::Works),
        Some(Finding::Unused(identity, _)) => (identity.px4_device_type(), Condition::Fails),
    };
    (
        DeviceId::receiver(GPS_LINE, DeviceType(device_type)),
        condition,
    )
}

/// How the memory card was at its last use.
pub fn card() -> Condition {
    match CARD.get().map(|report| report.not_saved) {
        None => Condition::Unknown,
        Some(None) => Condition::Works,
        Some(Some(_)) => Condition::Fails,
    }
}

/// Whether USB has a host that speaks.
pub fn usb() -> Condition {
    if usb::has_received() {
        Condition::Works
    } else {
        Condition::Unknown
    }
}

/// The number of the device that steers the clock; 0 while none does.
pub fn prime() -> u32 {
    match GNSS.get().map(|report| report.source) {
        None | Some(Source::Nothing) => 0,
        Some(Source::Message | Source::Pulse) => receiver().0.number(),
    }
}
