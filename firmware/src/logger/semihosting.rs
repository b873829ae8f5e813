//! Frames to the standard output of the emulator: semihosting.
//!
//! *Design.* A frame is staged and handed over in one call, since each call stops the machine. The
//! operations are Arm's "Semihosting for AArch32 and AArch64", sections 7.9 and 7.20: SYS_OPEN of
//! `:tt` for writing is the standard output.
//!
//! *Limits.* [`SIZE`] is the longest frame.

use core::arch::asm;

const SYS_OPEN: u32 = 0x01;
const SYS_WRITE: u32 = 0x05;
/// The mode `w` of SYS_OPEN.
const WRITING: u32 = 4;
/// What SYS_OPEN gives when it fails.
const NO_HANDLE: u32 = u32::MAX;

/// Bytes of a frame.
const SIZE: usize = 2 * 1024;

/// The frame that is being staged. There is one of these.
pub struct Out {
    handle: Option<u32>,
    bytes: [u8; SIZE],
    len: usize,
    fits: bool,
}

impl Out {
    /// Without a frame.
    pub const fn new() -> Self {
        Self {
            handle: None,
            bytes: [0; SIZE],
            len: 0,
            fits: false,
        }
    }

    /// Begins a frame, in place of one that was not committed.
    pub fn begin(&mut self) {
        self.len = 0;
        self.fits = true;
    }

    /// Adds `bytes` to the frame.
    pub fn put(&mut self, bytes: &[u8]) {
        let end = self.len + bytes.len();
        match self.bytes.get_mut(self.len..end) {
            Some(room) => {
                room.copy_from_slice(bytes);
                self.len = end;
            }
            None => self.fits = false,
        }
    }

    /// Hands the frame over if it is whole; whether it was.
    pub fn commit(&mut self) -> bool {
        let handle = *self.handle.get_or_insert_with(|| {
            const NAME: &[u8] = b":tt\0";
            let name = [NAME.as_ptr() as u32, WRITING, NAME.len() as u32 - 1];
            call(SYS_OPEN, &name)
        });
        if self.fits && handle != NO_HANDLE {
            call(
                SYS_WRITE,
                &[handle, self.bytes.as_ptr() as u32, self.len as u32],
            );
        }
        self.fits
    }

    /// A host that is called takes everything: there is always room.
    pub fn make_room(&mut self) {}
}

/// Has the host do `operation` with `arguments`; its answer.
fn call(operation: u32, arguments: &[u32; 3]) -> u32 {
    let answer;
    // SAFETY: both operations read what `arguments` point at, and write no memory of ours.
    unsafe {
        asm!(
            "bkpt 0xab",
            inout("r0") operation => answer,
            in("r1") arguments.as_ptr(),
            options(nostack, preserves_flags)
        );
    }
    answer
}
