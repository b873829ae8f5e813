//! How much a text matters.

/// The severity of a text, as RFC 5424 has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Something failed.
    Error,
    /// Something may fail.
    Warning,
    /// Unusual, but no fault.
    Notice,
    /// Ordinary operation.
    Info,
}
