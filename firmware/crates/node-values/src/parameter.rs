//! The read-only parameters of a node: their names, for both ends of a line, and where the values are.
//!
//! *Limits.* Each value is a whole number below 2^24, which a REAL32 holds exactly.

use crate::text::Name;

/// A parameter of a node. Its index is its place here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// How the image was built: 0 pixclock, 1 the paper's default, 2 its step I, 3 its step II.
    Variant,
    /// From one tick to the next, in µs.
    TickUs,
    /// The rate of the receiver's line, in baud.
    GpsBaud,
    /// What steers the clock now: 0 nothing, 1 the message, 2 the pulse.
    Source,
    /// Samples in the log now.
    LogLen,
    /// Samples that found the log full since it was cleared.
    LogMissed,
    /// Why the run before ended: 0 without a fault, otherwise the number that a stopped board's LED flashes.
    Fault,
    /// The receiver's device id: PX4's 24 bits, all of which a REAL32 holds.
    GnssId,
    /// How it is: 0 nothing is known, 1 it works, 2 it does not.
    GnssState,
    /// The memory card's.
    CardId,
    /// How it was at its last use.
    CardState,
    /// USB's.
    UsbId,
    /// Whether a host has sent something.
    UsbState,
    /// The id of the device that steers the clock; 0 while none does.
    ClockPrime,
}

impl Parameter {
    /// All of them, in the order of their indices.
    pub const ALL: [Self; 14] = [
        Self::Variant,
        Self::TickUs,
        Self::GpsBaud,
        Self::Source,
        Self::LogLen,
        Self::LogMissed,
        Self::Fault,
        Self::GnssId,
        Self::GnssState,
        Self::CardId,
        Self::CardState,
        Self::UsbId,
        Self::UsbState,
        Self::ClockPrime,
    ];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Variant => "PC_VARIANT",
            Self::TickUs => "PC_TICK_US",
            Self::GpsBaud => "PC_GPS_BAUD",
            Self::Source => "PC_SOURCE",
            Self::LogLen => "PC_LOG_LEN",
            Self::LogMissed => "PC_LOG_MISSED",
            Self::Fault => "PC_FAULT",
            Self::GnssId => "PC_GNSS_ID",
            Self::GnssState => "PC_GNSS_STATE",
            Self::CardId => "PC_CARD_ID",
            Self::CardState => "PC_CARD_STATE",
            Self::UsbId => "PC_USB_ID",
            Self::UsbState => "PC_USB_STATE",
            Self::ClockPrime => "PC_CLOCK_PRIME",
        }
    }

    /// Its index.
    #[must_use]
    pub const fn index(self) -> u16 {
        self as u16
    }

    /// The parameter of that name.
    #[must_use]
    #[inline(never)]
    pub fn named(name: Name) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|parameter| Name::from(parameter.name()) == name)
    }
}

/// Where a node finds the values of its parameters.
pub trait Parameters {
    /// The value of a parameter.
    fn parameter(&self, parameter: Parameter) -> f32;
}
