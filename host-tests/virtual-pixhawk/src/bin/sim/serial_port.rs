//! The board's USB as a serial port of this host.
//!
//! *Purpose.* A [`SerialPort`] has a name that any program opens as it opens `/dev/ttyACM0`.
//!
//! *Design.* A pseudo-terminal, of which this program keeps the controlling end: what a program writes to the other
//! one, the board's USB host sends, and what the host receives can be read there. The host's port is open while a
//! program has the pseudo-terminal open; what a program does not take, the host does not ask the board for; and what
//! the board does not take stays with the program.
//!
//! *Limits.* The line's settings mean nothing, as on USB; DTR is down while nobody has the port open and cannot be
//! lowered apart from that. Where there are no pseudo-terminals (Windows), none is opened.

use std::fmt;
use std::path::PathBuf;

use virtual_pixhawk::Pixhawk;

use terminal::Terminal;

/// Bytes that are taken from the program at once.
const CHUNK: usize = 512;
/// Nothing is taken from the program while the board has not taken this many bytes.
const AHEAD: usize = 2_048;

/// A pseudo-terminal.
#[derive(Debug)]
pub struct SerialPort {
    terminal: Terminal,
    name: PathBuf,
    /// What the program has not taken.
    waiting: Vec<u8>,
    /// The host has room for more from the program.
    has_room: bool,
}

/// Its address as other verbs take it.
impl fmt::Display for SerialPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "serial:{}", self.name.display())
    }
}

impl SerialPort {
    /// One that no program has open.
    ///
    /// # Errors
    ///
    /// This system has none, or none left.
    pub fn open() -> anyhow::Result<Self> {
        let (terminal, name) = Terminal::open()?;
        Ok(Self {
            terminal,
            name,
            waiting: Vec::new(),
            has_room: false,
        })
    }

    /// Moves what is there between the program and the host at the USB of `board`.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn exchange(&mut self, board: &mut Pixhawk) -> anyhow::Result<()> {
        let (is_open, sent) = if self.has_room {
            let read = self.terminal.read();
            (read.is_some(), read.unwrap_or_default())
        } else {
            (self.terminal.is_open(), Vec::new())
        };
        let takes = self.waiting.is_empty();
        let at = board.now();
        let (received, has_room) = board.with_usb(move |host| {
            host.open(is_open);
            host.read(takes);
            host.send(at, &sent);
            let has_room = host.is_configured() && host.unsent() < AHEAD;
            (host.take_received(), has_room)
        })?;
        self.has_room = has_room;
        self.waiting.extend(received.iter().map(|one| one.byte));
        if is_open {
            let taken = self.terminal.write(&self.waiting);
            self.waiting.drain(..taken);
        } else {
            self.waiting.clear();
        }
        Ok(())
    }
}

#[cfg(unix)]
mod terminal {
    use super::{CHUNK, PathBuf};

    use std::ffi::OsString;
    use std::fs::File;
    use std::io::{self, ErrorKind, Read as _, Write as _};
    use std::os::unix::ffi::OsStringExt as _;

    use anyhow::Context as _;
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open};
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

    /// The controlling end.
    #[derive(Debug)]
    pub(super) struct Terminal(File);

    impl Terminal {
        pub(super) fn open() -> anyhow::Result<(Self, PathBuf)> {
            let why = "no pseudo-terminal can be had on this system";
            let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).context(why)?;
            grantpt(&ours).context(why)?;
            unlockpt(&ours).context(why)?;
            let name = ptsname(&ours, Vec::new()).context(why)?.into_bytes();
            let name = PathBuf::from(OsString::from_vec(name));
            fcntl_setfl(&ours, fcntl_getfl(&ours)? | OFlags::NONBLOCK)?;
            // Neither echo nor lines until a program sets it up itself; and closed again it is a port that nobody has open.
            let theirs = open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())?;
            let mut settings = tcgetattr(&theirs)?;
            settings.make_raw();
            tcsetattr(&theirs, OptionalActions::Now, &settings)?;
            Ok((Self(File::from(ours)), name))
        }

        /// Whether a program has the other end open.
        pub(super) fn is_open(&self) -> bool {
            let mut ours = [PollFd::new(&self.0, PollFlags::IN)];
            let found = poll(&mut ours, Some(&Timespec::default()));
            found.is_ok() && !ours[0].revents().contains(PollFlags::HUP)
        }

        /// What the program has sent, a chunk of it; none if none has the other end open.
        pub(super) fn read(&mut self) -> Option<Vec<u8>> {
            let mut chunk = [0; CHUNK];
            match self.0.read(&mut chunk) {
                Ok(count @ 1..) => Some(chunk[..count].to_vec()),
                Err(error) if is_later(&error) => Some(Vec::new()),
                _ => None,
            }
        }

        /// How many of `bytes` the program's end has room for.
        pub(super) fn write(&mut self, bytes: &[u8]) -> usize {
            if bytes.is_empty() {
                return 0;
            }
            // Where it fails, nobody has it open: the next read finds out.
            self.0.write(bytes).unwrap_or_default()
        }
    }

    fn is_later(error: &io::Error) -> bool {
        matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn a_program_that_opens_it_is_noticed_and_bytes_go_both_ways_as_they_are() {
            let (mut ours, name) = Terminal::open().unwrap();
            assert!(!ours.is_open());
            assert_eq!(ours.read(), None);
            let open = || File::options().read(true).write(true).open(&name);
            let mut program = open().unwrap();
            assert!(ours.is_open());
            assert_eq!(ours.read(), Some(Vec::new()));
            // What a terminal would echo, change or act upon.
            let every: Vec<u8> = (0..=255).collect();
            program.write_all(&every).unwrap();
            assert_eq!(ours.read().unwrap(), every);
            assert_eq!(ours.write(&every), every.len());
            let mut received = vec![0; every.len()];
            program.read_exact(&mut received).unwrap();
            assert_eq!(received, every);
            assert_eq!(ours.read(), Some(Vec::new()));
            // The last words are read before it is closed.
            program.write_all(b"bye").unwrap();
            drop(program);
            assert_eq!(ours.read().unwrap(), b"bye");
            assert_eq!(ours.read(), None);
            let again = open().unwrap();
            assert!(ours.is_open());
            drop(again);
        }

        #[test]
        fn a_program_that_does_not_read_stops_the_board_and_not_this_program() {
            let (mut ours, name) = Terminal::open().unwrap();
            let _program = File::options().read(true).write(true).open(&name).unwrap();
            let chunk = [0; CHUNK];
            assert!((0..10_000).any(|_| ours.write(&chunk) < CHUNK));
            assert_eq!(ours.write(&chunk), 0);
        }
    }
}

#[cfg(not(unix))]
mod terminal {
    use super::PathBuf;

    /// None.
    #[derive(Debug)]
    pub(super) enum Terminal {}

    impl Terminal {
        pub(super) fn open() -> anyhow::Result<(Self, PathBuf)> {
            anyhow::bail!("this system has no pseudo-terminals")
        }

        pub(super) fn is_open(&self) -> bool {
            match *self {}
        }

        pub(super) fn read(&mut self) -> Option<Vec<u8>> {
            match *self {}
        }

        pub(super) fn write(&mut self, _: &[u8]) -> usize {
            match *self {}
        }
    }
}
