//! A board at the end of a line.
//!
//! *Purpose.* Who it is, what it runs, whether its clock is set; and the commands that a
//! test begins and ends.
//!
//! *Design.* One question at a time, asked again until it is answered or [`PATIENCE`]
//! is over. The board's other messages are handled meanwhile.
//!
//! *Limits.* The first system that sends a HEARTBEAT on a line is the board.

use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use mavlink_node::client::{Client, GROUND_STATION, Message, Received};
use mavlink_node::{Address, Parameter, Test, Version};
use testbed::{OwnLog, SILENCE_NS};
use timebase::{Stamp, StampedByte};
use variant::Image;

use crate::ctrl_c;
use crate::link::Link;

/// How long an answer is waited for.
pub const PATIENCE: Duration = Duration::from_nanos(SILENCE_NS.cast_unsigned());
/// After how long a question is asked again.
const AGAIN: Duration = Duration::from_millis(500);

/// A board whose line is open.
pub struct Connected {
    /// Where it is.
    pub name: String,
    /// The line to it, and the line from it: one and the same, mostly.
    outgoing: Link,
    incoming: Link,
    client: Client,
    address: Option<Address>,
    clock: Option<Clock>,
}

/// The last message of a board about its clock.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// It is set.
    pub is_set: bool,
    /// How long the board had been up.
    pub up: Duration,
    /// When the message came.
    pub received: Instant,
}

/// What a board reports of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Identity {
    /// Its address.
    pub address: Address,
    /// What it runs: `PC_VARIANT`, `PC_TICK_US` and `PC_GPS_BAUD`.
    pub image: Image,
    /// `PC_SOURCE` is the pulse.
    pub follows_pulse: bool,
}

impl Connected {
    /// The board that `name` names, at the end of `line`.
    ///
    /// # Errors
    ///
    /// When the system has no more handles.
    pub fn new(name: String, line: Link) -> Result<Self> {
        let outgoing = line.another()?;
        Ok(Self::with_lines(name, outgoing, line))
    }

    /// The board that `name` names, which receives on one line and sends on another.
    pub const fn with_lines(name: String, outgoing: Link, incoming: Link) -> Self {
        Self {
            name,
            outgoing,
            incoming,
            client: Client::new(GROUND_STATION, Version::V2),
            address: None,
            clock: None,
        }
    }

    /// Receives for a moment.
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn receive(&mut self) -> Result<Vec<Received>> {
        let mut buffer = [0; 1_024];
        let bytes = self.incoming.receive(&mut buffer)?;
        let stamp = Stamp(0);
        let stamped = bytes.iter().map(|&byte| StampedByte { stamp, byte });
        let mut messages: Vec<Received> =
            stamped.filter_map(|byte| self.client.push(byte)).collect();
        let is_heartbeat = |received: &&Received| received.message == Message::Heartbeat;
        if self.address.is_none() {
            let heartbeat = messages.iter().find(is_heartbeat);
            self.address = heartbeat.map(|received| received.from);
        }
        // Another system on a radio's line is no board.
        messages.retain(|one| self.address.is_none_or(|address| one.from == address));
        for received in &messages {
            if let Message::StatusText { text, .. } = &received.message {
                console::print_error!("{}: {}", self.name, text.as_str());
            }
            if let Message::SystemTime {
                time_unix_usec,
                time_boot_ms,
            } = received.message
            {
                self.clock = Some(Clock {
                    is_set: time_unix_usec > 0,
                    up: Duration::from_millis(time_boot_ms.into()),
                    received: Instant::now(),
                });
            }
        }
        Ok(messages)
    }

