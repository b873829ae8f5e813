//! What a receiver says that it is.
//!
//! *Purpose.* The generations of u-blox receivers are configured by different messages, and two of
//! them cannot serve this clock. MON-VER tells them apart.
//!
//! *Design.* The version of the protocol decides (`PROTVER`). Where a receiver has none, the version
//! of its hardware does: u-blox 6 and before do not name a protocol.
//!
//! *Limits.* A protocol newer than 50 is taken for one that is configured by keys, as all have been
//! since 27.

/// The length of a name, in bytes.
const NAME_LEN: usize = 16;

/// The first characters of a text of the receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name {
    bytes: [u8; NAME_LEN],
    length: u8,
}

impl Name {
    const NONE: Self = Self {
        bytes: [0; NAME_LEN],
        length: 0,
    };

    /// The printable characters that `text` begins with, without blanks at its end.
    #[inline(never)]
    pub(crate) fn of(text: &[u8]) -> Self {
        let mut name = Self::NONE;
        for (nth, (to, from)) in name.bytes.iter_mut().zip(text).enumerate() {
            if !(b' '..=b'~').contains(from) {
                break;
            }
            *to = *from;
            if *from != b' ' {
                name.length = (nth as u8).wrapping_add(1);
            }
        }
        name
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let used = self.bytes.get(..self.length.into()).unwrap_or_default();
        core::str::from_utf8(used).unwrap_or_default()
    }
}

/// By which messages a receiver is configured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Generation {
    /// CFG-PRT, CFG-MSG and their like: M8.
    Messages,
    /// CFG-VALSET: M9, M10, F9, F10, X20.
    Keys,
}

/// Why a receiver cannot serve this clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unusable {
    /// It has no NAV-PVT: u-blox 6 and before.
    NoNavPvt,
    /// Its NAV-PVT has 84 bytes: u-blox 7.
    ShortNavPvt,
}

impl Unusable {
    /// The reason in words.
    #[must_use]
    pub const fn reason(self) -> &'static str {
        match self {
            Self::NoNavPvt => "it has no NAV-PVT",
            Self::ShortNavPvt => "NAV-PVT of 84 bytes",
        }
    }
}

/// A receiver, by its MON-VER.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// What it is called; empty where it has no name for itself.
    model: Name,
    /// Its firmware.
    firmware: Name,
    /// The version of its hardware, the first four of eight digits.
    hardware: [u8; 4],
    /// The version of its protocol, in hundredths; 0 where it has none.
    protocol: u16,
}

impl Identity {
    /// Nothing is known.
    pub(crate) const NONE: Self = Self {
        model: Name::NONE,
        firmware: Name::NONE,
        hardware: [0; 4],
        protocol: 0,
    };

    /// Takes field `nth` of a MON-VER: software, hardware, and then the extensions.
    #[inline(never)]
    pub(crate) fn handle_field(&mut self, nth: usize, field: &[u8]) {
        let after = |prefix: &[u8]| field.strip_prefix(prefix);
        match nth {
            0 => self.firmware = Name::of(field),
            1 => {
                if let Some(hardware) = field.first_chunk() {
                    self.hardware = *hardware;
                }
            }
            _ => {
                if let Some([_, version @ ..]) = after(b"PROTVER") {
                    self.protocol = hundredths(version);
                } else if let Some(firmware) = after(b"FWVER=") {
                    self.firmware = Name::of(firmware);
                } else if let Some(model) = after(b"MOD=") {
                    self.model = Name::of(model);
                }
            }
        }
    }

    /// What it is called: its own name for itself, or its generation's.
    #[must_use]
    #[inline(never)]
    pub fn model(&self) -> &str {
        let own = self.model.as_str();
        if !own.is_empty() {
            return own;
        }
        match (self.protocol / 100, &self.hardware) {
            (34, _) => "u-blox 10",
            (27..34, _) => "u-blox 9",
            (15..27, _) | (_, b"0008") => "u-blox 8",
            (14, _) | (_, b"0007") => "u-blox 7",
            (_, b"0004") => "u-blox 6",
            _ => "u-blox",
        }
    }

    /// The device type by which PX4's `drv_sensor.h` knows it.
    #[must_use]
    #[inline(never)]
    pub fn px4_device_type(&self) -> u8 {
        match (self.protocol / 100, &self.hardware) {
            (50, _) => 0xAD,
            (34, _) => 0xAC,
            (27..34, _) if self.model.as_str().ends_with("F9P") => 0xAA,
            (27..34, _) => 0xA9,
            (15..27, _) | (_, b"0008") => 0xA8,
            (14, _) | (_, b"0007") => 0xA7,
            (_, b"0004") => 0xA6,
            _ => 0xA5,
        }
    }

