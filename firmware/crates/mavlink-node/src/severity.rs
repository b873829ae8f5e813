//! How much a text matters.

use mavlink::dialects::common::MavSeverity;

/// The severity of a STATUSTEXT (MAV_SEVERITY, RFC 5424).
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

impl From<Severity> for MavSeverity {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Error => Self::MAV_SEVERITY_ERROR,
            Severity::Warning => Self::MAV_SEVERITY_WARNING,
            Severity::Notice => Self::MAV_SEVERITY_NOTICE,
            Severity::Info => Self::MAV_SEVERITY_INFO,
        }
    }
}
