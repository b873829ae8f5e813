//! A simulated u-blox receiver: time marks with their latency, and its configuration.
//!
//! *Purpose.* The far end of the GPS line in `sim`, in `qemu` and in tests: it is
//! configured like a real one and sends the time like a real one.
//!
//! *Design.* Its solutions are those of [`Arrivals`](crate::Arrivals), drawn one
//! ahead, so that [`Talker::next_event`] is a look at a field. Answers to
//! configuration wait in a queue; one line carries both. TIM-TP leaves behind the
//! first solution after each pulse and forecasts the next one in
//! [`Pulses`](crate::Pulses). What the line cannot take waits; what has to wait for too long is lost.
//!
//! At a restart it is silent for [`BOOT_NS`], and then as its memory has it.
//!
//! *Limits.* Of what is not configuration it answers the polls of NAV-TIMELS, MON-VER and CFG-PRT. A
//! whole solution is lost, where a real one drops the messages that do not fit. Its pulse goes on through a
//! restart.

use std::collections::VecDeque;

use crate::arrivals::{Solution, Solver};
use crate::chance::{Stream, stream};
use crate::configuration::{Configuration, UBX};
use crate::pulse::Pulses;
use crate::pulse_maker::PulseMaker;
use crate::settings::{LeftOn, Port, ReceiverSettings};
use crate::talker::{Sent, Talker, Transmission, WorldNanos, line_ns};
use crate::ubx::{self, Claims};

/// From the last byte of a configuration frame to its answer, in ns: a receiver
/// looks at its port between other things.
const ANSWER_NS: u64 = 5_000_000;
/// The largest configuration frame that is understood. \[bytes\]
const RECEIVED_MAX: usize = 256;
/// From a restart to the first solution that may leave, in ns.
const BOOT_NS: u64 = 1_000_000_000;
const NS_PER_S: i64 = 1_000_000_000;

/// An answer that is on its way to the line.
#[derive(Clone, Debug)]
struct Answer {
    ready: WorldNanos,
    baud: u32,
    bytes: Vec<u8>,
}

/// The simulated receiver.
#[derive(Clone, Debug)]
pub struct Receiver {
    settings: ReceiverSettings,
    configuration: Configuration,
    rng: fastrand::Rng,
    solver: Solver,
    solution: Solution,
    pulses: PulseMaker,
    /// Restarts to come.
    restarts: VecDeque<WorldNanos>,
    /// Until then it takes and sends nothing.
    off_until: WorldNanos,
    /// Epochs so far, for messages that leave at every n-th one.
    epochs: u64,
    /// Pulses that were forecast so far, for TIM-TP that leaves at every n-th one.
    forecasts: u64,
    answers: VecDeque<Answer>,
    received: Vec<u8>,
    line_free: WorldNanos,
    truth: Vec<Sent>,
}

impl Receiver {
    /// A receiver that is powered at the world's start.
    #[must_use]
    pub fn new(settings: ReceiverSettings) -> Self {
        let mut solver = Solver::new(&settings);
        let on_utc_ns = settings.utc_at_start_ns + settings.power_on.0.cast_signed();
        let solution = solver.solve_after(on_utc_ns, settings.port.period_ns());
        Self {
            configuration: Configuration::new(&settings),
            rng: stream(settings.seed, Stream::Answers),
            solver,
            solution,
            pulses: PulseMaker::new(&settings),
            restarts: settings.restarts.iter().copied().collect(),
            off_until: settings.power_on,
            epochs: 0,
            forecasts: 0,
            answers: VecDeque::new(),
            received: Vec::new(),
            line_free: WorldNanos(0),
            truth: Vec::new(),
            settings,
        }
    }

    /// How its port and rate stand now.
    #[must_use]
    pub const fn port(&self) -> Port {
        self.configuration.port()
    }

    /// How they will stand after a restart.
    #[must_use]
    pub const fn saved_port(&self) -> Port {
        self.configuration.saved_port()
    }

    /// What it makes on its pulse's wire, as wide as CFG-TP5 asks for.
    #[must_use]
    pub fn pulses(&self) -> Pulses {
        Pulses::at(self.configuration.pulse_port(), &self.settings)
    }

    /// The messages beside those of its port that it still sends.
    pub fn left_on(&self) -> impl Iterator<Item = &LeftOn> {
        let left_on = self.configuration.left_on().iter();
        left_on.filter(|left| left.every > 0)
    }

