//! The firmware's log buffer, as a probe reads it.
//!
//! *Purpose.* Takes what the firmware has written to RTT's first up-channel out of
//! the board's memory.
//!
//! *Design.* The control block is found by its symbol, `_SEGGER_RTT`: an identifier
//! of 16 bytes, two counts, then the channel's descriptor (name, buffer, size, write
//! and read offset). The read offset is written back, as a probe does.
//!
//! *Limits.* The firmware overwrites what is not read in time. The run reads once a
//! ms of true time; the log would have to be faster than 1 MB/s to lose a byte.

use rigless::emulator::{Error, Host};
use rigless::soc::Width;

use crate::image::Firmware;

const IDENTIFIER: [u8; 10] = *b"SEGGER RTT";
/// Where the first up-channel's descriptor begins, and its fields in it.
const CHANNEL: u64 = 24;
const BUFFER: u64 = CHANNEL + 4;
const SIZE: u64 = CHANNEL + 8;
const WRITE: u64 = CHANNEL + 12;
const READ: u64 = CHANNEL + 16;
/// More than any firmware has: a larger size is memory that was not set up yet.
const SIZE_MAX: u64 = 65_536;

/// Where the control block is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rtt(u64);

impl Rtt {
    /// # Errors
    ///
    /// The image has no such block: it logs some other way.
    pub(crate) fn new(firmware: &Firmware) -> anyhow::Result<Self> {
        Ok(Self(firmware.symbol("_SEGGER_RTT")?.address.into()))
    }

    /// What was written since the last call; nothing while the firmware's start-up
    /// has not set the block up.
    pub(crate) fn take(self, host: &mut dyn Host) -> Result<Vec<u8>, Error> {
        for (at, byte) in (self.0..).zip(IDENTIFIER) {
            if host.read(at, Width::W8)? != u64::from(byte) {
                return Ok(Vec::new());
            }
        }
        let mut field = |offset| host.read(self.0 + offset, Width::W32);
        let (buffer, size) = (field(BUFFER)?, field(SIZE)?);
        let (write, mut read) = (field(WRITE)?, field(READ)?);
        if size == 0 || size > SIZE_MAX || write >= size || read >= size {
            return Ok(Vec::new());
        }
        let mut bytes = Vec::new();
        while read != write {
            bytes.push(host.read(buffer + read, Width::W8)? as u8);
            read = (read + 1) % size;
        }
        if !bytes.is_empty() {
            host.write(self.0 + READ, Width::W32, read)?;
        }
        Ok(bytes)
    }
}
