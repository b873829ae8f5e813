//! A test on boards at the end of a line.
//!
//! *Purpose.* All boards are made ready and get PINGs at the same moments; their answers are
//! received.
//!
//! *Design.* Each board has two threads: one sends each PING at its moment and notes
//! when it really left, the other notes when an answer came. So a slow answer delays no
//! question, and no board another. Boards that are wired to one line of ours share the
//! first of the two. The test ends early when fewer than two boards are left; at its end
//! the boards' own logs are read.
//!
//! *Limits.* Moments are this host's, with its scheduling: how late each PING left and
//! how long each answer took is measured and reported. A serial line's own delay (an adapter
//! that collects bytes for a millisecond) is in the round trip. A frame of USB that a PING waits for is not; it is in
//! the statement of uncertainty.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use indicatif::ProgressBar;
use mavlink_node::client::{Client, GROUND_STATION};
use mavlink_node::{Address, Test, Version};
use testbed::{Case, Conversation, Method, Options, OwnLog, Record, Run, Schedule, discard_late};
use timebase::{Stamp, StampedByte};

use super::board::{Clock, Connected, Identity, PATIENCE};
use crate::ctrl_c;
use crate::link::Link;

/// From the last command to the first PING.
const LEAD: Duration = Duration::from_millis(300);
/// How long answers are waited for after the last PING.
const AFTERWARDS: Duration = Duration::from_secs(1);
/// How much longer than the settling time a clock may take to be set.
const GRACE: Duration = Duration::from_secs(5);
/// How often the bar and the boards are looked at.
const LOOK: Duration = Duration::from_millis(100);
/// The longest sleep before a PING: Ctrl-C counts in between.
const NAP: Duration = Duration::from_millis(200);

/// After so long a test that begins anew is meant, although a log is lost by it.
const MEANT_AFTER: Duration = Duration::from_millis(2_500);

/// A board that is ready for a test.
pub struct Ready {
    board: Connected,
    identity: Identity,
}

impl Ready {
    /// Sends it that the test has ended, and reads its own log.
    fn end(&mut self) -> Result<OwnLog> {
        let Self { board, identity } = self;
        if !board.send_test(identity.address, Test::Ends)? {
            bail!("it did not confirm that the test has ended");
        }
        board.own_log(identity.address)
    }
}

/// Learns who the boards are, and waits until each has been up for the settling time
/// and has its clock set.
///
/// # Errors
///
/// When one does not answer, or its clock is never set.
pub fn prepare(options: &Options, boards: Vec<Connected>, bar: &ProgressBar) -> Result<Vec<Ready>> {
    let settle = Duration::from_secs(options.settle.into());
    let began = Instant::now();
    let at_start = bar.position();
    thread::scope(|scope| {
        let waiting: Vec<_> = boards
            .into_iter()
            .map(|board| scope.spawn(move || get_ready(board, settle, began)))
            .collect();
        while waiting.iter().any(|board| !board.is_finished()) {
            thread::sleep(LOOK);
            bar.set_position(at_start + began.elapsed().as_secs().min(settle.as_secs()));
        }
        bar.set_position(at_start + settle.as_secs());
        let ready = waiting.into_iter().map(|board| {
            let ready = board.join();
            ready.unwrap_or_else(|_| bail!("a board's thread panicked"))
        });
        ready.collect()
    })
}

fn get_ready(mut board: Connected, settle: Duration, began: Instant) -> Result<Ready> {
    // That it answers at all is checked at once.
    board.identify()?;
    loop {
        let clock = board.clock();
        if clock.is_some_and(|clock| clock.is_set && clock.up >= settle) {
            // What steers it may have changed while it settled.
            let identity = board.identify()?;
            return Ok(Ready { board, identity });
        }
        ctrl_c::check()?;
        if clock.is_some_and(|clock| clock.received.elapsed() > PATIENCE) {
            bail!("{} fell silent while its clock settled", board.name);
        }
        if began.elapsed() > settle + GRACE {
            bail!("{}", why_not_ready(&board.name, clock, settle));
        }
        board.receive()?;
    }
}

/// Why a board is not ready after the time that it had.
fn why_not_ready(name: &str, clock: Option<Clock>, settle: Duration) -> String {
    match clock {
        Some(Clock {
            is_set: true, up, ..
        }) => format!(
            "{name} has been up for {} s only: it started anew while its clock settled; look at \
             its power",
            up.as_secs()
        ),
        _ => format!(
            "the clock of {name} was not set within {} s: give its receiver a view of the sky, \
             look whether it is plugged in, or wait longer with --settle",
            settle.as_secs()
        ),
    }
}

