//! The log over MAVLink: LOG_ENTRY, and LOG_DATA piece by piece.
//!
//! *Purpose.* What has been requested of the log and not been sent yet.
//!
//! *Design.* A request is noted. The frames are made one at a time, when the line has room
//! ([`Node::poll`](crate::Node::poll)). A new request for data replaces the one before, so that a
//! client which missed a piece can ask for it and go on. The end of the log is looked up for each
//! piece, since the log may grow or be cleared meanwhile. A request behind its end is answered with
//! a piece of no bytes.
//!
//! *Limits.* There is one log, number 1, and it is listed even when it is empty. Number 2 is the
//! [status](crate::StatusLine).

use mavlink::dialects::common::{LOG_DATA_DATA, LOG_ENTRY_DATA};
use timebase::divide;

use crate::frame::{Frame, Sender, Version};

/// Bytes of a log in one LOG_DATA.
pub const LOG_DATA_LEN: usize = 90;

/// The number of the log.
pub(crate) const LOG_ID: u16 = 1;

/// Where a node finds the file of its log.
pub trait LogFile {
    /// Its length, in bytes.
    fn log_len(&self) -> u32;

    /// When the log was begun, in ns of UTC since 1970, if it was and that is known.
    fn log_began_ns(&self) -> Option<i64>;

    /// Fills `out` with the file from `offset` on, and returns the number of bytes: fewer than
    /// `out` has room for at the end of the file.
    fn read_log(&self, offset: u32, out: &mut [u8]) -> usize;
}

/// The frames that are still to be sent.
#[derive(Debug)]
pub(crate) struct LogTransfer {
    version: Version,
    entry_is_wanted: bool,
    stretch: Option<Stretch>,
}

/// The bytes that are still wanted, including those beyond the end of the log.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    next: u32,
    end: u32,
}

impl LogTransfer {
    pub(crate) const NONE: Self = Self {
        version: Version::V1,
        entry_is_wanted: false,
        stretch: None,
    };

    pub(crate) const fn want_entry(&mut self, version: Version) {
        self.version = version;
        self.entry_is_wanted = true;
    }

    pub(crate) const fn want(&mut self, version: Version, offset: u32, count: u32) {
        self.version = version;
        self.stretch = Some(Stretch {
            next: offset,
            end: offset.saturating_add(count),
        });
    }

    pub(crate) const fn end(&mut self) {
        self.stretch = None;
    }

    pub(crate) const fn is_done(&self) -> bool {
        !self.entry_is_wanted && self.stretch.is_none()
    }

    pub(crate) fn poll(&mut self, sender: &mut Sender, log: &impl LogFile) -> Option<Frame> {
        if self.entry_is_wanted {
            self.entry_is_wanted = false;
            return Some(sender.message(self.version, &entry(log)));
        }
        let Stretch { next, end } = self.stretch?;
        let mut data = [0; LOG_DATA_LEN];
        let wanted = end.saturating_sub(next).min(LOG_DATA_LEN as u32);
        let room = data.get_mut(..wanted as usize).unwrap_or_default();
        let count = log.read_log(next, room).min(LOG_DATA_LEN) as u32;
        let next_after = next.saturating_add(count);
        let goes_on = count > 0 && next_after < end.min(log.log_len());
        self.stretch = goes_on.then_some(Stretch {
            next: next_after,
            end,
        });
        let piece = LOG_DATA_DATA {
            ofs: next,
            id: LOG_ID,
            count: count as u8,
            data,
        };
        Some(sender.message(self.version, &piece))
    }
}

fn entry(log: &impl LogFile) -> LOG_ENTRY_DATA {
    let began_ns = u64::try_from(log.log_began_ns().unwrap_or(0)).unwrap_or(0);
    LOG_ENTRY_DATA {
        time_utc: divide::<1_000_000_000>(began_ns) as u32,
        size: log.log_len(),
        id: LOG_ID,
        num_logs: LOG_ID,
        last_log_num: LOG_ID,
    }
}
