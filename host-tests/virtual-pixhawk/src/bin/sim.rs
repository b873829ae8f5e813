//! `cargo xtask sim`: virtual Pixhawks with their receivers, in real time.
//!
//! *Purpose.* The main job to look at and to talk to: each board keeps UTC by the
//! receiver on its GPS connector and tells it on a TCP port of its own.
//!
//! *Design.* All boards share one world, whose time starts when they get power and
//! runs as this host's clock does. Each has a thread, which brings its board to the
//! present once a ms and shows its log. Their crystals are off by what was measured
//! on real boards, and their receivers differ in their chance.
//!
//! *Limits.* A board is up to a ms behind the host, more if the host is busy; the
//! summary says how far it once was. Exit code 1 if after `--duration` a clock had
//! never been set, 2 for a wrong option; a run that Ctrl-C ends is no failure.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use anyhow::Context as _;
use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser};
use console::{Screen, SimOptions, UtcNanos, Verdict};
use serde_json::{Value, json};
use virtual_pixhawk::{Builder, Firmware, Gaps, Pixhawk, TcpLine};
use world::{Pulses, Receiver, ReceiverSettings, Recording, WorldNanos};

/// How often a board is brought to the present.
const STEP: Duration = Duration::from_millis(1);
/// What the crystals of two Cubes were off by, in 10⁻⁹.
const CRYSTALS_PPB: [i32; 2] = [37_000, 44_000];

/// Virtual Pixhawks with simulated or replayed receivers, in real time.
#[derive(Parser, Debug)]
#[command(name = "sim")]
struct Sim {
    #[command(flatten)]
    options: SimOptions,
}

