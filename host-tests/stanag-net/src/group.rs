//! A group of nodes and stations that all receive each other's datagrams.

use std::fmt;
use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::str::FromStr;
use std::time::Duration;

use anyhow::Context as _;
use socket2::{Domain, Protocol, Socket, Type};

/// Who spoke to a unicast node and is answered: no more than these.
const PEERS: usize = 16;

/// Where a group meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place(pub SocketAddrV4);

impl Default for Place {
    /// 239.255.45.86:51017: no number is fixed by anybody.
    fn default() -> Self {
        Self(SocketAddrV4::new(Ipv4Addr::new(239, 255, 45, 86), 51_017))
    }
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = "wanted is GROUP:PORT, as in 239.255.45.86:51017 or 127.0.0.1:51017";
        let place: SocketAddrV4 = text.parse().map_err(|_| format!("`{text}`; {wanted}"))?;
        let is_known = place.ip().is_multicast() || place.ip().is_loopback();
        if !is_known || place.port() == 0 {
            return Err(format!(
                "`{text}` is neither multicast nor loopback; {wanted}"
            ));
        }
        Ok(Self(place))
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// One member's sockets.
#[derive(Debug)]
pub struct Group {
    incoming: UdpSocket,
    outgoing: UdpSocket,
    to: Vec<SocketAddr>,
    /// A unicast node learns whom to answer.
    learns: bool,
    own_port: u16,
}

impl Group {
    /// A node's membership: on loopback it has the place for itself.
    ///
    /// # Errors
    ///
    /// The port cannot be had.
    pub fn node(place: Place) -> anyhow::Result<Self> {
        if place.0.ip().is_multicast() {
            return Self::multicast(place);
        }
        let incoming = UdpSocket::bind(place.0).with_context(|| format!("listening on {place}"))?;
        let outgoing = incoming.try_clone()?;
        Ok(Self {
            incoming,
            outgoing,
            to: Vec::new(),
            learns: true,
            own_port: 0,
        })
    }

    /// A station's membership.
    ///
    /// # Errors
    ///
    /// The port cannot be had.
    pub fn station(place: Place) -> anyhow::Result<Self> {
        if place.0.ip().is_multicast() {
            return Self::multicast(place);
        }
        let incoming = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        let outgoing = incoming.try_clone()?;
        Ok(Self {
            incoming,
            outgoing,
            to: vec![place.0.into()],
            learns: false,
            own_port: 0,
        })
    }

    fn multicast(place: Place) -> anyhow::Result<Self> {
        let incoming = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
        incoming.set_reuse_address(true)?;
        incoming
            .bind(&SocketAddr::from(place.0).into())
            .with_context(|| format!("listening on {place}"))?;
        incoming.join_multicast_v4(place.0.ip(), &Ipv4Addr::LOCALHOST)?;
        let outgoing = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
        outgoing.set_multicast_if_v4(&Ipv4Addr::LOCALHOST)?;
        outgoing.set_multicast_ttl_v4(0)?;
        outgoing.set_multicast_loop_v4(true)?;
        outgoing.bind(&SocketAddr::from((Ipv4Addr::LOCALHOST, 0)).into())?;
        let outgoing = UdpSocket::from(outgoing);
        Ok(Self {
            incoming: incoming.into(),
            own_port: outgoing.local_addr()?.port(),
            outgoing,
            to: vec![place.0.into()],
            learns: false,
        })
    }

    /// How long [`Self::receive`] waits; `None` is not at all.
    ///
    /// # Errors
    ///
    /// When the system refuses it.
    pub fn set_patience(&self, patience: Option<Duration>) -> io::Result<()> {
        self.incoming.set_nonblocking(patience.is_none())?;
        match patience {
            Some(_) => self.incoming.set_read_timeout(patience),
            None => Ok(()),
        }
    }

    /// Sends a datagram to the group. One that finds nobody is lost, as on any network.
    pub fn send(&self, datagram: &[u8]) {
        for to in &self.to {
            // A peer that is gone refuses; the others are still there.
            let _ = self.outgoing.send_to(datagram, to);
        }
    }

    /// The next datagram of somebody else, if one comes.
    ///
    /// # Errors
    ///
    /// When the socket fails.
    pub fn receive<'a>(&mut self, buffer: &'a mut [u8]) -> io::Result<Option<&'a [u8]>> {
        loop {
            match self.incoming.recv_from(buffer) {
                Ok((length, from)) => {
                    if self.own_port != 0 && from.port() == self.own_port {
                        continue;
                    }
                    if self.learns && !self.to.contains(&from) {
                        self.to.insert(0, from);
                        self.to.truncate(PEERS);
                    }
                    return Ok(Some(&buffer[..length]));
                }
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Ok(None),
                    // The system reports a refused datagram on the next read.
                    ErrorKind::Interrupted | ErrorKind::ConnectionRefused => {}
                    _ => return Err(error),
                },
            }
        }
    }
}
