//! Events in words, for STATUSTEXT.
//!
//! *Limits.* A STATUSTEXT holds 50 characters; the longest text here is shorter.

use fault_record::{Place, Reason};
use heapless::{String, Vec};
use mavlink_node::{Severity, difference};
use timebase::divide;
use ubx_link::Finding;

use crate::clock_events::ClockEvent;
use crate::story;

type Text = String<50>;

/// The severity of an event, and its text.
#[inline(never)]
pub fn statustext(event: ClockEvent) -> (Severity, Text) {
    if let ClockEvent::Restarted { reason, place } = event {
        return (Severity::Error, restarted(reason, place));
    }
    if let ClockEvent::Receiver(finding) = event {
        return receiver(finding);
    }
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
        ClockEvent::Restarted { .. } => (Severity::Error, "restarted", None, ""),
        ClockEvent::Receiver(_) => (Severity::Info, "GNSS", None, ""),
        ClockEvent::CrystalLate { after_us } => (
            Severity::Warning,
            "the crystal started late: ",
            Some(after_us.into()),
            " us",
        ),
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
        ClockEvent::Unsaved(samples) => {
            push_number(&mut text, samples.into());
            let behind = " samples not saved: save, or begin again";
            (Severity::Warning, behind, None, "")
        }
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

/// What is known of the receiver. Its names have at most 16 characters.
fn receiver(finding: Finding) -> (Severity, Text) {
    let mut text = Text::new();
    let (severity, words) = match &finding {
        Finding::Searching | Finding::Silent => {
            (Severity::Warning, ["no receiver answers", "", ""])
        }
        Finding::Unnamed => (Severity::Warning, ["no name, nothing answered", "", ""]),
        Finding::Used(identity) => (Severity::Info, [identity.model(), " ", identity.firmware()]),
        Finding::Unused(identity, why) => (
            Severity::Warning,
            [identity.model(), " unused: ", why.reason()],
        ),
    };
    // All of it fits.
    let _ = text.push_str("GNSS: ");
    for word in words {
        let _ = text.push_str(word);
    }
    if let Finding::Used(identity) = finding {
        let hundredths = identity.protocol();
        let _ = text.push_str(", UBX ");
        push_number(&mut text, (hundredths / 100).into());
        let _ = text.push('.');
        for digit in [hundredths / 10 % 10, hundredths % 10] {
            push_number(&mut text, digit.into());
        }
    }
    (severity, text)
}

/// A fault that ended the run before.
fn restarted(reason: Reason, place: Place) -> Text {
    let mut text = Text::new();
    // All of it fits.
    let _ = text.push_str("restarted: ");
    let _ = match (reason, place) {
        (Reason::Panic, Place::Source { .. }) => {
            let _ = text.push_str("panic, ");
            text.push_str(&place_word(place))
        }
        (Reason::Panic, _) => text.push_str("panic"),
        (Reason::HardFault, Place::StackOverflow) => text.push_str("stack overflow"),
        (Reason::HardFault, Place::Instruction(_)) => {
            let _ = text.push_str("hard fault at ");
            text.push_str(&place_word(place))
        }
        (Reason::HardFault, _) => text.push_str("hard fault"),
        (Reason::Unexpected(exception), _) => {
            let _ = text.push_str("no handler for exception ");
            push_number(&mut text, exception.into());
            Ok(())
        }
        (Reason::Crystal, _) => text.push_str("the crystal failed"),
        (Reason::Task(which), _) => {
            let _ = text.push_str("the task stopped: ");
            text.push_str(story::task_name(which))
        }
        (Reason::Watchdog, Place::Instruction(_)) => text.push_str("the tick stopped"),
        (Reason::Watchdog, _) => text.push_str("the watchdog was not fed"),
    };
    text
}

/// The place of a fault as one word: `file.rs:12`, `0x08001234`, `stack_overflow`; empty if it is not
/// known.
pub fn place_word(place: Place) -> Text {
    /// Of a file's path, what has room.
    const FILE: usize = 22;
    let mut text = Text::new();
    match place {
        Place::Source { file, len, line } => {
            let path = story::file_name(file, len);
            let tail = path.get(path.len().saturating_sub(FILE)..).unwrap_or(path);
            // All of it fits.
            let _ = text.push_str(tail);
            let _ = text.push(':');
            push_number(&mut text, line.into());
        }
        Place::Instruction(at) => {
            let _ = text.push_str("0x");
            push_hex(&mut text, at);
        }
        Place::StackOverflow => {
            let _ = text.push_str("stack_overflow");
        }
        Place::Unknown => {}
    }
    text
}

fn push_hex(text: &mut Text, number: u32) {
    for digit in (0..8).rev().map(|n| number >> (4 * n) & 0xF) {
        let _ = text.push(char::from_digit(digit, 16).unwrap_or('?'));
    }
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
