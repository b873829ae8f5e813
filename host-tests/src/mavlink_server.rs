//! A node on a TCP port, with this host's clock: it stands for a board in tests of the tools at the
//! other end of the line, mishaps included.
//!
//! *Design.* The crates that the firmware uses, fed from a socket; one node and one log a
//! connection, as each line of the board has its own.
//!
//! *Limits.* Its stamps are taken when a read returns, not when a byte arrives. What takes many
//! frames is sent at once: a socket is no line.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use mavlink_node::{
    Command, Config, Fix, LogFile, Node, NodeTime, Order, Parameter, Parameters, Request,
    RequestKind, StatusLine, StatusWriter, Test,
};
use sample_log::{Record, Sample, SampleLog};
use timebase::{ClockState, Cycles, StampedByte};

/// How the node's clock stands.
#[derive(Clone, Copy, Debug)]
pub enum Clock {
    /// Not set.
    Unset,
    /// This host's UTC, and this much more, in ns.
    HostPlus(i64),
}

/// What a node is like, and what happens to it.
#[derive(Clone, Copy, Debug)]
pub struct Behaviour {
    /// How its clock stands.
    pub clock: Clock,
    /// Its system.
    pub system_id: u8,
    /// Its parameters, in the order of [`Parameter::ALL`]; those of the log are the log's own.
    pub parameters: [f32; 6],
    /// What happens to it, and how long after a test began.
    pub mishap: Option<(Duration, Mishap)>,
}

/// What can happen to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mishap {
    /// It starts anew; its clock is set again after half a second.
    Reboots,
    /// Its receiver falls silent.
    LosesReceiver,
    /// It sends nothing any more.
    FallsSilent,
    /// The third piece of its log is lost on the way.
    LosesALogPiece,
    /// It does not receive the command that ends the test.
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

/// One connection: answers, and broadcasts once a second.
fn converse(mut stream: TcpStream, behaviour: Behaviour) -> io::Result<()> {
    let mut memory = [Record::EMPTY; 1_024];
    let mut board = Board::new(behaviour, SampleLog::new(&mut memory, &mut []));
    let mut buffer = [0; 512];
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(5)))?;
    loop {
        board.suffer();
        board.broadcast(&mut stream)?;
        match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(length) => board.receive(buffer.get(..length).unwrap_or_default(), &mut stream)?,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error),
        }
    }
}

/// A board with one line.
struct Board<'a> {
    behaviour: Behaviour,
    node: Node,
    held: Held<'a>,
    booted: Instant,
    /// When the next broadcasts are due, since boot.
    next_second: Duration,
    /// When the clock is set, since boot.
    set_again: Duration,
    test_began: Option<Instant>,
    fix: Option<Fix>,
    is_silent: bool,
    misses_the_end: bool,
    /// Pieces of the log that arrive before one is lost.
    pieces_until_lost: Option<u32>,
}

impl<'a> Board<'a> {
    fn new(behaviour: Behaviour, log: SampleLog<'a>) -> Self {
        Self {
            behaviour,
            node: node(behaviour),
            held: Held {
                parameters: behaviour.parameters,
                log,
            },
            booted: Instant::now(),
            next_second: Duration::ZERO,
            set_again: Duration::ZERO,
            test_began: None,
            fix: Some(Fix {
                fix_type: 3,
                fix_ok: true,
                ..Fix::default()
            }),
            is_silent: false,
            misses_the_end: false,
            pieces_until_lost: None,
        }
    }

    /// The mishap begins, if it is due.
    fn suffer(&mut self) {
        let began = self.test_began;
        let is_due = |(after, _): &mut (Duration, Mishap)| {
            began.is_some_and(|began| began.elapsed() >= *after)
        };
        match self.behaviour.mishap.take_if(is_due) {
            Some((_, Mishap::Reboots)) => {
                (self.booted, self.node) = (Instant::now(), node(self.behaviour));
                (self.next_second, self.set_again) = (Duration::ZERO, SET_AGAIN);
                self.held.log.clear();
            }
            Some((_, Mishap::LosesReceiver)) => self.fix = None,
            Some((_, Mishap::FallsSilent)) => self.is_silent = true,
            Some((_, Mishap::LosesALogPiece)) => self.pieces_until_lost = Some(2),
            Some((_, Mishap::MissesTheEnd)) => self.misses_the_end = true,
            None => {}
        }
    }

