//! The log of a test on the memory card: the file is right, each fault is reported by its kind and loses
//! nothing, and the clock is not disturbed.

use crate::common::{
    BAUD, MS, SECOND, START_UTC_NS, image, ping_answers, pings, receiver_settings,
};
use console::Status;
use fat_image::Kind;
use mavlink_node::client::Client;
use mavlink_node::{Address, Test, Version};
use sample_log::csv;
use virtual_pixhawk::{Builder, Card, Connector, Fault, Firmware, Pixhawk, Script, Transfer};
use world::{Receiver, Transmission, WorldNanos};

/// The file that a card gets first.
const FIRST_FILE: &str = "TEST0001.CSV";
/// When PINGs begin; the clock is set by then.
const FIRST_PING: WorldNanos = WorldNanos(3 * SECOND);

/// The command that ends a test, from a ground station to the board.
fn end_of_test(at: WorldNanos) -> Transmission {
    let [station, board] =
        [(255, 190), (1, 1)].map(|(system, component)| Address { system, component });
    let mut client = Client::new(station, Version::V2);
    Transmission {
        start: at,
        bytes: client.test(board, Test::Ends).to_vec(),
        baud: BAUD,
    }
}

/// `count` PINGs from [`FIRST_PING`] on, `apart_ns` apart.
fn some_pings(count: u64, apart_ns: u64) -> Vec<Transmission> {
    let at = (0..count).map(|n| WorldNanos(FIRST_PING.0 + n * apart_ns));
    pings(Version::V2, at)
}

/// A board with a receiver and these requests.
fn board(firmware: &Firmware, telem1: Vec<Transmission>) -> Builder {
    Builder::new(firmware.clone())
        .crystal_ppb(17_000)
        .gps(Receiver::new(receiver_settings()))
        .telem1(Script::new(telem1))
}

/// A board that gets 40 PINGs, and the end of the test at 5 s and again at each of `again`.
fn after_a_test(firmware: &Firmware, card: Option<Card>, again: &[WorldNanos]) -> Pixhawk {
    let mut telem1 = some_pings(40, 25 * MS);
    telem1.push(end_of_test(WorldNanos(5 * SECOND)));
    telem1.extend(again.iter().map(|&at| end_of_test(at)));
    let mut board = board(firmware, telem1);
    if let Some(card) = card {
        board = board.card(card);
    }
    board.power_on().unwrap()
}

/// The lines of the log about the card since the last call.
fn lines_about_the_card(board: &mut Pixhawk) -> Vec<String> {
    let log = board.take_log().unwrap();
    let lines = log.into_iter().map(|logged| logged.line.text);
    lines
        .filter(|text| text.starts_with("the log is"))
        .map(|text| text.split(", took").next().unwrap().to_owned())
        .collect()
}

/// What the board has sent on its line, with what is no text replaced.
fn texts(board: &mut Pixhawk) -> String {
    let received = board.take_received(Connector::Telem1).unwrap();
    let bytes: Vec<u8> = received.iter().map(|received| received.byte).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Asserts that a file has a line for each PING, with the time that it was answered with.
fn assert_is_the_log(contents: &[u8], answers: &[(u32, u64)]) {
    let text = std::str::from_utf8(contents).unwrap();
    let mut lines = text.split_terminator("\r\n");
    assert_eq!(
        lines.next().map(str::as_bytes),
        csv::HEADER.strip_suffix(b"\r\n")
    );
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), answers.len());
    for (row, &(seq, time_usec)) in rows.iter().zip(answers) {
        let numbers: Vec<u64> = [0, 1, 2, 4].map(|n: usize| row[n].parse().unwrap()).into();
        assert_eq!(row.len(), 5);
        assert_eq!(numbers[0], u64::from(seq));
        assert_eq!(numbers[1], u64::from(seq) + 1_000, "the PING's own time");
        assert_eq!(numbers[2] / 1_000, time_usec, "PING {seq}");
        assert_eq!(row[3], "set");
        assert!(numbers[3] > 0);
    }
}

