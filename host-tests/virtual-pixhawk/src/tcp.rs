//! A serial line that programs on this host can talk to.
//!
//! *Purpose.* The far end of the board's MAVLink port as a TCP server on the
//! loopback interface, for ground stations and for `xtask ping`.
//!
//! *Design.* Any number of clients at once: each receives everything, as on a radio,
//! and what they send is put on the line in the order in which it is found. The
//! sockets are looked at once a ms of true time, for both ways, and never waited
//! for. The line goes at the speed at which the board talks, and no more is taken
//! from the clients than it carries: a client that sends faster finds its socket
//! full, and those beside it have their turns. A client that has ended its own
//! sending goes on to receive.
//!
//! *Limits.* Two clients that send at the same time can have their frames cut into
//! each other where a frame comes in two reads. A client that does not read is cut
//! off when its socket is full.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::Context as _;
use world::{Sent, Talker, Transmission, WorldNanos};

const LOOK_EVERY_NS: u64 = 1_000_000;
/// What is taken from a client at once: the longest frame of MAVLink is 280 bytes.
const CHUNK: usize = 512;
/// Nothing is taken while the line is busy for longer than this.
const AHEAD_NS: u64 = 5_000_000;
/// The speed of the line until the board has sent something.
const FIRST_BAUD: u32 = 115_200;

/// A TCP server as the far end of a line.
#[derive(Debug)]
pub struct TcpLine {
    listener: TcpListener,
    clients: Vec<Client>,
    /// What the board has sent since the last look.
    sent: Vec<u8>,
    baud: u32,
    next_look: WorldNanos,
    line_free: WorldNanos,
    counts: Arc<Counts>,
}

/// A program that is connected.
#[derive(Debug)]
struct Client {
    stream: TcpStream,
    /// It will send nothing more.
    has_ended: bool,
}

/// How many clients have come and gone since the start.
#[derive(Debug, Default)]
struct Counts {
    came: AtomicU32,
    left: AtomicU32,
}

/// Who comes to a [`TcpLine`] and leaves it, for someone who does not own it.
#[derive(Debug)]
pub struct Visits {
    counts: Arc<Counts>,
    seen: (u32, u32),
}

impl Visits {
    /// How many clients have come and how many have left since the last call.
    pub fn take(&mut self) -> (u32, u32) {
        let Counts { came, left } = &*self.counts;
        let now = (came.load(Ordering::Relaxed), left.load(Ordering::Relaxed));
        let before = std::mem::replace(&mut self.seen, now);
        (now.0.wrapping_sub(before.0), now.1.wrapping_sub(before.1))
    }
}

