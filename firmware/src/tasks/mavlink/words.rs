//! Events in words, for STATUSTEXT.
//!
//! *Limits.* A STATUSTEXT holds 50 characters; the longest text here is shorter.

use heapless::{String, Vec};
use mavlink_node::{Severity, difference};
use timebase::divide;

use crate::clock_events::ClockEvent;

type Text = String<50>;

/// The severity of an event, and its text.
pub fn statustext(event: ClockEvent) -> (Severity, Text) {
    let mut text = Text::new();
    let (severity, before, number, behind) = match event {
        ClockEvent::Set => (Severity::Notice, "clock set", None, ""),
        ClockEvent::SecondUnproved => (Severity::Warning, "clock: second not proved", None, ""),
        ClockEvent::SecondProved => (Severity::Notice, "clock: second proved", None, ""),
        ClockEvent::SecondContradicted => {
            (Severity::Warning, "clock: second contradicted", None, "")
        }
        ClockEvent::Holdover => (Severity::Warning, "clock in holdover", None, ""),
        ClockEvent::SteeredAgain => (Severity::Notice, "clock steered again", None, ""),
        ClockEvent::Stepped { by_ns } => {
            // All of it fits.
            let _ = text.push_str("clock stepped ");
            let _ = text.push_str(difference(by_ns).as_str());
            return (Severity::Warning, text);
        }
        ClockEvent::PulseFollowed => (Severity::Notice, "clock follows the pulse", None, ""),
        ClockEvent::PulseLost => (Severity::Warning, "clock lost the pulse", None, ""),
        ClockEvent::Refused(setting) => {
            (Severity::Warning, "receiver refuses ", None, setting.name())
        }
        ClockEvent::LogFull => (Severity::Warning, "log full", None, ""),
        ClockEvent::Saved { file, samples } => {
            push_number(&mut text, samples.into());
            let behind = " samples saved to the card, file ";
            (Severity::Notice, behind, Some(file.into()), "")
        }
        ClockEvent::Saving { for_s } => (
            Severity::Notice,
            "log is being saved, for ",
            Some(for_s.cast_signed()),
            " s; 3 stops it",
        ),
        ClockEvent::NotSaved(why) => (Severity::Warning, "log not saved: ", None, why.advice()),
    };
    // All of it fits.
    let _ = text.push_str(before);
    if let Some(number) = number {
        push_number(&mut text, number);
    }
    let _ = text.push_str(behind);
    (severity, text)
}

/// Writes a number by hand: `core::fmt` would bring 2 KB for this one.
fn push_number(text: &mut Text, number: i64) {
    let mut digits = Vec::<u8, 20>::new();
    let mut rest = number.unsigned_abs();
    while rest > 0 || digits.is_empty() {
        let tens = divide::<10>(rest);
        // 2⁶⁴ has 20 digits.
        let _ = digits.push(b'0' + (rest - tens * 10) as u8);
        rest = tens;
    }
    if number < 0 {
        let _ = text.push('-');
    }
    for digit in digits.iter().rev() {
        let _ = text.push(char::from(*digit));
    }
}
