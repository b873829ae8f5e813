//! The files' names: TEST0001.CSV to TEST9999.CSV, as a directory has them.

/// A name in a directory: eight bytes and the extension's three.
pub(crate) type Name = [u8; 11];

/// The last number that a name has room for.
pub(crate) const LAST: u16 = 9_999;

/// The name of the file with that number, which is at most [`LAST`].
pub(crate) fn of(number: u16) -> Name {
    let digit = |unit| b'0' + (number / unit % 10) as u8;
    let [a, b, c, d] = [1_000, 100, 10, 1].map(digit);
    [b'T', b'E', b'S', b'T', a, b, c, d, b'C', b'S', b'V']
}

/// The number in a name, if it is one of ours.
pub(crate) fn number(name: &[u8]) -> Option<u16> {
    let digits = name.strip_prefix(b"TEST")?.strip_suffix(b"CSV")?;
    let digits: [u8; 4] = digits.try_into().ok()?;
    digits.into_iter().try_fold(0, |number, digit| {
        digit
            .is_ascii_digit()
            .then(|| number * 10 + u16::from(digit - b'0'))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_and_its_number_belong_together() {
        for n in 1..=LAST {
            assert_eq!(number(&of(n)), Some(n));
        }
        assert_eq!(&of(42), b"TEST0042CSV");
        for name in [
            "TEST001 CSV",
            "TEST000ACSV",
            "TEXT0001CSV",
            "TEST0001TXT",
            "TEST0001",
            "",
        ] {
            assert_eq!(number(name.as_bytes()), None, "{name}");
        }
    }
}
