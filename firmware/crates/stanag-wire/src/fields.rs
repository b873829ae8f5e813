//! Data that begin with a presence vector.

use crate::refusal::Refusal;

/// The fields of a message: how wide its presence vector is, and how long each field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The presence vector's width, up to 8. \[bytes\]
    pub vector: u8,
    /// The length of each field, in the order of the vector's bits from the lowest. \[bytes\]
    pub sizes: &'static [u8],
}

impl Layout {
    /// How long data with this presence vector are as far as fields are known, and whether it has
    /// bits beyond these.
    #[inline(never)]
    fn extent(&self, vector: u64) -> (usize, bool) {
        let sizes = self.sizes.iter().map(|&size| usize::from(size));
        let present = sizes
            .enumerate()
            .filter(|&(field, _)| vector >> field & 1 == 1);
        let length = present.map(|(_, size)| size).sum::<usize>();
        let unknown = vector.checked_shr(self.sizes.len() as u32).unwrap_or(0);
        (usize::from(self.vector) + length, unknown != 0)
    }

    /// How long data with all fields are. \[bytes\]
    #[must_use]
    pub fn longest(&self) -> usize {
        self.extent(u64::MAX).0
    }

    /// How long data with this presence vector are, if the table has all of its bits. \[bytes\]
    #[must_use]
    pub fn length_of(&self, vector: u64) -> Option<usize> {
        let (length, has_unknown) = self.extent(vector);
        (!has_unknown).then_some(length)
    }

    /// The fields in `data`. What stands behind the known ones is ignored when the vector has bits
    /// that the table does not have.
    ///
    /// # Errors
    ///
    /// `Data` when the length is not what the vector says.
    #[inline(never)]
    pub fn values<'a>(&self, data: &'a [u8]) -> Result<Values<'a>, Refusal> {
        let (head, fields) = data
            .split_at_checked(self.vector.into())
            .ok_or(Refusal::Data)?;
        let vector = head
            .iter()
            .fold(0, |vector, &byte| vector << 8 | u64::from(byte));
        let (length, has_unknown) = self.extent(vector);
        let is_as_said = match has_unknown {
            false => data.len() == length,
            true => data.len() > length,
        };
        if !is_as_said {
            return Err(Refusal::Data);
        }
        let sizes = self.sizes;
        Ok(Values {
            vector,
            sizes,
            fields,
        })
    }
}

/// The fields of a message that was received. Fields are numbered from 0, the Time Stamp.
#[derive(Clone, Copy, Debug)]
pub struct Values<'a> {
    vector: u64,
    sizes: &'static [u8],
    fields: &'a [u8],
}

impl<'a> Values<'a> {
    /// The field's bytes. `None` when it is absent: "no data".
    #[must_use]
    pub fn bytes(&self, field: usize) -> Option<&'a [u8]> {
        let is_present = |field: usize| self.vector >> field & 1 == 1;
        let length = usize::from(*self.sizes.get(field)?);
        if !is_present(field) {
            return None;
        }
        let before = self.sizes.iter().take(field).enumerate();
        let before = before.filter(|&(field, _)| is_present(field));
        let begin = before.map(|(_, &size)| usize::from(size)).sum::<usize>();
        self.fields.get(begin..begin + length)
    }

    /// An Unsigned of up to 8 bytes.
    #[must_use]
    #[inline(never)]
    pub fn unsigned(&self, field: usize) -> Option<u64> {
        let bytes = self.bytes(field)?;
        Some(
            bytes
                .iter()
                .fold(0, |value, &byte| value << 8 | u64::from(byte)),
        )
    }

    /// An Integer of up to 8 bytes.
    #[must_use]
    pub fn integer(&self, field: usize) -> Option<i64> {
        let unused = 64 - 8 * u32::from(*self.sizes.get(field)?).clamp(1, 8);
        self.unsigned(field)
            .map(|value| (value << unused).cast_signed() >> unused)
    }
}

/// The longest data that are built here: an alert with its text has 110. \[bytes\]
const MAX_BUILT: usize = 128;

/// Data that are being written: field by field, from the first on.
#[derive(Clone, Debug)]
pub struct Builder {
    layout: Layout,
    next: usize,
    length: usize,
    bytes: [u8; MAX_BUILT],
}

