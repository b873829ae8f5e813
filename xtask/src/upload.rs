//! `upload`: firmware onto a board through its bootloader.
//!
//! *Purpose.* `cargo xtask upload [serial:DEVICE] [FILE]`: our own image, or any `.px4` for this board,
//! over the board's USB or over TELEM1.
//!
//! *Design.* The protocol is the crate `upload`'s; here are the lines. First a bootloader is looked for
//! on the line. If none answers, the firmware that runs there is asked to restart into it. With USB
//! that unplugs the board and plugs it in under another name, so until the bootloader answers, every
//! port that may be it is tried.
//!
//! *Limits.* Without a name there has to be exactly one board. A firmware that does not listen to
//! MAVLink on this line cannot be asked: plug the board in anew, its bootloader waits 5 s.

mod ports;

use std::path::{Path, PathBuf};
use std::str::FromStr as _;
use std::thread;
use std::time::{Duration, Instant};

use ::upload::{Device, Failure, Phase, Px4File, Uploader};
use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mavlink_node::client::{Client, GROUND_STATION, Message, Received};
use mavlink_node::{Address as System, Version};
use timebase::{Stamp, StampedByte};

use crate::ctrl_c;
use crate::link::{Address, Link};
use crate::px4::Ours;

/// The rate of the bootloader's serial line.
const BOOTLOADER_BAUD: u32 = 115_200;
/// How long a bootloader is looked for before the firmware is asked.
const FIRST_LOOK: Duration = Duration::from_secs(1);
/// How long one port is looked at while the board restarts.
const LOOK: Duration = Duration::from_secs(2);
/// How long a bootloader is waited for after that.
const RESTART: Duration = Duration::from_secs(30);
/// How long the firmware's HEARTBEAT is waited for; it comes each second.
const HEARTBEAT: Duration = Duration::from_millis(2_500);
/// How long the firmware's answer is waited for, and how often it is asked.
const ANSWER: Duration = Duration::from_millis(500);
const ASKED: u32 = 3;

/// What can be asked for.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Where the board is (serial:DEVICE, serial:DEVICE:BAUD or tcp:HOST:PORT; otherwise it is looked
    /// for on USB), and the .px4 file (otherwise the image is built)
    #[arg(value_name = "ADDR|FILE", num_args = 0..=2)]
    what: Vec<String>,
    #[command(flatten)]
    ours: Ours,
}

impl Options {
    /// The address and the file.
    fn parts(&self) -> Result<(Option<Address>, Option<PathBuf>)> {
        let (mut address, mut file) = (None, None);
        for what in &self.what {
            let is_address = ["serial:", "tcp:", "udp:"]
                .iter()
                .any(|kind| what.starts_with(kind));
            if is_address && address.is_none() {
                address = Some(Address::from_str(what).map_err(anyhow::Error::msg)?);
            } else if !is_address && file.is_none() {
                file = Some(PathBuf::from(what));
            } else {
                bail!("one board and one file at a time: '{what}' is the second");
            }
        }
        if let Some(Address::Udp(_)) = address {
            bail!("datagrams can be lost and reordered: an upload needs serial: or tcp:");
        }
        Ok((address, file))
    }
}

/// Uploads.
///
/// # Errors
///
/// With what to do.
pub fn run(options: &Options) -> Result<()> {
    let (address, path) = options.parts()?;
    let file = match &path {
        None => options.ours.file()?,
        Some(_) if options.ours.variant.is_some() => {
            bail!("a file is what it is: --variant is for the image that is built here")
        }
        Some(path) => {
            let mut file = read(path)?;
            if let Some(id) = options.ours.system_id {
                file.set_system_id(id)?;
            }
            file
        }
    };
    ctrl_c::catch()?;
    let image = &file.image;
    console::print_line!(
        "{} {}: {} bytes for board {}",
        file.summary,
        file.version,
        image.bytes().len(),
        image.board_id()
    );
    let device = upload(address.as_ref(), &file)?;
    console::print_line!(
        "programmed, checked and booted: board {}, revision {}, bootloader protocol {}",
        device.board_id,
        device.revision,
        device.protocol
    );
    Ok(())
}

