//! `devices`: what a running board has, over MAVLink: each device with its id, what it is, and how it is.
//!
//! *Design.* The board says it by read-only parameters, `PC_GNSS_ID` and `PC_GNSS_STATE` and their like; here they are
//! put into words. The one whose id `PC_CLOCK_PRIME` has steers the clock, as PX4's `CAL_MAG_PRIME` names a
//! magnetometer.
//!
//! *Limits.* One board a line.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use ::device_id::{Condition, DeviceId};
use anyhow::{Context as _, Result, bail};
use mavlink_node::Parameter;
use mavlink_node::client::Message;
use serde_json::json;

use crate::ctrl_c;
use crate::link::Address;
use crate::status::Board;

/// The board's devices: what they are for, and the parameters of id and state.
const DEVICES: [(&str, Parameter, Parameter); 3] = [
    ("receiver", Parameter::GnssId, Parameter::GnssState),
    ("memory card", Parameter::CardId, Parameter::CardState),
    ("USB", Parameter::UsbId, Parameter::UsbState),
];
/// How long all parameters are waited for, and how often they are asked for.
const PATIENCE: Duration = Duration::from_secs(3);
const ASKED: u32 = 3;

/// What `devices` is asked to do.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Where the board is: tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE, or serial:DEVICE:BAUD
    #[arg(value_name = "ADDR")]
    address: Address,
    /// Print a JSON array
    #[arg(long)]
    json: bool,
}

/// Asks, and prints.
///
/// # Errors
///
/// When the line cannot be opened, no board answers there, or it has no such parameters.
pub fn run(options: &Options) -> Result<()> {
    ctrl_c::catch()?;
    let mut board = Board::find(&options.address)?;
    let values = parameters(&mut board)?;
    let prime = values[&Parameter::ClockPrime.index()];
    let devices = DEVICES.map(|(what, id, state)| Device::new(what, &values, (id, state), prime));
    let devices = devices.into_iter().collect::<Result<Vec<_>>>()?;
    if options.json {
        let devices: Vec<_> = devices.iter().map(Device::to_json).collect();
        console::print_line!("{:#}", json!(devices));
    } else {
        devices
            .iter()
            .for_each(|device| console::print_line!("{}", device.line()));
    }
    Ok(())
}

/// The values of the parameters of devices, by their index.
fn parameters(board: &mut Board) -> Result<HashMap<u16, u32>> {
    let wanted = DEVICES.iter().flat_map(|&(_, id, state)| [id, state]);
    let wanted: Vec<_> = wanted.chain([Parameter::ClockPrime]).collect();
    let mut values = HashMap::new();
    for _ in 0..ASKED {
        for &parameter in &wanted {
            board.ask_parameter(parameter)?;
        }
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            ctrl_c::check()?;
            for received in board.receive()? {
                if let Message::Parameter { name, value, .. } = received.message
                    && let Some(parameter) = Parameter::named(name)
                    && wanted.contains(&parameter)
                {
                    values.insert(parameter.index(), value as u32);
                }
            }
            if values.len() == wanted.len() {
                return Ok(values);
            }
        }
    }
    bail!("the board does not say what it has: is it pixclock, of this version or a later one?")
}

/// A device, as the board has it.
struct Device {
    what: &'static str,
    id: DeviceId,
    condition: Condition,
    is_prime: bool,
}

impl Device {
    fn new(
        what: &'static str,
        values: &HashMap<u16, u32>,
        (id, state): (Parameter, Parameter),
        prime: u32,
    ) -> Result<Self> {
        let value = |of: Parameter| {
            let value = values.get(&of.index()).copied();
            value.with_context(|| format!("no {}", of.name()))
        };
        let (number, state) = (value(id)?, value(state)?);
        let condition = u8::try_from(state).ok().and_then(Condition::of_number);
        Ok(Self {
            what,
            id: DeviceId::from_number(number.into())?,
            condition: condition.with_context(|| format!("{state} is no state of a device"))?,
            is_prime: number == prime,
        })
    }

    fn line(&self) -> String {
        let prime = if self.is_prime {
            ", steers the clock"
        } else {
            ""
        };
        format!(
            "{:8}  {:11}  {}: {}{prime}",
            self.id.number(),
            self.what,
            self.id,
            self.condition.word()
        )
    }

    fn to_json(&self) -> serde_json::Value {
        json!({
            "id": self.id.number(),
            "what": self.what,
            "is": self.id.to_string(),
            "state": self.condition.word(),
            "steers": self.is_prime,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_one_that_steers_is_marked() {
        let values = [
            (Parameter::GnssId, 0xA8_00_1D),
            (Parameter::GnssState, 1),
            (Parameter::CardId, 0xFF_01_00),
            (Parameter::CardState, 2),
        ];
        let values: HashMap<_, _> = values.map(|(of, value)| (of.index(), value)).into();
        let line = |device: usize| {
            let (what, id, state) = DEVICES[device];
            Device::new(what, &values, (id, state), 0xA8_00_1D).map(|device| device.line())
        };
        assert_eq!(
            line(0).unwrap(),
            "11010077  receiver     u-blox 8, address 0x00, serial port 3: works, steers the clock"
        );
        assert!(line(1).unwrap().ends_with(": fails"));
        assert!(line(2).is_err());
    }
}
