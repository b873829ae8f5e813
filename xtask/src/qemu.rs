//! `qemu`: the firmware on QEMU, in real time: the second opinion.
//!
//! *Purpose.* As `sim`, with an emulator that other people made.
//!
//! *Design.* Each board is a [QEMU](machine) process, a thread that [plays](player()) its receiver and
//! a thread that reads its log. QEMU's time is this host's, so this host's clock is the reference:
//! the time in a status line is compared with the host's at the moment at which the line is read.
//!
//! *Limits.* The error that is shown has the host's scheduling noise in it, and the way of the line
//! from QEMU to here: it is good to about a ms. Ticks that QEMU lost are made good and counted by
//! the firmware. QEMU serves the MAVLink port itself, to one client at a time, and does not say who
//! connects.

pub mod machine;
pub mod player;

use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{ChildStdout, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, Result, bail};
use clap::Args;
use console::{Contents, Ending, LogDecoder, Report, Sample, Screen, Status, Verdict, Word};
use jiff::Timestamp;
use timebase::ClockState;
use world::{ReceiverSettings, Recording};

use crate::ctrl_c;
use crate::image;
use machine::MACHINE;
use player::Player;

/// What `qemu` can be asked for.
#[derive(Args)]
pub struct QemuOptions {
    #[command(flatten)]
    run: console::Options,
    /// Install QEMU (by apt-get, as root) and end
    #[arg(long)]
    install: bool,
}

/// A board cannot go on, so the others end, too.
static BOARD_FAILED: AtomicBool = AtomicBool::new(false);

/// Runs boards on QEMU until the end of `--duration` or Ctrl-C.
///
/// # Errors
///
/// When QEMU is not there, with how to get it; when the image cannot be built or a
/// port is taken.
pub fn run(options: &QemuOptions) -> Result<ExitCode> {
    if options.install {
        machine::install()?;
        return Ok(ExitCode::SUCCESS);
    }
    machine::check()?;
    let options = &options.run;
    let image = match &options.image {
        Some(image) => image.clone(),
        None => machine::build(options.variant())?,
    };
    ctrl_c::catch()?;
    let reference = Reference::new(options)?;
    if !options.json {
        announce(options);
    }
    let mut screen = Screen::new(Contents {
        boards: options.qemu_boards().into(),
        errors: options.ubx.is_none(),
        verbose: options.verbose,
    });
    let (sender, reports) = channel();
    let endings = thread::scope(|scope| {
        let running: Vec<_> = (0..options.qemu_boards())
            .map(|index| {
                let (image, sender) = (&image, sender.clone());
                scope.spawn(move || {
                    let ended = run_board(options, image, index, reference, &sender);
                    if ended.is_err() {
                        BOARD_FAILED.store(true, Ordering::Relaxed);
                    }
                    ended
                })
            })
            .collect();
        // The reports end when each board's sender is gone.
        drop(sender);
        console::show(&mut screen, &reports, Some(reference.started), options.json);
        running
            .into_iter()
            .map(|board| {
                let ended = board.join();
                ended.unwrap_or_else(|_| bail!("a board's thread panicked"))
            })
            .collect::<Result<Vec<_>>>()
    })?;
    console::print_summary(&screen, &endings, options.json);
    let never_set = screen.verdict() == Verdict::NeverSet;
    Ok(ExitCode::from(u8::from(
        never_set && options.duration().is_some(),
    )))
}

/// Says what runs, where it can be talked to, and what the columns mean.
fn announce(options: &console::Options) {
    let variant = options.variant();
    console::print_line!(
        "QEMU {MACHINE}, {}, tick {} µs",
        variant.name(),
        variant.tick_us()
    );
    for index in 0..options.qemu_boards() {
        console::print_line!(
            "board {}: tcp:127.0.0.1:{}, MAVLink system {}",
            index + 1,
            options.mavlink_port_of(index),
            system_id(index)
        );
    }
    console::print_line!(
        "{}; ± is what the clock claims",
        match options.ubx {
            Some(_) => "a recording has no true time to compare with",
            None => "a clock's error is against this host's clock, good to about a ms",
        }
    );
}

/// The MAVLink system of board `index`: 1, 2, …
fn system_id(index: u16) -> u8 {
    u8::try_from(index + 1).unwrap_or(u8::MAX)
}

/// What all boards' clocks are compared with: this host's, or one that runs as it does.
#[derive(Clone, Copy)]
struct Reference {
    started: Instant,
    utc_at_start_ns: i64,
}

impl Reference {
    /// One that begins now, with `--start` or this host's UTC.
    fn new(options: &console::Options) -> Result<Self> {
        let host = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?;
        let host_ns = i64::try_from(host.as_nanos())?;
        Ok(Self {
            started: Instant::now(),
            utc_at_start_ns: options.start.map_or(host_ns, |start| start.0),
        })
    }

    /// UTC `since_start`, in ns since 1970.
    fn utc_ns(self, since_start: Duration) -> i64 {
        let since_start = i64::try_from(since_start.as_nanos()).unwrap_or(i64::MAX);
        self.utc_at_start_ns.saturating_add(since_start)
    }
}

