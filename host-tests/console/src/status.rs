//! The firmware's status line.
//!
//! *Purpose.* Once a second the firmware logs `status state=set utc=… marks=5 …`;
//! [`Status`] is that line as pairs, in its own order.
//!
//! *Design.* The pairs are the firmware's. Named here are the state, and what the keys of refusals
//! begin with: a new counter shows without a change.
//!
//! *Limits.* Keys and values are words without blanks and `=`.

use timebase::ClockState;

use serde_json::{Map, Number, Value};

/// What a status line begins with.
const OPENING: &str = "status ";

/// One status line of the firmware.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Status(Vec<(String, String)>);

impl Status {
    /// Reads a line of the log; `None` if it is no status line.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let pairs = text
            .strip_prefix(OPENING)?
            .split_whitespace()
            .filter_map(|pair| pair.split_once('='))
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .collect();
        Some(Self(pairs))
    }

    /// The value of `key`.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&str> {
        self.pairs()
            .find_map(|(name, value)| (name == key).then_some(value))
    }

    /// The value of `key` as a number.
    #[must_use]
    pub fn number(&self, key: &str) -> Option<i64> {
        self.get(key)?.parse().ok()
    }

    /// The state of the clock.
    #[must_use]
    pub fn state(&self) -> Option<ClockState> {
        let word = self.get("state")?;
        (0..)
            .map_while(ClockState::from_bits)
            .find(|state| state.as_str() == word)
    }

    /// The clock keeps UTC: it was set and marks still come.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.state() == Some(ClockState::Set)
    }

    /// Marks and pulses that were not believed, by kind, as in `mark_outlier`: those counters
    /// that are not 0.
    pub fn refusals(&self) -> impl Iterator<Item = (&str, u64)> {
        self.pairs()
            .filter(|(key, _)| key.starts_with("mark_") || key.starts_with("pulse_"))
            // A lock is what one hopes for.
            .filter(|(key, _)| *key != "pulse_locks")
            .filter_map(|(key, count)| Some((key, count.parse().ok()?)))
    }

    /// The pairs, in the firmware's order.
    pub fn pairs(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0
            .iter()
            .map(|(key, value)| (key.as_str(), value.as_str()))
    }

    /// As a JSON object, with numbers as numbers and truths as truths.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let fields = self.pairs().map(|(key, value)| {
            let number = value.parse::<i64>().map(Number::from).map(Value::Number);
            let truth = value.parse::<bool>().map(Value::Bool);
            let value = number.or(truth).unwrap_or_else(|_| value.into());
            (key.to_owned(), value)
        });
        Value::Object(fields.collect::<Map<_, _>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: &str =
        "status state=set utc=2026-11-22T04:00:00.123456Z unc_us=120001 marks=5 leap=true";

    #[test]
    fn the_pairs_come_out_in_their_order() {
        let status = Status::parse(LINE).unwrap();
        let keys: Vec<_> = status.pairs().map(|(key, _)| key).collect();
        assert_eq!(keys, ["state", "utc", "unc_us", "marks", "leap"]);
        assert_eq!(status.state(), Some(ClockState::Set));
        assert!(status.is_set());
        assert_eq!(status.number("unc_us"), Some(120_001));
        assert_eq!(status.number("utc"), None);
    }

    #[test]
    fn a_line_that_only_speaks_of_a_status_is_none() {
        assert_eq!(Status::parse("the status state=set"), None);
    }

    #[test]
    fn refusals_are_the_counters_of_marks_and_pulses_and_no_others() {
        let text = "status source=pulse marks=5 refused=3 mark_late=2 pulses=9 pulse_locks=1 \
                    pulse_off_second=1 mav_unknown=4";
        let status = Status::parse(text).unwrap();
        let refusals: Vec<_> = status.refusals().collect();
        assert_eq!(refusals, [("mark_late", 2), ("pulse_off_second", 1)]);
        assert_eq!(status.state(), None);
    }

    #[test]
    fn json_has_numbers_and_truths_as_such() {
        let json = Status::parse(LINE).unwrap().to_json();
        assert_eq!(json["marks"], 5);
        assert_eq!(json["leap"], true);
        assert_eq!(json["utc"], "2026-11-22T04:00:00.123456Z");
    }
}
