//! How PX4 1.9 waits for the bytes that it reads.
//!
//! *Purpose.* The paper's variants read the receiver's line as the paper's boards did; this says
//! how long they wait between seeing the first bytes and reading them.
//!
//! *Design.* PX4 polls the line, and sleeps before it reads when fewer than [`CHARACTERS`] bytes
//! are there, for as long as that many take at the line's rate
//! (`src/drivers/gps/gps.cpp`, `pollOrRead`). The paper's step I puts a constant wait there.
//!
//! *Limits.* Its authors give the constant and not their line of code: it is read as a wait that
//! depends neither on the rate nor on what is there. (A poll returns with a line's first bytes, so
//! that fewer than the threshold are there nearly always.) A poll gives up after 50 ms and a
//! read takes 150 bytes at most; since PX4 then polls again, neither changes when a frame of
//! 100 bytes is read, and neither is here.

/// PX4 wants to read so many bytes at once.
pub const CHARACTERS: usize = 32;

/// The paper's constant wait, in µs (Shim, Joo, Kim 2021, step I).
const CONSTANT_US: u32 = 5_000;

/// The wait between a poll and its read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// PX4's own, on a line of so many baud.
    ForCharacters {
        /// The line's rate.
        baud: u32,
    },
    /// The paper's.
    Constant,
}

impl Wait {
    /// How long to sleep before a read, in µs, when so many bytes are there; `None` is not at all.
    #[must_use]
    pub const fn before_read(self, bytes_there: usize) -> Option<u32> {
        match self {
            Self::ForCharacters { .. } if bytes_there >= CHARACTERS => None,
            // As PX4 rounds it; a rate below 10 Bd would divide by 0.
            Self::ForCharacters { baud } => (CHARACTERS as u32 * 1_000_000).checked_div(baud / 10),
            Self::Constant => Some(CONSTANT_US),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn px4_waits_for_32_characters_unless_they_are_there() {
        let wait = |baud, there| Wait::ForCharacters { baud }.before_read(there);
        for there in [1, 31] {
            assert_eq!(wait(115_200, there), Some(2_777));
            assert_eq!(wait(38_400, there), Some(8_333));
        }
        for there in [32, 150] {
            assert_eq!(wait(115_200, there), None);
        }
        assert_eq!(wait(0, 1), None);
    }

    #[test]
    fn the_papers_wait_is_the_same_whatever_is_there() {
        for there in [1, 31, 32, 150] {
            assert_eq!(Wait::Constant.before_read(there), Some(5_000));
        }
    }
}
