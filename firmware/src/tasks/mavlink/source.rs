//! What the clock is steered by, as a number.

use utc_clock::Source;

/// The number of a source, as parameter and value have it.
pub fn number(source: Source) -> u8 {
    match source {
        Source::Nothing => 0,
        Source::Message => 1,
        Source::Pulse => 2,
    }
}
