//! The order in which a receiver is configured.

use crate::config::Setting;
use crate::identity::Generation;

/// What is sent once the receiver is found, in this order, and to which generation; then
/// [`Setting::Forecasts`]. An M8 is saved before UBX is alone, because what is saved is what it has
/// then; later ones at the end, behind the pulse.
pub(super) const STEPS: [(Setting, Option<Generation>); 10] = [
    (Setting::Version, None),
    (Setting::Save, Some(Generation::Messages)),
    (Setting::Port, Some(Generation::Messages)),
    (Setting::Pulse, None),
    (Setting::Port, Some(Generation::Keys)),
    (Setting::Corrections, Some(Generation::Keys)),
    (Setting::Rate, None),
    (Setting::Message, None),
    (Setting::Navigation, None),
    (Setting::Save, Some(Generation::Keys)),
];
