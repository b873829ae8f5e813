//! The jobs that are measured.

use anyhow::Context as _;
use mavlink_node::Version;
use mavlink_node::client::Client;
use virtual_pixhawk::{Script, Tally};
use world::{Transmission, WorldNanos};

use crate::board::{BAUD, HOST, MS, SECOND, Subject, executed, metered, receiver};
use crate::table::Row;

/// Exception numbers of the vector table (RM0090, table 62): 16 and the interrupt's.
const SYSTICK: u16 = 15;
const USART2: u16 = 16 + 38;
const UART4: u16 = 16 + 52;
const TASKS: u16 = 16 + 78;

/// The tick, a byte's interrupt, the readings.
pub fn interrupts_and_readings(subject: &Subject) -> anyhow::Result<(Vec<Row>, ByteCosts)> {
    let readings = ["bench_cycles_now", "bench_utc_now"];
    // A burst of the receiver lies in it, and a byte on the MAVLink line.
    let window = (2 * SECOND, 2 * SECOND + 200 * MS);
    let byte = Script::new([Transmission {
        start: WorldNanos(2 * SECOND + MS),
        bytes: vec![0],
        baud: BAUD,
    }]);
    let profile = metered(subject, receiver(), byte, window, &readings)?;
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
            // The most expensive ones fall into the ms after a change of course.
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
pub struct ByteCosts {
    pub gps: u64,
    pub mavlink: u64,
}

/// The estimator's part of a mark.
const MARK: &str = "<utc_clock::discipline::Discipline>::handle_mark";

/// The clock's own part of a mark and of a pulse: the most expensive of 20 s in which
/// it follows both, after eight minutes, when its memory is full.
pub fn estimators(subject: &Subject) -> anyhow::Result<[Row; 2]> {
    const PULSE: &str = "<utc_clock::clock::UtcClock>::handle_edge";
    let mut board = subject.board().gps_and_pulse(receiver()).power_on()?;
    board.run_to(WorldNanos(490 * SECOND))?;
    board.start_meter(&[MARK, PULSE])?;
    board.run_for(20 * SECOND)?;
    let functions = board.stop_meter().functions;
    let most = |name, least_calls| {
        functions
            .get(name)
            .filter(|tally: &&Tally| tally.times >= least_calls)
            .map(|tally| tally.most as f64)
            .with_context(|| format!("{name} was not called"))
    };
    Ok([
        Row::new("one mark, in the estimator", most(MARK, 90)?, 3000.0, ""),
        Row::new(
            "one pulse, in estimator and clock",
            most(PULSE, 19)?,
            2500.0,
            "",
        ),
    ])
}

/// Everything that the tasks do for one NAV-PVT, from waking up to going back to
/// sleep, with all their polls but without the estimator: the most expensive of some.
pub fn nav_pvt(subject: &Subject) -> anyhow::Result<Row> {
    const MARKS: u64 = 4;
    const PERIOD: u64 = 200 * MS;
    let mut board = subject.board().gps(receiver()).power_on()?;
    board.run_to(WorldNanos(2 * SECOND))?;
    let last = board.truth()?.last().map(|sent| sent.first_byte.0);
    let last = last.context("the receiver is silent")?;
    let mut most = 0;
    for start in (1..=MARKS).map(|mark| last + mark * PERIOD) {
        board.run_to(WorldNanos(start - MS))?;
        board.start_meter(&[MARK])?;
        // 100 bytes last 8.7 ms, and the line's pause is found within 2 ms.
        board.run_to(WorldNanos(start + 14 * MS))?;
        let profile = board.stop_meter();
        // A mark may come so much later than the last one that it is handled afterwards.
        if let Some(tasks) = profile.exceptions.get(&TASKS)
            && let Some(estimator) = profile.functions.get(MARK)
        {
            most = most.max(tasks.instructions - estimator.instructions);
        }
    }
    anyhow::ensure!(most > 0, "no mark was handled in time");
    // What is built for size is in it, as the pulse.
    Ok(Row::new(
        "one NAV-PVT after its interrupts, less the estimator",
        most as f64,
        3_000.0,
        "PX4 5028, inav 3901, crate ublox 993 to 31836 (parsing alone)",
    )
    .for_now(4_420.0))
}

/// From a PING's whole frame to the bytes of its answer. The search for its
/// beginning is in the cost of a byte.
pub fn ping(subject: &Subject) -> anyhow::Result<Row> {
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
    let profile = metered(subject, Script::default(), ping, window, &STEPS)?;
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
    )
    .for_now(1_265.0))
}

/// The part of all cycles in which the core is not asleep, in %, with marks at 5 Hz and
/// 10 PINGs a second, over 5 s.
pub fn load(subject: &Subject) -> anyhow::Result<Row> {
    let mut client = Client::new(HOST, Version::V2);
    let pings = (0..60_u32).map(|n| Transmission {
        start: WorldNanos(2 * SECOND + u64::from(n) * 100 * MS),
        bytes: client.ping(u64::from(n), n).to_vec(),
        baud: BAUD,
    });
    let window = (3 * SECOND, 8 * SECOND);
    let busy = executed(subject, receiver(), Script::new(pings), window)?;
    let cycles = 5.0 * f64::from(timebase::CORE_HZ);
    Ok(Row::new(
        "CPU load in %, 5 Hz and 10 PING/s",
        busy / cycles * 100.0,
        1.0,
        "",
    ))
}