    /// True UTC at `at`, since 1970. \[ns\]
    #[must_use]
    pub const fn utc_ns(&self, at: WorldNanos) -> i64 {
        self.settings.utc_at_start_ns + at.0.cast_signed()
    }

    /// Draws what follows the solution whose epoch on the grid was `utc_ns`.
    fn solve_after(&mut self, utc_ns: i64) {
        self.solution = self.solver.solve_after(utc_ns, self.port().period_ns());
    }

    /// What it claims at `at`: a cold start goes through the stages of a real
    /// one (nothing; a time that it must not be believed, first without and then
    /// with a fix) in three equal parts.
    fn claims(&self, at: WorldNanos) -> Claims {
        let (valid, t_acc_ns, fix_type) = if at.0 >= self.settings.cold_start_ns {
            let is_resolved = at >= self.settings.leap_resolved();
            (if is_resolved { 0x37 } else { 0xf7 }, 22, 3)
        } else {
            match at.0.saturating_mul(3) / self.settings.cold_start_ns {
                0 => (0xf0, u32::MAX, 0),
                1 => (0xf3, u32::MAX, 0),
                _ => (0xf3, u32::MAX, 3),
            }
        };
        Claims {
            valid,
            t_acc_ns,
            fix_type,
        }
    }

    /// The burst of the solution that is due, and the next one drawn.
    fn send_solution(&mut self, start: WorldNanos) -> Option<Transmission> {
        let Solution {
            wanted_utc_ns,
            reported_utc_ns: epoch_utc_ns,
            error_ns,
            ready,
            ..
        } = self.solution;
        self.epochs += 1;
        if start.0 - ready.0 > self.settings.queue_ns {
            self.solve_after(wanted_utc_ns);
            return None;
        }
        let port = self.port();
        let every = u64::from(port.nav_pvt_every);
        let baud = port.baud;
        let mut bytes = Vec::new();
        // `checked_rem`, because 0 means never.
        if let Some(length) = self.settings.model.nav_pvt_len()
            && port.ubx
            && self.epochs.checked_rem(every) == Some(0)
        {
            let (class, id) = ubx::NAV_PVT;
            let payload = ubx::nav_pvt_payload(epoch_utc_ns, self.claims(start));
            bytes.extend(ubx::frame(class, id, &payload[..length]));
            self.truth.push(Sent {
                epoch_utc_ns,
                first_byte: start,
            });
        }
        if port.nmea {
            bytes.extend(ubx::rmc(epoch_utc_ns));
        }
        for left in self.configuration.left_on().iter().filter(|_| port.ubx) {
            if self.epochs.checked_rem(left.every.into()) == Some(0) {
                let (class, id) = left.message;
                let mut noise = fastrand::Rng::with_seed(self.epochs);
                let payload: Vec<u8> = (0..left.payload_len).map(|_| noise.u8(..)).collect();
                bytes.extend(ubx::frame(class, id, &payload));
            }
        }
        if port.ubx && port.tim_tp_every > 0 {
            bytes.extend(self.forecast(start, bytes.len(), error_ns));
        }
        self.solve_after(wanted_utc_ns);
        (!bytes.is_empty()).then_some(Transmission { start, bytes, baud })
    }

    /// TIM-TP for the first pulse after it, behind `bytes` others that begin to
    /// leave at `start`; nothing if that pulse was forecast before, or never comes.
    fn forecast(&mut self, start: WorldNanos, bytes: usize, error_ns: i64) -> Vec<u8> {
        let end = start.plus(line_ns(bytes + ubx::TIM_TP_FRAME_LEN, self.port().baud));
        let utc_s = self.utc_ns(end).div_euclid(NS_PER_S) + 1;
        let made = match self.pulses.make_for(utc_s) {
            Some(made) if utc_s * NS_PER_S >= self.utc_ns(self.settings.pulse.from) => made,
            _ => return Vec::new(),
        };
        self.forecasts += 1;
        if !self
            .forecasts
            .is_multiple_of(u64::from(self.port().tim_tp_every))
        {
            return Vec::new();
        }
        let (class, id) = ubx::TIM_TP;
        let pulse_utc_ns = utc_s * NS_PER_S + error_ns;
        ubx::frame(class, id, &ubx::tim_tp_payload(pulse_utc_ns, made.late_ps))
    }

