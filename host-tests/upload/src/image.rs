//! What goes into a board's flash behind its bootloader.

use std::ops::Range;

/// Where an application begins: behind the 16 KB of the bootloader.
pub const APPLICATION: u32 = 0x0800_4000;

/// The bytes for the flash of one kind of board, from [`APPLICATION`] on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    board_id: u32,
    bytes: Vec<u8>,
}

impl Image {
    /// An image for boards with this id. The flash is programmed in words: bytes of 0xFF make the last
    /// one whole.
    #[must_use]
    pub fn new(board_id: u32, mut bytes: Vec<u8>) -> Self {
        bytes.resize(bytes.len().next_multiple_of(4), 0xFF);
        Self { board_id, bytes }
    }

    /// The id of the boards that it is for.
    #[must_use]
    pub const fn board_id(&self) -> u32 {
        self.board_id
    }

    /// Its bytes, a multiple of four.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Whether a bootloader with `room` bytes behind it would boot it: its first word is not erased, and
    /// its reset vector points into it.
    #[must_use]
    pub fn can_boot(&self, room: u32) -> bool {
        let word = |range: Range<usize>| {
            let bytes = self.bytes.get(range)?.try_into().ok()?;
            Some(u32::from_le_bytes(bytes))
        };
        let flash = APPLICATION..APPLICATION.saturating_add(room);
        word(0..4).is_some_and(|stack| stack != u32::MAX)
            && word(4..8).is_some_and(|reset| flash.contains(&reset))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_word_is_made_whole() {
        assert_eq!(
            Image::new(9, vec![1; 5]).bytes(),
            [1, 1, 1, 1, 1, 255, 255, 255]
        );
        assert_eq!(Image::new(9, vec![1; 4]).bytes(), [1; 4]);
    }

    #[test]
    fn what_a_bootloader_would_not_boot() {
        let image = |stack: u32, reset: u32| {
            Image::new(9, [stack.to_le_bytes(), reset.to_le_bytes()].concat())
        };
        assert!(image(0x2002_0000, 0x0800_4009).can_boot(0x1000));
        assert!(!image(u32::MAX, 0x0800_4009).can_boot(0x1000));
        assert!(!image(0x2002_0000, 0x0800_3FFF).can_boot(0x1000));
        assert!(!image(0x2002_0000, 0x0800_5001).can_boot(0x1000));
        assert!(!Image::new(9, vec![0; 4]).can_boot(0x1000));
    }
}
