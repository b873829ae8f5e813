//! The latest value of something: one writer, any number of readers.
//!
//! *Design.* A value is copied in and out under a critical section, which its size bounds.

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

/// The latest value; before the first there is none.
pub struct Latest<T>(Mutex<CriticalSectionRawMutex, Cell<Option<T>>>);

impl<T: Copy> Latest<T> {
    /// Without a value.
    pub const fn new() -> Self {
        Self(Mutex::new(Cell::new(None)))
    }

    /// Replaces the value.
    pub fn set(&self, value: T) {
        self.0.lock(|cell| cell.set(Some(value)));
    }

    /// The last one.
    pub fn get(&self) -> Option<T> {
        self.0.lock(Cell::get)
    }
}