    /// Answers one frame.
    fn answer(&mut self, now: WorldNanos, class: u8, id: u8, payload: &[u8]) {
        match (class, id, payload) {
            (0x06, 0x00, [1]) => {
                let port = self.configuration.port_payload();
                if let Some(payload) = port {
                    self.queue(now, self.port().baud, &ubx::frame(0x06, 0x00, &payload));
                }
                self.acknowledge(now, self.port().baud, 0x00, port.is_some());
            }
            (0x06, _, [_, ..]) => {
                let before = self.port();
                let accepted = self.configuration.configure(id, payload);
                let after = self.port();
                let utc_ns = self.utc_ns(now);
                // One that is on its way already still comes.
                if before.period_ms != after.period_ms && self.solution.wanted_utc_ns > utc_ns {
                    self.solve_after(utc_ns);
                }
                // At which speed a change of speed is acknowledged is not defined.
                let is_old = self.rng.bool();
                let baud = if is_old { before.baud } else { after.baud };
                self.acknowledge(now, baud, id, accepted);
            }
            (0x0a, 0x04, []) => {
                let payload = self.settings.model.version_payload();
                self.queue(now, self.port().baud, &ubx::frame(class, id, &payload));
            }
            (_, _, []) if (class, id) == ubx::NAV_TIMELS => {
                let ready = now.plus(ANSWER_NS);
                let is_resolved = ready >= self.settings.leap_resolved();
                let event = self.settings.leap.second_60_ends();
                let is_over = event.is_some_and(|end| ready >= end);
                let count = if is_resolved {
                    ubx::GPS_MINUS_UTC_S as i8 + i8::from(is_over)
                } else {
                    self.settings.leap.built_with
                };
                // It has a second's resolution, and is 0 from the second 60 on.
                let in_s = event.map(|end| end.0.saturating_sub(ready.0) / NS_PER_S.unsigned_abs());
                let in_s = in_s.filter(|_| is_resolved && !is_over);
                let payload = ubx::nav_timels_payload(self.utc_ns(ready), count, is_resolved, in_s);
                self.queue(now, self.port().baud, &ubx::frame(class, id, &payload));
            }
            _ => {}
        }
    }

    /// An answer is on its way to the line, if its port has UBX.
    fn queue(&mut self, now: WorldNanos, baud: u32, frame: &[u8]) {
        if self.port().ubx {
            self.answers.push_back(Answer {
                ready: now.plus(ANSWER_NS),
                baud,
                bytes: frame.to_vec(),
            });
        }
    }

    fn acknowledge(&mut self, now: WorldNanos, baud: u32, id: u8, accepted: bool) {
        let frame = ubx::frame(0x05, u8::from(accepted), &[0x06, id]);
        self.queue(now, baud, &frame);
    }

    /// Its power fails for a moment.
    fn restart(&mut self, at: WorldNanos) {
        self.answers.clear();
        self.received.clear();
        self.configuration.restart();
        self.off_until = at.plus(BOOT_NS);
        self.solve_after(self.utc_ns(self.off_until));
    }
}

impl Talker for Receiver {
    fn next_event(&self) -> Option<WorldNanos> {
        let answer = self.answers.front().map(|answer| answer.ready);
        let first = answer.map_or(self.solution.ready, |ready| ready.min(self.solution.ready));
        let leaves = first.max(self.line_free);
        let restarts = self.restarts.front().copied();
        Some(restarts.map_or(leaves, |at| leaves.min(at)))
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        let start = self.next_event()?;
        if start > now {
            return None;
        }
        if let Some(at) = self.restarts.pop_front_if(|at| *at <= start) {
            self.restart(at);
            return self.poll(now);
        }
        let answer = self
            .answers
            .pop_front_if(|answer| answer.ready <= self.solution.ready);
        let transmission = match answer {
            Some(Answer { baud, bytes, .. }) => Some(Transmission { start, bytes, baud }),
            None => self.send_solution(start),
        }?;
        self.line_free = transmission.end();
        Some(transmission)
    }

    fn handle_bytes(&mut self, now: WorldNanos, baud: u32, bytes: &[u8]) {
        let is_reachable = now >= self.off_until && !self.settings.is_deaf;
        if baud != self.port().baud || !is_reachable {
            self.received.clear();
            return;
        }
        self.received.extend(bytes);
        let received = core::mem::take(&mut self.received);
        let mut done = received.len().saturating_sub(RECEIVED_MAX);
        for frame in ubx::find_frames(&received, |_, _, _| true) {
            // What follows a change of its speed is noise.
            if baud == self.port().baud && self.port().protocols_in & UBX != 0 {
                self.answer(now, frame.class, frame.id, frame.payload);
            }
            done = done.max(frame.end());
        }
        self.received = received[done..].to_vec();
    }