#[test]
fn the_file_has_a_line_for_each_ping_on_every_kind_of_card() {
    let Some(firmware) = image() else { return };
    let fat16 = fat_image::formatted(Kind::Fat16);
    let fat32 = fat_image::formatted(Kind::Fat32);
    for card in [
        Card::holding(&fat16),
        Card::of_first_version(&fat16),
        Card::holding(&fat32),
    ] {
        let mut board = after_a_test(&firmware, Some(card), &[]);
        board.run_to(WorldNanos(7 * SECOND)).unwrap();
        let received = board.take_received(Connector::Telem1).unwrap();
        let answers = ping_answers(&received);
        assert_eq!(answers.len(), 40);
        let expected = "the log is saved: file 1, samples 40";
        assert_eq!(lines_about_the_card(&mut board), [expected]);
        let card = board.swap_card(None).unwrap().expect("it is in the slot");
        let mut files = fat_image::files(&card.image());
        let file = files.remove(FIRST_FILE).expect("the file is there");
        assert!(files.is_empty(), "{files:?}");
        assert_is_the_log(&file.contents, &answers);
        // The world began on that day at 04:00.
        let (date, time) = (file.modified.date, file.modified.time);
        assert_eq!((date.year, date.month, date.day), (2026, 11, 22));
        assert_eq!((time.hour, time.min, time.sec), (4, 0, 4), "{START_UTC_NS}");
        let gaps = board.gaps().unwrap();
        assert_eq!(gaps, virtual_pixhawk::Gaps::default());
    }
}

#[test]
fn nothing_is_written_over() {
    let Some(firmware) = image() else { return };
    let mut before = fat_image::formatted(Kind::Fat16);
    fat_image::put(&mut before, "TEST0001.CSV", 700);
    fat_image::put(&mut before, "TEST0041.CSV", 0);
    fat_image::put(&mut before, "a long name that is not ours.csv", 5_000);
    let again = [WorldNanos(6 * SECOND)];
    let mut board = after_a_test(&firmware, Some(Card::holding(&before)), &again);
    board.run_to(WorldNanos(7 * SECOND)).unwrap();
    let after = board.swap_card(None).unwrap().unwrap().image();
    let (mut after, before) = (fat_image::files(&after), fat_image::files(&before));
    let new = ["TEST0042.CSV", "TEST0043.CSV"].map(|name| after.remove(name).unwrap());
    assert_eq!(after, before);
    assert_eq!(new[0].contents, new[1].contents);
    assert_eq!(new[0].contents.len(), 41 * csv::LINE);
}

/// A card in the slot at the end of a test, and how the board reports it: the reason in its log,
/// and the text on its line.
type Failure = (Option<Card>, &'static str, &'static str);

fn failures() -> Vec<Failure> {
    const BLANK: (&str, &str) = ("NoFileSystem", "card is blank: format it as FAT32");
    const FAT12: (&str, &str) = ("Fat12", "card is FAT12: format it as FAT32");
    const DAMAGED: (&str, &str) = ("BootDamaged", "boot record damaged: fsck or chkdsk");
    const FULL: (&str, &str) = ("NoRoom", "card is full: delete files");
    const PULLED: (&str, &str) = ("Gone", "card was pulled: put it in again");
    const FAILED: (&str, &str) = ("Failed", "card fails: use another one");
    const PROTECTED: (&str, &str) = ("WriteProtected", "card is write-protected: unlock it");
    let good = fat_image::formatted(Kind::Fat16);
    let mut full = good.clone();
    let free = fat_image::free_bytes(&mut full);
    fat_image::put(&mut full, "most.bin", free - 2 * 1_024);
    let mut without_cluster_size = good.clone();
    without_cluster_size[2_048 * 512 + 13] = 0;
    let of = Card::holding;
    let pulled_at = |nth| of(&good).fault(Transfer::Write, nth, Fault::Pulled);
    let broken = (4..7).fold(of(&good), |card, nth| {
        card.fault(Transfer::Write, nth, Fault::Damaged)
    });
    let cards = [
        (of(&[0; 1 << 20]), BLANK),
        (of(&fat_image::formatted(Kind::Fat12)), FAT12),
        (of(&without_cluster_size), DAMAGED),
        (of(&good).write_protected(), PROTECTED),
        (of(&full), FULL),
        (pulled_at(0), PULLED),
        (pulled_at(7), PULLED),
        (broken, FAILED),
        (of(&good).busy_for_ns(700 * MS), FAILED),
    ];
    let cards = cards.map(|(card, (reason, text))| (Some(card), reason, text));
    let no_card = (None, "NoCard", "no card in the slot");
    [no_card].into_iter().chain(cards).collect()
}

