//! The commands that a node obeys.
//!
//! *Purpose.* MAV_CMD_USER_1 (31010) with 0 as its first parameter begins a test: the
//! log of PINGs is cleared and records. With 1 the test ends: the log is frozen, and
//! written to the card if there is one; 2 has it written once more, and 3 stops that. MAV_CMD_REQUEST_MESSAGE (512) asks for AUTOPILOT_VERSION
//! (148), PROTOCOL_VERSION (300) or HOME_POSITION (242), and so do the older commands 520, 519 and 410.
//! MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN (246) with 3 restarts the board into its bootloader, which then
//! waits for an upload; other restarts would end a clock for nothing, and are denied.
//!
//! *Design.* Parsed from the raw payload, since the type in `mavlink` has no value for commands
//! that it does not know, and these have to be refused.
//!
//! *Limits.* COMMAND_LONG and COMMAND_INT mean the same. The other parameters and `confirmation`
//! are ignored: a command that begins a test and is repeated clears the log again.

use core::error::Error;
use core::fmt;

use mavlink::MessageData;
use mavlink::dialects::common::{
    AUTOPILOT_VERSION_DATA, COMMAND_ACK_DATA, HOME_POSITION_DATA, MavResult,
};
use sample_log::Test;

use crate::frame::{Address, Frame, Sender, Version};
use crate::replies::{Described, PROTOCOL_VERSION};

/// MAV_CMD_USER_1.
pub(crate) const USER_1: u16 = 31_010;

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, and REBOOT_SHUTDOWN_ACTION_REBOOT_TO_BOOTLOADER, the one first
/// parameter of it that is obeyed.
const REBOOT: u16 = 246;
pub(crate) const TO_BOOTLOADER: f32 = 3.0;

/// MAV_CMD_GET_HOME_POSITION, _REQUEST_MESSAGE, _REQUEST_PROTOCOL_VERSION,
/// _REQUEST_AUTOPILOT_CAPABILITIES.
const GET_HOME_POSITION: u16 = 410;
const REQUEST_MESSAGE: u16 = 512;
const REQUEST_PROTOCOL_VERSION: u16 = 519;
const REQUEST_AUTOPILOT_CAPABILITIES: u16 = 520;

/// The offset of the command's number in COMMAND_LONG and in COMMAND_INT, in bytes: behind seven
/// words, of which the first is a float in both.
const NUMBER: usize = 28;

/// What MAV_CMD_USER_1 can mean.
const TESTS: [Test; 4] = [
    Test::Begins,
    Test::Ends,
    Test::SavesAgain,
    Test::StopsSaving,
];

/// The command's first parameter.
pub(crate) const fn param1(test: Test) -> f32 {
    match test {
        Test::Begins => 0.0,
        Test::Ends => 1.0,
        Test::SavesAgain => 2.0,
        Test::StopsSaving => 3.0,
    }
}

/// Why a command is not obeyed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// A command of that number is not known here (MAV_RESULT_UNSUPPORTED).
    Unsupported,
    /// The number is known, its first parameter is not (MAV_RESULT_DENIED).
    Denied,
    /// What is asked for is not known yet, or samples would be lost by it
    /// (MAV_RESULT_TEMPORARILY_REJECTED).
    NotYet,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unsupported => "the command is not supported",
            Self::Denied => "the command does not have this parameter",
            Self::NotYet => "not now: it is not known yet, or samples would be lost by it",
        })
    }
}

impl Error for Refusal {}

/// What a command wants to have done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// A test begins or ends.
    Test(Test),
    /// A message is sent after the acknowledgement.
    Describe(Described),
    /// The board restarts into its bootloader, once the acknowledgement has left.
    Bootloader,
}

/// A command to this node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// MAV_CMD, whether known or not.
    pub number: u16,
    /// What it means to this node.
    pub meaning: Result<Order, Refusal>,
}

impl Command {
    pub(crate) fn parse(payload: &[u8]) -> Option<Self> {
        let number = u16::from_le_bytes(*payload.get(NUMBER..)?.first_chunk()?);
        let param1 = f32::from_le_bytes(*payload.first_chunk()?);
        let describe = |what, is_meant: bool| {
            let order = is_meant.then_some(Order::Describe(what));
            order.ok_or(Refusal::Denied)
        };
        let meaning = match number {
            USER_1 => TESTS
                .into_iter()
                .find(|test| self::param1(*test) == param1)
                .map(Order::Test)
                .ok_or(Refusal::Denied),
            REBOOT if param1 == TO_BOOTLOADER => Ok(Order::Bootloader),
            REBOOT => Err(Refusal::Denied),
            REQUEST_MESSAGE if param1 == PROTOCOL_VERSION as f32 => {
                describe(Described::Protocol, true)
            }
            REQUEST_MESSAGE if param1 == HOME_POSITION_DATA::ID as f32 => {
                describe(Described::Home, true)
            }
            GET_HOME_POSITION => describe(Described::Home, true),
            REQUEST_MESSAGE => describe(
                Described::Autopilot,
                param1 == AUTOPILOT_VERSION_DATA::ID as f32,
            ),
            REQUEST_PROTOCOL_VERSION => describe(Described::Protocol, param1 == 1.0),
            REQUEST_AUTOPILOT_CAPABILITIES => describe(Described::Autopilot, param1 == 1.0),
            _ => Err(Refusal::Unsupported),
        };
        Some(Self { number, meaning })
    }

    /// COMMAND_ACK, built by hand for the same reason.
    pub(crate) fn ack(self, sender: &mut Sender, version: Version, to: Address) -> Frame {
        let kind = (COMMAND_ACK_DATA::ID, COMMAND_ACK_DATA::EXTRA_CRC);
        let [low, high] = self.number.to_le_bytes();
        let result = match self.meaning {
            Ok(_) => MavResult::MAV_RESULT_ACCEPTED,
            Err(Refusal::Unsupported) => MavResult::MAV_RESULT_UNSUPPORTED,
            Err(Refusal::Denied) => MavResult::MAV_RESULT_DENIED,
            Err(Refusal::NotYet) => MavResult::MAV_RESULT_TEMPORARILY_REJECTED,
        } as u8;
        // u16 command, u8 result; extensions: u8 progress, i32 result_param2,
        // u8 target_system, u8 target_component.
        let ack = [low, high, result, 0, 0, 0, 0, 0, to.system, to.component];
        sender.bytes(version, kind, &ack, 3)
    }
}
