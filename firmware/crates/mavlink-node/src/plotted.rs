//! What a ground station plots by itself: NAMED_VALUE_FLOAT.
//!
//! *Purpose.* How well the clock is known, beside the time itself, once a second: a person sees at a
//! glance what a SYSTEM_TIME does not say.
//!
//! *Design.* NAMED_VALUE_FLOAT is the message that MAVProxy, QGroundControl and Mission Planner
//! list and draw under its name without knowing it. A value that is not known is NaN.
//!
//! *Limits.* A name has 10 characters, a value 24 bits.

use mavlink::MessageData;
use mavlink::dialects::common::NAMED_VALUE_FLOAT_DATA;
use node_values::NodeTime;

use crate::frame::Frame;
use crate::node::Node;

/// A value of the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plotted {
    /// Half the width of the interval that holds UTC, in ns; NaN while the clock is unset.
    Uncertainty,
    /// How much faster than its crystal the clock runs, in ppb.
    Frequency,
    /// What steers the clock: 0 nothing, 1 the messages, 2 the pulse.
    Source,
    /// What is not proved, the sum of: 1 the second was never proved, 2 the second is
    /// contradicted, 4 no pulse proves where in the second it is, 8 no receiver steers.
    Unproved,
}

impl Plotted {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Uncertainty,
        Self::Frequency,
        Self::Source,
        Self::Unproved,
    ];

    /// Its name over MAVLink.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Uncertainty => "CLK_UNC_NS",
            Self::Frequency => "CLK_PPB",
            Self::Source => "CLK_SOURCE",
            Self::Unproved => "CLK_UNPROV",
        }
    }
}

impl Node {
    /// NAMED_VALUE_FLOAT: `value` of what is plotted at `time`.
    #[inline(never)]
    pub fn plot(&mut self, time: NodeTime, what: Plotted, value: f32) -> Frame {
        // u32 time, f32 value, 10 bytes of name.
        let mut payload = [0; 18];
        let fields = [time.boot_ms().to_le_bytes(), value.to_le_bytes()];
        let bytes = fields.into_iter().flatten().chain(what.name().bytes());
        for (place, byte) in payload.iter_mut().zip(bytes) {
            *place = byte;
        }
        let kind = (
            NAMED_VALUE_FLOAT_DATA::ID,
            NAMED_VALUE_FLOAT_DATA::EXTRA_CRC,
        );
        self.sender
            .bytes(self.version, kind, &payload, payload.len())
    }
}
