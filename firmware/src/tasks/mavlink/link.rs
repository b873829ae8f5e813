//! A link: a node of its own, and the port to whoever is at the other end.
//!
//! *Design.* What a node has noted of a client, a version, a stretch of the log, the second attempt of a
//! test's begin, belongs to its link alone, so that clients on two links do not confuse each other.
//! They share the log of a test: one that begins anew on one link ends its transfer on the others.

use core::task::{Context, Poll};

use mavlink_node::{Config, Node, PingReply};
use sample_log::BeginGuard;
use timebase::Cycles;

use super::lookup::ThisBoard;
use super::requests;
use crate::drivers::uart::{Reader, Writer};
use crate::reports::LinkReport;
use crate::{board, image_words, settings};

/// With this many bytes or fewer in the outgoing ring, the next frame of a long answer may follow:
/// they last 5.5 ms at 115200. 173 bytes at most wait then, of 1023. The rest has room for an answer
/// to each request in a full incoming ring (19, of 26 bytes each) and for what is kept for a second's
/// broadcasts.
const NEXT_BELOW: usize = 64;

/// One link.
pub struct Link {
    pub(super) node: Node,
    pub(super) writer: Writer,
    reader: Reader,
    guard: BeginGuard,
}

impl Link {
    /// Over a serial line.
    pub fn new((reader, writer): (Reader, Writer)) -> Self {
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
            writer,
            reader,
            guard: BeginGuard::new(),
        }
    }

    /// Ready when bytes are there.
    pub fn poll_wait(&mut self, context: &Context<'_>) -> Poll<()> {
        self.reader.poll_wait(context)
    }

    /// Whether a long answer goes on when the line has room.
    pub const fn has_more(&self) -> bool {
        self.node.has_more()
    }

    /// Serves what has come in, and sends on what takes many frames; whether the log is another one now.
    pub fn serve(&mut self, now: Cycles) -> bool {
        let Self {
            node,
            writer,
            reader,
            guard,
        } = self;
        let mut is_new_log = false;
        reader.take(|bytes| {
            for &byte in bytes {
                if let Some(request) = node.push(byte, now) {
                    is_new_log |= requests::serve(node, writer, guard, &request);
                }
            }
        });
        while node.has_more()
            && writer.waiting() <= NEXT_BELOW
            && let Some(frame) = node.poll(&ThisBoard)
        {
            writer.send(&frame);
        }
        is_new_log
    }

    /// Another link has begun the log anew.
    pub const fn handle_new_log(&mut self) {
        self.node.handle_new_log();
    }

    /// What was counted so far.
    pub fn report(&self) -> LinkReport {
        LinkReport {
            node: self.node.counters(),
            line: self.reader.errors(),
        }
    }
}