#[test]
fn every_failure_is_reported_by_its_kind_and_a_good_card_then_gets_all_of_it() {
    let Some(firmware) = image() else { return };
    for (card, reason, text) in failures() {
        let again = [WorldNanos(10 * SECOND)];
        let mut board = after_a_test(&firmware, card, &again);
        board.run_to(WorldNanos(9 * SECOND + 500 * MS)).unwrap();
        let expected = format!("the log is not saved: {reason}");
        assert_eq!(lines_about_the_card(&mut board), [expected]);
        let received = board.take_received(Connector::Telem1).unwrap();
        let answers = ping_answers(&received);
        assert_eq!(answers.len(), 40);
        let bytes: Vec<u8> = received.iter().map(|received| received.byte).collect();
        let received = String::from_utf8_lossy(&bytes);
        let text = format!("log not saved: {text}");
        assert!(received.contains(&text), "{reason}");
        let good = Card::holding(&fat_image::formatted(Kind::Fat16));
        board.swap_card(Some(good)).unwrap();
        board.run_to(WorldNanos(12 * SECOND)).unwrap();
        assert!(texts(&mut board).contains("40 samples saved to the card, file 1"));
        let card = board.swap_card(None).unwrap().unwrap();
        let files = fat_image::files(&card.image());
        assert_is_the_log(&files[FIRST_FILE].contents, &answers);
    }
}

#[test]
fn a_card_that_takes_the_place_of_another_in_mid_file_stays_as_it_was() {
    let Some(firmware) = image() else { return };
    let mut other = fat_image::formatted(Kind::Fat16);
    fat_image::put(&mut other, "holiday.jpg", 300_000);
    let slow = Card::holding(&fat_image::formatted(Kind::Fat16)).busy_for_ns(100 * MS);
    let again = [WorldNanos(8 * SECOND)];
    let mut board = after_a_test(&firmware, Some(slow), &again);
    // Some blocks have been written, some have not.
    board.run_to(WorldNanos(5_300 * MS)).unwrap();
    assert_eq!(lines_about_the_card(&mut board), [""; 0]);
    let swapped = Card::holding(&other).with_serial(7);
    let first = board.swap_card(Some(swapped)).unwrap().unwrap();
    assert!(first.transfers(Transfer::Write) > 0);
    board.run_to(WorldNanos(7 * SECOND)).unwrap();
    assert_eq!(
        lines_about_the_card(&mut board),
        ["the log is not saved: Swapped"]
    );
    let received = board.take_received(Connector::Telem1).unwrap();
    let answers = ping_answers(&received);
    let bytes: Vec<u8> = received.iter().map(|received| received.byte).collect();
    let text = "log not saved: card was swapped: save again";
    assert!(String::from_utf8_lossy(&bytes).contains(text));
    let swapped = board.swap_card(None).unwrap().unwrap();
    assert_eq!(swapped.transfers(Transfer::Write), 0);
    assert!(swapped.image() == other);
    // Asked for once more it gets its own file, beside what it holds.
    board.swap_card(Some(swapped)).unwrap();
    board.run_to(WorldNanos(10 * SECOND)).unwrap();
    assert_eq!(
        lines_about_the_card(&mut board),
        ["the log is saved: file 1, samples 40"]
    );
    let files = fat_image::files(&board.swap_card(None).unwrap().unwrap().image());
    assert_eq!(files["holiday.jpg"].contents.len(), 300_000);
    assert_is_the_log(&files[FIRST_FILE].contents, &answers);
}

