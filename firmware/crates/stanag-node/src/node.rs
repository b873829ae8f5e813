//! The node: which frames ask for something, and how they are answered.

use node_values::{Parameters, Severity};
use stanag_wire::{Builder, Frame, Framer, FramerCounters, Header, NodeId, Refusal};
use timebase::{CORE_HZ, Cycles, Fix, StampedByte};

use crate::answer::{self, Answer};
use crate::clock::Reading;
use crate::complaint::{Complaint, Complaints};
use crate::config::Config;
use crate::message as m;
use crate::position;
use crate::request::{Asked, Request, Requests};

/// How much later than `now` a byte may be stamped, in cycles: 1 s.
const AFTER_NOW: u64 = CORE_HZ as u64;
/// The longest frame that a line is searched for. \[bytes\]
const LONGEST: usize = 64;

/// What was received, by kind. All wrap.
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
    /// Messages that ask for a change, which nobody without a key gets.
    pub no_key: u32,
    /// Requests for more than LOI 2.
    pub loi: u32,
    /// Numbers and parameters of ours that do not exist.
    pub unknown: u32,
    /// Frames from our own id: there is another one with it.
    pub from_our_id: u32,
    /// What the framer of a serial line found.
    pub framing: FramerCounters,
}

/// A node on one line.
#[derive(Debug)]
pub struct Node {
    config: Config,
    counters: Counters,
    framer: Framer<Requests>,
    complaints: Complaints,
    /// Frames without a sum that were complained of.
    without_sum: u32,
    /// Alerts that were sent.
    alerts: u32,
    /// The last #4000.
    position: Option<Builder>,
    is_position_due: bool,
}

impl Node {
    /// A line that has been silent for this long, in cycles, is between frames: 1 s.
    pub const IDLE: u64 = CORE_HZ as u64;

