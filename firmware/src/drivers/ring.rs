//! A ring between one interrupt and one task.
//!
//! *Purpose.* What a UART's handler stores, its task reads in place; what the task stores as a whole frame, the
//! handler takes byte by byte; and neither keeps the other waiting.
//!
//! *Design.* Two counts that run on: who fills moves `filled`, who drains `drained`, each alone. Only places
//! that are drained are written, only places that are filled are read, so no place is anybody's but one's,
//! and no section is masked. `heapless::spsc` is the same and passes its items one by one, which costs the
//! task more than the search for frames.
//!
//! *Limits.* One core: what it sees of its own stores is their order.

use core::cell::UnsafeCell;
use core::sync::atomic::{
    AtomicU32,
    Ordering::{Acquire, Relaxed, Release},
};

/// The ring, over an array whose length is a power of two, or any such as a slice.
pub struct Ring<S: ?Sized> {
    /// Items that were ever stored.
    filled: AtomicU32,
    /// Items that were ever taken.
    drained: AtomicU32,
    items: UnsafeCell<S>,
}

// SAFETY: as the module says: no place is written and read at once, if who fills is one and who drains
// is one.
unsafe impl<S: Send + ?Sized> Sync for Ring<S> {}

impl<T: Copy, const N: usize> Ring<[T; N]> {
    /// An empty one; what its places hold is never read.
    pub const fn new(items: [T; N]) -> Self {
        const { assert!(N.is_power_of_two()) };
        Self {
            filled: AtomicU32::new(0),
            drained: AtomicU32::new(0),
            items: UnsafeCell::new(items),
        }
    }
}

impl<T: Copy> Ring<[T]> {
    /// For how many items there is room.
    #[inline(always)]
    pub const fn capacity(&self) -> usize {
        self.items.get().len()
    }

    /// The place of the item that is the `count`th ever.
    #[inline(always)]
    const fn place(&self, count: u32) -> usize {
        count as usize & (self.capacity() - 1)
    }

    #[inline(always)]
    const fn begin(&self) -> *mut T {
        self.items.get().cast()
    }

    /// How many items wait.
    #[inline(always)]
    pub fn len(&self) -> usize {
        let drained = self.drained.load(Relaxed);
        self.filled.load(Relaxed).wrapping_sub(drained) as usize
    }

    /// Stores an item; whether there was room.
    ///
    /// # Safety
    ///
    /// Who fills is one, and does not interrupt itself.
    #[inline(always)]
    pub unsafe fn push(&self, item: T) -> bool {
        let filled = self.filled.load(Relaxed);
        if filled.wrapping_sub(self.drained.load(Acquire)) as usize == self.capacity() {
            return false;
        }
        // SAFETY: masked, the count is a place; it is drained, so nobody reads it.
        unsafe { self.begin().add(self.place(filled)).write(item) };
        self.filled.store(filled.wrapping_add(1), Release);
        true
    }

    /// Stores all of `items`, or none of them where there is too little room; whether there was room.
    ///
    /// # Safety
    ///
    /// As for [`Self::push`].
    pub unsafe fn push_all(&self, items: &[T]) -> bool {
        let filled = self.filled.load(Relaxed);
        let waiting = filled.wrapping_sub(self.drained.load(Acquire)) as usize;
        if items.len() > self.capacity() - waiting {
            return false;
        }
        let begin = self.place(filled);
        let first = items.len().min(self.capacity() - begin);
        let from = items.as_ptr();
        // SAFETY: both pieces lie in the ring and in `items`, and are drained, so nobody reads them.
        unsafe {
            self.begin()
                .add(begin)
                .copy_from_nonoverlapping(from, first);
            let rest = items.len() - first;
            self.begin().copy_from_nonoverlapping(from.add(first), rest);
        }
        self.filled
            .store(filled.wrapping_add(items.len() as u32), Release);
        true
    }

    /// Takes the oldest item.
    ///
    /// # Safety
    ///
    /// Who drains is one, and does not interrupt itself.
    #[inline(always)]
    pub unsafe fn pop(&self) -> Option<T> {
        let drained = self.drained.load(Relaxed);
        if self.filled.load(Acquire) == drained {
            return None;
        }
        // SAFETY: masked, the count is a place; it is filled, so nobody writes it.
        let item = unsafe { self.begin().add(self.place(drained)).read() };
        self.drained.store(drained.wrapping_add(1), Release);
        Some(item)
    }

    /// Passes the items that are there now to `take`, in two pieces at most, and then drains them.
    ///
    /// # Safety
    ///
    /// As for [`Self::pop`].
    #[inline(always)]
    pub unsafe fn drain(&self, mut take: impl FnMut(&[T])) {
        let drained = self.drained.load(Relaxed);
        let filled = self.filled.load(Acquire);
        let count = filled.wrapping_sub(drained) as usize;
        let begin = self.place(drained);
        let first = count.min(self.capacity() - begin);
        for (begin, len) in [(begin, first), (0, count - first)] {
            // SAFETY: both pieces lie in the ring and are filled, so that nobody writes there before
            // `drained` is moved.
            take(unsafe { core::slice::from_raw_parts(self.begin().add(begin), len) });
        }
        self.drained.store(filled, Release);
    }
}
