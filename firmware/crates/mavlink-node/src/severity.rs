//! How much a STATUSTEXT matters.

use mavlink::dialects::common::MavSeverity;
use node_values::Severity;

/// The severity as MAVLink has it (MAV_SEVERITY).
pub(crate) const fn mav_severity(severity: Severity) -> MavSeverity {
    match severity {
        Severity::Error => MavSeverity::MAV_SEVERITY_ERROR,
        Severity::Warning => MavSeverity::MAV_SEVERITY_WARNING,
        Severity::Notice => MavSeverity::MAV_SEVERITY_NOTICE,
        Severity::Info => MavSeverity::MAV_SEVERITY_INFO,
    }
}
