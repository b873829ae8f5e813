//! The one command that a node obeys: a test begins, a test ends.
//!
//! *Purpose.* MAV_CMD_USER_1 (31010) with 0 as its first parameter begins a test: the
//! log of PINGs is cleared and records. With 1 the test ends: the log is frozen, and
//! written to the card if there is one.
//!
//! *Design.* Read from the raw payload, since the type in `mavlink` can only name
//! commands that it knows, and any other one is to be refused.
//!
//! *Limits.* The same in COMMAND_LONG and COMMAND_INT; the other parameters are not
//! looked at, `confirmation` neither: one that begins a test and comes again clears
//! the log again.

use mavlink::MessageData;
use mavlink::dialects::common::{COMMAND_ACK_DATA, MavResult};
use sample_log::Test;

use crate::frame::{Address, Frame, Sender, Version};

/// MAV_CMD_USER_1.
pub(crate) const USER_1: u16 = 31_010;

/// Where the command's number stands in COMMAND_LONG and in COMMAND_INT: behind
/// seven words, of which the first is a float in both.
const NUMBER: usize = 28;

/// The command's first parameter.
pub(crate) const fn param1(test: Test) -> f32 {
    match test {
        Test::Begins => 0.0,
        Test::Ends => 1.0,
    }
}

/// Why a command is not obeyed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Nothing of that number is known here (MAV_RESULT_UNSUPPORTED).
    Unsupported,
    /// The number is known, its first parameter is not (MAV_RESULT_DENIED).
    Denied,
}

/// A command to us.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// MAV_CMD, whether known or not.
    pub number: u16,
    /// What it means here.
    pub meaning: Result<Test, Refusal>,
}

impl Command {
    pub(crate) fn parse(payload: &[u8]) -> Option<Self> {
        let number = u16::from_le_bytes(*payload.get(NUMBER..)?.first_chunk()?);
        let param1 = f32::from_le_bytes(*payload.first_chunk()?);
        let meaning = if number != USER_1 {
            Err(Refusal::Unsupported)
        } else {
            [Test::Begins, Test::Ends]
                .into_iter()
                .find(|test| self::param1(*test) == param1)
                .ok_or(Refusal::Denied)
        };
        Some(Self { number, meaning })
    }

    /// COMMAND_ACK, by hand for the same reason.
    pub(crate) fn ack(self, sender: &mut Sender, version: Version, to: Address) -> Frame {
        let (id, crc_extra) = (COMMAND_ACK_DATA::ID as u8, COMMAND_ACK_DATA::EXTRA_CRC);
        let [low, high] = self.number.to_le_bytes();
        let result = match self.meaning {
            Ok(_) => MavResult::MAV_RESULT_ACCEPTED,
            Err(Refusal::Unsupported) => MavResult::MAV_RESULT_UNSUPPORTED,
            Err(Refusal::Denied) => MavResult::MAV_RESULT_DENIED,
        } as u8;
        // u16 command, u8 result; extensions: u8 progress, i32 result_param2,
        // u8 target_system, u8 target_component.
        let ack = [low, high, result, 0, 0, 0, 0, 0, to.system, to.component];
        sender.frame(version, id, crc_extra, |payload| {
            let (room, _) = payload.split_at_mut(ack.len());
            room.copy_from_slice(&ack);
            match version {
                Version::V1 => 3,
                // Trailing zeros are left out.
                Version::V2 => ack
                    .iter()
                    .rposition(|&byte| byte != 0)
                    .map_or(1, |last| last + 1),
            }
        })
    }
}
