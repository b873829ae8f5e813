//! The node: which frames ask for something, and how they are answered.

use node_values::{Parameters, Severity};
use stanag_wire::{Builder, Frame, Framer, FramerCounters, Header, NodeId, Refusal, TimeStamp};
use timebase::{CORE_HZ, Cycles, Fix, StampedByte};

use crate::answer::{self, Answer};
use crate::clock::Reading;
use crate::complaint::{Complaint, Complaints};
use crate::message as m;
use crate::position;
use crate::request::{Asked, Request, Requests};

/// How much later than `now` a byte may be stamped, in cycles: 1 s.
const AFTER_NOW: u64 = CORE_HZ as u64;
/// The longest frame that a line is searched for. \[bytes\]
const LONGEST: usize = 64;

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
    /// is to be answered with [`Self::answers`].
    #[inline]
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

    /// The frames that answer `request`: the clock `at_arrival` of its first byte, and `now`.
    pub fn answers<'a>(
        &'a self,
        request: &'a Request,
        at_arrival: Reading,
        now: Reading,
        parameters: &'a impl Parameters,
    ) -> impl Iterator<Item = Answer> {
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
        let messages = [acknowledgement, first, second].into_iter().flatten();
        messages.filter_map(move |message| {
            let data = self.data(message, request, at_arrival, now, parameters)?;
            let ends = (self.config.id, request.from);
            Answer::new(ends, request.idd, message, &data)
        })
    }

    fn data(
        &self,
        message: u16,
        request: &Request,
        at_arrival: Reading,
        now: Reading,
        parameters: &impl Parameters,
    ) -> Option<Builder> {
        Some(match (message, request.wanted) {
            (m::ACKNOWLEDGEMENT, _) => answer::acknowledgement(request, at_arrival),
            (m::AUTHORISATION_RESPONSE, _) => answer::authorisation(at_arrival),
            (m::VEHICLE_ID, _) => answer::vehicle(&self.config, at_arrival),
            (m::HEARTBEAT, _) => answer::stamped(&m::HEARTBEAT_LAYOUT, at_arrival),
            (m::SOFTWARE_VERSION, _) => answer::version(&self.config, at_arrival),
            (m::INERTIAL_STATES, _) => self.position.clone()?,
            (
                m::CLOCK_REPORT,
                Asked::Clock {
                    fraction_ns,
                    sequence,
                },
            ) => answer::report(request, (sequence, fraction_ns), at_arrival, now),
            (m::MESSAGE_INTERVAL, Asked::Interval(of)) => answer::interval(of, at_arrival),
            (m::PARAMETER_VALUE, Asked::Parameter(it)) => {
                answer::parameter(it, parameters.parameter(it), at_arrival)
            }
            _ => return None,
        })
    }

    /// A heartbeat to all, once a second.
    #[must_use]
    pub fn heartbeat(&self, now: Reading) -> Option<Answer> {
        self.to_all(m::HEARTBEAT, &answer::stamped(&m::HEARTBEAT_LAYOUT, now))
    }

    /// #4000 to all: where we are at an epoch of the receiver, whose UTC is `epoch_ns` once it is known.
    /// \[ns\]
    pub fn position(&mut self, epoch_ns: Option<i64>, fix: &Fix) -> Option<Answer> {
        let mut data = Builder::new(&m::INERTIAL_STATES_LAYOUT);
        if let Some(epoch_ns) = epoch_ns {
            data.unsigned(0, TimeStamp::from_unix_ns(epoch_ns).ms);
        }
        position::write(fix, &mut data);
        let answer = self.to_all(m::INERTIAL_STATES, &data);
        self.position = Some(data);
        answer
    }

    /// #16000 to all: something happened to the clock.
    pub fn alert(&mut self, now: Reading, severity: Severity, text: &str) -> Option<Answer> {
        self.alert_to(NodeId::BROADCAST, now, (answer::NAVIGATION, severity), text)
    }

    /// #16000 to who sent something that was refused, one at a time. To be called once a second, until it
    /// has none.
    pub fn poll_alert(&mut self, now: Reading) -> Option<Answer> {
        let without_sum = self.framer.counters().without_sum;
        if without_sum != self.without_sum {
            self.without_sum = without_sum;
            self.complain(NodeId::BROADCAST, Complaint::NoSum);
        }
        let (to, what) = self.complaints.poll()?;
        let said = (answer::VSM, Severity::Warning);
        self.alert_to(to, now, said, what.words())
    }

    fn alert_to(
        &mut self,
        to: NodeId,
        now: Reading,
        said: (u64, Severity),
        text: &str,
    ) -> Option<Answer> {
        self.alerts = self.alerts.wrapping_add(1) & i32::MAX.cast_unsigned();
        let data = answer::alert(now, said, self.alerts, text);
        Answer::new((self.config.id, to), Header::EDITION_3, m::ALERT, &data)
    }

    fn to_all(&self, message: u16, data: &Builder) -> Option<Answer> {
        let ends = (self.config.id, NodeId::BROADCAST);
        Answer::new(ends, Header::EDITION_3, message, data)
    }
}
