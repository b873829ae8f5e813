//! Tests of the flashed image on the virtual board: one program, so that the emulator
//! is linked once.
//!
//! `cargo xtask board-test` builds the images and hands their paths over; without it every
//! test here is skipped, with a line that names it.

#[cfg(test)]
mod asked;
#[cfg(test)]
mod boot;
#[cfg(test)]
mod card;
#[cfg(test)]
mod clock;
#[cfg(test)]
mod common;
#[cfg(test)]
mod evidence;
#[cfg(test)]
mod faults;
#[cfg(test)]
mod flood;
#[cfg(test)]
mod links;
#[cfg(test)]
mod load;
#[cfg(test)]
mod log;
#[cfg(test)]
mod masks;
#[cfg(test)]
mod paper;
#[cfg(test)]
mod pulse;
#[cfg(test)]
mod radio;
#[cfg(test)]
mod receivers;
#[cfg(test)]
mod slot;
#[cfg(test)]
mod stanag;
#[cfg(test)]
mod status;
#[cfg(test)]
mod steering;
#[cfg(test)]
mod ticks;
#[cfg(test)]
mod traffic;
#[cfg(test)]
mod upload;
#[cfg(test)]
mod usb;
#[cfg(test)]
mod usb_troubles;
#[cfg(test)]
mod visible;
