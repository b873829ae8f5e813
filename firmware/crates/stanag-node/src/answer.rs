//! The data of each message that is sent.

use node_values::{Parameter, Severity};
use stanag_wire::{Builder, Header, Layout, MAX_FRAME, NodeId, Sum, TimeStamp};
use timebase::divide;

use crate::clock::Reading;
use crate::config::Config;
use crate::message as m;
use crate::request::{LOI_2, Request};

/// Acknowledgement Type: it has arrived.
const RECEIVED: u32 = 1;
/// The longest frame that is sent, an alert: all of its fields, wrapper and sum. \[bytes\]
const MAX_ANSWER: usize = 132;
const _: () = assert!(MAX_ANSWER <= MAX_FRAME);
const NS_PER_MS: u64 = 1_000_000;
/// Subsystem IDs of an alert: the clock's, and the node's own.
pub(crate) const NAVIGATION: u32 = 5;
pub(crate) const VSM: u32 = 9;

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
    #[inline(never)]
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
pub(crate) fn stamped(layout: &Layout, utc_ns: Option<i64>) -> Builder {
    let mut data = Builder::new(layout);
    if let Some(utc_ns) = utc_ns {
        data.unsigned(0, TimeStamp::from_unix_ns(utc_ns).ms);
    }
    data
}

/// Adds fields with their numbers.
fn add(data: &mut Builder, fields: &[(u8, u32)]) {
    for &(field, value) in fields {
        data.unsigned(field.into(), value.into());
    }
}

/// The fields of each message that is sent to who asked for it, but for its Time Stamp.
pub(crate) fn layout(message: u16) -> Option<&'static Layout> {
    Some(match message {
        m::ACKNOWLEDGEMENT => &m::ACKNOWLEDGEMENT_LAYOUT,
        m::AUTHORISATION_RESPONSE => &m::AUTHORISATION_RESPONSE_LAYOUT,
        m::VEHICLE_ID => &m::VEHICLE_ID_LAYOUT,
        m::HEARTBEAT => &m::HEARTBEAT_LAYOUT,
        m::SOFTWARE_VERSION => &m::SOFTWARE_VERSION_LAYOUT,
        m::CLOCK_REPORT => &m::CLOCK_REPORT_LAYOUT,
        m::MESSAGE_INTERVAL => &m::MESSAGE_INTERVAL_LAYOUT,
        m::PARAMETER_VALUE => &m::PARAMETER_VALUE_LAYOUT,
        _ => return None,
    })
}

/// #17000.
pub(crate) fn acknowledgement(data: &mut Builder, request: &Request) {
    if let Some(time_ms) = request.time_ms {
        data.unsigned(1, time_ms);
    }
    add(data, &[(2, request.message.into()), (3, RECEIVED)]);
}

/// #2.
pub(crate) fn authorisation(data: &mut Builder) {
    const FIELDS: [(u8, u32); 6] = [
        (1, NodeId::NULL.0),
        (2, NodeId::NULL.0),
        (5, LOI_2 as u32),
        (6, LOI_2 as u32),
        (13, 0),
        (14, 0),
    ];
    add(data, &FIELDS);
}

/// #3. The subtype is the maker's own: major and minor of the firmware.
pub(crate) fn vehicle(data: &mut Builder, config: &Config) {
    let [major, minor, _] = config.version;
    let subtype = u16::from_be_bytes([major, minor]).into();
    add(data, &[(1, NodeId::NULL.0), (3, 0), (4, subtype), (5, 0)]);
}

/// #52002.
pub(crate) fn version(data: &mut Builder, config: &Config) {
    for (field, part) in (1..).zip(config.version) {
        data.unsigned(field, part.into());
    }
    let idd = Header::EDITION_3.into();
    add(
        data,
        &[(4, config.git_hash), (5, config.board.into()), (6, idd)],
    );
}

/// #52001, without the time that it begins with.
pub(crate) fn report(
    request: &Request,
    (sequence, fraction_ns): (Option<u64>, Option<u64>),
    at_arrival: &Reading,
    now: &Reading,
) -> Builder {
    let mut data = Builder::new(&m::CLOCK_REPORT_LAYOUT);
    // Either both times or none: a clock that was set in between has not timed the arrival.
    let times = at_arrival.time.utc_ns.zip(now.time.utc_ns);
    if let Some((_, sent)) = times {
        time(&mut data, 0, sent);
    }
    for (field, value) in [(2, sequence), (3, request.time_ms), (4, fraction_ns)] {
        if let Some(value) = value {
            data.unsigned(field, value);
        }
    }
    if let Some((arrived, _)) = times {
        time(&mut data, 5, arrived);
        data.unsigned(7, at_arrival.uncertainty_ns.into());
    }
    data.unsigned(8, at_arrival.state.number().into());
    let ns = at_arrival.time.boot.as_nanos();
    let ms = divide::<NS_PER_MS>(ns);
    data.unsigned(9, ms);
    data.unsigned(10, ns - ms * NS_PER_MS);
    data
}

/// A time and its fraction in two fields that follow each other.
#[inline(never)]
fn time(data: &mut Builder, field: usize, utc_ns: i64) {
    let stamp = TimeStamp::from_unix_ns(utc_ns);
    data.unsigned(field, stamp.ms);
    data.unsigned(field + 1, stamp.fraction_ns.into());
}

/// #52003: how often a message is sent. \[ms\]
pub(crate) fn interval(data: &mut Builder, message: u16) {
    let interval_ms = match message {
        m::HEARTBEAT | m::INERTIAL_STATES => 1_000,
        // Of itself nothing else is sent regularly.
        _ => 0,
    };
    add(data, &[(1, message.into()), (2, interval_ms)]);
}

/// #52005.
pub(crate) fn parameter(data: &mut Builder, parameter: Parameter, value: f32) {
    add(
        data,
        &[
            (1, parameter.index().into()),
            (2, Parameter::ALL.len() as u32),
        ],
    );
    data.bytes(3, parameter.name().as_bytes());
    add(data, &[(4, m::KIND_FLOAT), (5, value.to_bits())]);
}

/// #16000. A text that is too long loses its end. `number` counts the alerts; one that is said for the first
/// time is negative.
pub(crate) fn alert(
    data: &mut Builder,
    (subsystem, severity): (u32, Severity),
    number: u32,
    text: &str,
) {
    let priority = match severity {
        Severity::Error => 5,
        Severity::Warning => 3,
        Severity::Notice | Severity::Info => 1,
    };
    add(
        data,
        &[(2, priority), (4, subsystem), (10, number.wrapping_neg())],
    );
    let text = text.as_bytes();
    data.bytes(11, text.get(..m::ALERT_TEXT - 1).unwrap_or(text));
}
