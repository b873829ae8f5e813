//! The configuration frames, byte for byte.
//!
//! *Purpose.* The receiver's settings: the line's rate and UBX alone, a solution
//! each 200 ms on the grid of UTC, NAV-PVT of it, the airborne model, a pulse at
//! each full second, whether to forecast it, silence about the rest, and the line's rate once
//! more for the next start. And the polls of NAV-TIMELS, MON-VER and CFG-PRT.
//!
//! *Design.* One list of settings for all receivers, each with a message of its own for the M8
//! and with keys for those after it ([`keys`](crate::keys)). The messages are built by `ublox`, except
//! for CFG-PRT: its builder leaves out a bit of `mode` that is reserved and set in every receiver's
//! own answer. A test compares the frames to the byte with those of two other encoders.

use ublox::cfg_msg::CfgMsgSinglePortBuilder;
use ublox::cfg_nav5::{CfgNav5Builder, CfgNav5Params, NavDynamicModel, NavFixMode};
use ublox::cfg_rate::{AlignmentToReferenceTime, CfgRateBuilder};
use ublox::cfg_tp5::{CfgTp5Builder, CfgTp5Flags};

use crate::answers::Protocols;
use crate::frame_buffer::{Buffer, put, sum};
use crate::identity::Generation;
use crate::keys::{self, Keys};
use crate::kind::{SYNC_1, SYNC_2};

/// The default rate of the line, in baud.
pub const BAUD: u32 = 115_200;

/// The rates at which a receiver is looked for, in baud, in the order of the search: ours, the
/// factory's (of M9 and later, and of the M8 and before), and what makers of modules choose.
///
/// What is sent at 9600 makes so many framing errors at a faster receiver that it may ignore its line
/// for the rest of the second: so the rate that is least common follows.
pub const BAUDS: [u32; 6] = [BAUD, 38_400, 9_600, 460_800, 57_600, 230_400];

/// From solution to solution, in ms.
const PERIOD_MS: u16 = 200;

/// How long the pulse is high that the receiver is asked for, in µs: 37 ms.
///
/// It has to be nobody's default, so that the pulse of another module, or of this one as it comes out of its
/// box, is distinguished from ours by its width: u-blox has 100 ms, others 1, 10, 20, 25, 40, 50, 200 or 500 ms, and a
/// clock takes no width for ours that is 2 ms off. Inverted, it is 963 ms. And it is short, because a
/// pulse is known for one only when it falls.
pub const PULSE_WIDTH_US: u32 = 37_000;

/// The poll of NAV-TIMELS: the message without a payload.
pub(crate) const POLL_LEAP_SECONDS: [u8; 8] = [SYNC_1, SYNC_2, 0x01, 0x26, 0, 0, 0x27, 0x76];

/// CFG-INF: of protocol 0, which is UBX, no notice is left in the mask of any port.
const NOTICES: [u8; 18] = [
    SYNC_1, SYNC_2, 0x06, 0x02, 10, 0, // class, id, length
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // the protocol, and six ports
    0x12, 0xe6,
];

/// The poll of MON-VER.
const POLL_VERSION: [u8; 8] = [SYNC_1, SYNC_2, 0x0a, 0x04, 0, 0, 0x0e, 0x34];

/// The poll of CFG-PRT for UART1.
pub(crate) const POLL_PORT: [u8; 9] = [SYNC_1, SYNC_2, 0x06, 0x00, 1, 0, 1, 0x08, 0x22];

/// CFG-CFG: nothing is cleared or loaded, the ports are saved, in all memories that there are.
const SAVE_PORTS: [u8; 21] = [
    SYNC_1, SYNC_2, 0x06, 0x09, 13, 0, // class, id, length
    0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0,    // clear, save, load
    0x17, // battery-backed RAM, flash, EEPROM and SPI flash
    0x34, 0xd9,
];

const NAV_PVT: (u8, u8) = (0x01, 0x07);
const TIM_TP: (u8, u8) = (0x0d, 0x01);

/// The protocols of a port with UBX alone.
pub(crate) const UBX_ALONE: Protocols = [UBX, 0, UBX, 0];
const UBX: u8 = 1;

