//! The configuration frames, byte for byte.
//!
//! *Purpose.* The receiver's settings: the line's rate and UBX alone, a solution
//! each 200 ms on the grid of UTC, NAV-PVT of it, the airborne model, a pulse at
//! each full second, whether to forecast it, and silence about the rest. And the poll of NAV-TIMELS.
//!
//! *Design.* Built by `ublox`, except for CFG-PRT: its builder leaves out a bit of
//! `mode` that is reserved and set in every receiver's own answer. A test compares
//! the frames to the byte with those of two other encoders.
//!
//! *Limits.* The configuration messages of the M8 and before it. An F9 accepts
//! them; an F10 and later do not.

use ublox::cfg_msg::CfgMsgSinglePortBuilder;
use ublox::cfg_nav5::{CfgNav5Builder, CfgNav5Params, NavDynamicModel, NavFixMode};
use ublox::cfg_rate::{AlignmentToReferenceTime, CfgRateBuilder};
use ublox::cfg_tp5::{CfgTp5Builder, CfgTp5Flags};

use crate::fletcher::Fletcher;
use crate::kind::{SYNC_1, SYNC_2};

/// The default rate of the line, in baud.
pub const BAUD: u32 = 115_200;

/// The rates at which a receiver is looked for, in baud, in the order of the search: ours, the
/// factory's, a Here+'s, and the rest of PX4's list (`PX4-GPSDrivers`, `ubx.cpp`).
pub const BAUDS: [u32; 5] = [BAUD, 9_600, 38_400, 57_600, 230_400];

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

const NAV_PVT: (u8, u8) = (0x01, 0x07);
const TIM_TP: (u8, u8) = (0x0d, 0x01);

/// The longest frame of all, in bytes.
pub(crate) const LONGEST: usize = 44;

/// A configuration frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// CFG-PRT: UART1 at our rate, 8N1, UBX in and out.
    Port,
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
    pub const fn message(self) -> (u8, u8) {
        let id = match self {
            Self::Port => 0x00,
            Self::Rate => 0x08,
            Self::Message | Self::Forecasts { .. } | Self::Off { .. } => 0x01,
            Self::Notices => 0x02,
            Self::Navigation => 0x24,
            Self::Pulse => 0x31,
        };
        (0x06, id)
    }

    /// What it is called in the receiver's own words; of [`Self::Off`] the message.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Port => "CFG-PRT",
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

    /// Class and id of the message that it is about, or its own.
    #[must_use]
    pub const fn subject(self) -> (u8, u8) {
        match self {
            Self::Message => NAV_PVT,
            Self::Forecasts { .. } => TIM_TP,
            Self::Off { class, id } => (class, id),
            other => other.message(),
        }
    }

    /// Writes the frame to `buffer` and returns its length, in bytes; `baud` is our rate.
    pub(crate) fn write(self, baud: u32, buffer: &mut [u8; LONGEST]) -> usize {
        match self {
            Self::Port => put(buffer, &port(baud)),
            Self::Rate => put(
                buffer,
                &CfgRateBuilder {
                    measure_rate_ms: PERIOD_MS,
                    nav_rate: 1,
                    time_ref: AlignmentToReferenceTime::Utc,
                }
                .into_packet_bytes(),
            ),
            Self::Message => put(buffer, &message(NAV_PVT, 1)),
            Self::Forecasts { on } => put(buffer, &message(TIM_TP, on.into())),
            Self::Off { class, id } => put(buffer, &message((class, id), 0)),
            Self::Notices => put(buffer, &NOTICES),
            Self::Navigation => put(
                buffer,
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
fn port(baud: u32) -> [u8; 28] {
    // Reserved bit 4, eight bits of data, no parity, one stop bit.
    const MODE: u32 = 0x08d0;
    const UART1: u8 = 1;
    const UBX: u8 = 1;
    let [m0, m1, m2, m3] = MODE.to_le_bytes();
    let [b0, b1, b2, b3] = baud.to_le_bytes();
    let mut frame = [
        SYNC_1, SYNC_2, 0x06, 0x00, 20, 0, // class, id, length
        UART1, 0, 0, 0, m0, m1, m2, m3, b0, b1, b2, b3, // txReady is off
        UBX, 0, UBX, 0, 0, 0, 0, 0, // protocols in and out, flags
        0, 0,
    ];
    let [_, _, summed @ .., a, b] = &mut frame;
    let start = Fletcher::START;
    [*a, *b] = start.then_all(summed).since(start, summed.len());
    frame
}

fn put(buffer: &mut [u8; LONGEST], frame: &[u8]) -> usize {
    if let Some(space) = buffer.get_mut(..frame.len()) {
        space.copy_from_slice(frame);
    }
    frame.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The frames as pyubx2 and a second encoder give them.
    #[test]
    fn frames_are_right_to_the_byte() {
        let known: [(Setting, &[u8]); 9] = [
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
        for (setting, expected) in known {
            let mut buffer = [0; LONGEST];
            let length = setting.write(BAUD, &mut buffer);
            assert_eq!(buffer.get(..length), Some(expected), "{setting:?}");
            let (class, id) = setting.message();
            assert_eq!(expected.get(2..4), Some(&[class, id][..]));
        }
        assert_eq!(&POLL_LEAP_SECONDS, b"\xb5\x62\x01\x26\x00\x00\x27\x76");
    }
}
