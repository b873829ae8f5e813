//! The MAVLink task: requests in, answers and broadcasts out, on every link.
//!
//! *Design.* One task has all links, each with a node of its own ([`link`]). Answers go into the
//! outgoing ring of the link on which they were asked for, at once; what is sent each second goes into all.
//! What takes many frames, the parameters and the log, follows at the line's own pace: a frame
//! only while the ring is nearly empty, so that there is room for the answers to all requests that can come
//! in meanwhile.

mod broadcast;
mod link;
mod lookup;
mod requests;
mod source;
mod words;

#[cfg(stanag)]
pub use {broadcast::News, lookup::ThisBoard, words::statustext};

use core::future::poll_fn;
use core::task::{Context, Poll};

use embassy_futures::select::{Either3, select3};
use embassy_time::{Duration, Ticker, Timer};
use fault_record::Hang;

use crate::bootloader;
use crate::drivers::time;
use crate::drivers::uart::{Reader, Writer};
use crate::reports::{LINKS, MAVLINK};
use crate::supervision::{self, COME_BY};
use link::Link;

/// From look to look at the outgoing rings while a long answer goes on; less than what such a frame
/// follows upon lasts.
const PACE: Duration = Duration::from_millis(5);

/// A restart into the bootloader waits until what is in the outgoing rings, the answer among it, has
/// left: at 57600 Bd 1023 bytes last 178 ms.
const LEAVES_AFTER: Duration = Duration::from_millis(200);

/// The lines that the task has.
pub struct Lines {
    /// Those that speak MAVLink.
    pub mavlink: [(Reader, Writer); LINKS],
    /// The one that speaks STANAG 4586.
    #[cfg(stanag)]
    pub stanag: (Reader, Writer),
}

/// Runs forever, on the high executor.
#[embassy_executor::task]
pub async fn run(lines: Lines) {
    let mut links = lines.mavlink.map(Link::new);
    #[cfg(stanag)]
    let mut stanag = super::stanag::Link::new(lines.stanag);
    let mut beat = Ticker::every(Duration::from_secs(1));
    loop {
        supervision::came_by(Hang::Mavlink);
        let has_more = links.iter().any(Link::has_more);
        let pace = Timer::after(if has_more { PACE } else { COME_BY });
        let received = poll_fn(|context| {
            #[cfg(stanag)]
            if stanag.poll_wait(context).is_ready() {
                return Poll::Ready(());
            }
            poll_any(&mut links, context)
        });
        let woken = select3(received, beat.next(), pace).await;
        if matches!(woken, Either3::Second(())) {
            let news = broadcast::news();
            broadcast::once_a_second(&mut links, &news);
            MAVLINK.set(links.each_ref().map(Link::report));
            #[cfg(stanag)]
            stanag.once_a_second(&news);
        }
        #[cfg(stanag)]
        stanag.serve();
        serve_all(&mut links);
        if bootloader::is_called() {
            Timer::after(LEAVES_AFTER).await;
            bootloader::reboot();
        }
    }
}

/// Ready when bytes are there on any link; otherwise the task is woken by each.
fn poll_any(links: &mut [Link], context: &Context<'_>) -> Poll<()> {
    let waits = links
        .iter_mut()
        .map(|link| link.poll_wait(context))
        .filter(Poll::is_pending)
        .count();
    if waits == links.len() {
        Poll::Pending
    } else {
        Poll::Ready(())
    }
}

/// Serves each link; a log that one has begun anew is not the one whose transfer another has.
fn serve_all(links: &mut [Link]) {
    let now = time::now();
    for index in 0..links.len() {
        if links[index].serve(now) {
            for (other, link) in links.iter_mut().enumerate() {
                if other != index {
                    link.handle_new_log();
                }
            }
        }
    }
}
