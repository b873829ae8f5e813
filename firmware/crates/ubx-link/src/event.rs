//! What a good frame says.
//!
//! *Purpose.* A NAV-PVT becomes the clock's [`TimeMark`] and the [`Fix`] that MAVLink passes on, a
//! TIM-TP a [`PulseForecast`]; and there are the answers to the configuration.
//!
//! *Design.* `ublox` parses the payload, once, and only its raw integers are used:
//! its scaled accessors are in `f64`, which this core does in software, and its
//! `Debug` panics on some packets. Nothing is checked here: a month may be 13.
//!
//! *The sign of `qErr`.* The receiver description calls it the quantisation error
//! of the time pulse and defines no sign. Measured with a time-interval counter, from a
//! reference to the pulse of a ZED-F9T, it is to be **added** to the measured
//! interval to remove the sawtooth (A. Wallin, anderswallin.net, "uBlox F9T qErr
//! correction", 2019): a pulse that is late has a negative one. So
//! [`PulseForecast::late_ps`] is −`qErr`.
//!
//! *Limits.* Height above the ellipsoid, the velocity's components and the
//! magnetic fields are not used.

use timebase::{CivilTime, Cycles, Fix, LeapEvent, LeapSeconds, PulseForecast, TimeMark, Validity};
use ublox::UbxProtocol;
use ublox::proto23::{PacketRef, Proto23};

use crate::kind::{
    ACK_PAYLOAD_LEN, HEADER_LEN, Kind, NAV_PVT_PAYLOAD_LEN, NAV_TIMELS_PAYLOAD_LEN,
    TIM_TP_PAYLOAD_LEN,
};

/// A message of the receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// NAV-PVT: a solution.
    NavPvt {
        /// Its time.
        mark: TimeMark,
        /// Its position.
        fix: Fix,
    },
    /// TIM-TP: the error of the next time pulse.
    TimTp(PulseForecast),
    /// NAV-TIMELS: where the leap count comes from.
    LeapSeconds(LeapSeconds),
    /// ACK-ACK: a configuration frame was accepted.
    Ack {
        /// The class of that frame.
        class: u8,
        /// Its id.
        id: u8,
    },
    /// ACK-NAK: a configuration frame was refused.
    Nak {
        /// The class of that frame.
        class: u8,
        /// Its id.
        id: u8,
    },
}

/// `qErrInvalid` in the flags of a TIM-TP: `qErr` has no value. The bit is newer than the M8
/// (u-blox F9 interface descriptions), which has 0 there. In a recorded cold start it is set, and
/// `qErr` is 0, until the start is over.
const QUANTISATION_UNKNOWN: u8 = 0x10;
/// `timeBase` and `utc` in the same flags.
const TIM_TP_UTC_BASE: u8 = 0x01;
const TIM_TP_UTC_AVAILABLE: u8 = 0x02;
/// `validCurrLs` and `validTimeToLsEvent` in the last byte of a NAV-TIMELS.
const LEAP_COUNT_VALID: u8 = 0x01;
const LEAP_EVENT_VALID: u8 = 0x02;
/// The offset of those flags in the payload, in bytes: `ublox` does not give their raw value.
const TIM_TP_FLAGS: usize = 14;

/// `validDate` in the field `valid` of a NAV-PVT.
const VALID_DATE: u8 = 0x01;
/// `validTime` in the same field.
const VALID_TIME: u8 = 0x02;
/// `fullyResolved` in the same field.
const FULLY_RESOLVED: u8 = 0x04;
/// `utcStandard`, the upper four bits of the same field, while the count of leap seconds is the one
/// that the receiver was built with.
const UTC_STANDARD_UNKNOWN: u8 = 0xf;
/// `gnssFixOK` in the field `flags`.
const GNSS_FIX_OK: u8 = 0x01;
/// `confirmedTime` in the field `flags2`.
const CONFIRMED_TIME: u8 = 0x80;

/// Where a NAV-PVT has `height`, and `velN`, `velE`, `velD`, in bytes: `ublox` gives them as floats.
const HEIGHT_AT: usize = 32;
const VELOCITY_AT: [usize; 3] = [48, 52, 56];

/// The I4 at `at`; 0 where there is none.
fn four_bytes(payload: &[u8], at: usize) -> i32 {
    let bytes = payload.get(at..).and_then(<[u8]>::first_chunk);
    i32::from_le_bytes(bytes.copied().unwrap_or_default())
}

/// The payload of a frame, of `LENGTH` bytes.
fn payload<const LENGTH: usize>(frame: &[u8]) -> Option<&[u8; LENGTH]> {
    frame.get(HEADER_LEN..)?.first_chunk()
}