/// A configuration frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// MON-VER: what the receiver is. It is a poll.
    Version,
    /// CFG-PRT: UART1 at our rate, 8N1, UBX in and out.
    Port,
    /// No RTCM3 from UART1: a key that only some have. CFG-PRT has it for the M8.
    Corrections,
    /// The rate of the line is kept when the receiver restarts: CFG-CFG with the protocols that the port
    /// has then, or the key alone in battery-backed RAM, so that the protocols there stay as they were.
    Save,
    /// CFG-RATE: a solution every 200 ms, aligned to UTC.
    Rate,
    /// CFG-MSG: NAV-PVT at every solution, on the port that receives this.
    Message,
    /// CFG-NAV5: airborne below 2 g, 3D fixes only.
    Navigation,
    /// CFG-TP5: a pulse of [`PULSE_WIDTH_US`] at each second of UTC, and none while GNSS time is not
    /// known; its rising edge is the mark.
    Pulse,
    /// CFG-MSG: TIM-TP before every pulse, on the port that receives this, or never.
    Forecasts {
        /// Whether it is to come.
        on: bool,
    },
    /// CFG-INF: no notices (the class INF) in UBX.
    Notices,
    /// CFG-MSG: a message never, on the port that receives this.
    Off {
        /// Its class.
        class: u8,
        /// Its id.
        id: u8,
    },
}

impl Setting {
    /// Class and id, as in the answer.
    #[must_use]
    pub const fn message(self, generation: Generation) -> (u8, u8) {
        let id = match (generation, self) {
            (_, Self::Version) => return (0x0a, 0x04),
            (Generation::Keys, _) => 0x8a,
            (_, Self::Port | Self::Corrections) => 0x00,
            (_, Self::Rate) => 0x08,
            (_, Self::Save) => 0x09,
            (_, Self::Message | Self::Forecasts { .. } | Self::Off { .. }) => 0x01,
            (_, Self::Notices) => 0x02,
            (_, Self::Navigation) => 0x24,
            (_, Self::Pulse) => 0x31,
        };
        (0x06, id)
    }

