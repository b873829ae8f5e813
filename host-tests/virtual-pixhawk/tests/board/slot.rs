//! Whatever is in the slot, the clock goes on: cards that fail, and one that comes late, while 400 PINGs a
//! second are answered.

use crate::common::{
    BAUD, MS, SECOND, assert_nothing_lost, image, ping_answers, pings, receiver_settings,
};
use fat_image::Kind;
use mavlink_node::client::Client;
use mavlink_node::{Address, Test, Version};
use virtual_pixhawk::{Builder, Card, Connector, Fault, Firmware, Pixhawk, Script, Transfer};
use world::{Receiver, Transmission, WorldNanos};

/// From PING to PING: 400 a second, just below what the line carries. \[ns\]
const APART_NS: u64 = 2_500_000;
/// When PINGs begin; the clock is set by then. \[ns\]
const FIRST_NS: u64 = 3 * SECOND;
/// When the log is to be saved. \[ns\]
const SAVE_NS: u64 = FIRST_NS + 600 * APART_NS + APART_NS / 2;
/// What a command takes of the line, in which there is no PING. \[ns\]
const COMMAND_NS: u64 = 5 * MS;

/// A board under test, and the number of PINGs that it gets.
struct Pinged {
    board: Pixhawk,
    count: u32,
}

/// A board with `card`, pinged up to `until_ns`, whose log is saved at [`SAVE_NS`] and gets `others` beside.
fn pinged(
    firmware: &Firmware,
    card: Option<Card>,
    until_ns: u64,
    others: &[(u64, Test)],
) -> Pinged {
    let commands = [&[(SAVE_NS, Test::Ends)], others].concat();
    let is_free = |at: &u64| {
        let meets = |&(begin, _): &(u64, Test)| *at + APART_NS > begin && *at < begin + COMMAND_NS;
        !commands.iter().any(meets)
    };
    let at = (FIRST_NS..until_ns).step_by(APART_NS as usize);
    let at: Vec<_> = at.filter(is_free).map(WorldNanos).collect();
    let count = at.len() as u32;
    let [station, node] =
        [(255, 190), (1, 1)].map(|(system, component)| Address { system, component });
    let mut client = Client::new(station, Version::V2);
    let commands = commands.into_iter().map(|(at, test)| Transmission {
        start: WorldNanos(at),
        bytes: client.test(node, test).to_vec(),
        baud: BAUD,
    });
    let telem1: Vec<_> = pings(Version::V2, at).into_iter().chain(commands).collect();
    let builder = Builder::new(firmware.clone())
        .crystal_ppb(17_000)
        .gps(Receiver::new(receiver_settings()))
        .telem1(Script::new(telem1));
    let builder = match card {
        Some(card) => builder.card(card),
        None => builder,
    };
    Pinged {
        board: builder.power_on().unwrap(),
        count,
    }
}

impl Pinged {
    /// Runs to `until_ns`, and asserts that every PING was answered and nothing was lost. Returns what the log
    /// says about the card.
    #[track_caller]
    fn ends(&mut self, until_ns: u64, what: &str) -> Vec<String> {
        self.board
            .run_to(WorldNanos(until_ns + SECOND + 500 * MS))
            .unwrap();
        let log = self.board.take_log().unwrap();
        let lines: Vec<_> = log.into_iter().map(|logged| logged.line.text).collect();
        let status = lines.iter().rfind(|line| line.starts_with("status "));
        assert_nothing_lost(status.expect("a status each second"), what);
        let received = self.board.take_received(Connector::Telem1).unwrap();
        let answers = ping_answers(&received).into_iter();
        assert!(answers.map(|(seq, _)| seq).eq(0..self.count), "{what}");
        let about_the_card = |line: &String| line.starts_with("the log is ");
        lines.into_iter().filter(about_the_card).collect()
    }
}

fn good() -> Card {
    Card::holding(&fat_image::formatted(Kind::Fat16))
}

#[track_caller]
fn assert_says(lines: &[String], expected: &str, what: &str) {
    assert_eq!(lines.len(), 1, "{what}: {lines:?}");
    assert!(lines[0].starts_with(expected), "{what}: {lines:?}");
}

#[test]
fn a_card_that_lies_is_busy_or_noisy_costs_no_ping() {
    let Some(firmware) = image() else { return };
    let until_ns = SAVE_NS + 6 * SECOND;
    for (what, card, expected) in [
        (
            "lies",
            good().keeping_nothing(),
            "the log is not saved: NotKept",
        ),
        (
            "busy for 1 s",
            good().fault(Transfer::Write, 5, Fault::Busy(1_000)),
            "the log is not saved: Failed",
        ),
        ("noisy", good().noisy(7), "the log is saved: file 1"),
    ] {
        let mut run = pinged(&firmware, Some(card), until_ns, &[]);
        assert_says(&run.ends(until_ns, what), expected, what);
    }
}

#[test]
fn a_card_that_is_put_in_late_gets_the_log() {
    let Some(firmware) = image() else { return };
    let again_ns = SAVE_NS + 2 * SECOND;
    let until_ns = again_ns + 2 * SECOND;
    let mut run = pinged(&firmware, None, until_ns, &[(again_ns, Test::SavesAgain)]);
    run.board.run_to(WorldNanos(SAVE_NS + SECOND)).unwrap();
    run.board.swap_card(Some(good())).unwrap();
    let lines = run.ends(until_ns, "late");
    assert_eq!(lines.len(), 2, "{lines:?}");
    assert!(
        lines[0].starts_with("the log is not saved: NoCard"),
        "{lines:?}"
    );
    assert!(
        lines[1].starts_with("the log is saved: file 1"),
        "{lines:?}"
    );
}
