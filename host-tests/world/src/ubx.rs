//! UBX and NMEA as bytes: an encoder and a brute-force reader of their own.
//!
//! *Purpose.* What the simulated receiver sends and understands, and an
//! independent judge of what stands in a recording.
//!
//! *Design.* Written from the u-blox M8 receiver description (UBX-13003221) with
//! no regard to cost, and sharing nothing with the crates under test.
//!
//! *Limits.* Only what the simulation needs.

/// Sync, class, id, length and checksum around a payload.
const OVERHEAD: usize = 8;
const HEADER: usize = 6;
const NS_PER_S: i64 = 1_000_000_000;
const MS_PER_WEEK: i64 = 7 * 86_400_000;

/// GPS is ahead of UTC by this since 2017. \[s\]
pub(crate) const GPS_MINUS_UTC_S: i64 = 18;
/// 1980-01-06, where GPS begins, since 1970. \[s\]
const GPS_ORIGIN_S: i64 = 315_964_800;

/// Class and id of NAV-PVT.
pub const NAV_PVT: (u8, u8) = (0x01, 0x07);
/// The length of an M8's NAV-PVT payload. \[bytes\]
pub const NAV_PVT_LEN: usize = 92;
/// The length of a whole NAV-PVT frame. \[bytes\]
pub const NAV_PVT_FRAME_LEN: usize = NAV_PVT_LEN + OVERHEAD;
/// Class and id of TIM-TP.
pub const TIM_TP: (u8, u8) = (0x0d, 0x01);
/// The length of a TIM-TP payload. \[bytes\]
pub const TIM_TP_LEN: usize = 16;
/// The length of a whole TIM-TP frame. \[bytes\]
pub const TIM_TP_FRAME_LEN: usize = TIM_TP_LEN + OVERHEAD;

/// Class and id of NAV-TIMELS.
pub const NAV_TIMELS: (u8, u8) = (0x01, 0x26);
/// The length of a NAV-TIMELS payload. \[bytes\]
pub const NAV_TIMELS_LEN: usize = 24;

/// The Fletcher-8 checksum of everything between sync and checksum.
fn checksum(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0, 0], |[a, b], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    })
}

/// A whole frame around `payload`.
///
/// # Panics
///
/// If `payload` is longer than its 16-bit length can say.
#[must_use]
pub fn frame(class: u8, id: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len()).expect("a payload of at most 65535 bytes");
    let mut frame = vec![0xb5, 0x62, class, id];
    frame.extend(length.to_le_bytes());
    frame.extend(payload);
    frame.extend(checksum(&frame[2..]));
    frame
}

/// A frame that [`find_frames`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found<'a> {
    /// Where its sync stands.
    pub offset: usize,
    /// Its class.
    pub class: u8,
    /// Its id.
    pub id: u8,
    /// Its payload.
    pub payload: &'a [u8],
}

impl Found<'_> {
    /// The offset behind the frame.
    #[must_use]
    pub const fn end(&self) -> usize {
        self.offset + self.payload.len() + OVERHEAD
    }
}

/// The frame that begins at `offset`, if its sync, length and checksum hold.
fn frame_at(bytes: &[u8], offset: usize) -> Option<Found<'_>> {
    let [0xb5, 0x62, class, id, low, high] = *bytes.get(offset..)?.first_chunk::<HEADER>()? else {
        return None;
    };
    let end = offset + HEADER + usize::from(u16::from_le_bytes([low, high]));
    let sum = bytes.get(end..end + 2)?;
    (checksum(&bytes[offset + 2..end]) == sum).then(|| Found {
        offset,
        class,
        id,
        payload: &bytes[offset + HEADER..end],
    })
}

/// Every frame among those that `wanted` (class, id, payload length) names: each
/// offset at which sync, length and checksum hold, from the left, none
/// overlapping. What is not wanted hides nothing.
pub fn find_frames(bytes: &[u8], wanted: impl Fn(u8, u8, usize) -> bool) -> Vec<Found<'_>> {
    let mut found = Vec::new();
    let mut offset = 0;
    while offset < bytes.len() {
        match frame_at(bytes, offset).filter(|f| wanted(f.class, f.id, f.payload.len())) {
            Some(frame) => {
                offset = frame.end();
                found.push(frame);
            }
            None => offset += 1,
        }
    }
    found
}

