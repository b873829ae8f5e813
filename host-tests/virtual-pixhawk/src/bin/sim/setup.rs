//! The boards before they have power.
//!
//! *Purpose.* What the options ask for, as boards with a crystal, a receiver and a line each.

use std::fs::OpenOptions;
use std::path::Path;
use std::time::SystemTime;

use anyhow::{Context as _, ensure};
use console::{SimOptions, UtcNanos, Word};
use stanag_net::Place;
use stanag_wire::NodeId;
use virtual_pixhawk::{Builder, Card, Firmware, Host, Script, StanagLine, TcpLine};
use world::{Receiver, ReceiverSettings, Recording};

use crate::life::Life;
use crate::serial_port::SerialPort;

/// What the crystals of two Cubes were off by, in 10⁻⁹.
const CRYSTALS_PPB: [i32; 2] = [37_000, 44_000];

/// The firmware's ids: the system in the last byte.
const STANAG_ID: u32 = 0x0050_4300;

/// What all boards share.
pub struct Setup<'a> {
    options: &'a SimOptions,
    firmware: Firmware,
    recording: Option<Recording>,
    stanag: Option<Place>,
    utc_at_start_ns: i64,
}

impl<'a> Setup<'a> {
    /// Reads the files that `options` name.
    ///
    /// # Errors
    ///
    /// Says which option has to be another.
    pub fn new(options: &'a SimOptions) -> anyhow::Result<Self> {
        let shared = &options.shared;
        let image = shared.image.as_deref().context(
            "--image PATH is missing; `cargo xtask sim` builds the image and fills it in",
        )?;
        let recording = shared.ubx.as_deref().map(|path| {
            let bytes = console::read_recording(path)?;
            Ok::<_, anyhow::Error>(Recording::new(&bytes)?)
        });
        let recording = recording.transpose().context("--ubx")?;
        let stanag = options
            .stanag
            .as_deref()
            .map(|place| place.parse::<Place>().map_err(anyhow::Error::msg));
        Ok(Self {
            options,
            stanag: stanag.transpose().context("--stanag")?,
            firmware: Firmware::read(image).context("--image")?,
            recording,
            utc_at_start_ns: shared.start.map_or_else(host_utc, Ok)?.0,
        })
    }

    /// Gives board `index`, counted from 0, its power.
    ///
    /// # Errors
    ///
    /// Its port is taken, or the emulator refuses its image.
    pub fn power_on(&self, index: u16) -> anyhow::Result<Life> {
        let mavlink_port = self.options.shared.mavlink_port_of(index);
        let line = listen(mavlink_port)?;
        let visits = line.visits();
        let id = system_id(index).into();
        let firmware = self.firmware.with_word(Word::SystemId, id)?;
        let firmware = match &self.recording {
            Some(recording) => firmware.for_recording(recording, self.options.shared.floor)?,
            None => firmware,
        };
        let mut unique_id = *b"virtual chip";
        unique_id[11] = system_id(index);
        let builder = Builder::new(firmware)
            .unique_id(unique_id)
            .crystal_ppb(crystal_ppb(index))
            .telem1(line);
        let builder = match self.stanag_place(index) {
            Some(place) => builder.telem2(StanagLine::join(place)?),
            None => builder,
        };
        let builder = match &self.options.card {
            Some(image) if index == 0 => builder.card(card(image).context("--card")?),
            _ => builder,
        };
        let usb = self.options.usb.then(SerialPort::open).transpose();
        let usb = usb.with_context(|| {
            format!("--usb; without it the board is at tcp:127.0.0.1:{mavlink_port}")
        })?;
        let builder = match &usb {
            Some(_) => builder.usb(Host::new(Script::default())),
            None => builder,
        };
        let builder = match &self.recording {
            Some(recording) => builder.gps(recording.clone()),
            None => {
                let settings = ReceiverSettings {
                    seed: index.into(),
                    ..ReceiverSettings::new(self.utc_at_start_ns)
                };
                let receiver = Receiver::new(settings);
                if self.options.pulse {
                    builder.gps_and_pulse(receiver)
                } else {
                    builder.gps(receiver)
                }
            }
        };
        Ok(Life {
            index: index.into(),
            board: builder.power_on()?,
            visits,
            mavlink_port,
            usb,
            utc_at_start_ns: self.utc_at_start_ns,
            duration: self.options.shared.duration(),
            is_up: false,
        })
    }

