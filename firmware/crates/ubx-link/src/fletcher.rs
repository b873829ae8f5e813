//! The checksum of UBX, as a running pair.
//!
//! *Purpose.* The checksum of any stretch of the line from two readings of one
//! running pair, so that no candidate has to be summed again.
//!
//! *Design.* Fletcher's checksum is the sum of the bytes, `A`, and the sum of all
//! values of `A`, `B`. Both are linear: with the pair read before and after
//! a stretch of `n` bytes, the stretch alone has `A₂ − A₁` and
//! `B₂ − B₁ − n · A₁`. They have 32 bits and may wrap, because the checksum is
//! their lowest eight.

/// A reading of the running pair.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fletcher {
    a: u32,
    b: u32,
}

impl Fletcher {
    pub(crate) const START: Self = Self { a: 0, b: 0 };

    /// The pair after one more byte, the lowest of `byte`.
    #[inline]
    pub(crate) const fn then(self, byte: u32) -> Self {
        let a = self.a.wrapping_add(byte & 0xff);
        let b = self.b.wrapping_add(a);
        Self { a, b }
    }

    /// The pair after `bytes`.
    #[inline]
    pub(crate) fn then_all(self, bytes: &[u8]) -> Self {
        // By words: on this core a byte from a register costs nothing extra, and one from memory
        // an instruction.
        let (words, rest) = bytes.as_chunks();
        let whole = words.iter().fold(self, |pair, word| {
            let word = u32::from_le_bytes(*word);
            let pair = pair.then(word).then(word >> 8);
            pair.then(word >> 16).then(word >> 24)
        });
        rest.iter()
            .fold(whole, |pair, byte| pair.then((*byte).into()))
    }

    /// The checksum of the last `length` bytes, before which the pair was `before`.
    #[inline]
    pub(crate) const fn since(self, before: Self, length: usize) -> [u8; 2] {
        let a = self.a.wrapping_sub(before.a);
        let b = self.b.wrapping_sub(before.b);
        [
            a as u8,
            b.wrapping_sub(before.a.wrapping_mul(length as u32)) as u8,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_stretch_follows_from_two_readings() {
        // Long and high enough for `B` to wrap.
        let line: [u8; 9_000] = core::array::from_fn(|i| 0xff ^ (i * i / 7) as u8);
        let start = Fletcher::START.then_all(&line[..8_000]);
        for length in 0..130 {
            let stretch = &line[8_000..8_000 + length];
            let (mut a, mut b) = (0_u8, 0_u8);
            for byte in stretch {
                a = a.wrapping_add(*byte);
                b = b.wrapping_add(a);
            }
            assert_eq!(start.then_all(stretch).since(start, length), [a, b]);
        }
        assert!(
            start.b < u32::MAX / 2 && start.a > 500_000,
            "it has wrapped"
        );
    }
}