/// Days since 1970 as year, month and day (Howard Hinnant, "chrono-compatible
/// low-level date algorithms", `civil_from_days`).
fn civil_from_days(days: i64) -> (i64, u8, u8) {
    let shifted = days + 719_468;
    let era = shifted.div_euclid(146_097);
    let day_of_era = shifted.rem_euclid(146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 {
        march_month + 3
    } else {
        march_month - 9
    };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    (year, month as u8, day as u8)
}

/// Year, month and day as days since 1970 (the same source, `days_from_civil`).
fn days_from_civil(year: i64, month: u8, day: u8) -> i64 {
    let year = year - i64::from(month <= 2);
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let march_month = (i64::from(month) + 9) % 12;
    let day_of_year = (153 * march_month + 2) / 5 + i64::from(day) - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    era * 146_097 + day_of_era - 719_468
}

/// What a NAV-PVT of the simulated receiver states beside its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claims {
    /// The field `valid`.
    pub valid: u8,
    /// The field `tAcc`. \[ns\]
    pub t_acc_ns: u32,
    /// The field `fixType`.
    pub fix_type: u8,
}

/// A NAV-PVT payload for the epoch `epoch_utc_ns`, over Zürich, standing still.
///
/// Hours, minutes and seconds are rounded to 10 ms as the receiver does it, so
/// that `nano` is negative just before a full second.
#[must_use]
pub fn nav_pvt_payload(epoch_utc_ns: i64, claims: Claims) -> [u8; NAV_PVT_LEN] {
    let second = (epoch_utc_ns + 5_000_000).div_euclid(NS_PER_S);
    let nano = epoch_utc_ns - second * NS_PER_S;
    let (year, month, day) = civil_from_days(second.div_euclid(86_400));
    let of_day = second.rem_euclid(86_400);
    let epoch_ms = (epoch_utc_ns + 500_000).div_euclid(1_000_000);
    let itow = (epoch_ms - (GPS_ORIGIN_S - GPS_MINUS_UTC_S) * 1_000).rem_euclid(MS_PER_WEEK);
    let fixed = claims.fix_type >= 2;

    let mut payload = [0; NAV_PVT_LEN];
    let mut put = |offset: usize, bytes: &[u8]| {
        payload[offset..offset + bytes.len()].copy_from_slice(bytes);
    };
    put(0, &(itow as u32).to_le_bytes());
    put(4, &(year as u16).to_le_bytes());
    put(6, &[month, day]);
    put(8, &[(of_day / 3_600) as u8, (of_day / 60 % 60) as u8]);
    put(10, &[(of_day % 60) as u8, claims.valid]);
    put(12, &claims.t_acc_ns.to_le_bytes());
    put(16, &(nano as i32).to_le_bytes());
    put(20, &[claims.fix_type, u8::from(fixed), 0]);
    if fixed {
        put(23, &[12]);
        put(24, &85_417_000_i32.to_le_bytes());
        put(28, &473_769_000_i32.to_le_bytes());
        put(32, &455_300_i32.to_le_bytes());
        put(36, &408_000_i32.to_le_bytes());
        put(40, &1_800_u32.to_le_bytes());
        put(44, &2_600_u32.to_le_bytes());
    }
    put(76, &if fixed { 145_u16 } else { 9_999 }.to_le_bytes());
    payload
}

/// The epoch of a NAV-PVT payload, UTC since 1970. \[ns\]
#[must_use]
pub fn nav_pvt_epoch_utc_ns(payload: &[u8; NAV_PVT_LEN]) -> i64 {
    let year = i64::from(u16::from_le_bytes([payload[4], payload[5]]));
    let days = days_from_civil(year, payload[6].clamp(1, 12), payload[7]);
    let of_day = payload[8..11]
        .iter()
        .fold(0, |sum, field| sum * 60 + i64::from(*field));
    let nano = i32::from_le_bytes([payload[16], payload[17], payload[18], payload[19]]);
    (days * 86_400 + of_day) * NS_PER_S + i64::from(nano)
}

