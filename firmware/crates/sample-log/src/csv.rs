//! The file of a log: comma-separated values, a header and a line for each sample.
//!
//! *Design.* Every line has the same length, so that any stretch of the file can be made from the
//! samples in it alone. Numbers have leading zeros for that, which programs that read such
//! files ignore. The sequence number is longer where the state is shorter.
//!
//! The column `clock_state` says what is not known: `unproved` is a clock whose date and second are
//! not proved, or contradicted, and `unset` one whose time is that since boot.
//!
//! *Limits.* A time before 1970 is written as 0. Lines end with CR and LF (RFC 4180).

use timebase::divide;

use crate::Sample;

/// Bytes of a line, the header included.
pub const LINE: usize = 77;

/// The first line.
pub const HEADER: &[u8; LINE] =
    b"sequence,ping_time_us,board_time_ns,clock_state,uncertainty_on_each_side_ns\r\n";

/// Digits of the PING's time: enough until 2286.
const PING_DIGITS: usize = 16;
/// Digits of the board's time: enough for `i64`.
const BOARD_DIGITS: usize = 19;
/// Digits of the uncertainty: enough for `u64`.
const UNCERTAINTY_DIGITS: usize = 20;

/// The length of the file of a log with that number of samples, in bytes; `u32::MAX` beyond 4 GB.
#[must_use]
pub const fn file_len(samples: u32) -> u32 {
    samples.saturating_add(1).saturating_mul(LINE as u32)
}

/// The line of a sample.
#[must_use]
pub fn line(sample: &Sample) -> [u8; LINE] {
    let mut line = [b','; LINE];
    // Filled from its end to its beginning.
    let free = write(&mut line, b"\r\n");
    let free = digits(free, UNCERTAINTY_DIGITS, sample.uncertainty_ns);
    let free = write(free, b",");
    let free = write(free, sample.state.as_str().as_bytes());
    let free = write(free, b",");
    let free = digits(free, BOARD_DIGITS, sample.board_ns.max(0).cast_unsigned());
    let free = write(free, b",");
    let free = digits(free, PING_DIGITS, sample.ping_us);
    let free = write(free, b",");
    let rest = free.len();
    digits(free, rest, sample.sequence.into());
    line
}

/// Fills `out` with the file from `offset` on, for a log of that number of samples; `get` returns
/// a sample by its index. Returns the number of bytes: fewer than `out` has room for at the end of
/// the file, or where `get` returns none.
pub fn read(
    offset: u32,
    out: &mut [u8],
    samples: u32,
    mut get: impl FnMut(u32) -> Option<Sample>,
) -> usize {
    const LINE_U32: u32 = LINE as u32;
    let mut number = offset / LINE_U32;
    let mut skipped = (offset % LINE_U32) as usize;
    let mut made = 0;
    while let Some(free) = out.get_mut(made..)
        && !free.is_empty()
        && number <= samples
    {
        let whole = match number.checked_sub(1) {
            None => *HEADER,
            Some(index) => match get(index) {
                Some(sample) => line(&sample),
                None => break,
            },
        };
        let wanted = whole.get(skipped..).unwrap_or_default();
        let count = wanted.len().min(free.len());
        for (place, byte) in free.iter_mut().zip(wanted) {
            *place = *byte;
        }
        made += count;
        skipped = 0;
        number += 1;
    }
    made
}

/// Writes `text` at the end of `line`, and returns what is before it.
fn write<'a>(line: &'a mut [u8], text: &[u8]) -> &'a mut [u8] {
    let (free, place) = line.split_at_mut(line.len().saturating_sub(text.len()));
    for (place, byte) in place.iter_mut().zip(text) {
        *place = *byte;
    }
    free
}

