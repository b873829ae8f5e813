//! CSV as the spreadsheets of people write it.
//!
//! *Purpose.* A byte-order mark is taken off and `;` between columns is read as `,`. What would be read
//! wrongly is refused by its own name: UTF-16, and numbers with decimal commas.

use std::borrow::Cow;

use anyhow::{Result, bail, ensure};

/// The byte-order mark of UTF-8.
const MARK: &[u8] = b"\xEF\xBB\xBF";

/// The same text with `,` between its columns; bytes that are no such text stay as they are.
///
/// # Errors
///
/// It is UTF-16, or has `;` between columns and `,` in them.
pub fn plain(bytes: &[u8]) -> Result<Cow<'_, [u8]>> {
    if let [0xFF, 0xFE, _, 0, ..] | [0xFE, 0xFF, 0, ..] = bytes {
        bail!("it is UTF-16: save it as CSV in UTF-8");
    }
    let text = bytes.strip_prefix(MARK).unwrap_or(bytes);
    let header = text.split(|&byte| byte == b'\n').next().unwrap_or(text);
    let is_text = header
        .iter()
        .all(|&byte| matches!(byte, b' '..=b'~' | b'\r' | b'\t'));
    if !is_text || !header.contains(&b';') || header.contains(&b',') {
        return Ok(Cow::Borrowed(text));
    }
    ensure!(
        !text.contains(&b','),
        "it has `;` between columns and `,` in numbers: save it with `,` between columns and `.` in numbers"
    );
    let commas = text
        .iter()
        .map(|&byte| if byte == b';' { b',' } else { byte });
    Ok(Cow::Owned(commas.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_spreadsheets_write_is_read_or_refused_by_its_name() {
        let wanted = b"local_us,gps_utc_us\r\n1,2\r\n";
        for written in [
            &b"local_us,gps_utc_us\r\n1,2\r\n"[..],
            b"\xEF\xBB\xBFlocal_us,gps_utc_us\r\n1,2\r\n",
            b"\xEF\xBB\xBFlocal_us;gps_utc_us\r\n1;2\r\n",
        ] {
            assert_eq!(&*plain(written).unwrap(), wanted);
        }
        let refused = |written: &[u8]| plain(written).unwrap_err().to_string();
        assert!(refused(b"from_s;to_s\n1,5;2\n").contains("`,` in numbers"));
        assert!(refused(b"\xFF\xFEl\0o\0").contains("UTF-16"));
        assert!(refused(b"\xFE\xFF\0l\0o").contains("UTF-16"));
    }

    #[test]
    fn a_recording_stays_as_it_is() {
        let recording = b"\xB5b\x01\x07;\x00\n;1,2";
        assert_eq!(&*plain(recording).unwrap(), recording);
    }
}
