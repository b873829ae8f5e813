//! A node on a TCP port, with this host's clock: the board's stand-in for tests of
//! what runs at the other end of the line, mishaps included.
//!
//! *Design.* The crates that the firmware uses, fed from a socket; one node and one log a
//! connection, as each line of the board has its own.
//!
//! *Limits.* Its stamps are taken when a read returns, not when a byte arrives. What takes many
//! frames goes out at once: a socket is no line.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use mavlink_node::{
    Command, Config, Fix, LogFile, Node, NodeTime, Parameter, Parameters, Request, RequestKind,
    Test,
};
use sample_log::{Record, Sample, SampleLog};
use timebase::{ClockState, Cycles, StampedByte};

/// How the node's clock stands.
#[derive(Clone, Copy, Debug)]
pub enum Clock {
    /// Not set.
    Unset,
    /// This host's UTC and so many ns more.
    HostPlus(i64),
}

/// What a node is like, and what befalls it.
#[derive(Clone, Copy, Debug)]
pub struct Behaviour {
    /// How its clock stands.
    pub clock: Clock,
    /// Its system.
    pub system_id: u8,
    /// Its parameters, in the order of [`Parameter::ALL`]; those of the log are the log's own.
    pub parameters: [f32; 6],
    /// What befalls it so long after a test began.
    pub mishap: Option<(Duration, Mishap)>,
}

/// What can befall a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mishap {
    /// It starts anew; its clock is set again after half a second.
    Reboots,
    /// It does not hear its receiver any more.
    LosesReceiver,
    /// It says nothing any more.
    FallsSilent,
    /// The third piece of its log is lost on the way.
    LosesALogPiece,
    /// It does not hear that the test ends.
    MissesTheEnd,
}

impl From<Clock> for Behaviour {
    /// System 1, which runs pixclock and stays well.
    fn from(clock: Clock) -> Self {
        Self {
            clock,
            system_id: 1,
            parameters: [0.0, 50.0, 115_200.0, 1.0, 0.0, 0.0],
            mishap: None,
        }
    }
}

/// Serves each connection until it is closed, as long as the process lives.
///
/// # Errors
///
/// When the listener fails.
pub fn serve(listener: &TcpListener, behaviour: impl Into<Behaviour>) -> io::Result<()> {
    let behaviour = behaviour.into();
    for stream in listener.incoming() {
        let stream = stream?;
        thread::spawn(move || converse(stream, behaviour));
    }
    Ok(())
}

/// How long a clock takes to be set after a reboot.
const SET_AGAIN: Duration = Duration::from_millis(500);