    fn truth(&self) -> &[Sent] {
        &self.truth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Latency, Pulse, Pulses};

    const NOON_NS: i64 = 1_795_348_800_000_000_000;
    const SECOND: u64 = 1_000_000_000;
    const PORT_115200_UBX: [u8; 20] = [
        1, 0, 0, 0, 0xd0, 8, 0, 0, 0, 0xc2, 1, 0, 1, 0, 1, 0, 0, 0, 0, 0,
    ];

    fn configured(latency: Latency) -> ReceiverSettings {
        let mut settings = ReceiverSettings::new(NOON_NS);
        settings.port = Port::CONFIGURED;
        settings.latency = latency;
        settings
    }

    /// Everything that leaves before `end`.
    fn run(receiver: &mut Receiver, end: WorldNanos) -> Vec<Transmission> {
        let mut sent = Vec::new();
        while let Some(at) = receiver.next_event()
            && at < end
        {
            sent.extend(receiver.poll(at));
        }
        sent
    }

    fn payload(sent: &Transmission) -> [u8; ubx::NAV_PVT_LEN] {
        *sent.bytes[6..].first_chunk().unwrap()
    }

    #[test]
    fn five_a_second_with_the_latency_that_was_asked_for() {
        let mut receiver = Receiver::new(configured(Latency::constant(70_000_000)));
        let sent = run(&mut receiver, WorldNanos(2_000 * SECOND));
        assert_eq!(sent.len(), 9_999);
        let mut off_grid_ns = Vec::new();
        for (sent, truth) in sent.iter().zip(receiver.truth()) {
            assert_eq!(
                ubx::nav_pvt_epoch_utc_ns(&payload(sent)),
                truth.epoch_utc_ns
            );
            assert_eq!(sent.start, truth.first_byte);
            assert_eq!(receiver.utc_ns(sent.start) - truth.epoch_utc_ns, 70_000_000);
            off_grid_ns
                .push((truth.epoch_utc_ns + 100_000_000).rem_euclid(200_000_000) - 100_000_000);
        }
        // 600 · 10⁻⁹ for 2000 s is 1.2 teeth of ±0.5 ms, in steps of 120 ns.
        let (least, most) = (off_grid_ns.iter().min(), off_grid_ns.iter().max());
        assert_eq!(most.copied(), Some(499_920));
        assert_eq!(least.copied(), Some(-499_960));
    }

    #[test]
    fn a_half_bell_stands_on_its_floor() {
        let mut receiver = Receiver::new(configured(Latency::half_normal(60_000_000, 5_000_000)));
        run(&mut receiver, WorldNanos(2_000 * SECOND));
        let late: Vec<i64> = receiver
            .truth()
            .iter()
            .map(|sent| receiver.utc_ns(sent.first_byte) - sent.epoch_utc_ns - 60_000_000)
            .collect();
        assert!(late.iter().all(|ns| *ns >= 0));
        // The mean of half a bell curve is σ · √(2/π) = 3.989 ms; its own standard
        // deviation over 10 000 draws is 0.030 ms.
        let mean_ns = late.iter().sum::<i64>() / late.len() as i64;
        assert!((mean_ns - 3_989_000).abs() < 150_000, "{mean_ns}");
    }

    #[test]
    fn it_is_configured_at_its_own_speed_only() {
        let mut receiver = Receiver::new(ReceiverSettings::new(NOON_NS));
        let port = ubx::frame(6, 0, &PORT_115200_UBX);
        receiver.handle_bytes(WorldNanos(0), 115_200, &port);
        assert_eq!(receiver.port(), Port::FACTORY);
        // In two pieces, behind noise.
        receiver.handle_bytes(WorldNanos(0), 9_600, b"\xb5\x62\x06");
        receiver.handle_bytes(WorldNanos(0), 9_600, &port[..9]);
        receiver.handle_bytes(WorldNanos(0), 9_600, &port[9..]);
        assert_eq!(
            (receiver.port().baud, receiver.port().nmea),
            (115_200, false)
        );

        let now = WorldNanos(100_000_000);
        receiver.handle_bytes(now, 115_200, &ubx::frame(6, 8, &[0xc8, 0, 1, 0, 0, 0]));
        receiver.handle_bytes(now, 115_200, &ubx::frame(6, 1, &[1, 7, 1]));
        receiver.handle_bytes(now, 115_200, &ubx::frame(6, 0x3e, &[0]));
        assert_eq!(receiver.port(), Port::CONFIGURED);
        let sent = run(&mut receiver, WorldNanos(SECOND));
        let answers: Vec<&[u8]> = sent.iter().take(4).map(|sent| &sent.bytes[..]).collect();
        assert_eq!(
            answers,
            [
                ubx::frame(5, 1, &[6, 0]),
                ubx::frame(5, 1, &[6, 8]),
                ubx::frame(5, 1, &[6, 1]),
                ubx::frame(5, 0, &[6, 0x3e]),
            ]
        );
        // From the epoch at 0.2 s on, four are through their latency.
        assert_eq!(sent.len(), 8);
        assert!(sent.is_sorted_by(|one, next| one.end() <= next.start));
    }

