//! `cargo xtask testbed --boards virtual`: the paper's experiment on virtual Pixhawks.
//!
//! *Purpose.* Two or more boards, each with a crystal and a receiver of its own, in one
//! world whose laptop asks them all at the same moments.
//!
//! *Design.* The boards get power within the same second, each at a moment of its own.
//! The first PING follows after `--settle`, the same for all methods. Each board has a
//! thread and lives alone, since nothing that it says changes what the others hear; it
//! is run in steps of a second, so that Ctrl-C is soon obeyed. UTC is the world's time
//! at the end of a PING's first byte. As in the paper, a message tells the boards that the
//! test is over, and each writes what it noted to the card in its slot.
//!
//! *Limits.* Crystals do not wander. The laptop's line takes what the board's own
//! 115200 baud take: a PING that is due while the one before still leaves, waits.

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use anyhow::Context as _;
use clap::Parser;
use clap::{CommandFactory as _, error::ErrorKind};
use console::Status;
use fastrand::Rng;
use fat_image::Kind;
use indicatif::ProgressBar;
use mavlink_node::client::{Client, GROUND_STATION, Message, Received};
use mavlink_node::{Address, Frame, Parameter, Test, Version};
use testbed::{
    Boards, Conversation, Method, Options, OwnLog, Place, Record, Results, Run, Schedule, progress,
};
use timebase::{Stamp, StampedByte};
use virtual_pixhawk::{Builder, Card, Connector, Firmware, Gaps, Pixhawk, Script};
use world::{Pulses, Receiver, ReceiverSettings, Transmission, WorldNanos};

const SECOND: u64 = 1_000_000_000;
/// 2026-11-22T04:00:00Z: UTC when the first board may get power.
const START_UTC_NS: i64 = 1_795_320_000 * 1_000_000_000;
/// Boards get power within so many ns.
const POWER_WITHIN_NS: u64 = SECOND;
/// The speed of the laptop's line: off by less than a USB adapter's, and slower than the
/// board's own 115 068, so that the emulated port, which takes ten of its own bit times for a
/// word, is free when the next one begins.
const BAUD: u32 = 115_000;
/// Ten bits at the board's own speed (42 MHz by 365, RM0090 30.3.4): a PING's first byte
/// has arrived so many ns after its start.
const FIRST_BYTE_NS: i64 = 86_905;
/// Receivers have a TCXO that is within so many ppb.
const RECEIVER_PPB: i32 = 1_000;
/// How long before the first PING a board is told that a test begins, and how long after
/// the last one that it ends, in ns.
const ASIDE_NS: u64 = SECOND / 2;
/// How long a board is listened to after the last PING, in s: for its last answers, its
/// next status line, and until its card has a full log, which takes 1.4 s.
const AFTERWARDS_S: u32 = 3;
/// A board, as it is flashed.
const BOARD: Address = Address {
    system: 1,
    component: 1,
};
/// The name of the first log on an empty card.
const LOG_FILE: &str = "TEST0001.CSV";

static ASKED_TO_END: AtomicBool = AtomicBool::new(false);

/// The paper's experiment on virtual Pixhawks.
#[derive(Parser, Debug)]
#[command(name = "testbed")]
struct Testbed {
    #[command(flatten)]
    options: Options,
}

fn main() -> ExitCode {
    let Testbed { options } = Testbed::parse();
    if options.boards != Boards::Virtual {
        wrong_usage("this program has virtual boards only; `cargo xtask testbed` has the others");
    }
    run(&options).unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}

fn wrong_usage(message: &str) -> ! {
    Testbed::command()
        .error(ErrorKind::ValueValidation, message)
        .exit()
}

/// Every method with every seed.
fn run(options: &Options) -> anyhow::Result<ExitCode> {
    ctrlc::set_handler(|| ASKED_TO_END.store(true, Ordering::Relaxed))?;
    let methods = options.methods();
    let mut results = Results::new(options, Place::Virtual, conditions(options))?;
    // The first second is the one in which the boards get power.
    let each_s = 1 + u64::from(options.settle + options.duration + AFTERWARDS_S);
    let bar = progress::bar(each_s * methods.len() as u64 * options.seeds);
    'all: for method in methods {
        for seed in options.seeds() {
            bar.set_message(format!("{method}, seed {seed}"));
            match one_run(options, method, seed, &bar) {
                // One that Ctrl-C ended before its first PING has nothing to keep.
                Ok(run) if run.lasted_s == 0 => {}
                Ok(run) => results.keep(run),
                Err(error) => {
                    results.cut_short(&format!("{method}, seed {seed}: {error:#}"));
                    break 'all;
                }
            }
            if ASKED_TO_END.load(Ordering::Relaxed) {
                results.cut_short("it was stopped by Ctrl-C");
                break 'all;
            }
        }
    }
    bar.finish_and_clear();
    results.end(options, ASKED_TO_END.load(Ordering::Relaxed))
}

