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
mod outgoing;
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
#[cfg(stanag)]
use crate::drivers::uart::{Reader, Writer};
use crate::reports::{LINKS, MAVLINK};
use crate::supervision::{self, COME_BY};
use link::Link;
pub use link::Port;

/// From look to look at the outgoing rings while a long answer goes on; less than what such a frame
/// follows upon lasts.
const PACE: Duration = Duration::from_millis(5);

/// A restart into the bootloader waits until what is in the outgoing rings, the answer among it, has
/// left: at 57600 Bd 1024 bytes last 178 ms.
const LEAVES_AFTER: Duration = Duration::from_millis(200);

/// The lines that the task has.
pub struct Lines {
    /// Those that speak MAVLink.
    pub mavlink: [Option<Port>; LINKS],
    /// The one that speaks STANAG 4586.
    #[cfg(stanag)]
    pub stanag: (Reader, Writer),
}

/// The links that there are.
type Links = [Option<Link>; LINKS];

/// Runs forever, on the high executor.
#[embassy_executor::task]
pub async fn run(lines: Lines) {
    // One by one: a link is large, and an array of them would be on the stack beside this one.
    let mut links: Links = [const { None }; LINKS];
    for (link, port) in links.iter_mut().zip(lines.mavlink) {
        *link = port.map(Link::new);
    }
    #[cfg(stanag)]
    let mut stanag = super::stanag::Link::new(lines.stanag);
    let mut beat = Ticker::every(Duration::from_secs(1));
    loop {
        supervision::came_by(Hang::Mavlink);
        let needs_pace = links.iter().flatten().any(Link::needs_pace);
        let pace = Timer::after(if needs_pace { PACE } else { COME_BY });
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
            broadcast::once_a_second(links.iter_mut().flatten(), &news);
            MAVLINK.set(links.each_ref().map(|link| link.as_ref().map(Link::report)));
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

/// Ready when any link has something to be served; otherwise the task is woken by each.
fn poll_any(links: &mut Links, context: &mut Context<'_>) -> Poll<()> {
    let mut is_ready = false;
    for link in links.iter_mut().flatten() {
        is_ready |= link.poll(context).is_ready();
    }
    if is_ready {
        Poll::Ready(())
    } else {
        Poll::Pending
    }
}

/// Serves each link; a log that one has begun anew is not the one whose transfer another has.
fn serve_all(links: &mut Links) {
    for index in 0..links.len() {
        if links[index].as_mut().is_some_and(Link::serve) {
            let others = links.iter_mut().enumerate();
            let others = others.filter(|(other, _)| *other != index);
            others
                .filter_map(|(_, link)| link.as_mut())
                .for_each(Link::handle_new_log);
        }
    }
}
