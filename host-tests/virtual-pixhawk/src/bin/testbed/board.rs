//! One board of a run, from its power to the end of the test.

use std::iter::Peekable;
use std::sync::atomic::{AtomicBool, Ordering};
use std::vec::IntoIter;

use anyhow::Context as _;
use console::{Status, Word};
use fastrand::Rng;
use fat_image::Kind;
use indicatif::ProgressBar;
use mavlink_node::client::{Client, GROUND_STATION, Message, Received};
use mavlink_node::{Parameter, Version};
use testbed::{Case, Conversation, Link, Options, OwnLog, Record, Schedule};
use timebase::{Stamp, StampedByte};
use variant::{Image, Variant};
use virtual_pixhawk::{Builder, Card, Connector, Firmware, Gaps, Host, Pixhawk, Script};
use world::{Port, Receiver, ReceiverSettings};

use crate::outgoing;

/// A second. \[ns\]
const SECOND: u64 = 1_000_000_000;
/// 2026-11-22T04:00:00Z: UTC when the first board may get power.
const START_UTC_NS: i64 = 1_795_320_000 * 1_000_000_000;
/// Boards get power within this time. \[ns\]
const POWER_WITHIN_NS: u64 = SECOND;
/// How far the TCXO of a receiver is off, at most. \[ppb\]
const RECEIVER_PPB: i32 = 1_000;
/// How long a board runs on after the last PING: for its last answers, its next status line, and
/// until its card has a full log, which takes 1.4 s. \[s\]
pub const AFTERWARDS_S: u32 = 3;
/// The name of the first log on an empty card.
const LOG_FILE: &str = "TEST0001.CSV";

/// A receiver's port as it is plugged in: out of its box, but that PX4's *Auto* stays at the rate where it finds
/// it, which is the image's.
fn port(image: Image) -> Port {
    match image.variant {
        Variant::PaperDefault => Port {
            baud: image.gps_baud,
            ..Port::FACTORY
        },
        _ => Port::FACTORY,
    }
}

/// A board before it has power.
pub struct Prepared {
    builder: Builder,
    name: String,
    link: Link,
    schedule: Schedule,
    /// From the world's start to its power. \[ns\]
    power_ns: u64,
    /// From the world's start to the test's. \[ns\]
    test_ns: u64,
}

/// A board after its test.
pub struct Finished {
    /// What the test measured.
    pub record: Record,
    /// How long the test lasted. \[s\]
    pub lasted_s: u32,
}

/// A board under power.
struct Running {
    board: Pixhawk,
    link: Link,
    conversation: Conversation,
    client: Client,
    /// The PINGs to come, with their numbers.
    pings: Peekable<IntoIter<(u32, u64)>>,
    /// From power to the test's start. \[ns\]
    begins: u64,
    line_full: u32,
    log_missed: u32,
    /// By the last status line before the test, and by the last of all.
    lost_ticks: (u32, u32),
    overruns: u32,
}

impl Prepared {
    /// Board `index` of a run.
    ///
    /// # Errors
    ///
    /// When its image is missing or cannot be read.
    pub fn new(
        options: &Options,
        case: Case,
        seed: u64,
        index: usize,
        crystal_ppb: i32,
    ) -> anyhow::Result<Self> {
        let image = case.image(index);
        let path = options.image(image).with_context(|| {
            format!("the image {image} is missing; `cargo xtask testbed` builds it")
        })?;
        // The board of a seed is the same under every method.
        let mut rng = Rng::with_seed(seed);
        rng = Rng::with_seed(rng.u64(..) ^ index as u64);
        let power_ns = rng.u64(0..POWER_WITHIN_NS);
        let receiver = ReceiverSettings {
            seed: rng.u64(..),
            crystal_ppb: rng.i32(-RECEIVER_PPB..=RECEIVER_PPB),
            latency: case.receivers.latency(),
            port: port(image),
            ..ReceiverSettings::new(START_UTC_NS + power_ns.cast_signed())
        };
        let schedule = Schedule {
            rate_hz: options.rate,
            duration_s: options.duration,
            seed,
        };
        let test_ns = POWER_WITHIN_NS + u64::from(options.settle) * SECOND;
        let pace = options.cpi.parse().map_err(anyhow::Error::msg)?;
        let mut firmware = Firmware::read(path)?;
        if image.load.is_some() {
            firmware = firmware.with_word(Word::LoadSeed, rng.u32(..))?;
        }
        let mut builder = Builder::new(firmware)
            .pace(pace)
            .crystal_ppb(crystal_ppb)
            .card(Card::holding(&fat_image::formatted(Kind::Fat16)));
        let laptop = Script::new(outgoing::all(schedule, test_ns - power_ns));
        builder = match case.link {
            Link::Telem1 => builder.telem1(laptop),
            Link::Telem2 => builder.telem2(laptop),
            Link::Usb => builder.usb(Host::new(laptop).in_frame(power_ns)),
        };
        let receiver = Receiver::new(receiver);
        builder = if case.method.has_pulse() {
            builder.gps_and_pulse(receiver)
        } else {
            builder.gps(receiver)
        };
        Ok(Self {
            builder,
            name: format!("board {}", index + 1),
            link: case.link,
            schedule,
            power_ns,
            test_ns,
        })
    }

