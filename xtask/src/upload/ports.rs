//! The serial ports that a board may be at.
//!
//! *Design.* By what the USB device says of itself: the bootloader and PX4's own firmware by their
//! vendor and product (3D Robotics), anything else by the name of its product.
//!
//! *Limits.* An adapter on TELEM1 says nothing of the board behind it: it has to be named.

use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use serialport::{SerialPortInfo, SerialPortType, UsbPortInfo};

use crate::link::Address;
use crate::{ctrl_c, system};

/// 3D Robotics, as the bootloader of the Pixhawk 1 and PX4's firmware for it name themselves.
const VENDOR: u16 = 0x26AC;
/// What the products of others are called.
const PRODUCTS: [&str; 4] = ["pixclock", "PX4", "ArduPilot", "Pixhawk"];
/// How long a board is waited for.
const PATIENCE: Duration = Duration::from_secs(30);
/// The rate of firmware whose line is USB, which has none.
const ANY_BAUD: u32 = 115_200;

/// Waits until there is exactly one board on USB.
///
/// # Errors
///
/// When there are several, or none in time.
pub fn wait_for_one() -> Result<Address> {
    let until = Instant::now() + PATIENCE;
    let mut is_said = false;
    loop {
        match boards().as_slice() {
            [] => {}
            [one] => return Ok(Address::Serial(one.clone(), ANY_BAUD)),
            several => bail!(
                "there are several boards; name one of {}, as in serial:{}",
                several.join(", "),
                several[0]
            ),
        }
        if Instant::now() >= until {
            bail!(
                "no board is on USB: plug it in; over an adapter on TELEM1 name it, as in {}",
                system::SERIAL_LINE
            );
        }
        if !is_said {
            console::print_line!("no board is on USB; plug it in");
            is_said = true;
        }
        ctrl_c::check()?;
        thread::sleep(Duration::from_millis(100));
    }
}

/// Where the bootloader of the board that was at `device` may be by now.
pub fn candidates(device: &str) -> Vec<String> {
    let mut names = boards();
    names.retain(|name| name != device);
    if system::has_serial_port(device) {
        names.insert(0, device.to_owned());
    }
    names
}

/// The ports of boards on USB.
fn boards() -> Vec<String> {
    let ports = serialport::available_ports().unwrap_or_default();
    let mut names: Vec<_> = ports
        .into_iter()
        .filter(is_board)
        .map(|port| port.port_name)
        .collect();
    names.sort();
    names
}

fn is_board(port: &SerialPortInfo) -> bool {
    match &port.port_type {
        SerialPortType::UsbPort(UsbPortInfo { vid, product, .. }) => {
            let product = product.as_deref().unwrap_or_default();
            *vid == VENDOR || PRODUCTS.iter().any(|known| product.contains(known))
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usb(vid: u16, product: Option<&str>) -> SerialPortInfo {
        SerialPortInfo {
            port_name: "/dev/ttyACM0".into(),
            port_type: SerialPortType::UsbPort(UsbPortInfo {
                vid,
                pid: 0x0011,
                serial_number: None,
                manufacturer: None,
                product: product.map(str::to_owned),
            }),
        }
    }

    #[test]
    fn boards_are_told_from_other_usb_devices() {
        assert!(is_board(&usb(0x26AC, Some("PX4 BL FMU v2.x"))));
        assert!(is_board(&usb(0x26AC, None)));
        assert!(is_board(&usb(0x1209, Some("pixclock"))));
        assert!(!is_board(&usb(0x0403, Some("FT232R USB UART"))));
        assert!(!is_board(&usb(0x1546, None)));
    }
}
