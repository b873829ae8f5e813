//! How often a board has restarted for one reason.

use crate::reason::Reason;

/// The fault that would be this restart for one reason within [`WINDOW_MS`] is the end instead.
pub const RESTARTS: usize = 3;

/// The time in which restarts are counted, in ms of the runs between them.
pub const WINDOW_MS: u32 = 60_000;

/// How long ago an event was that never happened.
const NEVER: u32 = u32::MAX;

/// When a board restarted for a reason, as of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct History {
    /// How long before it the last restarts for the same reason were, the last first. \[ms\]
    pub(crate) ages_ms: [u32; RESTARTS - 1],
}

impl History {
    /// No restart yet.
    pub const NONE: Self = Self {
        ages_ms: [NEVER; RESTARTS - 1],
    };

    /// The history at a fault for `reason` that ends a run of `up_ms`, which itself was the restart
    /// after `before`, if there was one.
    #[must_use]
    pub fn at(reason: Reason, up_ms: u32, before: Option<(Reason, Self)>) -> Self {
        let Some((_, Self { ages_ms })) = before.filter(|(earlier, _)| *earlier == reason) else {
            return Self::NONE;
        };
        let [last, ..] = ages_ms;
        Self {
            ages_ms: [up_ms, last.saturating_add(up_ms)],
        }
    }

    /// Whether a restart now would be one too many.
    #[must_use]
    pub fn is_enough(self) -> bool {
        self.ages_ms.iter().all(|&age| age <= WINDOW_MS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Hang;

    /// Which of the faults, each after a run of that length in ms for that reason, is the end.
    fn end(faults: &[(Reason, u32)]) -> Option<usize> {
        let mut before = None;
        faults.iter().position(|&(reason, up_ms)| {
            let history = History::at(reason, up_ms, before);
            before = Some((reason, history));
            history.is_enough()
        })
    }

    #[test]
    fn the_third_restart_within_a_minute_is_not_made() {
        let fault = |up_ms| (Reason::HardFault, up_ms);
        assert_eq!(end(&[fault(5), fault(5)]), None);
        assert_eq!(end(&[fault(5), fault(5), fault(5)]), Some(2));
        // The first run may have been long.
        assert_eq!(end(&[fault(u32::MAX), fault(1), fault(1)]), Some(2));
        assert_eq!(end(&[fault(0), fault(59_000), fault(1_000)]), Some(2));
        assert_eq!(end(&[fault(0), fault(59_000), fault(1_001)]), None);
        // Once every half a minute and a bit goes on for ever.
        assert_eq!(end(&[fault(30_001); 50]), None);
        // A window slides: a late second fault does not forgive the third and fourth.
        assert_eq!(end(&[fault(0), fault(60_001), fault(5), fault(5)]), Some(3));
    }

    #[test]
    fn reasons_are_counted_apart() {
        let gnss = (Reason::Task(Hang::Gnss), 1_000);
        let mavlink = (Reason::Task(Hang::Mavlink), 1_000);
        assert_eq!(end(&[gnss, mavlink, gnss, mavlink, gnss, mavlink]), None);
        assert_eq!(end(&[mavlink, gnss, gnss, gnss]), Some(3));
    }
}