impl TcpLine {
    /// Listens on `port` of 127.0.0.1.
    ///
    /// # Errors
    ///
    /// The port cannot be had.
    pub fn listen(port: u16) -> anyhow::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
            .with_context(|| format!("listening on tcp:127.0.0.1:{port}"))?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            clients: Vec::new(),
            sent: Vec::new(),
            baud: FIRST_BAUD,
            next_look: WorldNanos(0),
            line_free: WorldNanos(0),
            counts: Arc::default(),
        })
    }

    /// Who comes and leaves from now on.
    #[must_use]
    pub fn visits(&self) -> Visits {
        let counts = Arc::clone(&self.counts);
        let seen = (0, 0);
        let mut visits = Visits { counts, seen };
        visits.take();
        visits
    }

    /// The port that it listens on.
    ///
    /// # Errors
    ///
    /// The system does not say.
    pub fn port(&self) -> anyhow::Result<u16> {
        Ok(self.listener.local_addr()?.port())
    }

    fn welcome(&mut self) {
        while let Ok((client, _)) = self.listener.accept() {
            // Without these a socket could stop the run, or delay an answer.
            if client.set_nonblocking(true).is_ok() && client.set_nodelay(true).is_ok() {
                self.clients.push(Client {
                    stream: client,
                    has_ended: false,
                });
                self.counts.came.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    fn write(&mut self) {
        let sent = std::mem::take(&mut self.sent);
        if !sent.is_empty() {
            self.clients
                .retain_mut(|client| client.stream.write_all(&sent).is_ok());
        }
    }

    fn read(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut chunk = [0; CHUNK];
        self.clients.retain_mut(|client| {
            if client.has_ended {
                return true;
            }
            match client.stream.read(&mut chunk) {
                // It may still listen; a write finds out.
                Ok(0) => {
                    client.has_ended = true;
                    true
                }
                Ok(count) => {
                    bytes.extend(&chunk[..count]);
                    true
                }
                Err(error) => {
                    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
                }
            }
        });
        bytes
    }
}

impl Talker for TcpLine {
    fn next_event(&self) -> Option<WorldNanos> {
        Some(self.next_look)
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        if now < self.next_look {
            return None;
        }
        self.next_look = now.plus(LOOK_EVERY_NS);
        self.welcome();
        let connected = self.clients.len();
        self.write();
        let is_full = self.line_free > now.plus(AHEAD_NS);
        let bytes = if is_full { Vec::new() } else { self.read() };
        let left = connected.saturating_sub(self.clients.len()) as u32;
        self.counts.left.fetch_add(left, Ordering::Relaxed);
        if bytes.is_empty() {
            return None;
        }
        let transmission = Transmission {
            start: now.max(self.line_free),
            bytes,
            baud: self.baud,
        };
        self.line_free = transmission.end();
        Some(transmission)
    }

    fn handle_bytes(&mut self, _: WorldNanos, baud: u32, bytes: &[u8]) {
        self.baud = baud;
        self.sent.extend(bytes);
    }

    fn truth(&self) -> &[Sent] {
        &[]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// Polls `line` as a run does, in time that is not the host's, until it has
    /// something or ten seconds of the host's have passed.
    fn poll_patiently(line: &mut TcpLine) -> Option<Transmission> {
        (0..10_000).find_map(|_| {
            std::thread::sleep(Duration::from_millis(1));
            line.next_event().and_then(|next| line.poll(next))
        })
    }

    fn client(line: &TcpLine) -> TcpStream {
        let client = TcpStream::connect((Ipv4Addr::LOCALHOST, line.port().unwrap())).unwrap();
        client
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        client
    }

    #[test]
    fn every_client_receives_the_board_and_the_board_every_client() {
        let mut line = TcpLine::listen(0).unwrap();
        let mut clients = [client(&line), client(&line)];
        for (client, word) in clients.iter_mut().zip([b"one", b"two"]) {
            client.write_all(word).unwrap();
            assert_eq!(poll_patiently(&mut line).unwrap().bytes, word);
        }
        line.handle_bytes(WorldNanos(0), 57_600, b"hello");
        assert_eq!(line.poll(line.next_event().unwrap()), None);
        for client in &mut clients {
            let mut word = [0; 5];
            client.read_exact(&mut word).unwrap();
            assert_eq!(&word, b"hello");
        }
        // From now on the line goes as fast as the board talks.
        clients[0].write_all(b"x").unwrap();
        assert_eq!(poll_patiently(&mut line).unwrap().baud, 57_600);
    }

    #[test]
    fn a_client_that_has_gone_makes_room_for_the_next() {
        let mut line = TcpLine::listen(0).unwrap();
        let mut visits = line.visits();
        for word in [b"one", b"two"] {
            client(&line).write_all(word).unwrap();
            assert_eq!(poll_patiently(&mut line).unwrap().bytes, word);
        }
        // Their sockets refuse what is written after the first that finds nobody.
        for _ in 0..100 {
            std::thread::sleep(Duration::from_millis(1));
            line.handle_bytes(WorldNanos(0), 57_600, b"lost");
            assert_eq!(line.poll(line.next_event().unwrap()), None);
        }
        assert!(line.clients.is_empty());
        assert_eq!(visits.take(), (2, 2));
        assert_eq!(visits.take(), (0, 0));
    }

    #[test]
    fn no_more_is_taken_than_the_line_carries_and_each_has_its_turn() {
        let mut line = TcpLine::listen(0).unwrap();
        let mut flooding = client(&line);
        flooding.set_nonblocking(true).unwrap();
        let mut other = client(&line);
        let mut sent = 0;
        let mut taken = 0;
        let mut received = false;
        // A second of the world's.
        while line.next_event().unwrap() < WorldNanos(1_000_000_000) {
            sent += flooding.write(&[0; 4_096]).unwrap_or(0);
            if line.next_event().unwrap() == WorldNanos(500_000_000) {
                other.write_all(b"hello").unwrap();
            }
            if let Some(transmission) = line.poll(line.next_event().unwrap()) {
                taken += transmission.bytes.len();
                received |= transmission.bytes.windows(5).any(|bytes| bytes == b"hello");
            }
        }
        assert!(received);
        // 11 520 bytes a second, and what was taken ahead.
        assert!((11_000..13_000).contains(&taken), "{taken} of {sent}");
        assert!(sent > taken, "the rest waits in the sockets");
    }

    #[test]
    fn who_has_ended_its_sending_goes_on_to_receive() {
        let mut line = TcpLine::listen(0).unwrap();
        let mut half = client(&line);
        half.write_all(b"all").unwrap();
        half.shutdown(std::net::Shutdown::Write).unwrap();
        assert_eq!(poll_patiently(&mut line).unwrap().bytes, b"all");
        for word in [b"one", b"two"] {
            std::thread::sleep(Duration::from_millis(1));
            line.handle_bytes(WorldNanos(0), 57_600, word);
            assert_eq!(line.poll(line.next_event().unwrap()), None);
        }
        let mut received = [0; 6];
        half.read_exact(&mut received).unwrap();
        assert_eq!(&received, b"onetwo");
    }

    #[test]
    fn what_is_sent_waits_until_the_line_is_free() {
        let mut line = TcpLine::listen(0).unwrap();
        let mut client = client(&line);
        client.write_all(&[0; 100]).unwrap();
        let first = poll_patiently(&mut line).unwrap();
        client.write_all(&[0]).unwrap();
        let second = poll_patiently(&mut line).unwrap();
        assert!(second.start >= first.end());
    }
}