    /// From power to the end of the test, a second at a time; `is_stopped` ends it.
    ///
    /// # Errors
    ///
    /// When the emulator gives up.
    pub fn run(
        self,
        bar: Option<&ProgressBar>,
        is_stopped: &AtomicBool,
    ) -> anyhow::Result<Finished> {
        let begins = self.test_ns - self.power_ns;
        let ends = begins + u64::from(self.schedule.duration_s) * SECOND;
        let over = ends + u64::from(AFTERWARDS_S) * SECOND;
        let numbers = self.schedule.pings().map(|(sequence, _)| sequence);
        let starts = outgoing::pings(self.schedule, begins).into_iter();
        let pings: Vec<_> = numbers.zip(starts.map(|ping| ping.start.0)).collect();
        let mut running = Running {
            board: self.builder.power_on()?,
            link: self.link,
            conversation: Conversation::new(&self.name),
            client: Client::new(GROUND_STATION, Version::V2),
            pings: pings.into_iter().peekable(),
            begins,
            line_full: 0,
            log_missed: 0,
            lost_ticks: (0, 0),
            overruns: 0,
        };
        while running.board.now().0 < over && !is_stopped.load(Ordering::Relaxed) {
            running.run_for(SECOND.min(over - running.board.now().0))?;
            if let Some(bar) = bar {
                bar.inc(1);
            }
        }
        let gaps = running.board.gaps()?;
        if gaps != Gaps::default() {
            console::print_error!(
                "the emulator has no model for what the firmware did here: {gaps:?}"
            );
        }
        let lasted_ns = running.since_test(running.board.now().0.min(ends)).max(0);
        let test_utc_ns = START_UTC_NS + self.test_ns.cast_signed();
        let record = running.end(test_utc_ns, !is_stopped.load(Ordering::Relaxed));
        Ok(Finished {
            record,
            lasted_s: (lasted_ns.cast_unsigned() / SECOND) as u32,
        })
    }
}

impl Running {
    const fn since_test(&self, at: u64) -> i64 {
        at.cast_signed() - self.begins.cast_signed()
    }

    /// Runs for `ns`, and handles what was sent, received and logged meanwhile.
    fn run_for(&mut self, ns: u64) -> anyhow::Result<()> {
        self.board.run_for(ns)?;
        let now = self.board.now();
        while let Some((sequence, at)) = self.pings.next_if(|(_, at)| *at <= now.0) {
            let sent_ns = self.since_test(at);
            self.conversation.handle_sent(sequence, sent_ns, None);
        }
        let received = match self.link {
            Link::Telem1 => self.board.take_received(Connector::Telem1)?,
            Link::Telem2 => self.board.take_received(Connector::Telem2)?,
            Link::Usb => self.board.with_usb(Host::take_received)?,
        };
        for received in received {
            let byte = StampedByte {
                stamp: Stamp((received.at.0 / 6) as u32),
                byte: received.byte,
            };
            if let Some(Received { message, .. }) = self.client.push(byte) {
                let now_ns = self.since_test(received.at.0);
                self.conversation.handle_message(now_ns, &message);
                if let Message::Parameter { name, value, .. } = message
                    && Parameter::named(name) == Some(Parameter::LogMissed)
                {
                    self.log_missed = value as u32;
                }
            }
        }
        let log = self.board.take_log()?;
        let mut statuses = log
            .iter()
            .filter_map(|logged| Status::parse(&logged.line.text));
        if let Some(status) = statuses.next_back() {
            // Counters of 0 are left out.
            let count = |name| status.number(name).unwrap_or(0) as u32;
            self.line_full = count(match self.link {
                Link::Telem1 => "mav_outgoing_full",
                Link::Telem2 => "mav2_outgoing_full",
                Link::Usb => "usb_outgoing_full",
            });
            let overruns = ["gps_overrun", "mav_overrun", "mav2_overrun"].map(count);
            self.overruns = overruns.iter().sum();
            self.lost_ticks.1 = count("lost_ticks");
            if now.0 <= self.begins {
                self.lost_ticks.0 = self.lost_ticks.1;
            }
        }
        Ok(())
    }

    /// The record of a test that began at `test_utc_ns`; with the board's own log, if that is
    /// complete.
    fn end(mut self, test_utc_ns: i64, is_complete: bool) -> Record {
        let constant_ns = self.link.constant_ns();
        let utc_ns = |sent_ns| test_utc_ns + sent_ns + constant_ns;
        let mut record = Record {
            line_full: Some(self.line_full),
            lost_ticks: Some(self.lost_ticks.1.wrapping_sub(self.lost_ticks.0)),
            overruns: Some(self.overruns),
            ..self.conversation.end(Some(&utc_ns))
        };
        if is_complete {
            record.take_log(own_log(&mut self.board, self.log_missed));
        }
        record
    }
}

/// The log on the card in a board's slot.
fn own_log(board: &mut Pixhawk, missed: u32) -> anyhow::Result<OwnLog> {
    let card = board.swap_card(None)?.context("its slot is empty")?;
    let file = fat_image::contents(&mut card.image(), LOG_FILE)
        .with_context(|| format!("no {LOG_FILE} on its card"))?;
    OwnLog::read(file, missed)
}
