//! Whether a test may begin where a log is not saved yet.
//!
//! *Design.* A test that begins clears the log. Where samples would be lost by that, the command is
//! refused once, and obeyed when it comes again: not so soon that it could be a repetition by a
//! program, and not so late that nobody remembers.

use timebase::{CORE_HZ, Cycles};

/// From when to when after a refusal the same command is meant. \[cycles\]
const MEANT_FROM: i64 = 2 * CORE_HZ as i64;
const MEANT_UNTIL: i64 = 30 * CORE_HZ as i64;

/// Asks back before a log is lost.
#[derive(Debug, Default)]
pub struct BeginGuard {
    refused: Option<Cycles>,
}

impl BeginGuard {
    /// Nothing was refused yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { refused: None }
    }

    /// Whether a test may begin, by a command that came at `now`; `unsaved` samples would be lost.
    pub fn handle_begin(&mut self, unsaved: u32, now: Cycles) -> bool {
        let waited = self.refused.map(|refused| now.since(refused));
        let is_meant = waited.is_some_and(|waited| (MEANT_FROM..=MEANT_UNTIL).contains(&waited));
        let may_begin = unsaved == 0 || is_meant;
        let is_repeated = waited.is_some_and(|waited| (0..MEANT_FROM).contains(&waited));
        if may_begin {
            self.refused = None;
        } else if !is_repeated {
            self.refused = Some(now);
        }
        may_begin
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> Cycles {
        Cycles::from_micros(ms * 1_000)
    }

    #[test]
    fn a_log_is_lost_only_by_a_command_that_is_repeated_in_time() {
        for (again_ms, may_begin) in [
            (1, false),
            (1_999, false),
            (2_000, true),
            (30_000, true),
            (30_001, false),
        ] {
            let mut guard = BeginGuard::new();
            assert!(!guard.handle_begin(7, at(500)));
            assert_eq!(
                guard.handle_begin(7, at(500 + again_ms)),
                may_begin,
                "{again_ms}"
            );
        }
    }

    #[test]
    fn repetitions_by_a_program_do_not_put_it_off() {
        let mut guard = BeginGuard::new();
        let obeyed = [0, 700, 1_400, 2_100].map(|ms| guard.handle_begin(7, at(ms)));
        assert_eq!(obeyed, [false, false, false, true]);
        assert!(
            !guard.handle_begin(7, at(2_800)),
            "the next log has its own question"
        );
    }

    #[test]
    fn nothing_is_asked_where_nothing_is_lost() {
        let mut guard = BeginGuard::new();
        assert!(guard.handle_begin(0, at(0)));
        assert!(!guard.handle_begin(1, at(10)));
    }
}
