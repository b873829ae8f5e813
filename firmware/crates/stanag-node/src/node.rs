//! The node: which frames ask for something, and how they are answered.

use stanag_wire::{Builder, Frame, Header, Layout, NodeId, Refusal, Sum, TimeStamp, Values};

use crate::clock::Reading;
use crate::number::{
    ACKNOWLEDGEMENT, ACKNOWLEDGEMENT_LAYOUT, AUTHORISATION_REQUEST, AUTHORISATION_RESPONSE,
    AUTHORISATION_RESPONSE_LAYOUT, CLOCK_REPORT, CLOCK_REPORT_LAYOUT, CLOCK_REQUEST,
    CLOCK_REQUEST_LAYOUT, HEARTBEAT, HEARTBEAT_LAYOUT, INERTIAL_STATES, INERTIAL_STATES_LAYOUT,
    INFORMATION_REQUEST, INFORMATION_REQUEST_LAYOUT, SOFTWARE_VERSION, SOFTWARE_VERSION_LAYOUT,
    VEHICLE_ID, VEHICLE_ID_LAYOUT,
};
use crate::position::Position;

/// LOI 2, monitor, as Edition 2's bit.
const LOI_2: u64 = 1;
/// Acknowledgement Type: it has arrived.
const RECEIVED: u64 = 1;
const NS_PER_MS: u64 = 1_000_000;
/// The longest answer, #52001, with its wrapper and sum is shorter. \[bytes\]
const MAX_ANSWER: usize = 64;

/// Who a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Its id.
    pub id: NodeId,
    /// The firmware's version: major, minor, patch.
    pub version: [u8; 3],
    /// The first 32 bits of its commit's hash.
    pub git_hash: u32,
    /// The board's number, as AUTOPILOT_VERSION has it.
    pub board: u16,
}

/// What was received. All of them are since boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Counters {
    /// Frames that ask us for something.
    pub requests: u32,
    /// Frames of others to others, and what needs no answer.
    pub passed: u32,
    /// Datagrams that are no frames.
    pub refused: u32,
    /// Frames whose data are not as their presence vector says.
    pub malformed: u32,
    /// Frames from our own id: there is another one with it.
    pub from_our_id: u32,
}

/// What a station wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// Who wants it.
    pub from: NodeId,
    /// The message that asks.
    message: u16,
    /// The message that is asked for; 0 is none.
    wanted: u16,
    wants_acknowledgement: bool,
    idd: u8,
    time_ms: Option<u64>,
    /// Of #52000. \[ns\]
    fraction_ns: Option<u64>,
    sequence: Option<u64>,
}

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
}

/// The node.
#[derive(Clone, Debug)]
pub struct Node {
    config: Config,
    counters: Counters,
}

impl Node {
    /// A node that has heard nothing.
    #[must_use]
    pub fn new(config: Config) -> Self {
        let counters = Counters::default();
        Self { config, counters }
    }