/// One connection: answers, and what is told once a second.
fn converse(mut stream: TcpStream, mut behaviour: Behaviour) -> io::Result<()> {
    let config = Config {
        system_id: behaviour.system_id,
        ..Config::default()
    };
    let mut boot = Instant::now();
    let mut node = Node::new(config);
    let mut memory = [Record::EMPTY; 1_024];
    let mut held = Held {
        parameters: behaviour.parameters,
        log: SampleLog::new(&mut memory, &mut []),
    };
    let mut next_second = Duration::ZERO;
    let mut test_began = None;
    let mut set_again = Duration::ZERO;
    let mut fix = Some(Fix {
        fix_type: 3,
        fix_ok: true,
        ..Fix::default()
    });
    let mut is_silent = false;
    let mut misses_the_end = false;
    let mut pieces_until_lost: Option<u32> = None;
    let mut buffer = [0; 512];
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(5)))?;
    loop {
        let is_due = |(after, _): &mut (Duration, Mishap)| {
            test_began.is_some_and(|began: Instant| began.elapsed() >= *after)
        };
        match behaviour.mishap.take_if(is_due) {
            Some((_, Mishap::Reboots)) => {
                (boot, node) = (Instant::now(), Node::new(config));
                (next_second, set_again) = (Duration::ZERO, SET_AGAIN);
                held.log.clear();
            }
            Some((_, Mishap::LosesReceiver)) => fix = None,
            Some((_, Mishap::FallsSilent)) => is_silent = true,
            Some((_, Mishap::LosesALogPiece)) => pieces_until_lost = Some(2),
            Some((_, Mishap::MissesTheEnd)) => misses_the_end = true,
            None => {}
        }
        let clock = if boot.elapsed() < set_again {
            Clock::Unset
        } else {
            behaviour.clock
        };
        if boot.elapsed() >= next_second && !is_silent {
            next_second += Duration::from_secs(1);
            node.handle_timeout(Cycles::from_nanos(boot.elapsed().as_nanos() as u64));
            let now = time(clock, boot.elapsed());
            stream.write_all(&node.heartbeat(now))?;
            stream.write_all(&node.system_time(now))?;
            stream.write_all(&node.gps_raw_int(now, fix.as_ref()))?;
        }
        let bytes = match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(length) => buffer.iter().take(length),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                continue;
            }
            Err(error) => return Err(error),
        };
        if is_silent {
            continue;
        }
        let now = Cycles::from_nanos(boot.elapsed().as_nanos() as u64);
        for &byte in bytes {
            let stamp = now.stamp();
            if let Some(request) = node.push(StampedByte { stamp, byte }, now) {
                let is = |test| matches!(request.kind, RequestKind::Command(command) if command.meaning == Ok(test));
                if is(Test::Begins) {
                    test_began = Some(Instant::now());
                }
                if is(Test::Ends) && misses_the_end {
                    continue;
                }
                let ago = boot
                    .elapsed()
                    .saturating_sub(Duration::from_nanos(request.arrival.as_nanos()));
                let mut at_arrival = time(clock, boot.elapsed());
                at_arrival.utc_ns = at_arrival.utc_ns.map(|ns| ns - ago.as_nanos() as i64);
                at_arrival.boot_us = request.arrival.as_micros();
                held.act(&request, at_arrival);
                stream.write_all(&node.answer(&request, at_arrival))?;
            }
        }
        while let Some(frame) = node.poll(&held) {
            let is_lost = match pieces_until_lost {
                // Pieces of a log are as long as frames come.
                Some(left) if frame.len() > 90 => {
                    pieces_until_lost = left.checked_sub(1);
                    left == 0
                }
                _ => false,
            };
            if !is_lost {
                stream.write_all(&frame)?;
            }
        }
    }
}

/// What a node has beside the time.
struct Held<'a> {
    parameters: [f32; 6],
    log: SampleLog<'a>,
}

impl Held<'_> {
    /// Does what is asked, as the firmware does.
    fn act(&mut self, request: &Request, time: NodeTime) {
        match request.kind {
            RequestKind::Ping { time_usec, seq } => {
                // A full log says so by its parameter.
                let _ = self.log.record(&Sample {
                    board_ns: time.rtos_ns(),
                    ping_us: time_usec,
                    sequence: seq,
                    state: match time.utc_ns {
                        Some(_) => ClockState::Set,
                        None => ClockState::Unset,
                    },
                    uncertainty_ns: u32::MAX,
                });
            }
            RequestKind::Command(Command {
                meaning: Ok(test), ..
            }) => self.log.handle_test(test),
            RequestKind::EraseLog => self.log.clear(),
            RequestKind::Command(_) | RequestKind::TimeSync { .. } => {}
        }
    }
}

impl Parameters for Held<'_> {
    fn parameter(&self, parameter: Parameter) -> f32 {
        match parameter {
            Parameter::LogLen => self.log.len() as f32,
            Parameter::LogMissed => self.log.missed() as f32,
            built_in => self.parameters[usize::from(built_in.index())],
        }
    }
}

impl LogFile for Held<'_> {
    fn log_len(&self) -> u32 {
        self.log.file_len()
    }

    fn log_began_ns(&self) -> Option<i64> {
        self.log.began_ns()
    }

    fn read_log(&self, offset: u32, out: &mut [u8]) -> usize {
        self.log.read_file(offset, out)
    }
}

fn time(clock: Clock, since_boot: Duration) -> NodeTime {
    let host = || {
        SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default()
    };
    NodeTime {
        boot_us: since_boot.as_micros() as u64,
        utc_ns: match clock {
            Clock::Unset => None,
            Clock::HostPlus(ns) => Some(host().as_nanos() as i64 + ns),
        },
    }
}
