//! The station's side: requests, and what answers say.

use stanag_node::message as m;
use stanag_wire::{Builder, Frame, Header, Layout, MAX_FRAME, NodeId, Sum, TimeStamp};

/// The id of our tools: 00:50:5F and a number.
pub const TOOLS: NodeId = NodeId(0x0050_5F01);

/// What somebody said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Said {
    /// Who.
    pub from: NodeId,
    /// What.
    pub what: What,
}

/// What was said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// #2: a node answers discovery.
    Identity,
    /// #17000.
    Acknowledged {
        /// Its Time Stamp: the node's time. \[ns since 1970\]
        time_ns: Option<i64>,
        /// The Time Stamp of what is acknowledged. \[ms since 2000\]
        original_ms: Option<u64>,
    },
    /// #52001.
    Clock(Report),
}

/// A Clock Report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// The number of the request.
    pub sequence: Option<u64>,
    /// T2, when the request's first byte had arrived. \[ns since 1970\]
    pub arrival_ns: Option<i64>,
    /// T3, when the answer went into the queue. \[ns since 1970\]
    pub sent_ns: Option<i64>,
    /// How far both may be off. \[ns\]
    pub uncertainty_ns: Option<u64>,
    /// What the clock stands on.
    pub state: Option<u64>,
    /// Since boot, at the arrival. \[ns\]
    pub uptime_ns: Option<u64>,
}

fn frame(to: NodeId, from: NodeId, message: u16, asks: bool, data: &Builder) -> Vec<u8> {
    let header = Header {
        source: from,
        destination: to,
        message,
        wants_acknowledgement: asks,
        idd: Header::EDITION_3,
        sum: Sum::Bytes2,
    };
    let mut out = [0; MAX_FRAME];
    let length = header.write(data.data(), &mut out).unwrap_or_default();
    out[..length].to_vec()
}

/// #52000 at `now_ns` since 1970.
#[must_use]
pub fn clock_request(from: NodeId, to: NodeId, now_ns: i64, sequence: u32) -> Vec<u8> {
    let stamp = TimeStamp::from_unix_ns(now_ns);
    let mut data = Builder::new(&m::CLOCK_REQUEST_LAYOUT);
    data.unsigned(0, stamp.ms);
    data.unsigned(1, stamp.fraction_ns.into());
    data.unsigned(2, sequence.into());
    frame(to, from, m::CLOCK_REQUEST, false, &data)
}

/// #16002 with bit 15 at `now_ns` since 1970, for nodes that are not ours.
#[must_use]
pub fn heartbeat(from: NodeId, to: NodeId, now_ns: i64) -> Vec<u8> {
    let mut data = Builder::new(&m::HEARTBEAT_LAYOUT);
    data.unsigned(0, TimeStamp::from_unix_ns(now_ns).ms);
    frame(to, from, m::HEARTBEAT, true, &data)
}

/// #1 to all.
#[must_use]
pub fn discovery(from: NodeId) -> Vec<u8> {
    let mut data = Builder::new(&m::AUTHORISATION_REQUEST_LAYOUT);
    for field in [1, 2] {
        data.unsigned(field, NodeId::BROADCAST.0.into());
    }
    frame(
        NodeId::BROADCAST,
        from,
        m::AUTHORISATION_REQUEST,
        false,
        &data,
    )
}

/// What the frames of a datagram say to `us`. Times are the ones nearest to `now_ns`.
#[must_use]
pub fn read(datagram: &[u8], us: NodeId, now_ns: i64) -> Vec<Said> {
    let mut said = Vec::new();
    let mut rest = datagram;
    while let Ok((frame, behind)) = Frame::read(rest) {
        rest = behind;
        let header = frame.header;
        if header.destination == us
            && let Some(what) = what(header.message, frame.data, now_ns)
        {
            let from = header.source;
            said.push(Said { from, what });
        }
    }
    said
}

fn what(message: u16, data: &[u8], now_ns: i64) -> Option<What> {
    let values = |layout: &Layout| layout.values(data).ok();
    let ns = |ms: Option<u64>, fraction: Option<u64>| {
        let fraction_ns = fraction.and_then(|it| u32::try_from(it).ok()).unwrap_or(0);
        TimeStamp {
            ms: ms?,
            fraction_ns,
        }
        .unix_ns(now_ns)
    };
    Some(match message {
        m::AUTHORISATION_RESPONSE => What::Identity,
        m::ACKNOWLEDGEMENT => {
            let values = values(&m::ACKNOWLEDGEMENT_LAYOUT)?;
            What::Acknowledged {
                time_ns: ns(values.unsigned(0), None),
                original_ms: values.unsigned(1),
            }
        }
        m::CLOCK_REPORT => {
            let values = values(&m::CLOCK_REPORT_LAYOUT)?;
            let at = |field| values.unsigned(field);
            What::Clock(Report {
                sequence: at(2),
                sent_ns: ns(at(0), at(1)),
                arrival_ns: ns(at(5), at(6)),
                uncertainty_ns: at(7),
                state: at(8),
                uptime_ns: at(9).and_then(|ms| Some(ms * 1_000_000 + at(10)?)),
            })
        }
        _ => return None,
    })
}