    /// What was received so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Takes a datagram and returns what its frames ask for.
    ///
    /// # Errors
    ///
    /// When it does not divide into whole frames: then none of them counts.
    pub fn handle<'a>(
        &'a mut self,
        datagram: &'a [u8],
    ) -> Result<impl Iterator<Item = Request> + use<'a>, Refusal> {
        let mut rest = datagram;
        while !rest.is_empty() {
            match Frame::read(rest) {
                Ok((_, behind)) => rest = behind,
                Err(refusal) => {
                    self.counters.refused = self.counters.refused.wrapping_add(1);
                    return Err(refusal);
                }
            }
        }
        let mut rest = datagram;
        let frames = core::iter::from_fn(move || {
            let (frame, behind) = Frame::read(rest).ok()?;
            rest = behind;
            Some(frame)
        });
        Ok(frames.filter_map(|frame| self.request(&frame)))
    }

    /// What one frame asks for, counted.
    fn request(&mut self, frame: &Frame<'_>) -> Option<Request> {
        let Config { id, .. } = self.config;
        let header = frame.header;
        let is_for_us = [id, NodeId::BROADCAST].contains(&header.destination);
        let counters = &mut self.counters;
        let (counter, found) = match read(frame, id) {
            _ if header.source == id => (&mut counters.from_our_id, None),
            Ok(Some(request)) if is_for_us => (&mut counters.requests, Some(request)),
            Ok(_) => (&mut counters.passed, None),
            Err(_) if is_for_us => (&mut counters.malformed, None),
            Err(_) => (&mut counters.passed, None),
        };
        *counter = counter.wrapping_add(1);
        found
    }

    /// The frames that answer `request`: the clock `at_arrival` of its first byte, and `now`.
    pub fn answers(
        &self,
        request: Request,
        at_arrival: Reading,
        now: Reading,
    ) -> impl Iterator<Item = Answer> + use<> {
        let config = self.config;
        let acknowledgement = request.wants_acknowledgement.then_some(ACKNOWLEDGEMENT);
        let [first, second] = match (request.message, request.wanted) {
            (AUTHORISATION_REQUEST, _) => [Some(AUTHORISATION_RESPONSE), Some(VEHICLE_ID)],
            (_, 0) => [None, None],
            (_, wanted) => [Some(wanted), None],
        };
        [acknowledgement, first, second]
            .into_iter()
            .flatten()
            .filter_map(move |message| {
                let data = match message {
                    ACKNOWLEDGEMENT => acknowledge(&request, at_arrival),
                    AUTHORISATION_RESPONSE => authorise(at_arrival),
                    VEHICLE_ID => vehicle(&config, at_arrival),
                    HEARTBEAT => stamped(&HEARTBEAT_LAYOUT, at_arrival),
                    SOFTWARE_VERSION => version(&config, at_arrival),
                    CLOCK_REPORT => report(&request, at_arrival, now),
                    _ => return None,
                };
                frame(config.id, request.from, request.idd, message, &data)
            })
    }

    /// A heartbeat to all, once a second.
    #[must_use]
    pub fn heartbeat(&self, now: Reading) -> Option<Answer> {
        let data = stamped(&HEARTBEAT_LAYOUT, now);
        self.to_all(HEARTBEAT, &data)
    }

    /// #4000 to all: where we are at an epoch of the receiver, whose UTC is `epoch_ns` once it is known.
    /// \[ns\]
    #[must_use]
    pub fn position(&self, epoch_ns: Option<i64>, position: &Position) -> Option<Answer> {
        let mut data = Builder::new(&INERTIAL_STATES_LAYOUT);
        if let Some(epoch_ns) = epoch_ns {
            data.unsigned(0, TimeStamp::from_unix_ns(epoch_ns).ms);
        }
        position.write(&mut data);
        self.to_all(INERTIAL_STATES, &data)
    }

    fn to_all(&self, message: u16, data: &Builder) -> Option<Answer> {
        let id = self.config.id;
        frame(id, NodeId::BROADCAST, Header::EDITION_3, message, data)
    }
}

/// What a frame asks for, whoever is meant; `None` when nothing.
fn read(frame: &Frame<'_>, us: NodeId) -> Result<Option<Request>, Refusal> {
    let header = frame.header;
    let is_known = |layout: &Layout| layout.values(frame.data);
    let number = |values: &Values<'_>, field| values.unsigned(field);
    let mut request = Request {
        from: header.source,
        message: header.message,
        wanted: 0,
        // All would answer at once.
        wants_acknowledgement: header.wants_acknowledgement && header.destination == us,
        idd: header.idd,
        time_ms: None,
        fraction_ns: None,
        sequence: None,
    };
    match header.message {
        // Reports and answers; an answer to them could be answered again.
        ACKNOWLEDGEMENT
        | CLOCK_REPORT
        | AUTHORISATION_RESPONSE
        | VEHICLE_ID
        | INERTIAL_STATES
        | SOFTWARE_VERSION => return Ok(None),
        AUTHORISATION_REQUEST => {
            // Its first two fields: implementations of the rest differ.
            let id = authorisation_id(frame.data)?;
            if ![None, Some(us), Some(NodeId::BROADCAST), Some(NodeId::NULL)].contains(&id) {
                return Ok(None);
            }
            request.wanted = AUTHORISATION_RESPONSE;
        }
        HEARTBEAT => request.time_ms = number(&is_known(&HEARTBEAT_LAYOUT)?, 0),
        INFORMATION_REQUEST => {
            let values = is_known(&INFORMATION_REQUEST_LAYOUT)?;
            request.time_ms = number(&values, 0);
            let wanted = number(&values, 4).and_then(|it| u16::try_from(it).ok());
            // What needs a question of its own is not asked for by this one.
            let wanted = wanted.filter(|&it| ![ACKNOWLEDGEMENT, CLOCK_REPORT].contains(&it));
            request.wanted = wanted.unwrap_or(0);
        }
        CLOCK_REQUEST => {
            let values = is_known(&CLOCK_REQUEST_LAYOUT)?;
            request.time_ms = number(&values, 0);
            request.fraction_ns = number(&values, 1);
            request.sequence = number(&values, 2);
            request.wanted = CLOCK_REPORT;
        }
        _ => {}
    }
    let asks = request.wanted != 0 || request.wants_acknowledgement;
    Ok(asks.then_some(request))
}