/// From PING to PING in the runs with a full log. \[ns\]
const APART_NS: u64 = 3 * MS;
/// Where PINGs lie in a ms, so that none meets a status line, which comes within the half ms about
/// each whole second: its frame in the log masks interrupts for 40 µs. \[ns\]
const BESIDE_STATUS_NS: u64 = 750_000;
/// PINGs that fill the log.
const FULL: u64 = 8_192;
/// The end of the test.
const END_OF_FULL: WorldNanos = WorldNanos(FIRST_PING.0 + FULL * APART_NS + APART_NS / 2);
/// How long PINGs go on after that. \[ns\]
const PINGED_AFTER_NS: u64 = 6 * SECOND;

/// What is to be seen of the clock in a run with a full log.
struct Traces {
    answers: Vec<(u32, u64)>,
    /// The clock's readings while the card is written, in ns of UTC.
    readings: Vec<i64>,
    last_status: String,
    saved: Vec<String>,
    took_us: u64,
    card: Option<Card>,
}

/// A full log is written to `card` while PINGs and the receiver go on.
fn traces(firmware: &Firmware, card: Option<Card>) -> Traces {
    let count = FULL + PINGED_AFTER_NS / APART_NS;
    let first_ns = FIRST_PING.0 + BESIDE_STATUS_NS;
    let at = (0..count).map(|n| WorldNanos(first_ns + n * APART_NS));
    let mut telem1 = pings(Version::V2, at);
    telem1.push(end_of_test(END_OF_FULL));
    let mut board = board(firmware, telem1);
    if let Some(card) = card {
        board = board.card(card);
    }
    let mut board = board.power_on().unwrap();
    board.run_to(END_OF_FULL).unwrap();
    let mut readings = Vec::new();
    for _ in 0..PINGED_AFTER_NS / (10 * MS) {
        board.run_for(10 * MS).unwrap();
        readings.push(board.clock().unwrap().reading.utc.0);
    }
    board.run_for(SECOND).unwrap();
    let answers = ping_answers(&board.take_received(Connector::Telem1).unwrap());
    let log = board.take_log().unwrap();
    let texts = log.iter().map(|logged| logged.line.text.as_str());
    let last_status = texts.clone().rfind(|text| text.starts_with("status"));
    let saved: Vec<_> = texts
        .filter(|text| text.starts_with("the log is"))
        .collect();
    let took = saved.first().and_then(|text| text.split("took ").nth(1));
    assert_eq!(board.damaged_log_frames().unwrap(), 0);
    assert_eq!(board.gaps().unwrap(), virtual_pixhawk::Gaps::default());
    Traces {
        answers,
        readings,
        last_status: last_status.expect("a status each second").to_owned(),
        took_us: took
            .and_then(|text| text.split(' ').next()?.parse().ok())
            .unwrap(),
        saved: saved.into_iter().map(str::to_owned).collect(),
        card: board.swap_card(None).unwrap(),
    }
}

/// The most that two runs differ, in the unit of both.
fn apart<T: Copy + Into<i128>>(a: &[T], b: &[T]) -> i128 {
    assert_eq!(a.len(), b.len());
    let differences = a.iter().zip(b).map(|(&a, &b)| (a.into() - b.into()).abs());
    differences.max().unwrap_or_default()
}

