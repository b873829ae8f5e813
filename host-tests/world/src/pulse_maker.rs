//! The pulses as the receiver makes them, one a second.
//!
//! *Purpose.* When each comes, and what TIM-TP can forecast of it.
//!
//! *Design.* The receiver can only make an edge at a tick of its own clock, which
//! drifts through UTC: that part of the error is a sawtooth, which TIM-TP forecasts.
//! The rest is noise without a forecast, some of it white, some of it slow.
//!
//! *Limits.* The noise is normal; the data sheet's (30 ns RMS, 60 ns at 99 %) has
//! shorter tails. How much of it is slow is not published: none and half are the
//! two cases.

use fastrand::Rng;

use crate::WorldNanos;
use crate::chance::{Stream, even, normal, stream};
use crate::faults::{TimeFault, drifted_ns, time_error_ns};
use crate::settings::ReceiverSettings;

const NS_PER_S: i64 = 1_000_000_000;
const PS_PER_S: f64 = 1e12;
/// What the receiver's own clock does in a second beside its drift, in ps: an
/// assumption (2 ppb of white frequency noise), so that the sawtooth is none of a
/// textbook.
const CLOCK_NOISE_PS: f64 = 2_000.0;

/// A pulse as the receiver makes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Made {
    /// The second of UTC that it stands for, since 1970.
    pub utc_s: i64,
    /// When it rises; may lie before the world's start.
    pub edge_ns: i64,
    /// The clock's part in its lateness. \[ps\]
    pub late_ps: i32,
}

/// The pulses that the receiver makes, one a second.
#[derive(Clone, Debug)]
pub(crate) struct PulseMaker {
    rng: Rng,
    utc_at_start_ns: i64,
    time_faults: Vec<TimeFault>,
    next_s: i64,
    tick_ps: f64,
    /// What the receiver's clock gains on UTC in a second. \[ps\]
    gain_ps: f64,
    /// Where in a tick the second lies, from 0 to `tick_ps`.
    phase_ps: f64,
    white_ps: f64,
    slow_ps: f64,
    /// The share of the slow part that is kept from second to second.
    keeps: f64,
    /// Where the slow part stands, in its standard deviations.
    state: f64,
}

impl PulseMaker {
    pub(crate) fn new(settings: &ReceiverSettings) -> Self {
        let pulse = &settings.pulse;
        let mut rng = stream(settings.seed, Stream::Pulse);
        let tick_ps = match pulse.clock_hz {
            0 => 0.0,
            hz => PS_PER_S / f64::from(hz),
        };
        let square = (f64::from(pulse.rms_ns) * 1e3).powi(2);
        let slow_square = square * f64::from(pulse.correlated_percent.min(100)) / 100.0;
        // An even number within a tick has a twelfth of its square.
        let white_square = (square - slow_square - tick_ps * tick_ps / 12.0).max(0.0);
        Self {
            utc_at_start_ns: settings.utc_at_start_ns,
            time_faults: settings.time_faults.clone(),
            next_s: -(-settings.utc_at_start_ns).div_euclid(NS_PER_S),
            tick_ps,
            gain_ps: drifted_ns(NS_PER_S, settings.crystal_ppb) as f64 * 1e3,
            phase_ps: even(&mut rng) * tick_ps,
            white_ps: white_square.sqrt(),
            slow_ps: slow_square.sqrt(),
            keeps: (-(NS_PER_S as f64) / pulse.correlation_ns.max(1) as f64).exp(),
            state: normal(&mut rng),
            rng,
        }
    }

    pub(crate) fn make(&mut self) -> Made {
        let utc_s = self.next_s;
        self.next_s += 1;
        let since_start_ns = utc_s * NS_PER_S - self.utc_at_start_ns;
        let late_ps = self.phase_ps - 0.5 * self.tick_ps;
        let noise_ps = self.white_ps * normal(&mut self.rng) + self.slow_ps * self.state;
        // A receiver whose time is ahead makes its pulse early; whole seconds do
        // not show.
        let at = WorldNanos(since_start_ns.max(0).cast_unsigned());
        let half = NS_PER_S / 2;
        let early_ns = (time_error_ns(&self.time_faults, at) + half).rem_euclid(NS_PER_S) - half;
        let made = Made {
            utc_s,
            edge_ns: since_start_ns + ((late_ps + noise_ps) * 1e-3).round() as i64 - early_ns,
            late_ps: late_ps.round() as i32,
        };
        self.state = self.keeps * self.state
            + (1.0 - self.keeps * self.keeps).sqrt() * normal(&mut self.rng);
        let clock_ps = self.gain_ps + CLOCK_NOISE_PS * normal(&mut self.rng);
        if self.tick_ps > 0.0 {
            self.phase_ps = (self.phase_ps + clock_ps).rem_euclid(self.tick_ps);
        }
        made
    }