/// The VSM that #1 is for, if it names one.
fn authorisation_id(data: &[u8]) -> Result<Option<NodeId>, Refusal> {
    let (vector, fields) = data.split_first_chunk::<3>().ok_or(Refusal::Data)?;
    let [_, _, low] = vector;
    let fields = match low & 1 {
        0 => fields,
        _ => fields.get(5..).ok_or(Refusal::Data)?,
    };
    if low & 2 == 0 {
        return Ok(None);
    }
    let id = fields.first_chunk().ok_or(Refusal::Data)?;
    Ok(Some(NodeId(u32::from_be_bytes(*id))))
}

/// Data that begin with the time, if it is known.
fn stamped(layout: &Layout, reading: Reading) -> Builder {
    let mut data = Builder::new(layout);
    if let Some(utc_ns) = reading.utc_ns {
        data.unsigned(0, TimeStamp::from_unix_ns(utc_ns).ms);
    }
    data
}

/// #17000.
fn acknowledge(request: &Request, at_arrival: Reading) -> Builder {
    let mut data = stamped(&ACKNOWLEDGEMENT_LAYOUT, at_arrival);
    if let Some(time_ms) = request.time_ms {
        data.unsigned(1, time_ms);
    }
    data.unsigned(2, request.message.into());
    data.unsigned(3, RECEIVED);
    data
}

/// #2.
fn authorise(at_arrival: Reading) -> Builder {
    let mut data = stamped(&AUTHORISATION_RESPONSE_LAYOUT, at_arrival);
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
fn vehicle(config: &Config, at_arrival: Reading) -> Builder {
    let [major, minor, _] = config.version;
    let subtype = u16::from_be_bytes([major, minor]).into();
    let mut data = stamped(&VEHICLE_ID_LAYOUT, at_arrival);
    for (field, value) in [(1, NodeId::NULL.0.into()), (3, 0), (4, subtype), (5, 0)] {
        data.unsigned(field, value);
    }
    data
}

/// #52002.
fn version(config: &Config, at_arrival: Reading) -> Builder {
    let mut data = stamped(&SOFTWARE_VERSION_LAYOUT, at_arrival);
    for (field, part) in (1..).zip(config.version) {
        data.unsigned(field, part.into());
    }
    data.unsigned(4, config.git_hash.into());
    data.unsigned(5, config.board.into());
    data.unsigned(6, Header::EDITION_3.into());
    data
}

/// #52001.
fn report(request: &Request, at_arrival: Reading, now: Reading) -> Builder {
    let mut data = Builder::new(&CLOCK_REPORT_LAYOUT);
    let [sent, arrived] = [now, at_arrival].map(|it| it.utc_ns.map(TimeStamp::from_unix_ns));
    // Either both times or none: a clock that was set in between has not timed the arrival.
    let times = arrived.and_then(|arrived| Some((arrived, sent?)));
    if let Some((_, sent)) = times {
        data.unsigned(0, sent.ms);
        data.unsigned(1, sent.fraction_ns.into());
    }
    let original = [request.sequence, request.time_ms, request.fraction_ns];
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
    data.unsigned(8, at_arrival.state.number());
    data.unsigned(9, at_arrival.boot_ns / NS_PER_MS);
    data.unsigned(10, at_arrival.boot_ns % NS_PER_MS);
    data
}

fn frame(from: NodeId, to: NodeId, idd: u8, message: u16, data: &Builder) -> Option<Answer> {
    let header = Header {
        source: from,
        destination: to,
        message,
        wants_acknowledgement: false,
        idd,
        // Of Edition 4 no sum is known.
        sum: if idd == Header::EDITION_3 {
            Sum::Bytes2
        } else {
            Sum::None
        },
    };
    let mut bytes = [0; MAX_ANSWER];
    let length = header.write(data.data(), &mut bytes)?;
    Some(Answer { bytes, length })
}
