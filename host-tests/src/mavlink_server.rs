//! A node on a TCP port, with this host's clock: the board's stand-in for tests of
//! what runs at the other end of the line.
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
    Ask, Command, Config, GpsFix, Holdings, Node, NodeTime, Parameter, Request, Test,
};
use sample_log::{Record, Sample, SampleLog, State, csv};
use timebase::{Cycles, StampedByte};

/// How the node's clock stands.
#[derive(Clone, Copy, Debug)]
pub enum Clock {
    /// Not set.
    Unset,
    /// This host's UTC and so many ns more.
    HostPlus(i64),
}

/// Serves each connection until it is closed, as long as the process lives.
///
/// # Errors
///
/// When the listener fails.
pub fn serve(listener: &TcpListener, clock: Clock) -> io::Result<()> {
    for stream in listener.incoming() {
        let stream = stream?;
        thread::spawn(move || converse(stream, clock));
    }
    Ok(())
}

/// One connection: answers, and what is told once a second.
fn converse(mut stream: TcpStream, clock: Clock) -> io::Result<()> {
    let boot = Instant::now();
    let mut node = Node::new(Config::default());
    let mut memory = [Record::EMPTY; 1_024];
    let mut held = Held {
        clock,
        log: SampleLog::new(&mut memory, &mut []),
    };
    let mut next_second = Duration::ZERO;
    let mut buffer = [0; 512];
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(5)))?;
    loop {
        if boot.elapsed() >= next_second {
            next_second += Duration::from_secs(1);
            let now = time(clock, boot.elapsed());
            stream.write_all(&node.heartbeat(now))?;
            stream.write_all(&node.system_time(now))?;
            stream.write_all(&node.gps_raw_int(now, &GpsFix::NONE))?;
        }
        let bytes = match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(length) => buffer.iter().take(length),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                continue;
            }
            Err(error) => return Err(error),
        };
        let now = Cycles::from_nanos(boot.elapsed().as_nanos() as u64);
        for &byte in bytes {
            let stamp = now.stamp();
            if let Some(request) = node.receive(StampedByte { stamp, byte }, now) {
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
            stream.write_all(&frame)?;
        }
    }
}

/// What a node has beside the time.
struct Held<'a> {
    clock: Clock,
    log: SampleLog<'a>,
}

impl Held<'_> {
    /// Does what is asked, as the firmware does.
    fn act(&mut self, request: &Request, time: NodeTime) {
        match request.ask {
            Ask::Ping { time_usec, seq } => {
                // A full log says so by its parameter.
                let _ = self.log.record(&Sample {
                    board_ns: time.rtos_ns(),
                    ping_us: time_usec,
                    sequence: seq,
                    state: match time.utc_ns {
                        Some(_) => State::Set,
                        None => State::Unset,
                    },
                    uncertainty_ns: u32::MAX,
                });
            }
            Ask::Command(Command {
                meaning: Ok(Test::Ends),
                ..
            }) => self.log.freeze(),
            Ask::Command(Command {
                meaning: Ok(Test::Begins),
                ..
            })
            | Ask::EraseLog => self.log.clear(),
            Ask::Command(_) | Ask::TimeSync { .. } => {}
        }
    }
}

impl Holdings for Held<'_> {
    fn parameter(&self, parameter: Parameter) -> f32 {
        let value = match parameter {
            Parameter::Way => 0,
            Parameter::TickUs => 50,
            Parameter::GpsBaud => 115_200,
            Parameter::Source => u32::from(!matches!(self.clock, Clock::Unset)),
            Parameter::LogLen => self.log.len(),
            Parameter::LogMissed => self.log.missed(),
        };
        value as f32
    }

    fn log_len(&self) -> u32 {
        csv::file_len(self.log.len())
    }

    fn log_began_ns(&self) -> Option<i64> {
        let first = self.log.get(0)?;
        (first.state != State::Unset).then_some(first.board_ns)
    }

    fn read_log(&self, offset: u32, out: &mut [u8]) -> usize {
        csv::read(offset, out, self.log.len(), |index| self.log.get(index))
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