    #[test]
    fn out_of_its_box_it_speaks_nmea() {
        let mut receiver = Receiver::new(ReceiverSettings::new(NOON_NS));
        let sent = run(&mut receiver, WorldNanos(10 * SECOND));
        assert_eq!(sent.len(), 9);
        assert!(
            sent.iter()
                .all(|sent| sent.bytes.starts_with(b"$GNRMC") && sent.baud == 9_600)
        );
        assert!(receiver.truth().is_empty());
    }

    #[test]
    fn a_cold_start_claims_no_good_time_before_its_end() {
        let mut settings = configured(Latency::constant(0));
        settings.cold_start_ns = 30 * SECOND;
        let mut receiver = Receiver::new(settings);
        for sent in run(&mut receiver, WorldNanos(60 * SECOND)) {
            let payload = payload(&sent);
            let good = payload[11] & 7 == 7 && payload[12..16] != [0xff; 4];
            assert_eq!(good, sent.start >= WorldNanos(30 * SECOND));
        }
    }

    #[test]
    fn tim_tp_forecasts_each_pulse_before_it_comes() {
        let mut receiver = Receiver::new(configured(Latency::m8()));
        receiver.handle_bytes(WorldNanos(0), 115_200, &ubx::frame(6, 1, &[0x0d, 1, 1]));
        let pulses: Vec<Pulse> = Pulses::new(&configured(Latency::m8())).take(60).collect();
        let mut forecasts = 0;
        for sent in run(&mut receiver, WorldNanos(50 * SECOND)) {
            for frame in ubx::find_frames(&sent.bytes, |class, id, _| (class, id) == ubx::TIM_TP) {
                let field = |at: usize| <[u8; 4]>::try_from(&frame.payload[at..at + 4]).unwrap();
                // 2026-11-22 is a Sunday, the first day of the week; noon is its half.
                let tow_ms = u32::from_le_bytes(field(0)) - 43_200_000;
                let pulse = pulses
                    .iter()
                    .find(|p| p.utc_s == Some(NOON_NS / NS_PER_S + i64::from(tow_ms / 1_000)));
                let pulse = pulse.expect("a pulse as forecast");
                assert_eq!(i32::from_le_bytes(field(8)), -pulse.late_ps);
                assert!(sent.end() < pulse.edge && pulse.edge.0 - sent.end().0 < SECOND);
                forecasts += 1;
            }
        }
        // The first is forecast at 0.2 s, one more each second.
        assert_eq!(forecasts, 50);
        // And the pulse may begin later.
        let mut settings = configured(Latency::m8());
        settings.port.tim_tp_every = 1;
        settings.pulse.from = WorldNanos(30 * SECOND);
        let sent = run(&mut Receiver::new(settings), WorldNanos(50 * SECOND));
        let with_forecast = sent.iter().filter(|sent| sent.bytes.len() > 100);
        let starts: Vec<u64> = with_forecast.map(|sent| sent.start.0 / SECOND).collect();
        assert_eq!(starts, (29..50).collect::<Vec<u64>>());
    }

    #[test]
    fn the_same_seed_says_the_same() {
        let settings = ReceiverSettings {
            port: Port::CONFIGURED,
            ..ReceiverSettings::new(NOON_NS)
        };
        let send = |seed| {
            run(
                &mut Receiver::new(ReceiverSettings {
                    seed,
                    ..settings.clone()
                }),
                WorldNanos(9 * SECOND),
            )
        };
        assert_eq!(send(1), send(1));
        assert_ne!(send(1), send(2));
    }
}