/// What the report tells of the boards and their world.
fn conditions(options: &Options) -> Vec<(&'static str, String)> {
    vec![
        (
            "boards",
            format!("{} virtual Pixhawk 1", options.crystals.ppb.len()),
        ),
        ("crystals", format!("{} ppm", options.crystals.text())),
        ("receivers", options.receiver.title().to_owned()),
        (
            "seeds",
            match options.seeds().end - 1 {
                last if last == options.seed => format!("{last}"),
                last => format!("{} to {last}", options.seed),
            },
        ),
        (
            "test",
            format!(
                "{} s, {} PINGs a second, the first one {} s after the boards' power",
                options.duration, options.rate, options.settle
            ),
        ),
    ]
}

/// One method with one seed.
fn one_run(options: &Options, method: Method, seed: u64, bar: &ProgressBar) -> anyhow::Result<Run> {
    let settings = (0..).zip(&options.crystals.ppb);
    let boards = settings
        .map(|(index, &crystal_ppb)| Lab::board(options, method, seed, index, crystal_ppb))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let lives = thread::scope(|scope| {
        let running: Vec<_> = (0..)
            .zip(boards)
            .map(|(index, board)| {
                let bar = (index == 0).then_some(bar);
                scope.spawn(move || board.live(bar))
            })
            .collect();
        running
            .into_iter()
            .map(|board| {
                let ended = board.join();
                ended.unwrap_or_else(|_| anyhow::bail!("a board's thread panicked"))
            })
            .collect::<anyhow::Result<Vec<_>>>()
    })?;
    Ok(Run {
        method,
        seed,
        lasted_s: lives.iter().map(|life| life.lasted_s).min().unwrap_or(0),
        records: lives.into_iter().map(|life| life.record).collect(),
        late_ns: Vec::new(),
    })
}

/// A board in its place, before it has power.
struct Lab {
    builder: Builder,
    name: String,
    schedule: Schedule,
    /// From the world's start to its power, in ns.
    power_ns: u64,
    /// From the world's start to the test's, in ns.
    test_ns: u64,
}

/// What became of a board.
struct Life {
    record: Record,
    lasted_s: u32,
}

impl Lab {
    fn board(
        options: &Options,
        method: Method,
        seed: u64,
        index: usize,
        crystal_ppb: i32,
    ) -> anyhow::Result<Self> {
        let image = method.image(index);
        let path = options.image(image).with_context(|| {
            format!("the image {image} is missing; `cargo xtask testbed` builds it")
        })?;
        // What a seed makes of a board is the same under every method.
        let mut rng = Rng::with_seed(seed);
        rng = Rng::with_seed(rng.u64(..) ^ index as u64);
        let power_ns = rng.u64(0..POWER_WITHIN_NS);
        let receiver = ReceiverSettings {
            seed: rng.u64(..),
            crystal_ppb: rng.i32(-RECEIVER_PPB..=RECEIVER_PPB),
            latency: options.receiver.latency(),
            ..ReceiverSettings::new(START_UTC_NS + power_ns.cast_signed())
        };
        let schedule = Schedule {
            rate_hz: options.rate,
            duration_s: options.duration,
            seed,
        };
        let test_ns = POWER_WITHIN_NS + u64::from(options.settle) * SECOND;
        let mut builder = Builder::new(Firmware::read(path)?)
            .crystal_ppb(crystal_ppb)
            .gps(Receiver::new(receiver.clone()))
            .telem1(Script::new(asked(schedule, test_ns - power_ns)))
            .card(Card::holding(&fat_image::formatted(Kind::Fat16)));
        if method.has_pulse() {
            builder = builder.pulse(Pulses::new(&receiver));
        }
        Ok(Self {
            builder,
            name: format!("board {}", index + 1),
            schedule,
            power_ns,
            test_ns,
        })
    }

