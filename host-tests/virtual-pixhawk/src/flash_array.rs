//! The flash, as the core can program and erase it.
//!
//! *Purpose.* The emulator has the flash's registers but keeps what is in the flash as it was loaded: a
//! bootloader could not do its work. [`Programming`] is the run's bus with what is left out.
//!
//! *Design.* A store into the flash clears bits while CR has PG and not LOCK (RM0090, 3.6.4); a sector
//! whose erase CR has begun is all ones at once, while BSY lasts as long as the emulator's own model
//! says. The core may hold instructions that it has translated from there, so each change is told to
//! it.
//!
//! *Limits.* Only for boards with a [`UploadBootloader`](crate::UploadBootloader). No programming errors, no mass
//! erase, no time for programming a word; a power failure leaves no half-programmed word.

use std::sync::atomic::{AtomicPtr, Ordering};

use rigless::emulator::{Access, AccessKind, Checked, CoreBus, InterruptLine, Queued};
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::flash::FLASH;

/// The flash, in bytes (RM0090, table 6).
const SIZE: u64 = 2 << 20;
/// FLASH_CR, and its bits (RM0090, 3.9.8).
const CR: u64 = 0x4002_3C10;
const PG: u64 = 1;
const SER: u64 = 1 << 1;
const STRT: u64 = 1 << 16;
const LOCK: u64 = 1 << 31;

/// Where the emulator keeps what is in the flash; null until it has said so.
#[derive(Debug, Default)]
pub(crate) struct FlashArray(AtomicPtr<u8>);

impl FlashArray {
    /// The emulator maps `length` bytes at `host` to the address `start`.
    pub(crate) fn note(&self, start: u64, length: u64, host: *mut u8) {
        if start == u64::from(FLASH) && length == SIZE {
            self.0.store(host, Ordering::Relaxed);
        }
    }

    /// Has each of `length` bytes from `address` on become what `change` makes of it, if they are all in
    /// the flash.
    fn change(&self, address: u64, length: u64, change: impl Fn(u64, u8) -> u8) -> bool {
        let bytes = self.0.load(Ordering::Relaxed);
        let Some(offset) = address.checked_sub(FLASH.into()) else {
            return false;
        };
        if bytes.is_null() || offset + length > SIZE {
            return false;
        }
        for nth in 0..length {
            // SAFETY: the emulator has handed out `SIZE` bytes there, which it allocated as writable,
            // does not move, and itself writes from outside the core. The core is in a call to its
            // bus, during which it holds no reference to them.
            unsafe {
                let byte = bytes.add((offset + nth) as usize);
                byte.write(change(nth, byte.read()));
            }
        }
        true
    }
}

/// The sector that CR's SNB names: its address and its size (RM0090, table 6 and 3.9.8).
fn sector(cr: u64) -> Option<(u64, u64)> {
    let number = match cr >> 3 & 0x1F {
        number @ 0..12 => number,
        number @ 16..28 => number - 4,
        _ => return None,
    };
    let bank = (number / 12) << 20;
    let (offset, size) = match number % 12 {
        small @ 0..4 => (small * (16 << 10), 16 << 10),
        4 => (64 << 10, 64 << 10),
        large => ((large - 4) * (128 << 10), 128 << 10),
    };
    Some((u64::from(FLASH) + bank + offset, size))
}

/// The run's bus, with a flash that can be changed.
pub(crate) struct Programming<'a> {
    bus: &'a mut dyn CoreBus,
    array: &'a FlashArray,
    /// Changes that the core was not told yet.
    stale: Vec<Queued>,
}

impl<'a> Programming<'a> {
    pub(crate) const fn new(bus: &'a mut dyn CoreBus, array: &'a FlashArray) -> Self {
        Self {
            bus,
            array,
            stale: Vec::new(),
        }
    }

    fn change(&mut self, address: u64, length: u64, change: impl Fn(u64, u8) -> u8) {
        if self.array.change(address, length, change) {
            self.stale
                .push(Queued::Invalidate(address, address + length));
        }
    }

    /// CR as it is after `access`.
    fn cr(&mut self, access: Access) -> u64 {
        let mut read = access;
        read.kind = AccessKind::Read;
        read.address = CR;
        read.width = Width::W32;
        read.value = 0;
        self.bus.access(read, false).unwrap_or(LOCK)
    }

    fn written(&mut self, access: Access) {
        let is_flash = access
            .address
            .checked_sub(FLASH.into())
            .is_some_and(|offset| offset < SIZE);
        if access.address == CR {
            let cr = self.cr(access);
            if cr & STRT != 0
                && cr & SER != 0
                && let Some((address, size)) = sector(cr)
            {
                self.change(address, size, |_, _| 0xFF);
            }
        } else if is_flash && self.cr(access) & (PG | LOCK) == PG {
            let value = access.value.to_le_bytes();
            self.change(access.address, access.width.bytes().into(), |nth, byte| {
                byte & value[nth as usize]
            });
        }
    }
}

impl CoreBus for Programming<'_> {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        let answer = self.bus.access(access, from_code);
        if access.kind == AccessKind::Write {
            self.written(access);
        }
        answer
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.bus.time(instructions)
    }

    fn queued(&mut self) -> Vec<Queued> {
        let mut queued = self.bus.queued();
        queued.append(&mut self.stale);
        queued
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        self.bus.carry_on(instructions, event)
    }

    fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64> {
        self.bus.acknowledge(line, instructions)
    }

    fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked> {
        self.bus.read_checked(access, report)
    }

    fn write_checked(&mut self, access: Access) -> Option<bool> {
        self.bus.write_checked(access)
    }

    fn stops_before(&mut self, access: &Access) -> bool {
        self.bus.stops_before(access)
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.bus.send_trace(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sectors_lie_one_behind_the_other_to_the_end() {
        let numbers = (0..12).chain(16..28);
        let sectors: Vec<_> = numbers.map(|number| sector(number << 3).unwrap()).collect();
        let mut end = u64::from(FLASH);
        for (address, size) in sectors {
            assert_eq!(address, end);
            end += size;
        }
        assert_eq!(end, u64::from(FLASH) + SIZE);
        assert_eq!((sector(12 << 3), sector(28 << 3)), (None, None));
    }

    #[test]
    fn bytes_outside_the_flash_are_not_touched() {
        let mut bytes = vec![0xFF; SIZE as usize];
        let array = FlashArray::default();
        let clear = |address| array.change(address, 4, |_, _| 0);
        assert!(!clear(FLASH.into()), "nothing is mapped yet");
        array.note(FLASH.into(), SIZE, bytes.as_mut_ptr());
        let flash = u64::from(FLASH);
        assert!(!clear(flash - 1) && !clear(flash + SIZE - 3) && !clear(0));
        assert!(clear(flash + SIZE - 4));
        assert_eq!(bytes[SIZE as usize - 5..], [0xFF, 0, 0, 0, 0]);
    }
}
