//! A link: a node of its own, and the port to whoever is at the other end.
//!
//! *Design.* What a node has noted of a client, a version, a stretch of the log, the second attempt of a
//! test's begin, belongs to its link alone, so that clients on two links do not confuse each other.
//! They share the log of a test: one that begins anew on one link ends its transfer on the others.

use core::task::{Context, Poll};

use mavlink_node::{Config, Node, PingReply};
use sample_log::BeginGuard;

use super::lookup::ThisBoard;
use super::outgoing::Outgoing;
use super::requests;
use crate::bootloader;
use crate::drivers::uart::{Reader, Writer};
use crate::drivers::{time, usb};
use crate::reports::LinkReport;
use crate::{board, image_words, settings};

/// With this many bytes or fewer on their way out, the next frame of a long answer may follow:
/// they last 5.5 ms at 115200. 173 bytes at most wait then, of 1024. The rest has room for an answer
/// to each request in a full incoming ring (19, of 26 bytes each) and for what is kept for a second's
/// broadcasts.
const NEXT_BELOW: usize = 64;

/// What a link goes over.
pub enum Port {
    /// A serial line.
    Serial((Reader, Writer)),
    /// USB.
    Usb(usb::Port),
}

impl Port {
    /// The way out, if somebody may be there.
    pub fn open(&mut self) -> Option<&mut dyn Outgoing> {
        match self {
            Self::Serial((_, writer)) => Some(writer),
            Self::Usb(port) => {
                let out = port.outgoing();
                out.is_open().then_some(out)
            }
        }
    }
}

/// One link.
pub struct Link {
    pub(super) node: Node,
    pub(super) port: Port,
    guard: BeginGuard,
    /// It has begun the log anew, and the other links do not know yet.
    has_new_log: bool,
}

impl Link {
    /// Over `port`.
    #[inline(never)]
    pub fn new(port: Port) -> Self {
        let node = Node::new(Config {
            system_id: image_words::system_id(),
            component_id: 1,
            ping_reply: if settings::PING_ECHO {
                PingReply::Echo
            } else {
                PingReply::RtosTime
            },
            unique_id: board::unique_id(),
        });
        Self {
            node,
            port,
            guard: BeginGuard::new(),
            has_new_log: false,
        }
    }

    /// Ready when [`Self::serve`] has something to do. What comes over USB is served here: a packet is one
    /// wake-up, and another pass of the task's loop would cost as much again.
    pub fn poll(&mut self, context: &mut Context<'_>) -> Poll<()> {
        let Self {
            node,
            port,
            guard,
            has_new_log,
        } = self;
        match port {
            Port::Serial((reader, _)) => reader.poll_wait(context),
            Port::Usb(port) => {
                while let Some(packet) = port.poll_packet(context) {
                    let (mut bytes, now) = (packet.bytes(), time::now());
                    while let Some(request) = node.push_packet(&mut bytes, packet.came(), now) {
                        *has_new_log |= requests::serve(node, port.outgoing(), guard, &request);
                    }
                    port.served(&packet);
                }
                go_on(node, port.outgoing());
                port.poll_send(context);
                if *has_new_log || bootloader::is_called() {
                    Poll::Ready(())
                } else {
                    Poll::Pending
                }
            }
        }
    }

    /// Whether a long answer goes on at a time that nothing else shows.
    pub const fn needs_pace(&self) -> bool {
        matches!(self.port, Port::Serial(_)) && self.node.has_more()
    }

    /// Serves what has come in, and sends on what takes many frames; whether the log is another one now.
    pub fn serve(&mut self) -> bool {
        if let Port::Serial((reader, writer)) = &mut self.port {
            let (node, guard) = (&mut self.node, &mut self.guard);
            let now = time::now();
            reader.take(|mut bytes| {
                while let Some(request) = node.push_bytes(&mut bytes, now) {
                    self.has_new_log |= requests::serve(node, writer, guard, &request);
                }
            });
            go_on(node, writer);
        }
        core::mem::take(&mut self.has_new_log)
    }

    /// Another link has begun the log anew.
    pub const fn handle_new_log(&mut self) {
        self.node.handle_new_log();
    }

    /// What was counted so far.
    pub fn report(&self) -> LinkReport {
        LinkReport {
            node: self.node.counters(),
            line: match &self.port {
                Port::Serial((reader, _)) => reader.errors(),
                Port::Usb(port) => port.errors(),
            },
        }
    }
}

/// Sends on what takes many frames, while there is room for the answers to what comes in meanwhile.
fn go_on(node: &mut Node, out: &mut dyn Outgoing) {
    while node.has_more()
        && out.waiting() <= NEXT_BELOW
        && let Some(frame) = node.poll(&ThisBoard)
    {
        out.send(&frame);
    }
}
