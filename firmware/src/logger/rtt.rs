//! Frames into a ring in RAM that a debug probe reads: SEGGER's RTT.
//!
//! *Design.* One channel up, none down, laid out as SEGGER's `SEGGER_RTT.h` has it and as probe-rs reads
//! it: the control block by its symbol or its identifier, the channel by the name `defmt`. The
//! board moves the write offset, the probe the read offset. A frame's bytes are copied behind the write
//! offset, which moves when the frame is whole.
//!
//! *Limits.* [`SIZE`] less a byte is the longest frame, and half a minute of status lines: a probe has as long
//! to come by.

use core::cell::UnsafeCell;
use core::sync::atomic::{
    AtomicU32,
    Ordering::{Relaxed, Release},
};

/// Bytes of the ring; a power of two.
const SIZE: u32 = 8 * 1024;
const MASK: u32 = SIZE - 1;
const _: () = assert!(SIZE.is_power_of_two());

/// Room that [`Out::make_room`] makes sure of: the message of a panic and a line about registers.
const LAST_WORDS: u32 = 2 * 1024;

/// `SEGGER_RTT_MODE_NO_BLOCK_SKIP`: what does not fit is skipped whole. probe-rs writes another mode
/// here, one that waits for it, which is ignored.
const SKIP: u32 = 0;

/// The control block, of which debuggers know the layout.
#[repr(C)]
struct ControlBlock {
    id: [u8; 16],
    up_channels: u32,
    down_channels: u32,
    name: *const u8,
    ring: *const Ring,
    size: u32,
    /// Where the board writes next.
    write: AtomicU32,
    /// Where the probe reads next; equal to `write` when it has read everything.
    read: AtomicU32,
    flags: AtomicU32,
}

// SAFETY: the pointers are never written, and what changes is atomic.
unsafe impl Sync for ControlBlock {}

#[unsafe(no_mangle)]
static _SEGGER_RTT: ControlBlock = ControlBlock {
    id: *b"SEGGER RTT\0\0\0\0\0\0",
    up_channels: 1,
    down_channels: 0,
    name: NAME.as_ptr(),
    ring: &raw const RING,
    size: SIZE,
    write: AtomicU32::new(0),
    read: AtomicU32::new(0),
    flags: AtomicU32::new(SKIP),
};

/// In RAM, like all that a probe reads.
#[unsafe(link_section = ".data.rtt_name")]
static NAME: [u8; 6] = *b"defmt\0";

struct Ring(UnsafeCell<[u8; SIZE as usize]>);

// SAFETY: bytes are written by the one `Out`, and read by the probe alone.
unsafe impl Sync for Ring {}

// Not zeroed at the start: what counts is between the offsets.
#[unsafe(link_section = ".uninit.rtt_ring")]
static RING: Ring = Ring(UnsafeCell::new([0; SIZE as usize]));

/// The frame that is being staged. There is one of these.
pub struct Out {
    /// Where its next byte goes.
    at: u32,
    /// Bytes that still fit.
    room: u32,
    fits: bool,
}

impl Out {
    /// Without a frame.
    pub const fn new() -> Self {
        Self {
            at: 0,
            room: 0,
            fits: false,
        }
    }

    /// Begins a frame, in place of one that was not committed.
    pub fn begin(&mut self) {
        // The probe's offset is masked, since it is not ours.
        let write = _SEGGER_RTT.write.load(Relaxed);
        let read = _SEGGER_RTT.read.load(Relaxed) & MASK;
        self.at = write;
        self.room = read.wrapping_sub(write).wrapping_sub(1) & MASK;
        self.fits = true;
    }

    /// Adds `bytes` to the frame.
    pub fn put(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if self.room == 0 {
                self.fits = false;
                return;
            }
            self.room -= 1;
            // SAFETY: `at` is below SIZE, and the probe reads nothing between the write offset and the
            // read offset.
            unsafe {
                RING.0
                    .get()
                    .cast::<u8>()
                    .add(self.at as usize)
                    .write_volatile(byte);
            }
            self.at = (self.at + 1) & MASK;
        }
    }

    /// Shows the frame to the probe if it is whole; whether it is.
    pub fn commit(&mut self) -> bool {
        if self.fits {
            _SEGGER_RTT.write.store(self.at, Release);
        }
        self.fits
    }

    /// Makes sure that a few lines fit, if need be by giving up what was not read.
    pub fn make_room(&mut self) {
        self.begin();
        if self.room < LAST_WORDS {
            // A probe that is just reading comes to the same offset.
            let write = _SEGGER_RTT.write.load(Relaxed);
            _SEGGER_RTT.read.store(write, Relaxed);
        }
    }
}