    /// What it is called in the receiver's own words, of whatever generation; of [`Self::Off`] the
    /// message.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Version => "MON-VER",
            Self::Port => "CFG-PRT",
            Self::Corrections => "RTCM3 off",
            Self::Save => "CFG-CFG",
            Self::Rate => "CFG-RATE",
            Self::Message => "NAV-PVT",
            Self::Navigation => "CFG-NAV5",
            Self::Pulse => "CFG-TP5",
            Self::Forecasts { .. } => "TIM-TP",
            Self::Notices => "CFG-INF",
            Self::Off { class, id } => match (class, id) {
                (0x01, 0x26) => "NAV-TIMELS off",
                (0x01, _) => "NAV off",
                (0x02, 0x13) => "RXM-SFRBX off",
                (0x02, 0x14) => "RXM-MEASX off",
                (0x02, 0x15) => "RXM-RAWX off",
                (0x02, _) => "RXM off",
                (0x0a, _) => "MON off",
                (0x0d, _) => "TIM off",
                _ => "UBX off",
            },
        }
    }

    /// Class and id of the message that it is about, or its own of the M8.
    #[must_use]
    pub const fn subject(self) -> (u8, u8) {
        match self {
            Self::Message => NAV_PVT,
            Self::Forecasts { .. } => TIM_TP,
            Self::Off { class, id } => (class, id),
            other => other.message(Generation::Messages),
        }
    }

    /// Whether a receiver may refuse it without anybody missing anything.
    pub(crate) const fn is_optional(self) -> bool {
        matches!(self, Self::Corrections)
    }

    /// Writes the frame to `buffer` and returns its length, in bytes; 0 if it cannot be said to this
    /// generation. `baud` is our rate.
    pub(crate) fn write(self, generation: Generation, baud: u32, buffer: &mut Buffer) -> usize {
        match generation {
            _ if matches!(self, Self::Version) => put(buffer, 0, &POLL_VERSION),
            Generation::Messages => self.write_message(baud, buffer),
            Generation::Keys => self.write_keys(baud, buffer),
        }
    }

    /// The same by keys.
    #[inline(never)]
    fn write_keys(self, baud: u32, buffer: &mut Buffer) -> usize {
        let layers = if matches!(self, Self::Save) {
            keys::BATTERY_BACKED
        } else {
            keys::RAM
        };
        let mut frame = Keys::begin(buffer, layers);
        match self {
            Self::Version => return 0,
            Self::Port => frame.add_port(baud),
            Self::Corrections => frame.add(keys::RTCM3_OUT, 0),
            Self::Save => frame.add(keys::BAUD, baud),
            Self::Rate => frame.add_all(&const { keys::rate(PERIOD_MS) }),
            Self::Navigation => frame.add_all(&keys::NAVIGATION),
            Self::Pulse => frame.add_all(&const { keys::pulse(PULSE_WIDTH_US) }),
            Self::Notices => frame.add(keys::NOTICES, 0),
            Self::Message | Self::Forecasts { .. } | Self::Off { .. } => {
                let Some(key) = keys::of_message(self.subject()) else {
                    return 0;
                };
                let on = matches!(self, Self::Message | Self::Forecasts { on: true });
                frame.add(key, on.into());
            }
        }
        frame.finish()
    }

    /// The same by a message of its own.
    fn write_message(self, baud: u32, buffer: &mut Buffer) -> usize {
        match self {
            Self::Version => put(buffer, 0, &POLL_VERSION),
            Self::Port | Self::Corrections => put(buffer, 0, &port(baud, UBX_ALONE)),
            Self::Save => put(buffer, 0, &SAVE_PORTS),
            Self::Rate => put(
                buffer,
                0,
                &CfgRateBuilder {
                    measure_rate_ms: PERIOD_MS,
                    nav_rate: 1,
                    time_ref: AlignmentToReferenceTime::Utc,
                }
                .into_packet_bytes(),
            ),
            Self::Message => put(buffer, 0, &message(NAV_PVT, 1)),
            Self::Forecasts { on } => put(buffer, 0, &message(TIM_TP, on.into())),
            Self::Off { class, id } => put(buffer, 0, &message((class, id), 0)),
            Self::Notices => put(buffer, 0, &NOTICES),
            Self::Navigation => put(
                buffer,
                0,
                &CfgNav5Builder {
                    mask: CfgNav5Params::DYN | CfgNav5Params::POS_FIX_MODE,
                    dyn_model: NavDynamicModel::AirborneWithLess2gAcceleration,
                    fix_mode: NavFixMode::Only3D,
                    ..CfgNav5Builder::default()
                }
                .into_packet_bytes(),
            ),
            Self::Pulse => put(
                buffer,
                0,
                &CfgTp5Builder {
                    version: 1,
                    freq_period: 1_000_000.0,
                    freq_period_lock: 1_000_000.0,
                    pulse_len_ratio: 0.0,
                    pulse_len_ratio_lock: f64::from(PULSE_WIDTH_US),
                    // `ublox` has the four bits of gridUtcGnss as flags of one bit each, one bit
                    // too high: its UTC_TIME_GRID is the GPS grid in the message. Without a flag
                    // the field is 0, which is UTC.
                    flags: CfgTp5Flags::ACTIVE
                        | CfgTp5Flags::LOCK_GNSS_FREQ
                        | CfgTp5Flags::LOCKED_OTHER_SET
                        | CfgTp5Flags::IS_LENGTH
                        | CfgTp5Flags::ALIGN_TO_TOW
                        | CfgTp5Flags::POLARITY,
                    ..CfgTp5Builder::default()
                }
                .into_packet_bytes(),
            ),
        }
    }
}

/// What a receiver of unknown generation and rate is sent at its rate: our rate and UBX, by keys and
/// then by CFG-PRT, with `protocols` in it. Each generation takes the one that it knows: by then it has
/// changed its rate, or has yet to. Returns its length, in bytes.
pub(crate) fn write_greeting(baud: u32, protocols: Protocols, buffer: &mut Buffer) -> usize {
    let length = Setting::Port.write_keys(baud, buffer);
    put(buffer, length, &port(baud, protocols))
}