/// A TIM-TP payload for the next pulse, which stands for the moment `pulse_utc_ns`
/// and will be `late_ps` late because of the clock that makes it.
///
/// The time base is UTC, as CFG-TP5 asks for with the UTC grid: week and time of
/// week run without GPS's leap seconds.
///
/// The field `qErr` is −`late_ps`. The receiver description names no sign; that it
/// is *added* to the measured time of the edge was measured: with a time-interval
/// counter on a ZED-F9T (A. Wallin, anderswallin.net, 2019-10, "uBlox F9T qErr
/// correction"; the disciplined oscillator `clkpoc` does the same), and as a slope
/// of −0.99 of the pulse's lateness over `qErr` (the notes of `qpps-shm`, 2026).
#[must_use]
pub fn tim_tp_payload(pulse_utc_ns: i64, late_ps: i32) -> [u8; TIM_TP_LEN] {
    let of_base_ns = pulse_utc_ns - GPS_ORIGIN_S * NS_PER_S;
    let ms = of_base_ns.div_euclid(1_000_000);
    let sub_ms = i128::from(of_base_ns.rem_euclid(1_000_000)) * (1 << 32) / 1_000_000;
    let mut payload = [0; TIM_TP_LEN];
    payload[0..4].copy_from_slice(&(ms.rem_euclid(MS_PER_WEEK) as u32).to_le_bytes());
    payload[4..8].copy_from_slice(&(sub_ms as u32).to_le_bytes());
    payload[8..12].copy_from_slice(&late_ps.saturating_neg().to_le_bytes());
    payload[12..14].copy_from_slice(&(ms.div_euclid(MS_PER_WEEK) as u16).to_le_bytes());
    // The time base is UTC, and UTC is available; its standard is USNO's.
    payload[14] = 0x03;
    payload[15] = 0x3f;
    payload
}

/// A NAV-TIMELS payload at `utc_ns`: `count` leap seconds, as the GPS satellites send (source 2) or as
/// the firmware has it (source 0, not valid). A second 60 is announced that begins, and with it the
/// count's change, in so many seconds.
#[must_use]
pub fn nav_timels_payload(
    utc_ns: i64,
    count: i8,
    is_from_sky: bool,
    second_60_in_s: Option<u64>,
) -> [u8; NAV_TIMELS_LEN] {
    let of_gps_ms = utc_ns.div_euclid(1_000_000) - (GPS_ORIGIN_S - GPS_MINUS_UTC_S) * 1_000;
    let itow = of_gps_ms.rem_euclid(MS_PER_WEEK) as u32;
    let mut payload = [0; NAV_TIMELS_LEN];
    payload[0..4].copy_from_slice(&itow.to_le_bytes());
    payload[8] = if is_from_sky { 2 } else { 0 };
    payload[9] = count.cast_unsigned();
    payload[23] = u8::from(is_from_sky);
    if let Some(in_s) = second_60_in_s {
        let in_s = i32::try_from(in_s).unwrap_or(i32::MAX);
        // The satellites' word, of one second more.
        payload[10] = 2;
        payload[11] = 1;
        payload[12..16].copy_from_slice(&in_s.to_le_bytes());
        payload[23] |= 2;
    }
    payload
}

