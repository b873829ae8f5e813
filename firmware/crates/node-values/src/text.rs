//! Short texts of a fixed size.

use core::fmt;

/// A short text as messages carry it: up to `N` bytes, zeros behind a shorter one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text<const N: usize>([u8; N]);

/// The name of a parameter.
pub type Name = Text<16>;

impl<const N: usize> Text<N> {
    /// The text of these bytes, which ends at the first 0.
    #[must_use]
    pub const fn new(bytes: [u8; N]) -> Self {
        Self(bytes)
    }

    /// All of its bytes, with the zeros behind it.
    #[must_use]
    pub const fn bytes(&self) -> [u8; N] {
        self.0
    }

    /// The text, up to the first byte that is not UTF-8.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|&byte| byte == 0).unwrap_or(N);
        let bytes = self.0.get(..end).unwrap_or_default();
        bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid())
    }
}

impl<const N: usize> From<&str> for Text<N> {
    /// The first `N` bytes of `text`.
    fn from(text: &str) -> Self {
        let mut bytes = [0; N];
        for (place, byte) in bytes.iter_mut().zip(text.bytes()) {
            *place = byte;
        }
        Self(bytes)
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_str().fmt(f)
    }
}