/// Checks that no two boards are the same system.
///
/// # Errors
///
/// Names two that are.
pub fn check_systems(ready: &[Ready]) -> Result<()> {
    for (number, one) in ready.iter().enumerate() {
        let system = one.identity.address.system;
        let other = ready.iter().skip(number + 1);
        if let Some(other) = other
            .clone()
            .find(|other| other.identity.address.system == system)
        {
            bail!(
                "{} and {} are both system {system}: if they are two boards, give one of them another \
                 number (`cargo xtask upload {} --system-id {}`)",
                one.board.name,
                other.board.name,
                other.board.name,
                system % 254 + 1
            );
        }
    }
    Ok(())
}

/// The method that all boards together run.
///
/// # Errors
///
/// Names a board that does not fit the others, with what it runs.
pub fn method_of(ready: &[Ready]) -> Result<Method> {
    let runs = |ready: &Ready, method: Method, index: usize| {
        let image = method.image(index);
        let is = &ready.identity;
        is.image == image && is.follows_pulse == method.has_pulse()
    };
    let all_run = |method: &Method| {
        let mut boards = ready.iter().enumerate();
        boards.all(|(index, board)| runs(board, *method, index))
    };
    if let Some(method) = Method::ALL.into_iter().find(all_run) {
        return Ok(method);
    }
    let described: Vec<String> = ready
        .iter()
        .map(|ready| {
            let is = &ready.identity;
            let pulse = if is.follows_pulse {
                " and the pulse"
            } else {
                ""
            };
            format!("{} runs {}{pulse}", ready.board.name, is.image)
        })
        .collect();
    bail!(
        "the boards do not run one method of the experiment: {}; flash them alike (for \
         paper-default-mixed, every board but the first at 38400)",
        described.join("; ")
    )
}

/// One test.
///
/// # Errors
///
/// When a board cannot be sent that it begins, its line being gone.
pub fn run(
    options: &Options,
    method: Method,
    seed: u64,
    mut ready: Vec<Ready>,
    bar: &ProgressBar,
) -> Result<Run> {
    let schedule = Schedule {
        rate_hz: options.rate,
        duration_s: options.duration,
        seed,
    };
    begin(&mut ready)?;
    // The boards that receive one and the same PING.
    let together = if options.one_line { ready.len() } else { 1 };
    let began = Instant::now() + LEAD;
    let conversations = converse(schedule, &ready, together, began, bar)?;
    let lasted_s = began.elapsed().as_secs().min(schedule.duration_s.into()) as u32;
    bar.set_message("reading the boards' logs");
    let logs = end(&mut ready, &conversations, since(began));
    let mut records = records(conversations, logs);
    // A PING on one line is late for all of them alike.
    let judged = records.iter_mut().filter(|_| !options.one_line);
    let late_ns = judged.map(|record| discard_late(record).unwrap_or(0));
    let late_ns = late_ns.collect();
    Ok(Run {
        case: Case {
            link: options.first_link(),
            ..Case::of(method, options.first_receivers())
        },
        seed,
        lasted_s,
        records,
        late_ns,
    })
}

/// Sends the boards that a test begins.
fn begin(ready: &mut [Ready]) -> Result<()> {
    for Ready { board, identity } in ready {
        let mut begins = || board.send_test(identity.address, Test::Begins);
        // A board asks back before it loses a log that is in no file.
        let has_begun = begins()? || {
            thread::sleep(MEANT_AFTER);
            begins()?
        };
        if !has_begun {
            console::print_error!(
                "{} did not confirm that a test begins: its own log may begin before it",
                board.name
            );
        }
    }
    Ok(())
}

/// Sends PINGs and receives answers until the test is over; each PING goes to `together` boards.
fn converse(
    schedule: Schedule,
    ready: &[Ready],
    together: usize,
    began: Instant,
    bar: &ProgressBar,
) -> Result<Vec<Mutex<Conversation>>> {
    let lines = |line: fn(&Connected) -> Result<Link>| {
        let lines = ready.iter().map(|ready| line(&ready.board));
        lines.collect::<Result<Vec<Link>>>()
    };
    let (outgoing, incoming) = (lines(Connected::outgoing)?, lines(Connected::incoming)?);
    let new = |ready: &Ready| Mutex::new(Conversation::new(&ready.board.name));
    let conversations: Vec<_> = ready.iter().map(new).collect();
    let is_over = AtomicBool::new(false);
    let at_start = bar.position();
    thread::scope(|scope| {
        let is_over = &is_over;
        let outgoing = outgoing.into_iter().step_by(together);
        for (line, receivers) in outgoing.zip(conversations.chunks(together)) {
            scope.spawn(move || send_pings(schedule, line, receivers, began, is_over));
        }
        for ((line, ready), conversation) in incoming.into_iter().zip(ready).zip(&conversations) {
            let board = ready.identity.address;
            scope.spawn(move || receive(line, board, conversation, began, is_over));
        }
        watch(schedule, &conversations, began, &|passed_s| {
            bar.set_position(at_start + passed_s);
        });
        is_over.store(true, Ordering::Relaxed);
    });
    Ok(conversations)
}