fn read(path: &Path) -> Result<Px4File> {
    let text = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Px4File::parse(&String::from_utf8_lossy(&text)).with_context(|| path.display().to_string())
}

fn upload(address: Option<&Address>, file: &Px4File) -> Result<Device> {
    let address = match address {
        Some(address) => address.clone(),
        None => ports::wait_for_one()?,
    };
    let bootloader = at_bootloaders_rate(&address);
    let mut link = Link::open(&bootloader)?;
    match attempt(&mut link, file, FIRST_LOOK)? {
        Err(Failure::NoBootloader) => {}
        outcome => return Ok(outcome?),
    }
    if bootloader != address {
        drop(link);
        link = Link::open(&address)?;
    }
    let system = call_bootloader(&mut link)?;
    console::print_line!("{system}");
    let Address::Serial(device, _) = &address else {
        return Ok(attempt(&mut link, file, RESTART)??);
    };
    drop(link);
    let until = Instant::now() + RESTART;
    while Instant::now() < until {
        for name in ports::candidates(device) {
            // It may not be there yet, or be on its way out.
            let Ok(mut link) = Link::open(&Address::Serial(name, BOOTLOADER_BAUD)) else {
                continue;
            };
            match attempt(&mut link, file, LOOK) {
                Ok(Err(Failure::NoBootloader)) => {}
                Ok(outcome) => return Ok(outcome?),
                Err(error) if error.is::<Interrupted>() => return Err(error.context(STAYS)),
                Err(_) => {}
            }
        }
        ctrl_c::check()?;
        thread::sleep(Duration::from_millis(100));
    }
    Err(Failure::NoBootloader.into())
}

/// The same line at the rate that the bootloader speaks.
fn at_bootloaders_rate(address: &Address) -> Address {
    match address {
        Address::Serial(device, _) => Address::Serial(device.clone(), BOOTLOADER_BAUD),
        other => other.clone(),
    }
}

/// Asks the firmware on the line to restart into the bootloader; what to tell about it.
fn call_bootloader(link: &mut Link) -> Result<String> {
    let mut client = Client::new(GROUND_STATION, Version::V1);
    let is_heartbeat = |received: &Received| received.message == Message::Heartbeat;
    let heartbeat = wait_for(link, &mut client, HEARTBEAT, is_heartbeat)?;
    let Some(system) = heartbeat.map(|received| received.from) else {
        // A firmware that is silent here may listen all the same; px_uploader asks the same two.
        for system in [1, 0] {
            let component = 0;
            link.send(&client.bootloader(System { system, component }))?;
        }
        return Ok(
            "neither a bootloader nor a running firmware is heard here; if nothing follows, \
                   unplug the board and plug it in again"
                .to_owned(),
        );
    };
    let system_id = system.system;
    for _ in 0..ASKED {
        link.send(&client.bootloader(system))?;
        let is_answer = |received: &Received| {
            received.from == system && matches!(received.message, Message::CommandAck { .. })
        };
        let answer = wait_for(link, &mut client, ANSWER, is_answer)?;
        match answer.map(|answer| answer.message) {
            Some(Message::CommandAck {
                result: Message::ACCEPTED,
                ..
            }) => return Ok(format!("system {system_id} restarts into its bootloader")),
            Some(_) => bail!(
                "the firmware of system {system_id} refuses to restart: disarm it, or unplug the \
                 board and plug it in again while this runs"
            ),
            None => {}
        }
    }
    Ok(format!(
        "system {system_id} has not answered; its bootloader is waited for"
    ))
}

