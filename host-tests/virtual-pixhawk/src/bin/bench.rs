//! `cargo xtask bench`: what each job costs on the virtual board, in instructions.
//!
//! *Purpose.* Holds the image that is flashed against its budget, and shows what
//! others spend on the same jobs.
//!
//! *Design.* Nothing is timed: one instruction is one cycle there, and every run is
//! the same. Interrupts and functions are metered as they are; what a job costs
//! beyond them is the difference of two runs that differ in that job alone, with
//! every wake-up and poll that it causes. The
//! image has two functions more than the flashed one, readings of the clock, since
//! those are inlined everywhere else.
//!
//! *Limits.* No wait states, no stacking of interrupts, no bus contention: metal
//! takes longer. The peers' figures were counted on another emulator (QEMU with
//! `-icount`), in the same unit.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Parser;
use mavlink_node::client::Client;
use mavlink_node::{Address, Version};
use serde_json::{Value, json};
use virtual_pixhawk::{Builder, Firmware, Profile, Script, Tally};
use world::{Port, Pulses, Receiver, ReceiverSettings, Talker, Transmission, WorldNanos};

/// Exception numbers of the vector table (RM0090, table 62): 16 and the interrupt's.
const SYSTICK: u16 = 15;
const USART2: u16 = 16 + 38;
const UART4: u16 = 16 + 52;
const TASKS: u16 = 16 + 78;

const BAUD: u32 = 115_200;
const MS: u64 = 1_000_000;
const SECOND: u64 = 1_000 * MS;
/// Who asks: a ground station.
const HOST: Address = Address {
    system: 255,
    component: 190,
};
/// 2026-11-22T04:00:00Z.
const START_UTC_NS: i64 = 1_795_320_000 * 1_000_000_000;

/// Instructions of each job, held against the budget.
#[derive(Parser)]
struct Bench {
    /// The image to measure; `cargo xtask bench` builds it and fills this in
    #[arg(long, value_name = "PATH")]
    image: PathBuf,
    /// Print one JSON object instead of the table
    #[arg(long)]
    json: bool,
}

/// One job's cost beside its budget.
struct Row {
    job: &'static str,
    cost: f64,
    budget: f64,
    peers: &'static str,
}

impl Row {
    const fn new(job: &'static str, cost: f64, budget: f64, peers: &'static str) -> Self {
        Self {
            job,
            cost,
            budget,
            peers,
        }
    }

    fn is_kept(&self) -> bool {
        self.cost <= self.budget
    }
}

