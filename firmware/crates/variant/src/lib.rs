//! How an image of the firmware is built: its variant, its tick, the baud rate of its receiver.
//!
//! *Purpose.* One table for all who need it: the firmware and its build script, the tools that build
//! images, and the tests that run them. [`Load`] is what else keeps its core busy, if that is asked for.
//!
//! *Design.* [`Variant`] is how the clock is kept: pixclock, or one of the three ways that Shim, Joo
//! and Kim, "Minimizing GPS Clock Synchronization Error for PX4-Based Unmanned Aircraft" (2021),
//! measured. It contains the tick where a variant leaves a choice. [`Image`] adds the baud rate. A
//! variant has a name for people and a number for the parameter `PC_VARIANT`.
//!
//! ```
//! use variant::{Image, Variant};
//!
//! // What a person asks for, and what the build settings for it are.
//! let variant: Variant = "paper-step2:200".parse().unwrap();
//! assert_eq!((variant.name(), variant.tick_us()), ("paper-step2", 200));
//! assert_eq!(variant.gps_bauds(), [115_200, 38_400]);
//! assert!("paper-step2:1000".parse::<Variant>().is_err());
//!
//! // What a board reports in PC_VARIANT, PC_TICK_US and PC_GPS_BAUD.
//! let image = Image { gps_baud: 38_400, ..Image::of(variant) };
//! assert_eq!(Image::from_parameters(3, 200, 38_400), Some(image));
//! assert_eq!(Image::from_parameters(3, 1_000, 38_400), None);
//! ```
//!
//! *Limits.* A value can hold a tick or a baud rate that its variant does not have; the firmware's
//! build refuses it.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

#[cfg(test)]
extern crate std;

mod image;
mod load;
mod text;
mod variant;

pub use image::Image;
pub use load::{Load, LoadParts, UnknownLoad};
pub use text::UnknownVariant;
pub use variant::{TICKS_US, Variant};
