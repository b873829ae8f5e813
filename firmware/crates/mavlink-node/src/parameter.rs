//! The read-only parameters of a node.
//!
//! *Purpose.* Their names, for both ends of the line, and which of their values are still to be
//! sent.
//!
//! *Design.* A request is noted as a bit for each parameter that it wants, so that a second request
//! costs nothing. The values are looked up and sent one at a time, when the line has room
//! ([`Node::poll`](crate::Node::poll)). All values are REAL32, which every client understands. Each
//! of ours is a whole number below 2^24, which such a value holds exactly.
//!
//! *Limits.* PARAM_SET changes nothing. It is answered with PARAM_ERROR, for clients that know it, and
//! with the present value, which is how MAVLink refused it before.

use core::fmt;

use mavlink::dialects::common::{MavParamType, PARAM_VALUE_DATA};

use crate::frame::{Frame, Sender, Version};

/// A parameter of a node. Its index over MAVLink is its place here.
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
}

impl Parameter {
    /// All of them, in the order of their indices.
    pub const ALL: [Self; 7] = [
        Self::Variant,
        Self::TickUs,
        Self::GpsBaud,
        Self::Source,
        Self::LogLen,
        Self::LogMissed,
        Self::Fault,
    ];

    /// Its name over MAVLink.
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
        }
    }

    /// Its index over MAVLink.
    #[must_use]
    pub const fn index(self) -> u16 {
        self as u16
    }

    /// The parameter of that name.
    #[must_use]
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

/// The parameters that are still to be sent.
#[derive(Debug)]
pub(crate) struct PendingParameters {
    version: Version,
    /// A bit for each, by index.
    bits: u8,
}

const _: () = assert!(Parameter::ALL.len() <= u8::BITS as usize);

impl PendingParameters {
    pub(crate) const NONE: Self = Self {
        version: Version::V1,
        bits: 0,
    };

    pub(crate) const fn all(&mut self, version: Version) {
        self.version = version;
        self.bits = (1 << Parameter::ALL.len()) - 1;
    }

    pub(crate) const fn one(&mut self, version: Version, parameter: Parameter) {
        self.version = version;
        self.bits |= 1 << parameter.index();
    }

    pub(crate) const fn is_none(&self) -> bool {
        self.bits == 0
    }

    pub(crate) fn poll(
        &mut self,
        sender: &mut Sender,
        parameters: &impl Parameters,
    ) -> Option<Frame> {
        let index = self.bits.trailing_zeros();
        let parameter = *Parameter::ALL.get(index as usize)?;
        self.bits &= !(1 << index);
        let value = PARAM_VALUE_DATA {
            param_value: parameters.parameter(parameter),
            param_count: Parameter::ALL.len() as u16,
            param_index: parameter.index(),
            param_id: Name::from(parameter.name()).0.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        };
        Some(sender.message(self.version, &value))
    }
}

/// A short text as MAVLink carries it: up to `N` bytes, zeros behind a shorter one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text<const N: usize>([u8; N]);

/// The name of a parameter.
pub type Name = Text<16>;

impl<const N: usize> Text<N> {
    pub(crate) const fn new(bytes: [u8; N]) -> Self {
        Self(bytes)
    }

    pub(crate) const fn bytes(&self) -> [u8; N] {
        self.0
    }

    /// The text, up to the first byte that is not UTF-8.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|&byte| byte == 0).unwrap_or(N);
        let bytes = self.0.get(..end).unwrap_or_default();
        bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid())
    }
}

impl<const N: usize> From<&str> for Text<N> {
    /// The first `N` bytes of `text`.
    fn from(text: &str) -> Self {
        let mut bytes = [0; N];
        for (place, byte) in bytes.iter_mut().zip(text.bytes()) {
            *place = byte;
        }
        Self(bytes)
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_str().fmt(f)
    }
}
