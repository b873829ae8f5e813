//! The latest value of something: one writer, any number of readers, all of them tasks.
//!
//! *Design.* A value is copied in and out while other tasks are kept out, which its size bounds. No
//! interrupt waits for it.

use core::cell::Cell;

use crate::masks;
use crate::priorities::EXECUTOR_HIGH;

/// The latest value; before the first there is none.
pub struct Latest<T>(Cell<Option<T>>);

// SAFETY: the cell is touched only in sections that keep out all tasks, and by tasks and thread level
// alone.
unsafe impl<T: Send> Sync for Latest<T> {}

impl<T: Copy> Latest<T> {
    /// Without a value.
    pub const fn new() -> Self {
        Self(Cell::new(None))
    }

    /// Replaces the value. From tasks and thread level.
    pub fn set(&self, value: T) {
        masks::up_to(EXECUTOR_HIGH, || self.0.set(Some(value)));
    }

    /// The last one. From tasks and thread level.
    pub fn get(&self) -> Option<T> {
        masks::up_to(EXECUTOR_HIGH, || self.0.get())
    }
}