    /// Its firmware's version, in its own words.
    #[must_use]
    pub fn firmware(&self) -> &str {
        self.firmware.as_str()
    }

    /// The version of its protocol, in hundredths; 0 where it names none.
    #[must_use]
    pub const fn protocol(&self) -> u16 {
        self.protocol
    }

    /// How it is configured.
    ///
    /// # Errors
    ///
    /// It cannot serve this clock.
    #[inline(never)]
    pub const fn generation(&self) -> Result<Generation, Unusable> {
        match (self.protocol / 100, &self.hardware) {
            (27.., _) => Ok(Generation::Keys),
            (15..27, _) | (0, b"0008") => Ok(Generation::Messages),
            (14, _) | (0, b"0007") => Err(Unusable::ShortNavPvt),
            _ => Err(Unusable::NoNavPvt),
        }
    }
}

/// A version like `34.10`, in hundredths.
#[inline(never)]
fn hundredths(version: &[u8]) -> u16 {
    let mut value = 0_u16;
    let mut decimals = None::<u8>;
    for byte in version {
        match (byte, decimals) {
            (b'0'..=b'9', None | Some(0 | 1)) => {
                value = value
                    .saturating_mul(10)
                    .saturating_add((byte.wrapping_sub(b'0')).into());
                decimals = decimals.map(|decimals| decimals.wrapping_add(1));
            }
            (b'.', None) => decimals = Some(0),
            _ => break,
        }
    }
    match decimals {
        None | Some(0) => value.saturating_mul(100),
        Some(1) => value.saturating_mul(10),
        Some(_) => value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(hardware: &[u8], extensions: &[&[u8]]) -> Identity {
        let mut identity = Identity::NONE;
        let texts = [&b"EXT CORE 3.01 (107888)"[..], hardware];
        for (nth, text) in texts.iter().chain(extensions).enumerate() {
            let mut field = [0; 30];
            field[..text.len()].copy_from_slice(text);
            identity.handle_field(nth, &field);
        }
        identity
    }

    #[test]
    fn generations_are_told_apart() {
        use Generation::{Keys, Messages};
        use Unusable::{NoNavPvt, ShortNavPvt};
        for (hardware, protocol, expected, model, device_type) in [
            (&b"00040007"[..], &b""[..], Err(NoNavPvt), "u-blox 6", 0xA6),
            (
                b"00070000",
                b"PROTVER 14.00",
                Err(ShortNavPvt),
                "u-blox 7",
                0xA7,
            ),
            (b"00070000", b"", Err(ShortNavPvt), "u-blox 7", 0xA7),
            (
                b"00080000",
                b"PROTVER=18.00",
                Ok(Messages),
                "u-blox 8",
                0xA8,
            ),
            (
                b"00080000",
                b"PROTVER 15.00",
                Ok(Messages),
                "u-blox 8",
                0xA8,
            ),
            (b"00080000", b"", Ok(Messages), "u-blox 8", 0xA8),
            (b"00190000", b"PROTVER=27.31", Ok(Keys), "u-blox 9", 0xA9),
            (b"00190000", b"PROTVER=32.01", Ok(Keys), "u-blox 9", 0xA9),
            (b"000A0000", b"PROTVER=34.10", Ok(Keys), "u-blox 10", 0xAC),
            (b"000A0000", b"PROTVER=40.00", Ok(Keys), "u-blox", 0xA5),
            (b"000B0000", b"PROTVER=50.10", Ok(Keys), "u-blox", 0xAD),
        ] {
            let identity = identity(hardware, &[protocol]);
            assert_eq!(identity.generation(), expected, "{model}");
            assert_eq!(identity.model(), model);
            assert_eq!(identity.px4_device_type(), device_type, "{model}");
            assert_eq!(identity.firmware(), "EXT CORE 3.01 (1");
        }
    }

    #[test]
    fn its_own_words_count() {
        let extensions = [&b"FWVER=HPG 1.32"[..], b"PROTVER=27.31", b"MOD=ZED-F9P"];
        let identity = identity(b"00190000", &extensions);
        assert_eq!(
            (identity.model(), identity.firmware()),
            ("ZED-F9P", "HPG 1.32")
        );
        assert_eq!(identity.px4_device_type(), 0xAA);
        assert_eq!(identity.protocol(), 2_731);
        for (text, expected) in [
            (&b"18"[..], 1_800),
            (b"18.5", 1_850),
            (b"18.50.1", 1_850),
            (b"", 0),
            (b"99999999.9", u16::MAX),
        ] {
            assert_eq!(hundredths(text), expected);
        }
    }
}
