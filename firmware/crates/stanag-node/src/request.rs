//! What a frame asks for.

use node_values::{Name, Parameter};
use stanag_wire::{Frame, Layout, NodeId, Refusal, Wanted};
use timebase::Cycles;

use crate::complaint::Complaint;
use crate::message as m;

/// What a station wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// When the first byte of its frame had arrived.
    pub arrival: Cycles,
    /// Who wants it.
    pub from: NodeId,
    pub(crate) idd: u8,
    /// The message that asks.
    pub(crate) message: u16,
    /// Its Time Stamp. \[ms\]
    pub(crate) time_ms: Option<u64>,
    /// Whether #17000 is to be sent for it.
    pub(crate) wants_acknowledgement: bool,
    pub(crate) wanted: Asked,
}

/// What is to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Asked {
    /// Nothing but an acknowledgement.
    Nothing,
    /// Who we are: #2 and #3.
    Identity,
    /// A message that needs no question of its own.
    Message(u16),
    /// #52001.
    Clock {
        fraction_ns: Option<u64>,
        sequence: Option<u64>,
    },
    /// #52003: how often this message is sent.
    Interval(u16),
    /// #52005.
    Parameter(Parameter),
}

/// What stands in a frame.
pub(crate) struct Read {
    pub(crate) request: Request,
    pub(crate) complaint: Option<Complaint>,
}

/// The messages that a serial line is searched for.
#[derive(Debug)]
pub(crate) struct Requests;

impl Wanted for Requests {
    fn layout(message: u16) -> Option<&'static Layout> {
        Some(match message {
            m::AUTHORISATION_REQUEST => &m::AUTHORISATION_REQUEST_LAYOUT,
            m::HEARTBEAT => &m::HEARTBEAT_LAYOUT,
            m::SCHEDULE => &m::SCHEDULE_LAYOUT,
            m::INFORMATION_REQUEST => &m::INFORMATION_REQUEST_LAYOUT,
            m::CLOCK_REQUEST => &m::CLOCK_REQUEST_LAYOUT,
            m::MESSAGE_INTERVAL => &m::MESSAGE_INTERVAL_LAYOUT,
            m::PARAMETER_REQUEST => &m::PARAMETER_REQUEST_LAYOUT,
            m::PARAMETER_VALUE => &m::PARAMETER_VALUE_LAYOUT,
            _ => return None,
        })
    }
}

impl Request {
    /// Whether anything is to be sent.
    pub(crate) fn asks(&self) -> bool {
        self.wants_acknowledgement || self.wanted != Asked::Nothing
    }

    /// What `frame` asks of the node `us`, which it is meant for.
    ///
    /// # Errors
    ///
    /// When its data are not as long as their presence vector says.
    pub(crate) fn read(frame: &Frame<'_>, us: NodeId, arrival: Cycles) -> Result<Read, Refusal> {
        let mut request = Self::of(frame, us, arrival);
        let mut complaint = None;
        let message = frame.header.message;
        let Some(layout) = Requests::layout(message) else {
            if m::ANSWERS.contains(&message) {
                request.wants_acknowledgement = false;
            } else if m::OURS.contains(&message) {
                complaint = Some(Complaint::NotKnown);
            }
            return Ok(Read { request, complaint });
        };
        let values = match layout.values(frame.data) {
            Ok(values) => Some(values),
            // Of other implementations the first two fields are enough.
            Err(_) if message == m::AUTHORISATION_REQUEST => None,
            Err(refusal) => return Err(refusal),
        };
        let field = |field: usize| values.and_then(|it| it.unsigned(field));
        let number = |at: usize| field(at).and_then(|it| u16::try_from(it).ok());
        let parameter =
            |name_at: usize| parameter(number(1), values.and_then(|it| it.bytes(name_at)));
        request.time_ms = field(0);
        let interval = || number(1).map_or(Asked::Nothing, Asked::Interval);
        request.wanted = match message {
            m::AUTHORISATION_REQUEST => {
                let id = authorisation_id(frame.data)?;
                let ours = [us, NodeId::BROADCAST, NodeId::NULL];
                if id.is_none_or(|id| ours.contains(&id)) {
                    if field(5).is_some_and(|bits| bits > LOI_2) {
                        complaint = Some(Complaint::Loi);
                    }
                    Asked::Identity
                } else {
                    Asked::Nothing
                }
            }
            m::SCHEDULE => {
                complaint = Some(Complaint::NoKey);
                interval()
            }
            m::INFORMATION_REQUEST => number(4).map_or(Asked::Nothing, Asked::Message),
            m::CLOCK_REQUEST => Asked::Clock {
                fraction_ns: field(1),
                sequence: field(2),
            },
            m::MESSAGE_INTERVAL => {
                let asks = field(2).is_none_or(|it| it == m::ASKS.into());
                complaint = (!asks).then_some(Complaint::NoKey);
                interval()
            }
            m::PARAMETER_REQUEST => {
                let found = parameter(2);
                complaint = found.is_none().then_some(Complaint::NotKnown);
                found.map_or(Asked::Nothing, Asked::Parameter)
            }
            m::PARAMETER_VALUE => {
                complaint = Some(Complaint::NoKey);
                parameter(3).map_or(Asked::Nothing, Asked::Parameter)
            }
            _ => Asked::Nothing,
        };
        Ok(Read { request, complaint })
    }

    fn of(frame: &Frame<'_>, us: NodeId, arrival: Cycles) -> Self {
        let header = frame.header;
        Self {
            arrival,
            from: header.source,
            idd: header.idd,
            message: header.message,
            time_ms: None,
            // All would answer at once to what is for all.
            wants_acknowledgement: header.wants_acknowledgement && header.destination == us,
            wanted: Asked::Nothing,
        }
    }
}

/// LOI 2, monitor, as Edition 2's bit.
pub(crate) const LOI_2: u64 = 1;

/// The parameter of that index, or of that name.
fn parameter(index: Option<u16>, name: Option<&[u8]>) -> Option<Parameter> {
    match index.filter(|&it| it != m::BY_NAME) {
        Some(index) => Parameter::ALL.get(usize::from(index)).copied(),
        None => Parameter::named(Name::new(*name?.first_chunk()?)),
    }
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
