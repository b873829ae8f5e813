//! The named words of the image, which tools write after it is built.
//!
//! *Purpose.* Boards on one network need different MAVLink ids, and a recording needs the clock's
//! settings of its own time. The words let a tool give them to an image that is built already: the
//! virtual boards run the image that is flashed, and these are the only words that differ.
//!
//! *Design.* Each is a little-endian 32-bit word in flash under its symbol's name.
//!
//! | word | holds |
//! |---|---|
//! | `PIXCLOCK_SYSTEM_ID` | the MAVLink system id, 1 to 254; the build setting of that name is its value in the file |
//! | `PIXCLOCK_DATE_FLOOR` | the earliest date that is believed, in days since 1970; 0 is the release's |
//! | `PIXCLOCK_LEAP_SECONDS` | GPS less UTC for a receiver that does not send it, 1 to 127 s; 0: it has to be proved |
//! | `PIXCLOCK_LOAD_SEED` | in an image with a load, what it is drawn from |
//!
//! *Limits.* A system id outside its range counts as the build setting: a node with the id 0 would
//! speak as everybody.

use utc_clock::{Settings, UtcNanos};

use crate::settings;

/// Written by tools, in the file or in the flash; never by the running image.
#[used]
#[unsafe(no_mangle)]
static PIXCLOCK_SYSTEM_ID: u32 = settings::SYSTEM_ID as u32;

/// The same.
#[used]
#[unsafe(no_mangle)]
static PIXCLOCK_DATE_FLOOR: u32 = 0;

/// The same.
#[used]
#[unsafe(no_mangle)]
static PIXCLOCK_LEAP_SECONDS: u32 = 0;

/// The same.
#[cfg(loaded)]
#[used]
#[unsafe(no_mangle)]
static PIXCLOCK_LOAD_SEED: u32 = 1;

/// What the load is drawn from.
#[cfg(loaded)]
pub fn load_seed() -> u32 {
    read(&PIXCLOCK_LOAD_SEED)
}

/// The MAVLink system id of this board.
pub fn system_id() -> u8 {
    match u8::try_from(read(&PIXCLOCK_SYSTEM_ID)) {
        Ok(id @ 1..=254) => id,
        _ => settings::SYSTEM_ID,
    }
}

/// The earliest date that the clock believes.
pub fn date_floor() -> UtcNanos {
    const DAY_NS: i64 = 86_400_000_000_000;
    match read(&PIXCLOCK_DATE_FLOOR) {
        0 => Settings::DATE_FLOOR,
        days => UtcNanos(i64::from(days).saturating_mul(DAY_NS)),
    }
}

/// The count of leap seconds that somebody has configured.
pub fn leap_seconds() -> Option<i8> {
    i8::try_from(read(&PIXCLOCK_LEAP_SECONDS))
        .ok()
        .filter(|&count| count > 0)
}

fn read(word: &'static u32) -> u32 {
    // SAFETY: an aligned word of this image, which nothing writes while the image runs. The read is
    // volatile because the word in memory need not be the one that the compiler knows.
    unsafe { (&raw const *word).read_volatile() }
}
