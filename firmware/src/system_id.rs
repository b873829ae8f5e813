//! The MAVLink system id: one named word of the image, read at run time.
//!
//! *Purpose.* Boards on one network need different ids. The word lets a tool give one to an image
//! that is built already: the loader of the virtual boards writes it, so that they run the image
//! that is flashed, and it is the only word that differs.
//!
//! *Design.* The symbol `PIXCLOCK_SYSTEM_ID` is a little-endian 32-bit word in flash that holds the
//! id, 1 to 254; the build setting of that name is its value in the file.
//!
//! *Limits.* A word outside that range counts as the build setting: a node with the id 0 would
//! speak as everybody.

use crate::settings;

/// Written by tools, in the file or in the flash; never by the running image.
#[used]
#[unsafe(no_mangle)]
static PIXCLOCK_SYSTEM_ID: u32 = settings::SYSTEM_ID as u32;

/// The id of this board.
pub fn system_id() -> u8 {
    // SAFETY: an aligned word of this image, which nothing writes while the image runs. The read is
    // volatile because the word in memory need not be the one that the compiler knows.
    let word = unsafe { (&raw const PIXCLOCK_SYSTEM_ID).read_volatile() };
    match u8::try_from(word) {
        Ok(id @ 1..=254) => id,
        _ => settings::SYSTEM_ID,
    }
}
