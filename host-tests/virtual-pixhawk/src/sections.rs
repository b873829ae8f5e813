//! What keeps interrupts waiting, and for how long.
//!
//! *Purpose.* Each section under PRIMASK with its length, and the way from a peripheral's request to
//! its handler, and to the handler's reading of the time.
//!
//! *Design.* A section lasts from the first instruction under PRIMASK to the one that ends it, and is
//! known by where it begins. A request lasts from the rise of the interrupt line to the first
//! instruction of the handler; to its stamp, until the handler reads the witness, which each reading
//! of the time does.
//!
//! *Limits.* A line that is up already when a second reason for it comes has one rise: the wait of the
//! second is counted from the first, too long rather than too short.

use std::collections::BTreeMap;

use rigless::device::Level;

use crate::stepping::{Moment, Traffic};
use crate::tally::Tally;

/// TIM5's CNT (RM0090, table 1 and section 18.4.10).
const WITNESS: u64 = 0x4000_0c24;
/// The exception number of interrupt line 0.
const FIRST_INTERRUPT: u16 = 16;

/// What was seen of sections and requests. \[instructions\]
#[derive(Clone, Debug, Default)]
pub(crate) struct Sections {
    /// By the address of their first instruction.
    pub(crate) masked: BTreeMap<u32, Tally>,
    /// From a request to the first instruction of its handler, by exception number.
    pub(crate) entries: BTreeMap<u16, Tally>,
    /// From a request to the handler's reading of the time.
    pub(crate) stamps: BTreeMap<u16, Tally>,
    /// Where the section that lasts began, and how long it is by now.
    open: Option<(u32, u64)>,
    /// When the lines that are up rose.
    requests: BTreeMap<u16, Request>,
}

/// A request that stands.
#[derive(Clone, Copy, Debug)]
struct Request {
    /// Instructions executed when it came.
    since: u64,
    is_entered: bool,
    is_stamped: bool,
}

impl Sections {
    /// `retired` instructions were executed at `moment`, the last of `executed` in all.
    pub(crate) fn after(&mut self, moment: Moment, retired: u64, executed: u64) {
        if moment.is_masked {
            let (_, length) = self.open.get_or_insert((moment.pc, 0));
            *length += retired;
        } else if let Some((from, length)) = self.open.take() {
            self.masked.entry(from).or_default().add(length);
        }
        if let Some(request) = self.requests.get_mut(&moment.ipsr)
            && !request.is_entered
        {
            request.is_entered = true;
            let waited = (executed - retired).saturating_sub(request.since);
            self.entries.entry(moment.ipsr).or_default().add(waited);
        }
    }

    /// Something went over the bus while the core was on behalf of `exception`, with `executed`
    /// instructions done.
    pub(crate) fn on_traffic(&mut self, traffic: Traffic, exception: u16, executed: u64) {
        match traffic {
            Traffic::Line(line, Level::High) => {
                let request = Request {
                    since: executed,
                    is_entered: false,
                    is_stamped: false,
                };
                self.requests
                    .entry(FIRST_INTERRUPT + line)
                    .or_insert(request);
            }
            Traffic::Line(line, Level::Low) => {
                self.requests.remove(&(FIRST_INTERRUPT + line));
            }
            Traffic::Read(WITNESS) => {
                if let Some(request) = self.requests.get_mut(&exception)
                    && !request.is_stamped
                {
                    request.is_stamped = true;
                    let waited = executed.saturating_sub(request.since);
                    self.stamps.entry(exception).or_default().add(waited);
                }
            }
            Traffic::Read(_) => {}
        }
    }
}