fn main() -> ExitCode {
    let Sim { options } = Sim::parse();
    let Some(image) = options.shared.image.as_deref() else {
        wrong_usage("--image PATH is missing; `cargo xtask sim` builds the image and fills it in")
    };
    let recording = options.shared.ubx.as_deref().map(|path| {
        read_recording(path).unwrap_or_else(|error| wrong_usage(&format!("--ubx: {error:#}")))
    });
    match run(&options, image, recording.as_ref()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn wrong_usage(message: &str) -> ! {
    Sim::command()
        .error(ErrorKind::ValueValidation, message)
        .exit()
}

fn read_recording(path: &Path) -> anyhow::Result<Recording> {
    let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    Recording::new(&bytes).with_context(|| format!("in {}", path.display()))
}

/// Runs all boards until the end of `--duration` or Ctrl-C.
fn run(sim: &SimOptions, image: &Path, recording: Option<&Recording>) -> anyhow::Result<ExitCode> {
    let options = &sim.shared;
    static ASKED_TO_END: AtomicBool = AtomicBool::new(false);
    ctrlc::set_handler(|| ASKED_TO_END.store(true, Ordering::Relaxed))?;

    let firmware = Firmware::read(image)?;
    // The world begins now: what powering on takes is made up for at once.
    let started = Instant::now();
    let utc_at_start = options.start.map_or_else(host_utc, Ok)?;
    let mut boards = Vec::new();
    for index in 0..options.boards {
        boards.push(power_on(sim, &firmware, recording, utc_at_start, index)?);
    }
    if !options.json {
        announce(sim, utc_at_start)?;
    }
    let ended: Vec<anyhow::Result<Ended>> = thread::scope(|scope| {
        let running: Vec<_> = (0..)
            .zip(boards)
            .map(|(index, board)| {
                let screen = Screen::new(options, index);
                scope.spawn(move || {
                    in_real_time(board, screen, started, options.duration(), &ASKED_TO_END)
                })
            })
            .collect();
        running
            .into_iter()
            .map(|board| {
                board
                    .join()
                    .unwrap_or_else(|_| anyhow::bail!("a board's thread panicked"))
            })
            .collect()
    });
    let ended = ended.into_iter().collect::<anyhow::Result<Vec<_>>>()?;
    if options.json {
        let boards: Vec<_> = (0..)
            .zip(&ended)
            .map(|(index, board)| board.to_json(options.mavlink_port_of(index)))
            .collect();
        println!("{}", json!({ "boards": boards }));
    } else {
        ended.iter().for_each(Ended::print);
    }
    let never_set = ended
        .iter()
        .any(|board| board.screen.verdict() == Verdict::NeverSet);
    let came_to_its_end = !ASKED_TO_END.load(Ordering::Relaxed);
    Ok(ExitCode::from(u8::from(never_set && came_to_its_end)))
}

/// UTC by this host's clock.
fn host_utc() -> anyhow::Result<UtcNanos> {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?;
    Ok(UtcNanos(i64::try_from(since_1970.as_nanos())?))
}

fn power_on(
    sim: &SimOptions,
    firmware: &Firmware,
    recording: Option<&Recording>,
    utc_at_start: UtcNanos,
    index: u16,
) -> anyhow::Result<Pixhawk> {
    let builder = Builder::new(firmware.clone())
        .crystal_ppb(CRYSTALS_PPB[usize::from(index) % CRYSTALS_PPB.len()])
        .telem1(TcpLine::listen(sim.shared.mavlink_port_of(index))?);
    let builder = match recording {
        Some(recording) => builder.gps(recording.clone()),
        None => {
            let settings = ReceiverSettings {
                seed: index.into(),
                ..ReceiverSettings::new(utc_at_start.0)
            };
            let builder = builder.gps(Receiver::new(settings.clone()));
            if sim.pulse {
                builder.pulse(Pulses::new(&settings))
            } else {
                builder
            }
        }
    };
    builder.power_on()
}

/// Says what runs and where it can be talked to.
fn announce(sim: &SimOptions, utc_at_start: UtcNanos) -> anyhow::Result<()> {
    let options = &sim.shared;
    let source = match &options.ubx {
        Some(path) => format!("the recording {}", path.display()),
        None => {
            let start = jiff::Timestamp::from_nanosecond(utc_at_start.0.into())?;
            let pulse = if sim.pulse { " and its pulse" } else { "" };
            format!("a simulated receiver{pulse} from {start:.3}")
        }
    };
    for index in 0..options.boards {
        println!(
            "virtual Pixhawk 1 on tcp:127.0.0.1:{}, {}, tick {} µs, {source}",
            options.mavlink_port_of(index),
            options.variant().name(),
            options.variant().tick_us()
        );
    }
    Ok(())
}

/// A board that has run, and how.
struct Ended {
    screen: Screen,
    ran: Duration,
    /// The most that it was behind the host's clock.
    behind: Duration,
    instructions: u64,
    damaged_log_frames: u64,
    gaps: Gaps,
}

/// Runs `board` as the host's clock runs, and shows its log.
fn in_real_time(
    mut board: Pixhawk,
    mut screen: Screen,
    started: Instant,
    duration: Option<Duration>,
    asked_to_end: &AtomicBool,
) -> anyhow::Result<Ended> {
    let mut behind = Duration::ZERO;
    loop {
        let present = started.elapsed();
        let goal = duration.map_or(present, |duration| present.min(duration));
        behind = behind.max(present.saturating_sub(Duration::from_nanos(board.now().0)));
        board.run_to(WorldNanos(u64::try_from(goal.as_nanos())?))?;
        for logged in board.take_log()? {
            screen.show(Duration::from_nanos(logged.at.0), &logged.line);
        }
        if duration.is_some_and(|duration| goal >= duration) || asked_to_end.load(Ordering::Relaxed)
        {
            break;
        }
        thread::sleep(STEP.saturating_sub(started.elapsed().saturating_sub(present)));
    }
    Ok(Ended {
        screen,
        ran: Duration::from_nanos(board.now().0),
        behind,
        instructions: board.instructions()?,
        damaged_log_frames: board.damaged_log_frames()?,
        gaps: board.gaps()?,
    })
}

impl Ended {
    /// The share of cycles that the core was not asleep, in parts per million.
    fn load_ppm(&self) -> u64 {
        let cycles = self.ran.as_micros() * 168;
        let load = u128::from(self.instructions) * 1_000_000;
        load.checked_div(cycles).map_or(0, |load| load as u64)
    }

    fn print(&self) {
        println!(
            "{}; {:.1} s, CPU load {:.2} %, at most {:.0} ms behind this host",
            self.screen.closing_line(),
            self.ran.as_secs_f64(),
            self.load_ppm() as f64 / 1e4,
            self.behind.as_secs_f64() * 1e3,
        );
        if self.gaps != Gaps::default() {
            println!(
                "the emulator has no model for what the firmware did here: {:?}",
                self.gaps
            );
        }
    }

    fn to_json(&self, mavlink_port: u16) -> Value {
        let mut object = self.screen.summary();
        object["mavlink_port"] = mavlink_port.into();
        object["seconds"] = self.ran.as_secs_f64().into();
        object["behind_ms"] = (self.behind.as_secs_f64() * 1e3).into();
        object["cpu_load_ppm"] = self.load_ppm().into();
        object["damaged_log_frames"] = self.damaged_log_frames.into();
        object["emulator_gaps"] = (self.gaps != Gaps::default()).into();
        object
    }
}