impl Builder {
    /// Data without any field.
    #[must_use]
    pub const fn new(layout: &Layout) -> Self {
        Self {
            layout: *layout,
            next: 0,
            length: layout.vector as usize,
            bytes: [0; MAX_BUILT],
        }
    }

    /// Adds a number, of which the lowest bytes are taken. A field that does not exist, or stands
    /// before one that is there already, stays out: `false`.
    #[inline(never)]
    pub fn unsigned(&mut self, field: usize, value: u64) -> bool {
        let bytes = value.to_be_bytes();
        let size = self.layout.sizes.get(field).copied().unwrap_or(0).into();
        match bytes.len().checked_sub(size).and_then(|at| bytes.get(at..)) {
            Some(lowest) => self.bytes(field, lowest),
            None => false,
        }
    }

    /// Adds a signed number, as [`Builder::unsigned`] does.
    pub fn integer(&mut self, field: usize, value: i64) -> bool {
        self.unsigned(field, value.cast_unsigned())
    }

    /// Adds bytes, with NULs up to the field's length behind them. More bytes than that are refused
    /// too.
    #[inline(never)]
    pub fn bytes(&mut self, field: usize, bytes: &[u8]) -> bool {
        let Some(&size) = self.layout.sizes.get(field) else {
            return false;
        };
        let end = self.length + usize::from(size);
        // The vector's byte that has the bit, counted from its end.
        let byte = usize::from(self.layout.vector).checked_sub(1 + field / 8);
        if field < self.next || bytes.len() > usize::from(size) || end > MAX_BUILT {
            return false;
        }
        let Some(byte) = byte.and_then(|byte| self.bytes.get_mut(byte)) else {
            return false;
        };
        *byte |= 1 << (field % 8);
        let room = self.bytes.get_mut(self.length..).unwrap_or_default();
        for (to, from) in room.iter_mut().zip(bytes) {
            *to = *from;
        }
        self.next = field + 1;
        self.length = end;
        true
    }

    /// What was written, presence vector included.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYOUT: Layout = Layout {
        vector: 2,
        sizes: &[5, 2, 3, 4, 1, 1, 1, 1, 3],
    };

    #[test]
    fn only_what_is_there_takes_room() {
        let mut data = Builder::new(&LAYOUT);
        assert!(data.unsigned(1, 0xABCD));
        assert!(data.integer(2, -2));
        assert!(data.integer(8, -70_000));
        assert_eq!(
            data.data(),
            [1, 6, 0xAB, 0xCD, 0xFF, 0xFF, 0xFE, 0xFE, 0xEE, 0x90]
        );
        let values = LAYOUT.values(data.data()).unwrap();
        assert_eq!(values.unsigned(0), None);
        assert_eq!(values.unsigned(1), Some(0xABCD));
        assert_eq!(values.integer(2), Some(-2));
        assert_eq!(values.integer(8), Some(-70_000));
        assert_eq!(values.integer(9), None);
    }

    #[test]
    fn fields_out_of_order_or_table_or_too_long_stay_out() {
        let mut data = Builder::new(&LAYOUT);
        assert!(data.unsigned(2, 7));
        let before = data.data().to_vec();
        assert!(!data.unsigned(2, 8));
        assert!(!data.unsigned(0, 8));
        assert!(!data.unsigned(9, 8));
        assert!(!data.bytes(3, &[0; 5]));
        assert_eq!(data.data(), before);
    }

    #[test]
    fn another_length_than_the_vector_says_is_refused() {
        let good = [0, 2, 0xAB, 0xCD];
        assert!(LAYOUT.values(&good).is_ok());
        assert!(LAYOUT.values(&good[..3]).is_err());
        assert!(LAYOUT.values(&[0, 2, 0xAB, 0xCD, 0]).is_err());
        assert!(LAYOUT.values(&[0]).is_err());
        // A bit beyond the table: its field is of a later edition and stands last.
        let later = [2, 2, 0xAB, 0xCD, 0x12];
        let values = LAYOUT.values(&later).unwrap();
        assert_eq!(values.unsigned(1), Some(0xABCD));
        assert!(LAYOUT.values(&later[..4]).is_err());
    }
}
