//! More than one link: each client has its answers, and its answers alone.

use mavlink_node::Version;
use mavlink_node::client::Message;
use virtual_pixhawk::{Builder, Connector, Script};
use world::{Receiver, WorldNanos};

use crate::common::{MS, SECOND, image, messages, ping_answers, pings, receiver_settings};

#[test]
fn answers_go_back_the_way_they_came_and_both_links_have_what_is_sent_each_second() {
    let Some(firmware) = image() else { return };
    let times = |count: u64, apart: u64| (0..count).map(move |n| WorldNanos(SECOND + n * apart));
    let mut board = Builder::new(firmware)
        .gps(Receiver::new(receiver_settings()))
        .telem1(Script::new(pings(Version::V1, times(80, 50 * MS))))
        .telem2(Script::new(pings(Version::V2, times(300, 10 * MS))))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(6 * SECOND)).unwrap();
    for (connector, asked) in [(Connector::Telem1, 80), (Connector::Telem2, 300)] {
        let received = board.take_received(connector).unwrap();
        let answered: Vec<u32> = ping_answers(&received)
            .iter()
            .map(|&(seq, _)| seq)
            .collect();
        assert_eq!(answered, (0..asked).collect::<Vec<_>>(), "{connector:?}");
        let heartbeats = messages(&received)
            .iter()
            .filter(|(_, message)| matches!(message, Message::Heartbeat))
            .count();
        assert!((4..=6).contains(&heartbeats), "{connector:?}: {heartbeats}");
    }
}
