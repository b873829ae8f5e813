//! What a baseline is.

/// A clock that follows the arrivals of time messages.
pub trait Baseline {
    /// Takes a message that names the epoch `epoch_utc_ns` (UTC since 1970), whose first byte
    /// arrived at `local_ns` of the board's nominal time. Calls come in the order of the arrivals.
    fn handle_mark(&mut self, local_ns: i64, epoch_utc_ns: i64);

    /// The time that it publishes at `local_ns`, UTC since 1970; none while it is unset. Never
    /// asked about a time before the last message. \[ns\]
    fn utc_ns(&self, local_ns: i64) -> Option<i64>;
}
