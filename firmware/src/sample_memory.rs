//! The memory for a test's samples: what nothing else uses.
//!
//! *Design.* On the Pixhawk the CCM, which no DMA reaches, and the upper 64 KB of SRAM, which QEMU
//! does not have: 8 192 samples. QEMU's board has 1 024 in ordinary RAM. The linker's start-up code
//! does not initialize these sections, so they are cleared here.

use core::mem::MaybeUninit;
use core::slice;

use sample_log::{Record, SampleLog};

use crate::board::SAMPLE_ROOM;

#[cfg_attr(feature = "pixhawk1", unsafe(link_section = ".ccm.samples"))]
static mut OLDER: MaybeUninit<[Record; SAMPLE_ROOM.0]> = MaybeUninit::uninit();
#[cfg_attr(feature = "pixhawk1", unsafe(link_section = ".sram3.samples"))]
static mut NEWER: MaybeUninit<[Record; SAMPLE_ROOM.1]> = MaybeUninit::uninit();

/// The empty log.
///
/// # Safety
///
/// To be called once.
pub unsafe fn samples() -> SampleLog<'static> {
    // SAFETY: no other code names these two, and this is called once.
    unsafe { SampleLog::new(cleared(&raw mut OLDER), cleared(&raw mut NEWER)) }
}

/// # Safety
///
/// No other code uses `memory`, from now on.
unsafe fn cleared<const N: usize>(memory: *mut MaybeUninit<[Record; N]>) -> &'static mut [Record] {
    let first = memory.cast::<Record>();
    for index in 0..N {
        // SAFETY: the place is within the array, which only this function uses.
        unsafe { first.add(index).write(Record::EMPTY) };
    }
    // SAFETY: every record has just been written, and the caller is the only one to have them.
    unsafe { slice::from_raw_parts_mut(first, N) }
}