/// Writes the last `count` digits of a number at the end of `line`, and returns what is before
/// them.
fn digits(line: &mut [u8], count: usize, mut number: u64) -> &mut [u8] {
    /// Digits that fit into a word, for which a division is one instruction.
    const AT_ONCE: usize = 9;
    const BEYOND: u64 = 10_u64.pow(AT_ONCE as u32);
    let (free, place) = line.split_at_mut(line.len().saturating_sub(count));
    for some in place.rchunks_mut(AT_ONCE) {
        let quotient = divide::<BEYOND>(number);
        let mut part = (number - quotient * BEYOND) as u32;
        number = quotient;
        for digit in some.iter_mut().rev() {
            *digit = b'0' + (part % 10) as u8;
            part /= 10;
        }
    }
    free
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::str;
    use std::vec::Vec;

    use timebase::ClockState;

    use super::*;

    fn sample(index: u32) -> Sample {
        Sample {
            board_ns: 1_795_309_322_961_327_001 + i64::from(index),
            ping_us: 1_795_309_322_000_000 + u64::from(index),
            sequence: index,
            state: [
                ClockState::Unset,
                ClockState::Set,
                ClockState::Holdover,
                ClockState::Unproved,
            ][index as usize % 4],
            uncertainty_ns: [u64::MAX, 64, 0, 18_000_000_077][index as usize % 4],
        }
    }

    fn file(samples: u32) -> Vec<u8> {
        let mut whole = HEADER.to_vec();
        whole.extend((0..samples).flat_map(|index| line(&sample(index))));
        whole
    }

    #[test]
    fn a_line_has_the_columns_of_the_header() {
        let lines = [0, 1, 0xff_fffe, 0xff_ffff].map(|index| line(&sample(index)));
        let texts = lines.each_ref().map(|line| str::from_utf8(line).unwrap());
        assert_eq!(
            texts,
            [
                "00000000000,1795309322000000,1795309322961327001,unset,18446744073709551615\r\n",
                "0000000000001,1795309322000001,1795309322961327002,set,00000000000000000064\r\n",
                "16777214,1795309338777214,1795309322978104215,holdover,00000000000000000000\r\n",
                "16777215,1795309338777215,1795309322978104216,unproved,00000000018000000077\r\n",
            ]
        );
        let columns = str::from_utf8(HEADER).unwrap().split(',').count();
        assert!(texts.iter().all(|text| text.split(',').count() == columns));
    }

    #[test]
    fn no_number_leaves_its_column() {
        let extreme = Sample {
            board_ns: i64::MIN,
            ping_us: u64::MAX,
            sequence: u32::MAX,
            state: ClockState::Holdover,
            uncertainty_ns: u64::MAX,
        };
        let text = line(&extreme);
        let mut columns = str::from_utf8(&text).unwrap().split(',');
        assert_eq!(columns.next().map(str::len), Some(8));
        assert_eq!(columns.next(), Some("6744073709551615"));
        assert_eq!(columns.next(), Some("0000000000000000000"));
    }

    #[test]
    fn any_stretch_is_that_of_the_whole() {
        let whole = file(7);
        assert_eq!(file_len(7) as usize, whole.len());
        for offset in 0..=whole.len() {
            for room in [0, 1, 76, 77, 78, 90, 512, 1_000] {
                let mut out = [0; 1_000];
                let made = read(offset as u32, &mut out[..room], 7, |index| {
                    Some(sample(index))
                });
                let end = whole.len().min(offset + room);
                assert_eq!(
                    out[..made],
                    whole[offset..end],
                    "{room} bytes from {offset}"
                );
            }
        }
        let mut out = [0; 10];
        assert_eq!(read(u32::MAX, &mut out, 7, |_| None), 0);
        assert_eq!(read(file_len(7) + 1, &mut out, 7, |_| None), 0);
    }

    #[test]
    fn a_sample_that_is_not_there_ends_the_file() {
        let mut out = [0; 512];
        let made = read(0, &mut out, 7, |index| (index < 2).then(|| sample(index)));
        assert_eq!(out[..made], file(2));
    }
}
