//! The frames that we use, and their headers.
//!
//! *Purpose.* Whether the first bytes of a frame can be one of ours.
//!
//! *Design.* Class, id **and** length must be right. A false length is no candidate, so it
//! cannot delay the frame behind it.
//!
//! *Limits.* A NAV-PVT whose length is not the M8's 92 bytes is not ours.

/// Bytes of the sync.
pub(crate) const SYNC_LEN: usize = 2;
/// Bytes of the sync, class, id and length.
pub(crate) const HEADER_LEN: usize = 6;
/// Bytes of the checksum behind the payload.
pub(crate) const CHECKSUM_LEN: usize = 2;
const OVERHEAD: usize = HEADER_LEN + CHECKSUM_LEN;
/// Payload of a NAV-PVT, in bytes (u-blox M8 receiver description).
pub(crate) const NAV_PVT_PAYLOAD_LEN: usize = 92;
/// Payload of an acknowledgement, in bytes (the same).
pub(crate) const ACK_PAYLOAD_LEN: usize = 2;
/// Payload of a TIM-TP, in bytes (the same).
pub(crate) const TIM_TP_PAYLOAD_LEN: usize = 16;
/// Payload of a NAV-TIMELS, in bytes (the same).
pub(crate) const NAV_TIMELS_PAYLOAD_LEN: usize = 24;
/// The longest frame that we use, in bytes.
pub(crate) const LONGEST: usize = NAV_PVT_PAYLOAD_LEN + OVERHEAD;
/// The shortest frame that we use, in bytes.
pub(crate) const SHORTEST: usize = ACK_PAYLOAD_LEN + OVERHEAD;

pub(crate) const SYNC_1: u8 = 0xb5;
pub(crate) const SYNC_2: u8 = 0x62;

/// A kind of frame that we use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    NavPvt,
    TimTp,
    NavTimeLs,
    Ack,
    Nak,
}

impl Kind {
    /// Length of the whole frame, in bytes.
    pub(crate) const fn frame_len(self) -> usize {
        match self {
            Self::NavPvt => LONGEST,
            Self::TimTp => TIM_TP_PAYLOAD_LEN + OVERHEAD,
            Self::NavTimeLs => NAV_TIMELS_PAYLOAD_LEN + OVERHEAD,
            Self::Ack | Self::Nak => SHORTEST,
        }
    }
}

/// What bytes that begin with [`SYNC_1`] may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Header {
    /// The header of a frame that we use.
    Ours(Kind),
    /// Too few bytes to decide.
    Unfinished,
    /// Not a UBX header: the second sync byte is missing.
    LoneSync,
    /// A UBX header of another message: its class and, in the upper half, its id.
    OtherMessage(u16),
    /// One of ours by class and id, but not by length.
    FalseLength,
}

impl Header {
    /// What `bytes` may be, which begin with a [`SYNC_1`].
    #[inline]
    pub(crate) fn at(bytes: &[u8]) -> Self {
        // Class, id and length are compared as one word, class and id as half.
        const NAV_PVT: u32 = u32::from_le_bytes([0x01, 0x07, NAV_PVT_PAYLOAD_LEN as u8, 0]);
        const TIM_TP: u32 = u32::from_le_bytes([0x0d, 0x01, TIM_TP_PAYLOAD_LEN as u8, 0]);
        const NAV_TIMELS: u32 = u32::from_le_bytes([0x01, 0x26, NAV_TIMELS_PAYLOAD_LEN as u8, 0]);
        const ACK: u32 = u32::from_le_bytes([0x05, 0x01, ACK_PAYLOAD_LEN as u8, 0]);
        const NAK: u32 = u32::from_le_bytes([0x05, 0x00, ACK_PAYLOAD_LEN as u8, 0]);
        const MESSAGE: u32 = 0xffff;
        if bytes.get(1).is_some_and(|byte| *byte != SYNC_2) {
            return Self::LoneSync;
        }
        let Some([_, _, word @ ..]) = bytes.first_chunk::<HEADER_LEN>() else {
            return Self::Unfinished;
        };
        match u32::from_le_bytes(*word) {
            NAV_PVT => Self::Ours(Kind::NavPvt),
            TIM_TP => Self::Ours(Kind::TimTp),
            NAV_TIMELS => Self::Ours(Kind::NavTimeLs),
            ACK => Self::Ours(Kind::Ack),
            NAK => Self::Ours(Kind::Nak),
            word if [NAV_PVT, TIM_TP, NAV_TIMELS, ACK, NAK]
                .iter()
                .any(|ours| (word ^ ours) & MESSAGE == 0) =>
            {
                Self::FalseLength
            }
            word => Self::OtherMessage((word & MESSAGE) as u16),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_known_by_class_id_and_length() {
        let at = |rest: &[u8; 5]| {
            let [sync_2, class, id, low, high] = *rest;
            Header::at(&[SYNC_1, sync_2, class, id, low, high])
        };
        assert_eq!(at(b"\x62\x01\x07\x5c\x00"), Header::Ours(Kind::NavPvt));
        assert_eq!(at(b"\x62\x0d\x01\x10\x00"), Header::Ours(Kind::TimTp));
        assert_eq!(at(b"\x62\x05\x01\x02\x00"), Header::Ours(Kind::Ack));
        assert_eq!(at(b"\x62\x05\x00\x02\x00"), Header::Ours(Kind::Nak));
        assert_eq!(at(b"\x62\x01\x07\x5c\x01"), Header::FalseLength);
        assert_eq!(at(b"\x62\x05\x00\x5c\x00"), Header::FalseLength);
        assert_eq!(at(b"\x62\x0d\x01\x10\x10"), Header::FalseLength);
        assert_eq!(at(b"\x62\x05\x02\x02\x00"), Header::OtherMessage(0x0205));
        assert_eq!(at(b"\x62\x07\x01\x5c\x00"), Header::OtherMessage(0x0107));
        assert_eq!(at(b"\xb5\x01\x07\x5c\x00"), Header::LoneSync);
    }

    #[test]
    fn a_header_is_waited_for_as_long_as_it_can_be_one() {
        let header = [SYNC_1, SYNC_2, 0x01, 0x07, 92];
        for length in 1..=header.len() {
            assert_eq!(Header::at(&header[..length]), Header::Unfinished);
        }
        assert_eq!(Header::at(&[SYNC_1, 0x00]), Header::LoneSync);
    }
}