/// The first message that is `wanted`, within `patience`. A line that is gone has none.
fn wait_for(
    link: &mut Link,
    client: &mut Client,
    patience: Duration,
    wanted: impl Fn(&Received) -> bool,
) -> Result<Option<Received>> {
    let until = Instant::now() + patience;
    let mut buffer = [0; 1_024];
    while Instant::now() < until {
        ctrl_c::check()?;
        let Ok(bytes) = link.receive(&mut buffer) else {
            return Ok(None);
        };
        let stamp = Stamp(0);
        let mut messages = bytes
            .iter()
            .filter_map(|&byte| client.push(StampedByte { stamp, byte }));
        if let Some(found) = messages.find(&wanted) {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// The upload was cut off after the erase had begun.
#[derive(Debug)]
struct Interrupted(anyhow::Error);

impl std::fmt::Display for Interrupted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:#}", self.0)
    }
}

impl std::error::Error for Interrupted {}

/// What is to be done after that.
const STAYS: &str = "the upload was cut off: the board stays in its bootloader; run it again";

/// One upload over `link`, whose bootloader is waited for so long.
fn attempt(link: &mut Link, file: &Px4File, patience: Duration) -> Result<Result<Device, Failure>> {
    let began = Instant::now();
    let mut uploader = Uploader::new(file.image.clone(), Duration::ZERO, patience);
    let mut shown = Shown::new(file.image.bytes().len());
    let mut buffer = [0; 1_024];
    loop {
        if let Some(outcome) = uploader.outcome() {
            shown.end();
            return Ok(outcome);
        }
        let received = match exchange(&mut uploader, link, &mut buffer) {
            Ok(received) => received,
            Err(error) => {
                let phase = uploader.progress().phase;
                return Err(match phase {
                    Phase::Connecting | Phase::Identifying => error,
                    _ => Interrupted(error).into(),
                });
            }
        };
        let now = began.elapsed();
        uploader.handle_bytes(received, now);
        uploader.handle_timeout(now);
        shown.update(&uploader);
    }
}

/// Sends what is to be sent, and receives for a moment.
fn exchange<'a>(
    uploader: &mut Uploader,
    link: &mut Link,
    buffer: &'a mut [u8],
) -> Result<&'a [u8]> {
    while let Some(command) = uploader.poll_transmit() {
        link.send(&command)?;
    }
    if ctrl_c::is_pressed() {
        bail!("stopped by Ctrl-C");
    }
    link.receive(buffer)
}

/// What a person sees: a bar on a terminal, a line a phase elsewhere.
struct Shown {
    bar: ProgressBar,
    phase: Phase,
}

impl Shown {
    fn new(size: usize) -> Self {
        let bar = ProgressBar::with_draw_target(Some(size as u64), ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{msg:12} {bar:30} {bytes}/{total_bytes} ({eta})");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self {
            bar,
            phase: Phase::Connecting,
        }
    }

    fn update(&mut self, uploader: &Uploader) {
        let progress = uploader.progress();
        if progress.phase != self.phase {
            self.phase = progress.phase;
            self.bar.set_message(self.phase.to_string());
            if self.bar.is_hidden() {
                console::print_line!("{}", self.phase);
            }
        }
        self.bar.set_position(progress.programmed as u64);
    }

    fn end(&self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(what: &[&str]) -> Result<(Option<Address>, Option<PathBuf>)> {
        Options {
            what: what.iter().map(ToString::to_string).collect(),
            ours: Ours {
                system_id: None,
                variant: None,
            },
        }
        .parts()
    }

    #[test]
    fn the_board_and_the_file_may_be_left_out_and_come_in_any_order() {
        let address = || Some(Address::Serial("/dev/ttyACM0".into(), 115_200));
        let file = || Some(PathBuf::from("a.px4"));
        assert_eq!(parts(&[]).unwrap(), (None, None));
        assert_eq!(parts(&["a.px4"]).unwrap(), (None, file()));
        assert_eq!(parts(&["serial:/dev/ttyACM0"]).unwrap(), (address(), None));
        let both = (address(), file());
        assert_eq!(parts(&["serial:/dev/ttyACM0", "a.px4"]).unwrap(), both);
        assert_eq!(parts(&["a.px4", "serial:/dev/ttyACM0"]).unwrap(), both);
        for wrong in [
            ["a", "b"],
            ["tcp:a:1", "tcp:b:2"],
            ["udp:a:1", "b"],
            ["tcp:a", "b"],
        ] {
            assert!(parts(&wrong).is_err(), "{wrong:?}");
        }
    }
}
