//! PX4's device ids: which sensor on which bus a number means.
//!
//! *Purpose.* PX4 identifies each device by 24 bits and keeps them in its parameters and logs as plain
//! numbers (`CAL_MAG0_ID` is 73225). Here they are taken apart, put together, named, and read back.
//!
//! *Design.* A [`DeviceId`] always has 24 bits: what has more is refused when it is read, while a
//! device type that no list has is an id like any other and shown as unknown. A [`DeviceType`] has two
//! names, for two lists give them: PX4's guide and today's source, which has used numbers again.
//!
//! ```
//! use device_id::{BusType, DeviceId, DeviceType};
//!
//! let id: DeviceId = "73225".parse().unwrap();
//! assert_eq!(id.to_string(), "HMC5883, address 0x1E, I2C bus 1");
//! assert_eq!((id.bus_type(), id.bus(), id.address()), (BusType::I2c, 1, 0x1E));
//!
//! // 0x04 means something else today.
//! let id = DeviceId::new(BusType::Spi, 1, 4, DeviceType(0x04)).unwrap();
//! assert_eq!(id.number(), 263_178);
//! assert_eq!(id.to_string(), "MPU9250 (AK8963 in today's PX4), device 4, SPI bus 1");
//!
//! // And back.
//! let found: Vec<_> = device_id::in_words("hmc5883, address 0x1e, I2C bus 1").collect();
//! assert_eq!(found[0].number(), 73_225);
//! ```
//!
//! *Limits.* A name can belong to several device types (an accelerometer and a gyroscope in one
//! housing), so words can mean several ids. What PX4's drivers put into the address differs with the
//! bus; it is shown as a number.
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

mod bus_type;
mod device_type;
mod error;
mod id;
mod names;
mod number;
mod own;
mod words;

pub use bus_type::BusType;
pub use device_type::DeviceType;
pub use error::NotAnId;
pub use id::DeviceId;
pub use names::{Kind, Name};
pub use own::Condition;
pub use words::in_words;