    /// A node that has received nothing.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            config,
            counters: Counters::default(),
            framer: Framer::new(config.id),
            complaints: Complaints::default(),
            without_sum: 0,
            alerts: 0,
            position: None,
            is_position_due: false,
        }
    }

    /// What was received so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        Counters {
            framing: self.framer.counters(),
            ..self.counters
        }
    }

    /// Takes a byte of a serial line, stamped at most 24 s before `now` or up to 1 s after it. A request
    /// is to be answered with [`Self::answer`].
    #[inline(never)]
    pub fn push(&mut self, byte: StampedByte, now: Cycles) -> Option<Request> {
        match self.framer.push(byte) {
            0 => None,
            length => self.handle_found(length, now),
        }
    }

    #[inline(never)]
    fn handle_found(&mut self, length: usize, now: Cycles) -> Option<Request> {
        let mut bytes = [0; LONGEST];
        let arrival = self.framer.take(length, &mut bytes);
        let (frame, _) = Frame::read(bytes.get(..length)?).ok()?;
        self.handle_frame(&frame, arrival.extend(now.plus(AFTER_NOW)))
    }

    /// When to call [`Self::handle_timeout`] if no byte comes before; `None` while no frame can
    /// have begun. `now` as for [`Self::push`].
    #[must_use]
    pub fn poll_timeout(&self, now: Cycles) -> Option<Cycles> {
        let newest = self.framer.newest()?.extend(now.plus(AFTER_NOW));
        Some(newest.plus(Self::IDLE))
    }

    /// Gives up a frame that has begun, if the line has been silent for [`Self::IDLE`]; otherwise
    /// does nothing. The call may be up to 20 s late: after that the stamps are ambiguous.
    #[inline(never)]
    pub fn handle_timeout(&mut self, now: Cycles) {
        if self.poll_timeout(now).is_some_and(|due| now >= due) {
            self.framer.give_up();
        }
    }

    /// Takes a datagram that arrived at `arrival` and returns what its frames ask for.
    ///
    /// # Errors
    ///
    /// When it does not divide into whole frames: then none of them counts.
    pub fn handle<'a>(
        &'a mut self,
        datagram: &'a [u8],
        arrival: Cycles,
    ) -> Result<impl Iterator<Item = Request> + use<'a>, Refusal> {
        let mut rest = datagram;
        while !rest.is_empty() {
            match Frame::read(rest) {
                Ok((_, behind)) => rest = behind,
                Err(refusal) => {
                    self.counters.refused = self.counters.refused.wrapping_add(1);
                    // Edition 2, and what is no frame at all, come from nobody who would understand.
                    match refusal {
                        Refusal::NoWrapper => {}
                        Refusal::Idd(_) => self.complain(NodeId::BROADCAST, Complaint::Idd),
                        _ => self.complain(NodeId::BROADCAST, Complaint::NotWhole),
                    }
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
        Ok(frames.filter_map(move |frame| self.handle_frame(&frame, arrival)))
    }

    /// What one frame asks for, counted.
    fn handle_frame(&mut self, frame: &Frame<'_>, arrival: Cycles) -> Option<Request> {
        let Config { id, .. } = self.config;
        let header = frame.header;
        let is_for_us = [id, NodeId::BROADCAST].contains(&header.destination);
        if header.source == id {
            self.counters.from_our_id = self.counters.from_our_id.wrapping_add(1);
            self.complain(NodeId::BROADCAST, Complaint::OurId);
            return None;
        }
        let counters = &mut self.counters;
        if !is_for_us {
            counters.passed = counters.passed.wrapping_add(1);
            return None;
        }
        let Ok(read) = Request::read(frame, id, arrival) else {
            counters.malformed = counters.malformed.wrapping_add(1);
            self.complain(header.source, Complaint::Malformed);
            return None;
        };
        let counter = match read.complaint {
            Some(Complaint::NoKey) => Some(&mut counters.no_key),
            Some(Complaint::Loi) => Some(&mut counters.loi),
            Some(_) => Some(&mut counters.unknown),
            None => None,
        };
        if let Some(counter) = counter {
            *counter = counter.wrapping_add(1);
        }
        let asks = read.request.asks();
        let counter = if asks {
            &mut counters.requests
        } else {
            &mut counters.passed
        };
        *counter = counter.wrapping_add(1);
        if let Some(complaint) = read.complaint {
            self.complain(header.source, complaint);
        }
        asks.then_some(read.request)
    }

    fn complain(&mut self, to: NodeId, what: Complaint) {
        self.complaints.push(to, what);
    }

    /// Hands the frames that answer `request` to `send`: the clock `at_arrival` of its first byte, and `now`.
    #[inline(never)]
    pub fn answer(
        &self,
        request: &Request,
        (at_arrival, now): (&Reading, &Reading),
        parameters: &dyn Parameters,
        send: &mut dyn FnMut(&[u8]),
    ) {
        let acknowledgement = request.wants_acknowledgement.then_some(m::ACKNOWLEDGEMENT);
        let [first, second] = match request.wanted {
            Asked::Nothing => [None, None],
            Asked::Identity => [Some(m::AUTHORISATION_RESPONSE), Some(m::VEHICLE_ID)],
            // What needs a question of its own is not asked for by another.
            Asked::Message(m::ACKNOWLEDGEMENT) => [None, None],
            Asked::Message(message) => [Some(message), None],
            Asked::Clock { .. } => [Some(m::CLOCK_REPORT), None],
            Asked::Interval(_) => [Some(m::MESSAGE_INTERVAL), None],
            Asked::Parameter(_) => [Some(m::PARAMETER_VALUE), None],
        };
        for message in [acknowledgement, first, second].into_iter().flatten() {
            let Some(data) = self.data(message, request, (at_arrival, now), parameters) else {
                continue;
            };
            let ends = (self.config.id, request.from);
            if let Some(answer) = Answer::new(ends, request.idd, message, &data) {
                send(answer.bytes());
            }
        }
    }

    fn data(
        &self,
        message: u16,
        request: &Request,
        (at_arrival, now): (&Reading, &Reading),
        parameters: &dyn Parameters,
    ) -> Option<Builder> {
        if message == m::INERTIAL_STATES {
            return self.position.clone();
        }
        let mut data = answer::stamped(answer::layout(message)?, at_arrival.time.utc_ns);
        match (message, request.wanted) {
            (m::ACKNOWLEDGEMENT, _) => answer::acknowledgement(&mut data, request),
            (m::AUTHORISATION_RESPONSE, _) => answer::authorisation(&mut data),
            (m::VEHICLE_ID, _) => answer::vehicle(&mut data, &self.config),
            (m::HEARTBEAT, _) => {}
            (m::SOFTWARE_VERSION, _) => answer::version(&mut data, &self.config),
            (
                m::CLOCK_REPORT,
                Asked::Clock {
                    fraction_ns,
                    sequence,
                },
            ) => data = answer::report(request, (sequence, fraction_ns), at_arrival, now),
            (m::MESSAGE_INTERVAL, Asked::Interval(of)) => answer::interval(&mut data, of),
            (m::PARAMETER_VALUE, Asked::Parameter(it)) => {
                answer::parameter(&mut data, it, parameters.parameter(it));
            }
            _ => return None,
        }
        Some(data)
    }

    /// #4000: where we are at an epoch of the receiver, whose UTC is `epoch_ns` once it is known. \[ns\]
    #[inline(never)]
    pub fn handle_position(&mut self, epoch_ns: Option<i64>, fix: &Fix) {
        let mut data = answer::stamped(&m::INERTIAL_STATES_LAYOUT, epoch_ns);
        position::write(fix, &mut data);
        self.position = Some(data);
        self.is_position_due = true;
    }

    /// Hands to `send` what is sent to all once a second: a heartbeat, a position that was not sent yet, and
    /// #16000 to each who sent something that was refused.
    #[inline(never)]
    pub fn handle_second(&mut self, now: &Reading, send: &mut dyn FnMut(&[u8])) {
        self.to_all(
            m::HEARTBEAT,
            &answer::stamped(&m::HEARTBEAT_LAYOUT, now.time.utc_ns),
            send,
        );
        if core::mem::take(&mut self.is_position_due)
            && let Some(data) = &self.position
        {
            self.to_all(m::INERTIAL_STATES, data, send);
        }
        let without_sum = self.framer.counters().without_sum;
        if without_sum != self.without_sum {
            self.without_sum = without_sum;
            self.complain(NodeId::BROADCAST, Complaint::NoSum);
        }
        while let Some((to, what)) = self.complaints.poll() {
            let said = (answer::VSM, Severity::Warning);
            self.alert_to(to, now, (said, what.words()), send);
        }
    }

    /// Hands #16000 to `send`, to all: something happened to the clock.
    pub fn alert(
        &mut self,
        now: &Reading,
        (severity, text): (Severity, &str),
        send: &mut dyn FnMut(&[u8]),
    ) {
        let said = (answer::NAVIGATION, severity);
        self.alert_to(NodeId::BROADCAST, now, (said, text), send);
    }

    #[inline(never)]
    fn alert_to(
        &mut self,
        to: NodeId,
        now: &Reading,
        (said, text): ((u32, Severity), &str),
        send: &mut dyn FnMut(&[u8]),
    ) {
        self.alerts = self.alerts.wrapping_add(1) & i32::MAX.cast_unsigned();
        let mut data = answer::stamped(&m::ALERT_LAYOUT, now.time.utc_ns);
        answer::alert(&mut data, said, self.alerts, text);
        let ends = (self.config.id, to);
        if let Some(answer) = Answer::new(ends, Header::EDITION_3, m::ALERT, &data) {
            send(answer.bytes());
        }
    }

    fn to_all(&self, message: u16, data: &Builder, send: &mut dyn FnMut(&[u8])) {
        let ends = (self.config.id, NodeId::BROADCAST);
        if let Some(answer) = Answer::new(ends, Header::EDITION_3, message, data) {
            send(answer.bytes());
        }
    }
}
