//! The data of each message that is sent.

use node_values::{Name, Parameter, Severity};
use stanag_wire::{Builder, Header, Layout, MAX_FRAME, NodeId, Sum, TimeStamp};
use timebase::{Cycles, divide};

use crate::clock::Reading;
use crate::message as m;
use crate::node::Config;
use crate::request::{LOI_2, Request};

/// Acknowledgement Type: it has arrived.
const RECEIVED: u64 = 1;
/// The longest frame that is sent, an alert: all of its fields, wrapper and sum. \[bytes\]
const MAX_ANSWER: usize = 132;
const _: () = assert!(MAX_ANSWER <= MAX_FRAME);
const NS_PER_MS: u64 = 1_000_000;
/// Subsystem IDs of an alert: the clock's, and the node's own.
pub(crate) const NAVIGATION: u64 = 5;
pub(crate) const VSM: u64 = 9;

/// A frame to send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    bytes: [u8; MAX_ANSWER],
    length: usize,
}

impl Answer {
    /// Its bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// The frame of these data. Of Edition 4 no sum is known for certain, so it gets none.
    pub(crate) fn new(
        (from, to): (NodeId, NodeId),
        idd: u8,
        message: u16,
        data: &Builder,
    ) -> Option<Self> {
        let header = Header {
            source: from,
            destination: to,
            message,
            wants_acknowledgement: false,
            idd,
            sum: if idd == Header::EDITION_3 {
                Sum::Bytes2
            } else {
                Sum::None
            },
        };
        let mut bytes = [0; MAX_ANSWER];
        let length = header.write(data.data(), &mut bytes)?;
        Some(Self { bytes, length })
    }
}

/// Data that begin with the time, if it is known.
pub(crate) fn stamped(layout: &Layout, reading: Reading) -> Builder {
    let mut data = Builder::new(layout);
    if let Some(utc_ns) = reading.time.utc_ns {
        data.unsigned(0, TimeStamp::from_unix_ns(utc_ns).ms);
    }
    data
}

/// #17000.
pub(crate) fn acknowledgement(request: &Request, at_arrival: Reading) -> Builder {
    let mut data = stamped(&m::ACKNOWLEDGEMENT_LAYOUT, at_arrival);
    if let Some(time_ms) = request.time_ms {
        data.unsigned(1, time_ms);
    }
    data.unsigned(2, request.message.into());
    data.unsigned(3, RECEIVED);
    data
}

/// #2.
pub(crate) fn authorisation(at_arrival: Reading) -> Builder {
    let mut data = stamped(&m::AUTHORISATION_RESPONSE_LAYOUT, at_arrival);
    let null = NodeId::NULL.0.into();
    for (field, value) in [
        (1, null),
        (2, null),
        (5, LOI_2),
        (6, LOI_2),
        (13, 0),
        (14, 0),
    ] {
        data.unsigned(field, value);
    }
    data
}

/// #3. The subtype is the maker's own: major and minor of the firmware.
pub(crate) fn vehicle(config: &Config, at_arrival: Reading) -> Builder {
    let [major, minor, _] = config.version;
    let subtype = u16::from_be_bytes([major, minor]).into();
    let mut data = stamped(&m::VEHICLE_ID_LAYOUT, at_arrival);
    for (field, value) in [(1, NodeId::NULL.0.into()), (3, 0), (4, subtype), (5, 0)] {
        data.unsigned(field, value);
    }
    data
}

/// #52002.
pub(crate) fn version(config: &Config, at_arrival: Reading) -> Builder {
    let mut data = stamped(&m::SOFTWARE_VERSION_LAYOUT, at_arrival);
    for (field, part) in (1..).zip(config.version) {
        data.unsigned(field, part.into());
    }
    data.unsigned(4, config.git_hash.into());
    data.unsigned(5, config.board.into());
    data.unsigned(6, Header::EDITION_3.into());
    data
}

/// #52001.
pub(crate) fn report(
    request: &Request,
    (sequence, fraction_ns): (Option<u64>, Option<u64>),
    at_arrival: Reading,
    now: Reading,
) -> Builder {
    let mut data = Builder::new(&m::CLOCK_REPORT_LAYOUT);
    let [sent, arrived] = [now, at_arrival].map(|it| it.time.utc_ns.map(TimeStamp::from_unix_ns));
    // Either both times or none: a clock that was set in between has not timed the arrival.
    let times = arrived.and_then(|arrived| Some((arrived, sent?)));
    if let Some((_, sent)) = times {
        data.unsigned(0, sent.ms);
        data.unsigned(1, sent.fraction_ns.into());
    }
    let original = [sequence, request.time_ms, fraction_ns];
    for (field, value) in (2..).zip(original) {
        if let Some(value) = value {
            data.unsigned(field, value);
        }
    }
    if let Some((arrived, _)) = times {
        data.unsigned(5, arrived.ms);
        data.unsigned(6, arrived.fraction_ns.into());
        data.unsigned(7, at_arrival.uncertainty_ns.into());
    }
    data.unsigned(8, at_arrival.state.number().into());
    let (ms, ns) = since_boot(at_arrival.time.boot);
    data.unsigned(9, ms);
    data.unsigned(10, ns);
    data
}

/// Whole ms since boot, and the ns that are left.
fn since_boot(boot: Cycles) -> (u64, u64) {
    let ns = boot.as_nanos();
    let ms = divide::<NS_PER_MS>(ns);
    (ms, ns - ms * NS_PER_MS)
}

/// #52003: how often a message is sent. \[ms\]
pub(crate) fn interval(message: u16, at_arrival: Reading) -> Builder {
    let interval_ms = match message {
        m::HEARTBEAT | m::INERTIAL_STATES => 1_000,
        // Of itself nothing else is sent regularly.
        _ => 0,
    };
    let mut data = stamped(&m::MESSAGE_INTERVAL_LAYOUT, at_arrival);
    data.unsigned(1, message.into());
    data.unsigned(2, interval_ms);
    data
}

/// #52005.
pub(crate) fn parameter(parameter: Parameter, value: f32, at_arrival: Reading) -> Builder {
    let mut data = stamped(&m::PARAMETER_VALUE_LAYOUT, at_arrival);
    data.unsigned(1, parameter.index().into());
    data.unsigned(2, Parameter::ALL.len() as u64);
    data.bytes(3, &Name::from(parameter.name()).bytes());
    data.unsigned(4, m::KIND_FLOAT);
    data.unsigned(5, value.to_bits().into());
    data
}

/// #16000. A text that is too long loses its end. `number` counts the alerts; one that is said for the first
/// time is negative.
pub(crate) fn alert(
    now: Reading,
    (subsystem, severity): (u64, Severity),
    number: u32,
    text: &str,
) -> Builder {
    let priority = match severity {
        Severity::Error => 5,
        Severity::Warning => 3,
        Severity::Notice | Severity::Info => 1,
    };
    let mut data = stamped(&m::ALERT_LAYOUT, now);
    data.unsigned(2, priority);
    data.unsigned(4, subsystem);
    data.integer(10, -i64::from(number));
    let text = text.as_bytes();
    data.bytes(11, text.get(..m::ALERT_TEXT - 1).unwrap_or(text));
    data
}