    /// Sends what is sent each second, if it is due.
    fn broadcast(&mut self, stream: &mut TcpStream) -> io::Result<()> {
        if self.is_silent || self.booted.elapsed() < self.next_second {
            return Ok(());
        }
        self.next_second += Duration::from_secs(1);
        self.node.handle_timeout(self.cycles());
        let now = self.time();
        stream.write_all(&self.node.heartbeat(now))?;
        stream.write_all(&self.node.system_time(now, true))?;
        stream.write_all(&self.node.gps_raw_int(now, self.fix.as_ref()))
    }

    /// Takes bytes, and sends the answers.
    fn receive(&mut self, bytes: &[u8], stream: &mut TcpStream) -> io::Result<()> {
        if self.is_silent {
            return Ok(());
        }
        let now = self.cycles();
        for &byte in bytes {
            let stamp = now.stamp();
            if let Some(request) = self.node.push(StampedByte { stamp, byte }, now) {
                self.answer(&request, stream)?;
            }
        }
        while let Some(frame) = self.node.poll(&self.held) {
            if !self.is_lost(&frame) {
                stream.write_all(&frame)?;
            }
        }
        Ok(())
    }

    /// Does what is asked, and answers, unless the board does not receive it.
    fn answer(&mut self, request: &Request, stream: &mut TcpStream) -> io::Result<()> {
        let test = match request.kind {
            RequestKind::Command(command) => command.meaning.ok(),
            _ => None,
        };
        match test {
            Some(Order::Test(Test::Begins)) => self.test_began = Some(Instant::now()),
            Some(Order::Test(Test::Ends)) if self.misses_the_end => return Ok(()),
            Some(Order::Test(_) | Order::Describe(_) | Order::Bootloader) | None => {}
        }
        let since_arrival = self
            .booted
            .elapsed()
            .saturating_sub(Duration::from_nanos(request.arrival.as_nanos()));
        let now = self.time();
        let at_arrival = NodeTime {
            boot: request.arrival,
            utc_ns: now.utc_ns.map(|ns| ns - since_arrival.as_nanos() as i64),
        };
        self.held.act(request, at_arrival);
        stream.write_all(&self.node.answer(request, at_arrival))
    }

    /// Whether the line loses this frame.
    fn is_lost(&mut self, frame: &[u8]) -> bool {
        match self.pieces_until_lost {
            // A longer frame is a piece of the log.
            Some(left) if frame.len() > 90 => {
                self.pieces_until_lost = left.checked_sub(1);
                left == 0
            }
            _ => false,
        }
    }

    fn cycles(&self) -> Cycles {
        Cycles::from_nanos(self.booted.elapsed().as_nanos() as u64)
    }

    /// The time that the board has now.
    fn time(&self) -> NodeTime {
        let since_boot = self.booted.elapsed();
        let utc_ns = match self.behaviour.clock {
            Clock::HostPlus(ns) if since_boot >= self.set_again => {
                let host = SystemTime::now()
                    .duration_since(UNIX_EPOCH)
                    .unwrap_or_default();
                Some(host.as_nanos() as i64 + ns)
            }
            Clock::HostPlus(_) | Clock::Unset => None,
        };
        NodeTime {
            boot: Cycles::from_micros(since_boot.as_micros() as u64),
            utc_ns,
        }
    }
}

fn node(behaviour: Behaviour) -> Node {
    Node::new(Config {
        system_id: behaviour.system_id,
        ..Config::default()
    })
}

/// What a board has beside the time.
struct Held<'a> {
    parameters: [f32; 6],
    log: SampleLog<'a>,
}

impl Held<'_> {
    /// Does what is asked, as the firmware does.
    fn act(&mut self, request: &Request, time: NodeTime) {
        match request.kind {
            RequestKind::Ping { time_usec, seq } => {
                // A parameter has the number of samples for which there was no room.
                let _ = self.log.record(&Sample {
                    board_ns: time.rtos_ns(),
                    ping_us: time_usec,
                    sequence: seq,
                    state: match time.utc_ns {
                        Some(_) => ClockState::Set,
                        None => ClockState::Unset,
                    },
                    uncertainty_ns: match time.utc_ns {
                        Some(_) => 1_000,
                        None => u64::MAX,
                    },
                });
            }
            RequestKind::Command(Command {
                meaning: Ok(Order::Test(test)),
                ..
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
            Parameter::Fault => 0.0,
            other => {
                let built_in = self.parameters.get(usize::from(other.index()));
                built_in.copied().unwrap_or(0.0)
            }
        }
    }
}

impl StatusLine for Held<'_> {
    fn write_status(&self, line: &mut StatusWriter<'_>) {
        line.word("state", "set");
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
