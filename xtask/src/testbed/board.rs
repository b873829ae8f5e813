//! A board at the end of a line.
//!
//! *Purpose.* Who it is, what it runs, whether its clock is set; and that it hears when
//! a test begins and ends.
//!
//! *Design.* One question at a time, asked again until it is answered or [`PATIENCE`]
//! is over. Everything that the board says meanwhile is taken note of.
//!
//! *Limits.* The first system that sends a HEARTBEAT on a line is the board.

use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use mavlink_node::client::{Client, Heard, What};
use mavlink_node::{Address, Parameter, Test, Version};
use testbed::Image;
use timebase::{Stamp, StampedByte};

use super::is_asked_to_end;
use crate::link::Link;

/// Who this host is: a ground station and the component that MAVLink gives to no device.
pub const HERE: Address = Address {
    system: 255,
    component: 190,
};
/// How long an answer is waited for: five HEARTBEATs.
const PATIENCE: Duration = Duration::from_secs(5);
/// After how long a question is asked again.
const AGAIN: Duration = Duration::from_millis(500);

/// A board whose line is open.
pub struct Connected {
    /// Where it is.
    pub name: String,
    link: Link,
    client: Client,
    address: Option<Address>,
    clock: Option<Clock>,
}

/// What a board said of its clock last.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// It is set.
    pub is_set: bool,
    /// How long it had been up.
    pub up: Duration,
}

/// What a board said of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Identity {
    /// Its address.
    pub address: Address,
    /// `PC_WAY`, as a name of [`Image::NAMES`].
    pub way: &'static str,
    /// `PC_TICK_US`.
    pub tick_us: u32,
    /// `PC_GPS_BAUD`.
    pub gps_baud: u32,
    /// `PC_SOURCE` is the pulse.
    pub follows_pulse: bool,
}

impl Connected {
    /// The board that `name` names, at the end of `link`.
    pub fn new(name: String, link: Link) -> Self {
        Self {
            name,
            link,
            client: Client::new(HERE, Version::V2),
            address: None,
            clock: None,
        }
    }

    /// Listens for a moment.
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn listen(&mut self) -> Result<Vec<Heard>> {
        let mut buffer = [0; 1_024];
        let bytes = self.link.receive(&mut buffer)?;
        let stamp = Stamp(0);
        let stamped = bytes.iter().map(|&byte| StampedByte { stamp, byte });
        let heard: Vec<Heard> = stamped
            .filter_map(|byte| self.client.receive(byte))
            .collect();
        for heard in &heard {
            match heard.what {
                What::Heartbeat => {
                    self.address.get_or_insert(heard.from);
                }
                What::SystemTime {
                    time_unix_usec,
                    time_boot_ms,
                } => {
                    self.clock = Some(Clock {
                        is_set: time_unix_usec > 0,
                        up: Duration::from_millis(time_boot_ms.into()),
                    });
                }
                _ => {}
            }
        }
        Ok(heard)
    }

    /// What it said of its clock last.
    pub const fn clock(&self) -> Option<Clock> {
        self.clock
    }

    /// Asks who it is and what it runs.
    ///
    /// # Errors
    ///
    /// When it does not answer, with what is there instead.
    pub fn identify(&mut self) -> Result<Identity> {
        let address = self.wait_for_address()?;
        let way = self.parameter(address, Parameter::Way)? as usize;
        let Some(way) = Image::NAMES.get(way) else {
            bail!(
                "{} runs a way (PC_WAY {way}) that this program does not know",
                self.name
            );
        };
        Ok(Identity {
            address,
            way,
            tick_us: self.parameter(address, Parameter::TickUs)? as u32,
            gps_baud: self.parameter(address, Parameter::GpsBaud)? as u32,
            follows_pulse: self.parameter(address, Parameter::Source)? as u32 == 2,
        })
    }

    fn wait_for_address(&mut self) -> Result<Address> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE && !is_asked_to_end() {
            if let Some(address) = self.address {
                return Ok(address);
            }
            self.listen()?;
        }
        bail!(
            "no board answers at {}: nothing that is MAVLink came from there within {} s; look at \
             its power, its wiring and its baud rate, and close other programs that talk with it",
            self.name,
            PATIENCE.as_secs()
        )
    }

    fn parameter(&mut self, address: Address, parameter: Parameter) -> Result<f32> {
        let answer = self.ask(
            |client| client.parameter(address, parameter),
            |what| match what {
                What::Parameter { name, value, .. }
                    if Parameter::named(*name) == Some(parameter) =>
                {
                    Some(*value)
                }
                _ => None,
            },
        )?;
        let Some(value) = answer else {
            bail!(
                "{} is system {} but does not tell its parameter {}: it is no pixclock, or an \
                 old one; flash it anew",
                self.name,
                address.system,
                parameter.name()
            );
        };
        Ok(value)
    }

    /// Tells it that a test begins or ends; whether it said that it had understood.
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn tell(&mut self, address: Address, test: Test) -> Result<bool> {
        let answer = self.ask(
            |client| client.test(address, test),
            |what| match what {
                What::CommandAck { result, .. } => Some(*result),
                _ => None,
            },
        )?;
        Ok(answer == Some(What::ACCEPTED))
    }

    /// Asks until it is answered, or nothing comes.
    fn ask<T>(
        &mut self,
        question: impl Fn(&mut Client) -> mavlink_node::Frame,
        answer: impl Fn(&What) -> Option<T>,
    ) -> Result<Option<T>> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE && !is_asked_to_end() {
            self.link.send(&question(&mut self.client))?;
            let asked = Instant::now();
            while asked.elapsed() < AGAIN {
                let heard = self.listen()?;
                if let Some(answer) = heard.iter().find_map(|heard| answer(&heard.what)) {
                    return Ok(Some(answer));
                }
            }
        }
        Ok(None)
    }

    /// Its line once more.
    ///
    /// # Errors
    ///
    /// When the system has no more handles.
    pub fn line(&self) -> Result<Link> {
        self.link.another()
    }
}
