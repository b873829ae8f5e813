//! The MAVLink task: requests in, answers and broadcasts out.
//!
//! *Design.* Answers go into the outgoing ring at once. What takes many frames, the parameters and
//! the log, follows at the line's own pace: a frame only while the ring is nearly empty, so that
//! there is room for the answers to all requests that can come in meanwhile.

mod broadcast;
mod lookup;
mod requests;
mod words;

use embassy_futures::select::{Either3, select3};
use embassy_time::{Duration, Ticker, Timer};
use fault_record::Hang;
use mavlink_node::{Config, Node, PingReply};
use sample_log::BeginGuard;

use crate::board;
use crate::drivers::time;
use crate::drivers::uart::{Reader, Writer};
use crate::reports::{MAVLINK, MavlinkReport};
use crate::supervision::{self, COME_BY};
use crate::{image_words, settings};
use lookup::ThisBoard;

/// With this many bytes or fewer in the outgoing ring, the next frame of a long answer may follow:
/// they last 5.5 ms at 115200. 173 bytes at most wait then, of 1023. The rest has room for an answer
/// to each request in a full incoming ring (19, of 26 bytes each) and for what is kept for a second's
/// broadcasts.
const NEXT_BELOW: usize = 64;

/// From look to look at the outgoing ring, less than these bytes last.
const PACE: Duration = Duration::from_millis(5);

/// Runs forever, on the high executor.
#[embassy_executor::task]
pub async fn run(line: (Reader, Writer)) {
    let (mut reader, mut writer) = line;
    let mut node = Node::new(Config {
        system_id: image_words::system_id(),
        component_id: 1,
        ping_reply: if settings::PING_ECHO {
            PingReply::Echo
        } else {
            PingReply::RtosTime
        },
        unique_id: board::unique_id(),
    });
    let mut guard = BeginGuard::new();
    let mut beat = Ticker::every(Duration::from_secs(1));
    loop {
        supervision::came_by(Hang::Mavlink);
        let has_more = node.has_more();
        let pace = Timer::after(if has_more { PACE } else { COME_BY });
        let woken = select3(reader.wait(), beat.next(), pace).await;
        if matches!(woken, Either3::Second(())) {
            broadcast::once_a_second(&mut node, &mut writer);
            MAVLINK.set(MavlinkReport {
                node: node.counters(),
                line: reader.errors(),
            });
        }
        let now = time::now();
        reader.take(|bytes| {
            for &byte in bytes {
                if let Some(request) = node.push(byte, now) {
                    requests::serve(&mut node, &mut writer, &mut guard, &request);
                }
            }
        });
        while node.has_more()
            && writer.waiting() <= NEXT_BELOW
            && let Some(frame) = node.poll(&ThisBoard)
        {
            writer.send(&frame);
        }
    }
}