/// One board with its receiver, to the end.
fn run_board(
    options: &console::Options,
    image: &Path,
    index: u16,
    reference: Reference,
    reports: &Sender<(usize, Report)>,
) -> Result<Ending> {
    let (image, elf) = image_of_board(options, image, index)?;
    let decoder = LogDecoder::new(&elf)?;
    let mavlink_port = options.mavlink_port_of(index);
    let mavlink = format!("tcp:127.0.0.1:{mavlink_port},server=on,wait=off");
    let (mut qemu, line) = machine::power_on(&mut machine::command(&image), &mavlink)?;
    // The receiver's world begins when QEMU has connected it.
    let powered = Instant::now();
    let utc_ns = reference.utc_ns(powered - reference.started);
    let mut player = player(options, index, utc_ns)?;
    let log = qemu.0.stdout.take().context("QEMU has no output")?;
    let started = reference.started;
    let is_over = || {
        let limit = options.duration();
        ctrl_c::is_pressed()
            || BOARD_FAILED.load(Ordering::Relaxed)
            || limit.is_some_and(|limit| started.elapsed() >= limit)
    };
    let damaged_log_frames = thread::scope(|scope| {
        let reports = |report| drop(reports.send((index.into(), report)));
        let reading = scope.spawn(move || read_log(log, decoder, reference, reports));
        let played = player.play(line, powered, is_over);
        // The log ends with it.
        drop(qemu);
        let read = reading.join();
        played?;
        read.or_else(|_| bail!("reading the log failed"))
    })?;
    Ok(Ending {
        mavlink_port,
        ran: powered.elapsed(),
        damaged_log_frames,
        ..Ending::default()
    })
}

/// A copy of `image` for board `index`, with a system id of its own: its file and its bytes.
fn image_of_board(
    options: &console::Options,
    image: &Path,
    index: u16,
) -> Result<(PathBuf, Vec<u8>)> {
    let elf = std::fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
    let id = system_id(index);
    let mut elf = console::with_word(&elf, Word::SystemId, id.into())?;
    if let Some(recording) = recording(options)? {
        let (began, has_leap_seconds) = (recording.began_utc_ns(), recording.has_leap_seconds());
        elf = console::for_recording(&elf, began, has_leap_seconds, options.floor)?;
    }
    let stem = image.file_stem().context("an image has a name")?;
    let name = format!("{}-system{id}.elf", stem.to_string_lossy());
    let place = image::folder()?.join(name);
    image::keep(&place, &elf).with_context(|| format!("cannot write {}", place.display()))?;
    Ok((place, elf))
}

/// Reports each line of `log` until its end, and a sample for each status line; how many frames of
/// it were damaged.
fn read_log(
    mut log: ChildStdout,
    mut decoder: LogDecoder,
    reference: Reference,
    report: impl Fn(Report),
) -> u64 {
    let mut buffer = [0; 4096];
    let mut seconds = 0;
    while let Ok(count @ 1..) = log.read(&mut buffer) {
        let at = reference.started.elapsed();
        for line in decoder.push(buffer.get(..count).unwrap_or_default()) {
            let status = Status::parse(&line.text);
            report(Report::Log { at, line });
            if let Some(status) = status {
                seconds += 1;
                let sample = sample(&status, reference.utc_ns(at));
                report(Report::Sample {
                    at_s: seconds,
                    sample,
                });
            }
        }
    }
    decoder.damaged()
}

/// The clock by a status line that was read at `utc_ns`.
fn sample(status: &Status, utc_ns: i64) -> Sample {
    let claimed_ns = status.get("unc_ns").and_then(|ns| ns.parse().ok());
    let (Some(state), Some(uncertainty_ns)) = (status.state(), claimed_ns) else {
        return Sample::UNSET;
    };
    if state == ClockState::Unset {
        return Sample::UNSET;
    }
    let shown: Option<Timestamp> = status.get("utc").and_then(|utc| utc.parse().ok());
    let shown_ns = shown.and_then(|utc| i64::try_from(utc.as_nanosecond()).ok());
    Sample {
        state,
        offset_ns: shown_ns.map(|ns| ns - utc_ns),
        uncertainty_ns,
    }
}

/// Who plays the receiver of board `index`, which gets power at `utc_ns`.
fn player(options: &console::Options, index: u16, utc_ns: i64) -> Result<Player> {
    Ok(match recording(options)? {
        Some(recording) => Player::Recording(recording),
        None => Player::receiver(ReceiverSettings {
            seed: index.into(),
            ..ReceiverSettings::new(utc_ns)
        }),
    })
}

/// The recording that is to be played.
fn recording(options: &console::Options) -> Result<Option<Recording>> {
    let Some(path) = &options.ubx else {
        return Ok(None);
    };
    let bytes = console::read_recording(path)?;
    let recording = Recording::new(&bytes).with_context(|| format!("in {}", path.display()))?;
    Ok(Some(recording))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_the_status_line_less_the_hosts_time() {
        let status = |text| Status::parse(text).expect("a status line");
        let set =
            status("status state=set source=pulse utc=2026-11-22T04:00:00.123456Z unc_ns=410");
        assert_eq!(
            sample(&set, 1_795_320_000_123_000_000),
            Sample {
                state: ClockState::Set,
                offset_ns: Some(456_000),
                uncertainty_ns: 410,
            }
        );
        let unset = status("status state=unset source=- utc=- unc_ns=18446744073709551615");
        assert_eq!(sample(&unset, 0), Sample::UNSET);
        let unproved = status(
            "status state=unproved second=open utc=2026-11-22T04:00:00.123456Z unc_ns=18000000410",
        );
        assert_eq!(
            sample(&unproved, 1_795_320_003_123_456_000),
            Sample {
                state: ClockState::Unproved,
                offset_ns: Some(-3_000_000_000),
                uncertainty_ns: 18_000_000_410,
            }
        );
    }
}
