//! Where a node is, and the line to it.
//!
//! *Purpose.* An ADDR of the command line, `tcp:HOST:PORT`, `udp:HOST:PORT` or
//! `serial:DEVICE[:BAUD]`, as something to read and write.
//!
//! *Design.* A read waits [`PATIENCE`] at most, so that the caller can look at the
//! time and at Ctrl-C while it waits for an answer.
//!
//! *Limits.* One address a name: the first one that can be connected.

use std::fmt;
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{TcpStream, UdpSocket};
use std::str::FromStr;
use std::time::Duration;

use anyhow::{Context, Result};
use serialport::SerialPort;

use crate::system;

/// The longest time that a read waits.
const PATIENCE: Duration = Duration::from_millis(20);

/// The baud rate of the node's serial lines.
const BAUD: u32 = 115_200;

/// Where a node is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// HOST:PORT of a TCP server.
    Tcp(String),
    /// HOST:PORT to send datagrams to.
    Udp(String),
    /// A serial device and its baud rate.
    Serial(String, u32),
}

/// What an address looks like, for the message about one that does not.
const ALLOWED: &str = "allowed: tcp:HOST:PORT, udp:HOST:PORT, serial:DEVICE[:BAUD], \
                       as in tcp:127.0.0.1:5760 or";

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = |what: &str| Err(format!("{what}; {ALLOWED} {}", system::SERIAL_LINE));
        let Some((kind, rest)) = text.split_once(':') else {
            return wrong("no kind of line before a colon");
        };
        match kind {
            "tcp" | "udp" => {
                let (host, port) = rest.rsplit_once(':').unwrap_or((rest, ""));
                if host.is_empty() {
                    return wrong("the host or the port is missing");
                }
                if !port.parse().is_ok_and(|port: u16| port != 0) {
                    return wrong(&format!("'{port}' is no port, 1 to 65535"));
                }
                let place = rest.to_owned();
                Ok(if kind == "tcp" {
                    Self::Tcp(place)
                } else {
                    Self::Udp(place)
                })
            }
            "serial" => {
                let (device, baud) = rest
                    .split_once(':')
                    .map_or((rest, None), |(d, b)| (d, Some(b)));
                if device.is_empty() {
                    return wrong("the device is missing");
                }
                match baud.map_or(Ok(BAUD), str::parse) {
                    Ok(baud) if baud > 0 => Ok(Self::Serial(device.to_owned(), baud)),
                    _ => wrong(&format!("'{}' is no baud rate", baud.unwrap_or_default())),
                }
            }
            other => wrong(&format!("'{other}' is no kind of line")),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(place) => write!(f, "tcp:{place}"),
            Self::Udp(place) => write!(f, "udp:{place}"),
            Self::Serial(device, baud) => write!(f, "serial:{device}:{baud}"),
        }
    }
}

/// An open line to a node.
pub enum Link {
    /// A TCP stream.
    Tcp(TcpStream),
    /// A serial line.
    Serial(Box<dyn SerialPort>),
    /// Datagrams.
    Datagrams(UdpSocket),
}

impl Link {
    /// Opens the line.
    ///
    /// # Errors
    ///
    /// When nothing listens there; the message has what to do.
    pub fn open(address: &Address) -> Result<Self> {
        Ok(match address {
            Address::Tcp(place) => {
                let stream = TcpStream::connect(place).with_context(|| {
                    format!("no node at {address} (`cargo xtask sim` starts one)")
                })?;
                Self::over(stream)?
            }
            Address::Udp(place) => {
                let socket = UdpSocket::bind("0.0.0.0:0")?;
                socket
                    .connect(place)
                    .with_context(|| format!("{address} cannot be reached"))?;
                socket.set_read_timeout(Some(PATIENCE))?;
                Self::Datagrams(socket)
            }
            Address::Serial(device, baud) => {
                let port = serialport::new(device, *baud).timeout(PATIENCE).open();
                Self::Serial(port.with_context(|| why_not_opened(device))?)
            }
        })
    }

