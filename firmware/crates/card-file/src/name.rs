//! The files' names: TEST0001.CSV to TEST9999.CSV.

use heapless::String;

/// The name of the file with that number, if it can have one.
pub(crate) fn of(number: u16) -> Option<String<12>> {
    if !(1..=9_999).contains(&number) {
        return None;
    }
    let mut name = String::new();
    name.push_str("TEST").ok()?;
    for unit in [1_000, 100, 10, 1] {
        let digit = number / unit % 10;
        name.push(char::from(b'0' + digit as u8)).ok()?;
    }
    name.push_str(".CSV").ok()?;
    Some(name)
}

/// The number in a file's name, if it is one of ours.
pub(crate) fn number(base_name: &[u8], extension: &[u8]) -> Option<u16> {
    let digits: [u8; 4] = base_name.strip_prefix(b"TEST")?.try_into().ok()?;
    if extension != b"CSV" {
        return None;
    }
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
        for n in 1..=9_999 {
            let name = of(n).unwrap();
            let (base, extension) = name.split_once('.').unwrap();
            assert_eq!(number(base.as_bytes(), extension.as_bytes()), Some(n));
        }
        assert_eq!((of(0), of(10_000)), (None, None));
        for (base, extension) in [
            ("TEST001", "CSV"),
            ("TEST00010", "CSV"),
            ("TEST000A", "CSV"),
            ("TEXT0001", "CSV"),
            ("TEST0001", "TXT"),
            ("", ""),
        ] {
            assert_eq!(
                number(base.as_bytes(), extension.as_bytes()),
                None,
                "{base}"
            );
        }
    }
}