    /// The pulse of the second `utc_s`, unless it has been asked for already.
    pub(crate) fn make_for(&mut self, utc_s: i64) -> Option<Made> {
        while self.next_s < utc_s {
            self.make();
        }
        (self.next_s == utc_s).then(|| self.make())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pulse, PulseSettings, Pulses};

    const NOON_NS: i64 = 1_795_348_800_000_000_000;
    const NOON_S: i64 = NOON_NS / NS_PER_S;
    const SECOND: u64 = 1_000_000_000;

    fn settings(pulse: PulseSettings) -> ReceiverSettings {
        ReceiverSettings {
            pulse,
            ..ReceiverSettings::new(NOON_NS)
        }
    }

    /// How late a true pulse is. \[ns\]
    fn late_ns(pulse: &Pulse) -> f64 {
        (NOON_NS + pulse.edge.0 as i64 - pulse.utc_s.unwrap() * NS_PER_S) as f64
    }

    fn rms(values: impl Iterator<Item = f64>) -> f64 {
        let (squares, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
        (squares / count).sqrt()
    }

    fn autocorrelation(values: &[f64], lag: usize) -> f64 {
        let products = values.iter().zip(&values[lag..]).map(|(a, b)| a * b);
        let square = rms(values.iter().copied()).powi(2);
        products.sum::<f64>() / (values.len() - lag) as f64 / square
    }

    #[test]
    fn the_error_is_as_great_as_asked_and_the_clock_has_its_part_in_it() {
        let pulses: Vec<Pulse> = Pulses::new(&settings(PulseSettings::m8()))
            .take(100_000)
            .collect();
        let late: Vec<f64> = pulses.iter().map(late_ns).collect();
        assert!((rms(late.iter().copied()) / 30.0 - 1.0).abs() < 0.02);
        // Even over a tick of 20.83 ns: 6.01 ns RMS, and never beyond ±10.42 ns.
        let forecast: Vec<f64> = pulses.iter().map(|p| f64::from(p.late_ps) * 1e-3).collect();
        assert!(forecast.iter().all(|ns| ns.abs() <= 10.417));
        assert!((rms(forecast.iter().copied()) / 6.014 - 1.0).abs() < 0.02);
        // The forecast is a part of the error: without it, √(30² − 6.01²) = 29.39 ns are
        // left, and with its sign turned more than before.
        let apart = |sign: f64| rms(late.iter().zip(&forecast).map(|(l, t)| l - sign * t));
        assert!((apart(1.0) - 29.39).abs() < 0.3, "{}", apart(1.0));
        assert!(apart(-1.0) > 31.0);
        // The rest is white.
        let rest: Vec<f64> = late.iter().zip(&forecast).map(|(l, t)| l - t).collect();
        assert!(autocorrelation(&rest, 1).abs() < 0.02);
    }

    #[test]
    fn the_clock_alone_makes_a_sawtooth() {
        let pulse = PulseSettings {
            rms_ns: 0,
            ..PulseSettings::m8()
        };
        for pulse in Pulses::new(&settings(pulse)).take(10_000) {
            // The wire is good to a ns.
            assert!((late_ns(&pulse) - f64::from(pulse.late_ps) * 1e-3).abs() <= 0.501);
        }
        let even = PulseSettings {
            rms_ns: 0,
            clock_hz: 0,
            ..PulseSettings::m8()
        };
        assert!(
            Pulses::new(&settings(even))
                .take(100)
                .all(|p| late_ns(&p) == 0.0)
        );
    }

    #[test]
    fn half_of_it_is_slow_where_asked() {
        let pulses = Pulses::new(&settings(PulseSettings::m8_correlated()));
        // 400 000 s: 4 000 time constants.
        let late: Vec<f64> = pulses.take(400_000).map(|p| late_ns(&p)).collect();
        assert!((rms(late.iter().copied()) / 30.0 - 1.0).abs() < 0.03);
        // The clock's part repeats itself a little; 50 s leave e^−0.5 of the slow half.
        for (lag, expected) in [(50, 0.303), (100, 0.184), (400, 0.009)] {
            let is = autocorrelation(&late, lag);
            assert!((is - expected).abs() < 0.04, "{lag}: {is}");
        }
    }

    #[test]
    fn a_receiver_that_runs_away_takes_its_pulse_with_it() {
        let mut settings = settings(PulseSettings::m8());
        settings.time_faults = vec![
            TimeFault::jump(WorldNanos(10 * SECOND), 1_000_000_000),
            TimeFault::drift(WorldNanos(50 * SECOND), 1_000),
        ];
        for pulse in Pulses::new(&settings).take(100) {
            // 1 µs a second, early because it is ahead; the jump does not show.
            let since_s = pulse.utc_s.unwrap() - NOON_S - 50;
            let expected = -1_000.0 * since_s.max(0) as f64;
            assert!((late_ns(&pulse) - expected).abs() < 200.0);
        }
    }
}