/// The boards' records, each with its log where there is one.
fn records(
    conversations: Vec<Mutex<Conversation>>,
    logs: Vec<Option<Result<OwnLog>>>,
) -> Vec<Record> {
    let pairs = conversations.into_iter().zip(logs);
    let records = pairs.map(|(conversation, log)| {
        let conversation = conversation.into_inner();
        let conversation = conversation.unwrap_or_else(PoisonError::into_inner);
        let mut record = conversation.end(None);
        if let Some(log) = log {
            record.take_log(log);
        }
        record
    });
    records.collect()
}

/// Sends the boards that the test has ended, and reads their own logs. None of a board
/// that is gone or has lost its log to a reboot, and none that Ctrl-C cut off.
fn end(
    ready: &mut [Ready],
    conversations: &[Mutex<Conversation>],
    now_ns: i64,
) -> Vec<Option<Result<OwnLog>>> {
    thread::scope(|scope| {
        let mut reading = Vec::new();
        for (ready, conversation) in ready.iter_mut().zip(conversations) {
            let is_over = conversation
                .lock()
                .is_ok_and(|mut conversation| conversation.is_over(now_ns));
            reading.push((!is_over).then(|| scope.spawn(move || ready.end())));
        }
        let read = reading.into_iter().map(|board| {
            let log = board?.join();
            let log = log.unwrap_or_else(|_| bail!("its thread panicked"));
            (log.is_ok() || !ctrl_c::is_pressed()).then_some(log)
        });
        read.collect()
    })
}

/// Until the test is over, by its time, by Ctrl-C or for lack of boards.
fn watch(
    schedule: Schedule,
    conversations: &[Mutex<Conversation>],
    began: Instant,
    show: &dyn Fn(u64),
) {
    let duration = Duration::from_secs(schedule.duration_s.into());
    let ends = began + duration + AFTERWARDS;
    while Instant::now() < ends && !ctrl_c::is_pressed() {
        thread::sleep(LOOK);
        let now_ns = since(began);
        show(began.elapsed().min(duration).as_secs());
        let left = conversations.iter().filter(|conversation| {
            let conversation = conversation.lock();
            conversation.is_ok_and(|mut conversation| !conversation.is_over(now_ns))
        });
        if left.count() < 2 {
            return;
        }
    }
}

/// Sends each PING at its moment to the boards of these conversations.
fn send_pings(
    schedule: Schedule,
    mut link: Link,
    conversations: &[Mutex<Conversation>],
    began: Instant,
    is_over: &AtomicBool,
) {
    let mut client = Client::new(GROUND_STATION, Version::V2);
    for (sequence, at) in schedule.pings() {
        let due = began + Duration::from_nanos(at);
        while let Some(left) = due
            .checked_duration_since(Instant::now())
            .filter(|d| !d.is_zero())
        {
            if is_over.load(Ordering::Relaxed) {
                return;
            }
            thread::sleep(left.min(NAP));
        }
        let ping = client.ping(at / 1_000, sequence);
        // Handled before it leaves, so that an answer finds it.
        let sent_ns = since(began);
        let delay_ns = sent_ns - at.cast_signed();
        let each = |handle: &dyn Fn(&mut Conversation)| {
            let locked = conversations.iter().filter_map(|one| one.lock().ok());
            locked.for_each(|mut conversation| handle(&mut conversation));
        };
        each(&|conversation| conversation.handle_sent(sequence, sent_ns, Some(delay_ns)));
        if link.send(&ping).is_err() {
            each(&|conversation| conversation.handle_line_lost(since(began)));
            return;
        }
    }
}

/// Passes the board's messages to its conversation.
fn receive(
    mut link: Link,
    board: Address,
    conversation: &Mutex<Conversation>,
    began: Instant,
    is_over: &AtomicBool,
) {
    let mut client = Client::new(GROUND_STATION, Version::V2);
    let mut buffer = [0; 1_024];
    while !is_over.load(Ordering::Relaxed) {
        let bytes = link.receive(&mut buffer);
        let now_ns = since(began);
        let Ok(mut conversation) = conversation.lock() else {
            return;
        };
        let Ok(bytes) = bytes else {
            conversation.handle_line_lost(now_ns);
            return;
        };
        let stamp = Stamp(0);
        for &byte in bytes {
            if let Some(received) = client.push(StampedByte { stamp, byte })
                && received.from == board
            {
                conversation.handle_message(now_ns, &received.message);
            }
        }
    }
}

/// From `began` to now; negative before it. \[ns\]
fn since(began: Instant) -> i64 {
    let now = Instant::now();
    let after = now.saturating_duration_since(began).as_nanos() as i64;
    let before = began.saturating_duration_since(now).as_nanos() as i64;
    after - before
}