/// The event of a whole `frame` of `kind` whose first byte came at `arrival`; `None` if `ublox`
/// refuses it, or if its own flags say that it has no value.
pub(crate) fn parse(kind: Kind, frame: &[u8], arrival: Cycles, busy_us: u32) -> Option<Event> {
    // Class and id are constants in each call, so that only this packet of `ublox`'s table is
    // compiled.
    match kind {
        Kind::NavPvt => {
            let payload = payload::<NAV_PVT_PAYLOAD_LEN>(frame)?;
            let PacketRef::NavPvt(pvt) = Proto23::match_packet(0x01, 0x07, payload).ok()? else {
                return None;
            };
            let valid = pvt.valid_raw();
            Some(Event::NavPvt {
                mark: TimeMark {
                    arrival,
                    busy_us,
                    epoch: CivilTime {
                        year: pvt.year(),
                        month: pvt.month(),
                        day: pvt.day(),
                        hour: pvt.hour(),
                        minute: pvt.min(),
                        second: pvt.sec(),
                        nano: pvt.nanosec(),
                    },
                    t_acc_ns: pvt.time_accuracy(),
                    validity: Validity {
                        date: valid & VALID_DATE != 0,
                        time: valid & VALID_TIME != 0,
                        fully_resolved: valid & FULLY_RESOLVED != 0,
                        confirmed: pvt.flags2_raw() & CONFIRMED_TIME != 0,
                        leap_seconds_known: valid >> 4 != UTC_STANDARD_UNKNOWN,
                    },
                },
                fix: Fix {
                    fix_type: pvt.fix_type_raw(),
                    fix_ok: pvt.flags_raw() & GNSS_FIX_OK != 0,
                    satellites: pvt.num_satellites(),
                    latitude_1e7_deg: pvt.latitude_raw(),
                    longitude_1e7_deg: pvt.longitude_raw(),
                    height_ellipsoid_mm: four_bytes(payload, HEIGHT_AT),
                    height_msl_mm: pvt.height_msl_raw(),
                    horizontal_accuracy_mm: pvt.horizontal_accuracy_raw(),
                    vertical_accuracy_mm: pvt.vertical_accuracy_raw(),
                    ground_speed_mm_s: pvt.ground_speed_2d_raw(),
                    velocity_mm_s: VELOCITY_AT.map(|at| four_bytes(payload, at)),
                    heading_1e5_deg: pvt.heading_motion_raw(),
                },
            })
        }
        Kind::TimTp => {
            let payload = payload::<TIM_TP_PAYLOAD_LEN>(frame)?;
            let PacketRef::TimTp(tp) = Proto23::match_packet(0x0d, 0x01, payload).ok()? else {
                return None;
            };
            let flags = *payload.get(TIM_TP_FLAGS)?;
            Some(Event::TimTp(PulseForecast {
                arrival,
                busy_us,
                late_ps: (flags & QUANTISATION_UNKNOWN == 0).then(|| tp.q_err().saturating_neg()),
                tow_ms: u32::from_le_bytes(*payload.first_chunk()?),
                week: u16::from_le_bytes(*payload.get(12..)?.first_chunk()?),
                is_utc_base: flags & TIM_TP_UTC_BASE != 0,
                is_utc_available: flags & TIM_TP_UTC_AVAILABLE != 0,
            }))
        }
        Kind::NavTimeLs => {
            let payload = payload::<NAV_TIMELS_PAYLOAD_LEN>(frame)?;
            let valid = *payload.get(23)?;
            let in_s = i32::from_le_bytes(*payload.get(12..)?.first_chunk()?);
            let event = LeapEvent {
                change: payload.get(11)?.cast_signed(),
                in_s,
            };
            Some(Event::LeapSeconds(LeapSeconds {
                arrival,
                busy_us,
                source: *payload.get(8)?,
                count: (valid & LEAP_COUNT_VALID != 0).then_some(payload.get(9)?.cast_signed()),
                event: (valid & LEAP_EVENT_VALID != 0).then_some(event),
            }))
        }
        Kind::Ack => {
            let payload = payload::<ACK_PAYLOAD_LEN>(frame)?;
            let PacketRef::AckAck(ack) = Proto23::match_packet(0x05, 0x01, payload).ok()? else {
                return None;
            };
            Some(Event::Ack {
                class: ack.class(),
                id: ack.msg_id(),
            })
        }
        Kind::Nak => {
            let payload = payload::<ACK_PAYLOAD_LEN>(frame)?;
            let PacketRef::AckNak(nak) = Proto23::match_packet(0x05, 0x00, payload).ok()? else {
                return None;
            };
            Some(Event::Nak {
                class: nak.class(),
                id: nak.msg_id(),
            })
        }
    }
}