    /// From power to the end of the test, a second at a time.
    fn live(self, bar: Option<&ProgressBar>) -> anyhow::Result<Life> {
        let mut conversation = Conversation::new(&self.name);
        let begins = self.test_ns - self.power_ns;
        let ends = begins + u64::from(self.schedule.duration_s) * SECOND;
        let over = ends + u64::from(AFTERWARDS_S) * SECOND;
        let since_test = |at: u64| at.cast_signed() - begins.cast_signed();
        let mut to_ask = pings(self.schedule, begins).into_iter().peekable();
        let mut sequences = self.schedule.pings();
        let mut client = Client::new(GROUND_STATION, Version::V2);
        let mut line_full = 0;
        let mut log_missed = 0;
        let mut board = self.builder.power_on()?;
        while board.now().0 < over && !ASKED_TO_END.load(Ordering::Relaxed) {
            board.run_for(SECOND.min(over - board.now().0))?;
            let now = board.now();
            while let Some(ping) = to_ask.next_if(|ping| ping.start <= now)
                && let Some((sequence, _)) = sequences.next()
            {
                conversation.asked(sequence, since_test(ping.start.0), None);
            }
            for heard in board.take_received(Connector::Telem1)? {
                let stamp = Stamp((heard.at.0 / 6) as u32);
                let byte = heard.byte;
                if let Some(Received { message, .. }) = client.push(StampedByte { stamp, byte }) {
                    conversation.heard(since_test(heard.at.0), &message);
                    if let Message::Parameter { name, value, .. } = message
                        && Parameter::named(name) == Some(Parameter::LogMissed)
                    {
                        log_missed = value as u32;
                    }
                }
            }
            let log = board.take_log()?;
            let mut statuses = log
                .iter()
                .filter_map(|logged| Status::parse(&logged.line.text));
            if let Some(status) = statuses.next_back() {
                // What is 0 is left out.
                line_full = status.number("mav_outgoing_full").unwrap_or(0) as u32;
            }
            if let Some(bar) = bar {
                bar.inc(1);
            }
        }
        let gaps = board.gaps()?;
        if gaps != Gaps::default() {
            eprintln!("the emulator has no model for what the firmware did here: {gaps:?}");
        }
        let lasted_ns = since_test(board.now().0.min(ends)).max(0);
        let test_utc_ns = START_UTC_NS + self.test_ns.cast_signed();
        let utc_ns = |sent_ns| test_utc_ns + sent_ns + FIRST_BYTE_NS;
        let mut record = Record {
            line_full: Some(line_full),
            ..conversation.end(Some(&utc_ns))
        };
        if !ASKED_TO_END.load(Ordering::Relaxed) {
            record.take_log(own_log(&mut board, log_missed));
        }
        Ok(Life {
            record,
            lasted_s: (lasted_ns.cast_unsigned() / SECOND) as u32,
        })
    }
}

/// What is on the card in a board's slot.
fn own_log(board: &mut Pixhawk, missed: u32) -> anyhow::Result<OwnLog> {
    let card = board.swap_card(None)?.context("its slot is empty")?;
    let file = fat_image::contents(&mut card.image(), LOG_FILE)
        .with_context(|| format!("no {LOG_FILE} on its card"))?;
    OwnLog::read(file, missed)
}

/// All that a board is asked: what tells it of the test, and the PINGs between.
fn asked(schedule: Schedule, begins: u64) -> Vec<Transmission> {
    let mut client = Client::new(GROUND_STATION, Version::V2);
    let leaves = |start: u64, frame: Frame| Transmission {
        start: WorldNanos(start),
        bytes: frame.to_vec(),
        baud: BAUD,
    };
    let ends = begins + u64::from(schedule.duration_s) * SECOND;
    let mut asked = vec![leaves(begins - ASIDE_NS, client.test(BOARD, Test::Begins))];
    asked.extend(pings(schedule, begins));
    asked.push(leaves(ends + ASIDE_NS, client.test(BOARD, Test::Ends)));
    let log_missed = client.parameter(BOARD, Parameter::LogMissed);
    asked.push(leaves(ends + 2 * ASIDE_NS, log_missed));
    asked
}

/// The laptop's PINGs, the test beginning at `begins`, in the world's ns since the
/// board's power. Those that the line has no room for until the test's end are not sent.
fn pings(schedule: Schedule, begins: u64) -> Vec<Transmission> {
    let mut client = Client::new(GROUND_STATION, Version::V2);
    let mut free = WorldNanos(0);
    let ends = begins + u64::from(schedule.duration_s) * SECOND;
    let pings = schedule.pings().map(|(sequence, at)| {
        let transmission = Transmission {
            start: WorldNanos(begins + at).max(free),
            bytes: client.ping(at / 1_000, sequence).to_vec(),
            baud: BAUD,
        };
        free = transmission.end();
        transmission
    });
    pings.take_while(|ping| ping.start.0 < ends).collect()
}