    /// Where board `index` is: a multicast group has room for all, a unicast place for one.
    fn stanag_place(&self, index: u16) -> Option<Place> {
        let Place(mut address) = self.stanag?;
        if !address.ip().is_multicast() {
            address.set_port(address.port().wrapping_add(index));
        }
        Some(Place(address))
    }

    /// What runs, where it can be talked to, and what the columns mean.
    pub fn announcement(&self, lives: &[Life]) -> Vec<String> {
        let options = &self.options.shared;
        let variant = options.variant();
        let source = match &options.ubx {
            Some(path) => format!("the recording {}", path.display()),
            None => {
                let pulse = if self.options.pulse { " and pulse" } else { "" };
                let start = jiff::Timestamp::from_nanosecond(self.utc_at_start_ns.into());
                let start = start.map_or_else(|_| String::new(), |start| format!("{start:.3}"));
                format!("simulated receivers{pulse}, from {start}")
            }
        };
        let mut lines = vec![format!(
            "virtual Pixhawk 1, {}, tick {} µs, {source}",
            variant.name(),
            variant.tick_us(),
        )];
        for (index, life) in (0..).zip(lives) {
            lines.push(format!(
                "board {}: tcp:127.0.0.1:{}, MAVLink system {}, crystal {:+} ppm",
                index + 1,
                options.mavlink_port_of(index),
                system_id(index),
                crystal_ppb(index) / 1_000,
            ));
            if let Some(place) = self.stanag_place(index) {
                let id = NodeId(STANAG_ID | u32::from(system_id(index)));
                lines.push(format!("         stanag:{place}/{id}"));
            }
            if let Some(port) = &life.usb {
                lines.push(format!("         {port}, its USB"));
            }
        }
        if let Some(image) = &self.options.card {
            lines.push(format!("in board 1: the card {}", image.display()));
        }
        lines.push(
            match &options.ubx {
                Some(_) => {
                    "± is what the clock claims; a recording has no true time to compare with"
                }
                None => {
                    "a clock's error is against the simulation's true time; ± is what it claims"
                }
            }
            .to_owned(),
        );
        lines
    }
}

/// A line at a port of this host.
fn listen(port: u16) -> anyhow::Result<TcpLine> {
    TcpLine::listen(port)
        .with_context(|| format!("port {port} cannot be had (`--mavlink-port` names another one)"))
}

/// A card whose blocks are those of an image; an image that cannot be written is write-protected.
fn card(image: &Path) -> anyhow::Result<Card> {
    let is_file = std::fs::metadata(image)
        .with_context(|| format!("cannot open {}", image.display()))?
        .is_file();
    ensure!(
        is_file,
        "{} is no image, but a device or a folder",
        image.display()
    );
    let mut how = OpenOptions::new();
    how.read(true);
    Ok(match how.clone().write(true).open(image) {
        Ok(file) => Card::on_file(file)?,
        Err(_) => Card::on_file(how.open(image)?)?.write_protected(),
    })
}

/// The crystal of board `index`.
fn crystal_ppb(index: u16) -> i32 {
    CRYSTALS_PPB[usize::from(index) % CRYSTALS_PPB.len()]
}

/// The MAVLink system of board `index`: 1, 2, …
fn system_id(index: u16) -> u8 {
    u8::try_from(index + 1).unwrap_or(u8::MAX)
}

/// UTC by this host's clock.
fn host_utc() -> anyhow::Result<UtcNanos> {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?;
    Ok(UtcNanos(i64::try_from(since_1970.as_nanos())?))
}
