//! How PX4 1.9 waits for the bytes that it reads.
//!
//! *Design.* PX4 polls the line. When it then finds fewer than [`CHARACTERS`] bytes, it sleeps before
//! it reads, for the time that [`CHARACTERS`] bytes take at the line's rate
//! (`src/drivers/gps/gps.cpp`, `pollOrRead`). The paper's step I puts a constant wait there.
//!
//! *Limits.* The paper gives the constant and not its line of code; here it depends neither on the
//! rate nor on the bytes that are there. (A poll returns with the first bytes of a message, so that
//! there are nearly always fewer than the threshold.) PX4's poll ends after 50 ms and its read
//! after 150 bytes. Neither is here, because PX4 then polls again: the time at which a frame of
//! 100 bytes is read does not change.

/// The number of bytes that PX4 wants to read at once.
pub const CHARACTERS: usize = 32;

/// The paper's constant wait (Shim, Joo, Kim 2021, step I). \[µs\]
const CONSTANT_US: u32 = 5_000;

/// The wait between a poll and its read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// PX4's own.
    ForCharacters {
        /// The line's rate. \[Bd\]
        baud: u32,
    },
    /// The paper's: 5 ms.
    Constant,
}

impl Wait {
    /// The sleep before a read when `bytes_there` bytes wait; `None` is no sleep. \[µs\]
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
    fn the_papers_wait_does_not_depend_on_what_is_there() {
        for there in [1, 31, 32, 150] {
            assert_eq!(Wait::Constant.before_read(there), Some(5_000));
        }
    }
}