/// An NMEA RMC sentence without a position, for the epoch `epoch_utc_ns`.
#[must_use]
pub fn rmc(epoch_utc_ns: i64) -> Vec<u8> {
    let hundredths = (epoch_utc_ns + 5_000_000).div_euclid(10_000_000);
    let second = hundredths.div_euclid(100);
    let (year, month, day) = civil_from_days(second.div_euclid(86_400));
    let of_day = second.rem_euclid(86_400);
    let body = format!(
        "GNRMC,{:02}{:02}{:02}.{:02},V,,,,,,,{day:02}{month:02}{:02},,,N",
        of_day / 3_600,
        of_day / 60 % 60,
        of_day % 60,
        hundredths.rem_euclid(100),
        year % 100,
    );
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n").into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMED: Claims = Claims {
        valid: 0x37,
        t_acc_ns: 20,
        fix_type: 3,
    };
    /// 2026-11-22T00:00:00 UTC (`date -u -d 2026-11-22 +%s`).
    const MIDNIGHT_NS: i64 = 1_795_305_600 * NS_PER_S;

    fn fields(epoch_utc_ns: i64) -> (u16, [u8; 5], i32) {
        let p = nav_pvt_payload(epoch_utc_ns, TIMED);
        (
            u16::from_le_bytes([p[4], p[5]]),
            [p[6], p[7], p[8], p[9], p[10]],
            i32::from_le_bytes([p[16], p[17], p[18], p[19]]),
        )
    }

    #[test]
    fn fields_are_rounded_to_ten_milliseconds() {
        assert_eq!(fields(MIDNIGHT_NS), (2026, [11, 22, 0, 0, 0], 0));
        let before = |ns| fields(MIDNIGHT_NS - ns);
        assert_eq!(before(300_000), (2026, [11, 22, 0, 0, 0], -300_000));
        assert_eq!(before(5_000_000), (2026, [11, 22, 0, 0, 0], -5_000_000));
        assert_eq!(before(5_000_001), (2026, [11, 21, 23, 59, 59], 994_999_999));
        // 2027-01-01: even the year is rounded up.
        let new_year_ns = 1_798_761_600 * NS_PER_S;
        assert_eq!(
            fields(new_year_ns - 400_000),
            (2027, [1, 1, 0, 0, 0], -400_000)
        );
    }

    #[test]
    fn an_epoch_survives_its_fields() {
        // 29 February 2000 and 2100's missing one, sawtooth on both sides.
        for second in [951_782_400, 951_868_799, 4_107_542_399, 4_107_542_400] {
            for nano in [-499_999, 0, 200_000_000, 499_999] {
                let epoch = second * NS_PER_S + nano;
                assert_eq!(nav_pvt_epoch_utc_ns(&nav_pvt_payload(epoch, TIMED)), epoch);
            }
        }
    }

    #[test]
    fn time_of_week_is_gps_time() {
        // 2026-11-22 is a Sunday, the first day of the GPS week.
        let p = nav_pvt_payload(MIDNIGHT_NS - 300_000, TIMED);
        assert_eq!(u32::from_le_bytes([p[0], p[1], p[2], p[3]]), 18_000);
    }

    #[test]
    fn a_pulse_is_named_in_the_week_of_utc() {
        // The GPS week that began on Sunday, 2026-11-22 is number 2446.
        let p = tim_tp_payload(MIDNIGHT_NS + 1_500_000_000 + 250_000, 10_417);
        let word = |at: usize| u32::from_le_bytes([p[at], p[at + 1], p[at + 2], p[at + 3]]);
        assert_eq!((word(0), word(4)), (1_500, 1 << 30));
        assert_eq!(word(8).cast_signed(), -10_417);
        assert_eq!(u16::from_le_bytes([p[12], p[13]]), 2_446);
        let before = tim_tp_payload(MIDNIGHT_NS - 1_000_000, 0);
        assert_eq!(u16::from_le_bytes([before[12], before[13]]), 2_445);
    }

    #[test]
    fn frames_have_the_checksum_of_known_ones() {
        // A MON-VER poll and the CFG-RATE frame for 5 Hz, as any encoder gives them.
        assert_eq!(
            frame(0x0a, 0x04, &[]),
            [0xb5, 0x62, 0x0a, 4, 0, 0, 0x0e, 0x34]
        );
        assert_eq!(frame(6, 8, &[0xc8, 0, 1, 0, 0, 0])[12..], [0xdd, 0x68]);
        // The example of the NMEA 0183 checksum: XOR of everything between $ and *.
        assert!(rmc(MIDNIGHT_NS).starts_with(b"$GNRMC,000000.00,V,,,,,,,221126,,,N*"));
    }

    #[test]
    fn unwanted_frames_hide_nothing() {
        let inner = frame(5, 1, &[6, 0]);
        let mut bytes = frame(0x0d, 1, &inner);
        bytes.extend(&inner);
        let acks = find_frames(&bytes, |class, _, _| class == 5);
        assert_eq!(acks.iter().map(|f| f.offset).collect::<Vec<_>>(), [6, 18]);
        assert_eq!(find_frames(&bytes, |_, _, _| true).len(), 2);
    }
}