/// CFG-MSG: a message at each n-th epoch, on the port that receives this; 0 is never.
fn message((msg_class, msg_id): (u8, u8), rate: u8) -> [u8; 11] {
    CfgMsgSinglePortBuilder {
        msg_class,
        msg_id,
        rate,
    }
    .into_packet_bytes()
}

/// CFG-PRT by hand (u-blox M8 receiver description, UBX-CFG-PRT).
#[inline(never)]
fn port(baud: u32, [in_0, in_1, out_0, out_1]: Protocols) -> [u8; 28] {
    // Reserved bit 4, eight bits of data, no parity, one stop bit.
    const MODE: u32 = 0x08d0;
    const UART1: u8 = 1;
    let [m0, m1, m2, m3] = MODE.to_le_bytes();
    let [b0, b1, b2, b3] = baud.to_le_bytes();
    let (in_0, out_0) = (in_0 | UBX, out_0 | UBX);
    let mut frame = [
        SYNC_1, SYNC_2, 0x06, 0x00, 20, 0, // class, id, length
        UART1, 0, 0, 0, m0, m1, m2, m3, b0, b1, b2, b3, // txReady is off
        in_0, in_1, out_0, out_1, 0, 0, 0, 0, // protocols in and out, flags
        0, 0,
    ];
    sum(&mut frame);
    frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame_buffer::LONGEST;

    /// The frames as pyubx2 and a second encoder give them.
    #[test]
    fn frames_are_right_to_the_byte() {
        let known: [(Setting, &[u8]); 11] = [
            (Setting::Version, b"\xb5\x62\x0a\x04\x00\x00\x0e\x34"),
            (
                Setting::Save,
                b"\xb5\x62\x06\x09\x0d\x00\0\0\0\0\x01\0\0\0\0\0\0\0\x17\x34\xd9",
            ),
            (
                Setting::Port,
                b"\xb5\x62\x06\x00\x14\x00\x01\x00\x00\x00\xd0\x08\x00\x00\x00\xc2\x01\x00\
                  \x01\x00\x01\x00\x00\x00\x00\x00\xb8\x42",
            ),
            (
                Setting::Rate,
                b"\xb5\x62\x06\x08\x06\x00\xc8\x00\x01\x00\x00\x00\xdd\x68",
            ),
            (
                Setting::Message,
                b"\xb5\x62\x06\x01\x03\x00\x01\x07\x01\x13\x51",
            ),
            (
                Setting::Navigation,
                b"\xb5\x62\x06\x24\x24\x00\x05\x00\x07\x02\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\
                  \0\0\0\0\0\0\0\0\0\0\0\0\0\0\x5c\xa8",
            ),
            (
                Setting::Pulse,
                b"\xb5\x62\x06\x31\x20\x00\x00\x01\x00\x00\x00\x00\x00\x00\x40\x42\x0f\x00\
                  \x40\x42\x0f\x00\x00\x00\x00\x00\x88\x90\x00\x00\x00\x00\x00\x00\x77\x00\
                  \x00\x00\x09\x82",
            ),
            (
                Setting::Forecasts { on: true },
                b"\xb5\x62\x06\x01\x03\x00\x0d\x01\x01\x19\x69",
            ),
            (
                Setting::Forecasts { on: false },
                b"\xb5\x62\x06\x01\x03\x00\x0d\x01\x00\x18\x68",
            ),
            (
                Setting::Notices,
                b"\xb5\x62\x06\x02\x0a\x00\0\0\0\0\0\0\0\0\0\0\x12\xe6",
            ),
            (
                Setting::Off {
                    class: 0x02,
                    id: 0x15,
                },
                b"\xb5\x62\x06\x01\x03\x00\x02\x15\x00\x21\x6f",
            ),
        ];
        compare(Generation::Messages, &known);
        assert_eq!(&POLL_LEAP_SECONDS, b"\xb5\x62\x01\x26\x00\x00\x27\x76");
        assert_eq!(&POLL_PORT, b"\xb5\x62\x06\x00\x01\x00\x01\x08\x22");
    }

    fn compare(generation: Generation, known: &[(Setting, &[u8])]) {
        for (setting, expected) in known {
            let mut buffer = [0; LONGEST];
            let length = setting.write(generation, BAUD, &mut buffer);
            assert_eq!(buffer.get(..length), Some(*expected), "{setting:?}");
            let (class, id) = setting.message(generation);
            assert_eq!(expected.get(2..4), Some(&[class, id][..]));
        }
    }

    /// The frames as pyubx2 gives them.
    #[test]
    fn keys_are_right_to_the_byte() {
        let known: [(Setting, &[u8]); 11] = [
            (
                Setting::Port,
                b"\xb5\x62\x06\x8a\x1b\x00\x00\x01\x00\x00\x01\x00\x52\x40\x00\xc2\x01\x00\x01\x00\
                  \x73\x10\x01\x01\x00\x74\x10\x01\x02\x00\x74\x10\x00\x93\xec",
            ),
            (
                Setting::Corrections,
                b"\xb5\x62\x06\x8a\x09\x00\x00\x01\x00\x00\x04\x00\x74\x10\x00\x22\xc1",
            ),
            (
                Setting::Save,
                b"\xb5\x62\x06\x8a\x0c\x00\x00\x02\x00\x00\x01\x00\x52\x40\x00\xc2\x01\x00\xf4\xb0",
            ),
            (
                Setting::Rate,
                b"\xb5\x62\x06\x8a\x15\x00\x00\x01\x00\x00\x01\x00\x21\x30\xc8\x00\x02\x00\x21\x30\
                  \x01\x00\x03\x00\x21\x20\x00\x58\xbd",
            ),
            (
                Setting::Message,
                b"\xb5\x62\x06\x8a\x09\x00\x00\x01\x00\x00\x07\x00\x91\x20\x01\x53\x48",
            ),
            (
                Setting::Forecasts { on: true },
                b"\xb5\x62\x06\x8a\x09\x00\x00\x01\x00\x00\x7e\x01\x91\x20\x01\xcb\x9f",
            ),
            (
                Setting::Forecasts { on: false },
                b"\xb5\x62\x06\x8a\x09\x00\x00\x01\x00\x00\x7e\x01\x91\x20\x00\xca\x9e",
            ),
            (
                Setting::Notices,
                b"\xb5\x62\x06\x8a\x09\x00\x00\x01\x00\x00\x02\x00\x92\x20\x00\x4e\x31",
            ),
            (
                Setting::Navigation,
                b"\xb5\x62\x06\x8a\x0e\x00\x00\x01\x00\x00\x21\x00\x11\x20\x07\x11\x00\x11\x20\x02\
                  \x3c\x29",
            ),
            (
                Setting::Pulse,
                b"\xb5\x62\x06\x8a\x4c\x00\x00\x01\x00\x00\x23\x00\x05\x20\x00\x30\x00\x05\x20\x01\
                  \x02\x00\x05\x40\x40\x42\x0f\x00\x03\x00\x05\x40\x40\x42\x0f\x00\x04\x00\x05\x40\
                  \x00\x00\x00\x00\x05\x00\x05\x40\x88\x90\x00\x00\x07\x00\x05\x10\x01\x08\x00\x05\
                  \x10\x01\x09\x00\x05\x10\x01\x0a\x00\x05\x10\x01\x0b\x00\x05\x10\x01\x0c\x00\x05\
                  \x20\x00\xa3\x72",
            ),
            (
                Setting::Off {
                    class: 0x02,
                    id: 0x15,
                },
                b"\xb5\x62\x06\x8a\x09\x00\x00\x01\x00\x00\xa5\x02\x91\x20\x00\xf2\x65",
            ),
        ];
        compare(Generation::Keys, &known);
        let mut buffer = [0; LONGEST];
        let unknown = Setting::Off {
            class: 0x0f,
            id: 0x01,
        };
        assert_eq!(unknown.write(Generation::Keys, BAUD, &mut buffer), 0);
    }
}