    /// Its last message about its clock.
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
        let variant = self.parameter(address, Parameter::Variant)? as u32;
        let tick_us = self.parameter(address, Parameter::TickUs)? as u32;
        let gps_baud = self.parameter(address, Parameter::GpsBaud)? as u32;
        let Some(image) = Image::from_parameters(variant, tick_us, gps_baud) else {
            bail!(
                "{} runs an image that this program does not know: PC_VARIANT {variant}, PC_TICK_US {tick_us}, PC_GPS_BAUD {gps_baud}",
                self.name
            );
        };
        Ok(Identity {
            address,
            image,
            follows_pulse: self.parameter(address, Parameter::Source)? as u32 == 2,
        })
    }

    fn wait_for_address(&mut self) -> Result<Address> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE && !ctrl_c::is_pressed() {
            if let Some(address) = self.address {
                return Ok(address);
            }
            self.receive()?;
        }
        ctrl_c::check()?;
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
            |message| match message {
                Message::Parameter { name, value, .. }
                    if Parameter::named(*name) == Some(parameter) =>
                {
                    Some(*value)
                }
                _ => None,
            },
        )?;
        let Some(value) = answer else {
            ctrl_c::check()?;
            bail!(
                "{} is system {} but does not answer with its parameter {}: it is no pixclock, or an \
                 old one; flash it anew",
                self.name,
                address.system,
                parameter.name()
            );
        };
        Ok(value)
    }

    /// Sends it that a test begins or ends; whether it acknowledged that.
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn send_test(&mut self, address: Address, test: Test) -> Result<bool> {
        let answer = self.ask(
            |client| client.test(address, test),
            |message| match message {
                Message::CommandAck { result, .. } => Some(*result),
                _ => None,
            },
        )?;
        Ok(answer == Some(Message::ACCEPTED))
    }

    /// Asks until it is answered, or nothing comes; once even after Ctrl-C.
    fn ask<T>(
        &mut self,
        question: impl Fn(&mut Client) -> mavlink_node::Frame,
        answer: impl Fn(&Message) -> Option<T>,
    ) -> Result<Option<T>> {
        let began = Instant::now();
        loop {
            self.outgoing.send(&question(&mut self.client))?;
            let asked = Instant::now();
            while asked.elapsed() < AGAIN {
                let messages = self.receive()?;
                if let Some(answer) = messages.iter().find_map(|one| answer(&one.message)) {
                    return Ok(Some(answer));
                }
            }
            if began.elapsed() >= PATIENCE || ctrl_c::is_pressed() {
                return Ok(None);
            }
        }
    }

    /// Reads its own log over the line, which carries some 9 KB of it a second.
    ///
    /// # Errors
    ///
    /// When it does not give it, its line is gone, or at Ctrl-C.
    pub fn own_log(&mut self, address: Address) -> Result<OwnLog> {
        let missed = self.parameter(address, Parameter::LogMissed)? as u32;
        let listed = self.ask(
            |client| client.logs(address),
            |message| match message {
                Message::LogEntry { size, .. } => Some(*size as usize),
                _ => None,
            },
        )?;
        let Some(size) = listed else {
            bail!("it does not list it");
        };
        let mut file = Vec::new();
        let mut came = Instant::now();
        while file.len() < size {
            if came.elapsed() > PATIENCE || ctrl_c::is_pressed() {
                bail!("it gave {} of {size} bytes", file.len());
            }
            let rest = (size - file.len()) as u32;
            let request = self.client.log_data(address, file.len() as u32, rest);
            self.outgoing.send(&request)?;
            // One piece follows the other, until one is lost on the way.
            let mut flowed = Instant::now();
            while file.len() < size && flowed.elapsed() < AGAIN && !ctrl_c::is_pressed() {
                for received in self.receive()? {
                    if let Some(next) = piece(&received.message, file.len()) {
                        file.extend(next);
                        (came, flowed) = (Instant::now(), Instant::now());
                    }
                }
            }
        }
        OwnLog::read(file, missed)
    }

    /// Another handle of the line to it.
    ///
    /// # Errors
    ///
    /// When the system has no more handles.
    pub fn outgoing(&self) -> Result<Link> {
        self.outgoing.another()
    }

    /// Another handle of the line from it.
    ///
    /// # Errors
    ///
    /// When the system has no more handles.
    pub fn incoming(&self) -> Result<Link> {
        self.incoming.another()
    }
}

/// The bytes of a log that begin at `offset`, if the message has them.
fn piece(message: &Message, offset: usize) -> Option<Vec<u8>> {
    match message {
        Message::LogData {
            offset: at,
            data,
            count,
            ..
        } if *at as usize == offset && *count > 0 => {
            Some(data.iter().take((*count).into()).copied().collect())
        }
        _ => None,
    }
}