fn main() -> anyhow::Result<ExitCode> {
    let Bench { image, json } = Bench::parse();
    let firmware = Firmware::read(&image)?;
    let (mut rows, byte) = interrupts_and_readings(&firmware)?;
    rows.push(nav_pvt(&firmware)?);
    rows.extend(estimators(&firmware)?);
    rows.push(ping(&firmware)?);
    let gps_noise = noise(&firmware, Line::Gps, byte.gps)?;
    let mavlink_noise = noise(&firmware, Line::Mavlink, byte.mavlink)?;
    rows.push(worst(
        "any byte on the GPS line, beyond its interrupt",
        &gps_noise,
        60.0,
        "crate ublox 454",
    ));
    rows.push(worst(
        "any byte on the MAVLink line, beyond its interrupt",
        &mavlink_noise,
        80.0,
        "crate mavlink 1550, C library 70",
    ));
    rows.push(load(&firmware)?);
    if json {
        println!("{}", to_json(&rows, &gps_noise, &mavlink_noise));
    } else {
        print(&rows, &gps_noise, &mavlink_noise);
    }
    Ok(if rows.iter().all(Row::is_kept) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// A receiver that needs no configuration.
fn receiver_settings() -> ReceiverSettings {
    let mut settings = ReceiverSettings::new(START_UTC_NS);
    settings.port = Port::CONFIGURED;
    settings
}

fn receiver() -> Receiver {
    Receiver::new(receiver_settings())
}

/// Runs a board and meters the time from `from_ns` to `to_ns`.
fn metered(
    firmware: &Firmware,
    gps: impl Talker + Send + 'static,
    telem1: impl Talker + Send + 'static,
    (from_ns, to_ns): (u64, u64),
    functions: &[&str],
) -> anyhow::Result<Profile> {
    let mut board = Builder::new(firmware.clone())
        .gps(gps)
        .telem1(telem1)
        .power_on()?;
    board.run_to(WorldNanos(from_ns))?;
    board.start_meter(functions)?;
    board.run_to(WorldNanos(to_ns))?;
    Ok(board.stop_meter())
}

/// The tick, a byte's interrupt, the readings.
fn interrupts_and_readings(firmware: &Firmware) -> anyhow::Result<(Vec<Row>, ByteCosts)> {
    let readings = ["bench_cycles_now", "bench_utc_now"];
    // A burst of the receiver lies in it, and a byte on the MAVLink line.
    let window = (2 * SECOND, 2 * SECOND + 200 * MS);
    let byte = Script::new([Transmission {
        start: WorldNanos(2 * SECOND + MS),
        bytes: vec![0],
        baud: BAUD,
    }]);
    let profile = metered(firmware, receiver(), byte, window, &readings)?;
    let exception = |number| {
        profile
            .exceptions
            .get(&number)
            .copied()
            .context("an interrupt that should have come did not")
    };
    let function = |name: &str| profile.functions.get(name).copied().unwrap_or_default();
    let bytes = ByteCosts {
        gps: exception(UART4)?.most,
        mavlink: exception(USART2)?.most,
    };
    let rows = vec![
        Row::new(
            "tick interrupt, no timer due",
            exception(SYSTICK)?.least as f64,
            28.0,
            "NuttX 63, ChibiOS 36, systick-timer 12",
        ),
        Row::new(
            "clock reading, cycles since boot",
            function(readings[0]).most as f64,
            32.0,
            "PX4 hrt 20, ArduPilot 23, systick-timer 73 to 385",
        ),
        Row::new(
            "clock reading, UTC in ns",
            // The dearest ones fall into the ms after a change of course.
            function(readings[1]).least as f64,
            56.0,
            "NuttX CLOCK_REALTIME 124",
        ),
        Row::new(
            "a received byte's interrupt",
            bytes.gps.max(bytes.mavlink) as f64,
            60.0,
            "",
        ),
    ];
    Ok((rows, bytes))
}

/// Instructions of the interrupt for one received byte, by line.
#[derive(Clone, Copy)]
struct ByteCosts {
    gps: u64,
    mavlink: u64,
}

/// Instructions that a board executes from `from_ns` to `to_ns`.
fn executed(
    firmware: &Firmware,
    gps: impl Talker + Send + 'static,
    telem1: impl Talker + Send + 'static,
    (from_ns, to_ns): (u64, u64),
) -> anyhow::Result<f64> {
    let mut board = Builder::new(firmware.clone())
        .gps(gps)
        .telem1(telem1)
        .power_on()?;
    board.run_to(WorldNanos(from_ns))?;
    let before = board.instructions()?;
    board.run_to(WorldNanos(to_ns))?;
    Ok((board.instructions()? - before) as f64)
}

/// What hears a mark: the envelope, and what it says of the clock.
const MARK: &str = "<utc_clock::discipline::Discipline>::handle_mark";

/// What the clock itself does for a mark and for a pulse: the dearest of 20 s in which
/// it follows both, after eight minutes, when its memory is full.
fn estimators(firmware: &Firmware) -> anyhow::Result<[Row; 2]> {
    const PULSE: &str = "<utc_clock::clock::UtcClock>::handle_pulse";
    let settings = receiver_settings();
    let mut board = Builder::new(firmware.clone())
        .gps(Receiver::new(settings.clone()))
        .pulse(Pulses::new(&settings))
        .power_on()?;
    board.run_to(WorldNanos(490 * SECOND))?;
    board.start_meter(&[MARK, PULSE])?;
    board.run_for(20 * SECOND)?;
    let functions = board.stop_meter().functions;
    let dearest = |name, least_calls| {
        functions
            .get(name)
            .filter(|tally: &&Tally| tally.times >= least_calls)
            .map(|tally| tally.most as f64)
            .with_context(|| format!("{name} was not called"))
    };
    Ok([
        Row::new("one mark, in the estimator", dearest(MARK, 90)?, 3000.0, ""),
        Row::new(
            "one pulse, in estimator and clock",
            dearest(PULSE, 19)?,
            2000.0,
            "",
        ),
    ])
}

/// Everything that the tasks do for one NAV-PVT, from waking up to going back to
/// sleep, with all their polls but without the estimator: the dearest of some.
fn nav_pvt(firmware: &Firmware) -> anyhow::Result<Row> {
    const MARKS: u64 = 4;
    const PERIOD: u64 = 200 * MS;
    let mut board = Builder::new(firmware.clone()).gps(receiver()).power_on()?;
    board.run_to(WorldNanos(2 * SECOND))?;
    let last = board.truth()?.last().map(|sent| sent.first_byte.0);
    let last = last.context("the receiver is silent")?;
    let mut dearest = 0;
    for start in (1..=MARKS).map(|mark| last + mark * PERIOD) {
        board.run_to(WorldNanos(start - MS))?;
        board.start_meter(&[MARK])?;
        // 100 bytes last 8.7 ms, and the line's pause is found within 2 ms.
        board.run_to(WorldNanos(start + 14 * MS))?;
        let profile = board.stop_meter();
        // A mark may come so much later than the last that it is heard afterwards.
        if let Some(tasks) = profile.exceptions.get(&TASKS)
            && let Some(estimator) = profile.functions.get(MARK)
        {
            dearest = dearest.max(tasks.instructions - estimator.instructions);
        }
    }
    anyhow::ensure!(dearest > 0, "no mark was heard in time");
    Ok(Row::new(
        "one NAV-PVT after its interrupts, less the estimator",
        dearest as f64,
        3_000.0,
        "PX4 5028, inav 3901, crate ublox 993 to 31836 (parsing alone)",
    ))
}

/// From a PING's whole frame to the bytes of its answer. The search for its
/// beginning is in the cost of a byte.
fn ping(firmware: &Firmware) -> anyhow::Result<Row> {
    /// The checksum, the fields, the answer.
    const STEPS: [&str; 3] = [
        "Framer<mavlink_node::wanted::Requests, 35>>::longest_intact",
        "node::Node>::request",
        "node::Node>::answer",
    ];
    let ping = Script::new([Transmission {
        start: WorldNanos(2 * SECOND + 5 * MS),
        bytes: Client::new(HOST, Version::V2).ping(1_000_000, 1).to_vec(),
        baud: BAUD,
    }]);
    let window = (2 * SECOND, 2 * SECOND + 20 * MS);
    let profile = metered(firmware, Script::default(), ping, window, &STEPS)?;
    let mut cost = 0;
    for step in STEPS {
        let tally = profile.functions.get(step).filter(|tally| tally.times > 0);
        cost += tally.context("the PING was not answered")?.most;
    }
    Ok(Row::new(
        "PING, from its frame to the answer's bytes",
        cost as f64,
        1_200.0,
        "C library 2319",
    ))
}

/// Which line noise comes in on.
#[derive(Clone, Copy)]
enum Line {
    Gps,
    Mavlink,
}

/// Costs of noise, by its name.
type NoiseCosts = Vec<(&'static str, f64)>;

/// What a byte costs beyond its interrupt, for each kind of noise: everything that the
/// board does more than in silence, over 1 000 bytes at full rate.
fn noise(firmware: &Firmware, line: Line, byte: u64) -> anyhow::Result<NoiseCosts> {
    const BYTES: usize = 1_000;
    let start = WorldNanos(2 * SECOND + 10 * MS);
    // 1 000 bytes last 87 ms; after the silence, what was held back is given up.
    let window = (2 * SECOND, 2 * SECOND + 500 * MS);
    let run = |bytes: Vec<u8>| {
        let script = Script::new([Transmission {
            start,
            bytes,
            baud: BAUD,
        }]);
        match line {
            Line::Gps => executed(firmware, script, Script::default(), window),
            Line::Mavlink => executed(firmware, Script::default(), script, window),
        }
    };
    let kinds = match line {
        Line::Gps => GPS_NOISE,
        Line::Mavlink => MAVLINK_NOISE,
    };
    let silence = run(Vec::new())?;
    let repeated = kinds
        .iter()
        .map(|&(name, bytes)| (name, bytes.iter().copied().cycle().take(BYTES).collect()));
    repeated
        .chain([("random bytes", random(BYTES))])
        .map(|(name, bytes)| Ok((name, (run(bytes)? - silence) / BYTES as f64 - byte as f64)))
        .collect()
}

/// Noise made to hurt the search for UBX frames.
const GPS_NOISE: &[(&str, &[u8])] = &[
    ("zeros", &[0]),
    ("first sync bytes", &[0xb5]),
    ("sync pairs", &[0xb5, 0x62]),
    ("NAV-PVT headers", &[0xb5, 0x62, 0x01, 0x07, 92, 0]),
    ("TIM-TP headers", &[0xb5, 0x62, 0x0d, 0x01, 16, 0]),
    ("ACK headers", &[0xb5, 0x62, 0x05, 0x01, 2, 0]),
    (
        "NAV-PVT and TIM-TP headers",
        &[0xb5, 0x62, 0x01, 0x07, 92, 0, 0xb5, 0x62, 0x0d, 0x01, 16, 0],
    ),
    (
        "NAV-PVT and ACK headers",
        &[0xb5, 0x62, 0x01, 0x07, 92, 0, 0xb5, 0x62, 0x05, 0x01, 2, 0],
    ),
    (
        "ACK frames with a wrong checksum",
        &[0xb5, 0x62, 0x05, 0x01, 2, 0, 6, 1, 0, 0],
    ),
    ("false lengths", &[0xb5, 0x62, 0x01, 0x07, 0xff, 0xff]),
    (
        "foreign frames",
        &[0xb5, 0x62, 0x0a, 0x04, 0, 0, 0x0e, 0x34],
    ),
    (
        "NMEA",
        b"$GNRMC,085001.60,A,4724.40,N,00833.00,E,0.0,,190717,,,A*7C\r\n",
    ),
];

/// Noise made to hurt the search for MAVLink frames.
const MAVLINK_NOISE: &[(&str, &[u8])] = &[
    ("zeros", &[0]),
    ("MAVLink 1 markers", &[0xfe]),
    ("MAVLink 2 markers", &[0xfd]),
    ("PING 1 headers, each third byte", &[0xfe, 14, 4]),
    ("PING 1 headers", &[0xfe, 14, 0, 255, 190, 4]),
    ("TIMESYNC 1 headers, each third byte", &[0xfe, 16, 111]),
    ("COMMAND_LONG 1 headers, each third byte", &[0xfe, 33, 76]),
    (
        "PARAM_REQUEST_LIST 1 headers, each third byte",
        &[0xfe, 2, 21],
    ),
    (
        "LOG_REQUEST_LIST 1 headers, each third byte",
        &[0xfe, 6, 117],
    ),
    (
        "LOG_REQUEST_DATA 1 headers, each third byte",
        &[0xfe, 12, 119],
    ),
    (
        "MAVLink 1 frames of 2, 14 and 35 bytes with one end",
        &[0xfe, 2, 4, 0xfe, 35, 121, 0xfe, 14, 75],
    ),
    (
        "MAVLink 1 frames of 12 and 33 bytes with one end",
        &[0xfe, 12, 76, 0xfe, 33, 119],
    ),
    (
        "MAVLink 1 frames of 6 and 33 bytes with one end",
        &[0xfe, 6, 76, 0xfe, 33, 117],
    ),
    (
        "MAVLink 1 frames of 2 and 35 bytes with one end",
        &[0xfe, 2, 75, 0xfe, 35, 122],
    ),
    (
        "MAVLink 1 frames of 14 and 35 bytes with one end",
        &[0xfe, 14, 75, 0xfe, 35, 4],
    ),
    ("PING 2 headers", &[0xfd, 14, 0, 0, 0, 255, 190, 4, 0, 0]),
    (
        "PING 2 headers, two in ten bytes",
        &[0xfd, 4, 0, 0, 0xfd, 1, 0, 4, 0, 0],
    ),
    (
        "PARAM_REQUEST_READ 2 headers, two in ten bytes",
        &[0xfd, 20, 0, 0, 0xfd, 20, 0, 20, 0, 0],
    ),
    (
        "PARAM_SET 2 headers, two in ten bytes",
        &[0xfd, 23, 0, 0, 0xfd, 23, 0, 23, 0, 0],
    ),
    (
        "LOG_ERASE 2 headers",
        &[0xfd, 1, 0, 0, 0, 255, 190, 121, 0, 0],
    ),
    (
        "shortest PING 2 headers",
        &[0xfd, 1, 0, 0, 0, 255, 190, 4, 0, 0],
    ),
    (
        "PING 2 headers of all lengths",
        &[
            0xfd, 14, 0, 0, 0, 1, 1, 4, 0, 0, 0xfd, 9, 0, 0, 0, 1, 1, 4, 0, 0, 0xfd, 4, 0, 0, 0, 1,
            1, 4, 0, 0, 0xfd, 1, 0, 0, 0, 1, 1, 4, 0, 0,
        ],
    ),
    (
        "signed PING 2 headers",
        &[0xfd, 14, 1, 0, 0, 255, 190, 4, 0, 0],
    ),
    ("unknown flags", &[0xfd, 14, 2, 0, 0, 255, 190, 4, 0, 0]),
    ("foreign frames", &[0xfe, 1, 0, 255, 190, 200, 0, 0, 0]),
];

/// Bytes of a linear congruential generator.
fn random(count: usize) -> Vec<u8> {
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    (0..count).map(|_| next()).collect()
}

/// The dearest kind of noise as a row.
fn worst(job: &'static str, costs: &NoiseCosts, budget: f64, peers: &'static str) -> Row {
    let dearest = costs.iter().map(|&(_, cost)| cost).fold(0.0, f64::max);
    Row::new(job, dearest, budget, peers)
}

/// The part of all cycles in which the core is not asleep, in %, with marks at 5 Hz and
/// 10 PINGs a second, over 5 s.
fn load(firmware: &Firmware) -> anyhow::Result<Row> {
    let mut client = Client::new(HOST, Version::V2);
    let pings = (0..60_u32).map(|n| Transmission {
        start: WorldNanos(2 * SECOND + u64::from(n) * 100 * MS),
        bytes: client.ping(u64::from(n), n).to_vec(),
        baud: BAUD,
    });
    let window = (3 * SECOND, 8 * SECOND);
    let busy = executed(firmware, receiver(), Script::new(pings), window)?;
    let cycles = 5.0 * f64::from(timebase::CORE_HZ);
    Ok(Row::new(
        "CPU load in %, 5 Hz and 10 PING/s",
        busy / cycles * 100.0,
        1.0,
        "",
    ))
}

fn print(rows: &[Row], gps_noise: &NoiseCosts, mavlink_noise: &NoiseCosts) {
    println!(
        "{:<52} {:>8} {:>7}  others",
        "instructions on the virtual board", "pixclock", "at most"
    );
    for row in rows {
        let decimals = usize::from(row.budget < 10.0 || row.cost.fract() != 0.0);
        println!(
            "{:<52} {:>8.*} {:>7} {}{}",
            row.job,
            decimals * 2,
            row.cost,
            row.budget,
            if row.is_kept() { " " } else { "!" },
            row.peers
        );
    }
    for (line, costs) in [("GPS", gps_noise), ("MAVLink", mavlink_noise)] {
        println!("\na byte of noise on the {line} line, beyond its interrupt");
        for (name, cost) in costs {
            println!("  {name:<50} {cost:>8.2}");
        }
    }
}

fn to_json(rows: &[Row], gps_noise: &NoiseCosts, mavlink_noise: &NoiseCosts) -> Value {
    let noise = |costs: &NoiseCosts| -> Value {
        costs
            .iter()
            .map(|&(name, cost)| (name.to_owned(), json!(cost)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    json!({
        "jobs": rows
            .iter()
            .map(|row| json!({
                "job": row.job,
                "instructions": row.cost,
                "budget": row.budget,
                "kept": row.is_kept(),
                "others": row.peers,
            }))
            .collect::<Vec<_>>(),
        "gps_noise": noise(gps_noise),
        "mavlink_noise": noise(mavlink_noise),
    })
}
