//! The memory for a test's samples, where nothing else wants to be.
//!
//! *Design.* On the Pixhawk the CCM, which no DMA reaches, and the upper 64 KB of SRAM, which QEMU
//! does not have: 8 192 samples. QEMU's board has 1 024 in ordinary RAM. The linker's start-up code
//! knows nothing of these sections, so they are cleared here.
//!
//! *Limits.* The CCM has a clock, which is on after a reset (RM0090, RCC_AHB1ENR) and which no
//! bootloader has a reason to stop.

use core::mem::MaybeUninit;
use core::slice;

use sample_log::{Record, SampleLog};

/// Records in the first piece of memory, and in the second.
#[cfg(feature = "pixhawk1")]
const ROOM: (usize, usize) = (4_096, 4_096);
#[cfg(feature = "qemu")]
const ROOM: (usize, usize) = (1_024, 0);

#[cfg_attr(feature = "pixhawk1", unsafe(link_section = ".ccm.samples"))]
static mut OLDER: MaybeUninit<[Record; ROOM.0]> = MaybeUninit::uninit();
#[cfg_attr(feature = "pixhawk1", unsafe(link_section = ".sram3.samples"))]
static mut NEWER: MaybeUninit<[Record; ROOM.1]> = MaybeUninit::uninit();

/// The empty log.
///
/// # Safety
///
/// To be called once.
pub unsafe fn samples() -> SampleLog<'static> {
    // SAFETY: both are named nowhere else, and this is called once.
    unsafe { SampleLog::new(cleared(&raw mut OLDER), cleared(&raw mut NEWER)) }
}

/// # Safety
///
/// `memory` is nobody else's, from now on for ever.
unsafe fn cleared<const N: usize>(memory: *mut MaybeUninit<[Record; N]>) -> &'static mut [Record] {
    let first = memory.cast::<Record>();
    for index in 0..N {
        // SAFETY: within the array, which is ours.
        unsafe { first.add(index).write(Record::EMPTY) };
    }
    // SAFETY: each record has just been written, and the array is ours for ever.
    unsafe { slice::from_raw_parts_mut(first, N) }
}
