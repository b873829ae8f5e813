//! The settings that this image was built with; `build.rs` makes them from the environment.

use variant::Variant;

include!(concat!(env!("OUT_DIR"), "/settings.rs"));