#[test]
fn writing_a_full_log_does_not_disturb_the_clock() {
    let Some(firmware) = image() else { return };
    let blank = fat_image::formatted(Kind::Fat16);
    let without = traces(&firmware, None);
    let mut kept_all = Vec::new();
    let damaged = Card::holding(&blank)
        .fault(Transfer::Read, 1, Fault::Damaged)
        .fault(Transfer::Read, 5, Fault::AnswerDamaged)
        .fault(Transfer::Write, 3, Fault::Lost)
        .fault(Transfer::Write, 100, Fault::Damaged)
        .fault(Transfer::Write, 101, Fault::Damaged)
        .fault(Transfer::Write, 500, Fault::AnswerDamaged)
        .fault(Transfer::Write, 900, Fault::Lost);
    for (card, errors) in [
        (Card::holding(&blank), ""),
        (damaged, " card_crc=5 card_timeout=2"),
    ] {
        let with = traces(&firmware, Some(card));
        println!(
            "{} in {} µs; {}",
            with.saved[0], with.took_us, with.last_status
        );
        assert_eq!(with.saved.len(), 1);
        assert!(with.saved[0].starts_with("the log is saved: file 1, samples 8192,"));
        let us = |run: &Traces| -> Vec<u64> { run.answers.iter().map(|&(_, us)| us).collect() };
        let (stamps_us, readings_ns) = (
            apart(&us(&with), &us(&without)),
            apart(&with.readings, &without.readings),
        );
        println!("PINGs at most {stamps_us} µs, the clock at most {readings_ns} ns apart");
        // A PING that meets the line that the card has in the log is stamped behind it.
        let pairs = with.answers.iter().zip(&without.answers);
        let late = pairs.filter(|(a, b)| a.1.abs_diff(b.1) > 1).count();
        assert!(late <= 1 && stamps_us <= 10, "{late} PINGs");
        assert!(readings_ns <= 100);
        for counter in ["overrun", "incoming_full", "outgoing_full"] {
            assert!(!with.last_status.contains(counter), "{}", with.last_status);
        }
        // The reader counts what looks like a frame inside a frame; the card adds none.
        let failures = |run: &Traces| {
            let status = Status::parse(&run.last_status);
            status.and_then(|status| status.number("mav_crc_failures"))
        };
        assert_eq!(failures(&with), failures(&without));
        let counted = with
            .last_status
            .find(" card_")
            .map(|at| &with.last_status[at..]);
        assert_eq!(counted.unwrap_or_default(), errors);
        let image = with.card.expect("it is in the slot").image();
        assert_is_the_log(
            &fat_image::files(&image)[FIRST_FILE].contents,
            &with.answers[..FULL as usize],
        );
        kept_all.push(with.last_status.contains(" lost_ticks=0"));
    }
    assert_eq!(kept_all, [true; 2], "no tick is lost in either run");
}

#[test]
fn a_card_may_be_busy_for_as_long_as_its_specification_says() {
    let Some(firmware) = image() else { return };
    for (busy_ms, is_saved) in [(300, true), (450, true), (700, false)] {
        let image = fat_image::formatted(Kind::Fat32);
        let card = Card::holding(&image).fault(Transfer::Write, 3, Fault::Busy(busy_ms));
        let mut board = after_a_test(&firmware, Some(card), &[]);
        board.run_to(WorldNanos(9 * SECOND)).unwrap();
        let log = board.take_log().unwrap();
        let lines: Vec<&str> = log.iter().map(|logged| logged.line.text.as_str()).collect();
        let saved = lines
            .iter()
            .any(|line| line.starts_with("the log is saved"));
        assert_eq!(saved, is_saved, "{busy_ms} ms: {lines:#?}");
        let status = lines.iter().rfind(|line| line.starts_with("status "));
        let timeouts = status.is_some_and(|line| line.contains(" card_timeout=1"));
        assert_eq!(timeouts, !is_saved, "{busy_ms} ms: {status:?}");
    }
}