    /// A line over a stream that is connected already.
    ///
    /// # Errors
    ///
    /// When the system does not let it be set up.
    pub fn over(stream: TcpStream) -> Result<Self> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        Ok(Self::Tcp(stream))
    }

    /// The same line once more, for a thread of its own.
    ///
    /// # Errors
    ///
    /// When the system has no more handles.
    pub fn another(&self) -> Result<Self> {
        Ok(match self {
            Self::Tcp(stream) => Self::Tcp(stream.try_clone()?),
            Self::Serial(port) => Self::Serial(port.try_clone()?),
            Self::Datagrams(socket) => Self::Datagrams(socket.try_clone()?),
        })
    }

    /// Sends `bytes`.
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn send(&mut self, bytes: &[u8]) -> Result<()> {
        match self {
            Self::Tcp(stream) => stream.write_all(bytes),
            Self::Serial(port) => port.write_all(bytes),
            Self::Datagrams(socket) => socket.send(bytes).map(drop),
        }
        .context("the line to the node is gone")
    }

    /// Reads what is there; nothing after [`PATIENCE`].
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn receive<'a>(&mut self, buffer: &'a mut [u8]) -> Result<&'a [u8]> {
        let end_is_an_end = |got| match got {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            got => got,
        };
        let got = match self {
            Self::Tcp(stream) => end_is_an_end(stream.read(buffer)),
            Self::Serial(port) => end_is_an_end(port.read(buffer)),
            Self::Datagrams(socket) => socket.recv(buffer),
        };
        match got {
            Ok(length) => Ok(&buffer[..length]),
            Err(error) if is_silence(&error) => Ok(&[]),
            Err(error) => Err(error).context("the line to the node is gone"),
        }
    }
}

/// What to do about a serial device that cannot be opened.
fn why_not_opened(device: &str) -> String {
    if system::has_serial_port(device) {
        format!(
            "{device} cannot be opened; if another program holds it (a ground station, \
             ModemManager), close that, and see that you may use serial ports"
        )
    } else {
        format!("there is no {device}; plug the adapter in, or name another device")
    }
}

/// Nothing came, which is no fault. The system reports a refused datagram on the next
/// read; the node may be there a moment later.
fn is_silence(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock
            | ErrorKind::TimedOut
            | ErrorKind::Interrupted
            | ErrorKind::ConnectionRefused
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses() {
        for (text, address) in [
            ("tcp:127.0.0.1:5760", Address::Tcp("127.0.0.1:5760".into())),
            ("tcp:[::1]:5760", Address::Tcp("[::1]:5760".into())),
            (
                "udp:board.local:14550",
                Address::Udp("board.local:14550".into()),
            ),
            (
                "serial:/dev/ttyACM0",
                Address::Serial("/dev/ttyACM0".into(), 115_200),
            ),
            ("serial:COM3", Address::Serial("COM3".into(), 115_200)),
            (
                "serial:/dev/tty.usbmodem1101:57600",
                Address::Serial("/dev/tty.usbmodem1101".into(), 57_600),
            ),
            (
                "serial:/dev/ttyUSB1:57600",
                Address::Serial("/dev/ttyUSB1".into(), 57_600),
            ),
        ] {
            assert_eq!(text.parse(), Ok(address));
        }
    }

    #[test]
    fn a_wrong_address_says_what_is_wrong_and_what_is_allowed() {
        for (text, wrong) in [
            ("localhost", "no kind"),
            ("http:localhost:80", "'http'"),
            ("tcp:localhost", "''"),
            ("tcp::5760", "host"),
            ("udp:localhost:99999", "'99999'"),
            ("udp:localhost:0", "'0'"),
            ("serial:", "device"),
            ("serial:/dev/ttyACM0:fast", "'fast'"),
            ("serial:/dev/ttyACM0:0", "'0'"),
        ] {
            let error = text.parse::<Address>().expect_err(text);
            assert!(error.contains(wrong), "{text}: {error}");
            assert!(
                error.contains("allowed: tcp:HOST:PORT, udp:"),
                "{text}: {error}"
            );
        }
    }
}
