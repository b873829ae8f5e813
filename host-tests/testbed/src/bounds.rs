//! What has to hold.
//!
//! *Purpose.* The bounds of the experiment on virtual boards, judged on what was run.
//!
//! *Design.* Each bound is there only when the methods that it speaks of were run. Means
//! are over all runs of a method.
//!
//! *Limits.* How the paper's own steps rank among each other is no bound: what their
//! receivers, oscillators and load were is not known.

use variant::Load;

use crate::boards::Receivers;
use crate::case::Case;
use crate::latency::beyond_telem1;
use crate::link::{FRAME_NS, Link};
use crate::method::Method;
use crate::run::{Experiment, Place, Run};
use crate::units::with_sign;

/// pixclock's mean difference. \[ns\]
const PIXCLOCK_NS: f64 = 300_000.0;
/// How much better than the paper's best method pixclock is.
const BETTER: f64 = 20.0;
/// The same on the pulse, as seen through PINGs. \[ns\]
const PULSE_NS: f64 = 500.0;

/// Up to this load the two bounds below hold for ours, in tests of this length: a shorter one sees the clocks
/// while they learn. \[%, s\]
const OURS_PERCENT: u8 = 60;
const WHOLE_TEST_S: u32 = 600;
/// pixclock's mean difference under such a load, with receivers like an M8. \[ns\]
const LOADED_NS: f64 = 75_000.0;
/// The same on the pulse. \[ns\]
const LOADED_PULSE_NS: f64 = 35.0;

/// Up to this rate no answer may be missing. \[PINGs a second\]
const EASY_HZ: u32 = 100;

/// A bound and what was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Bound {
    /// What has to hold.
    pub text: &'static str,
    /// What was measured, in words.
    pub measured: String,
    /// Whether it holds.
    pub holds: bool,
}

/// Every bound that the runs of `experiment` can be held against.
#[must_use]
pub fn judge(experiment: &Experiment) -> Vec<Bound> {
    if experiment.place != Place::Virtual {
        return Vec::new();
    }
    let mean = |method| {
        let case = experiment.plain(method)?;
        experiment.estimate(case).map(|estimate| estimate.mean)
    };
    let ours = mean(Method::Pixclock);
    let pulse = mean(Method::PixclockPps);
    let best = mean(Method::PaperStep2(50));
    let mixed = mean(Method::PaperDefaultMixed);
    let step1 = mean(Method::PaperStep1);
    let mut bounds = Vec::new();
    let mut hold = |text, measured, holds| {
        bounds.push(Bound {
            text,
            measured,
            holds,
        });
    };
    if let Some(ours) = ours {
        let measured = format!("{:.4} ms", ours / 1e6);
        hold("pixclock: mean ≤ 0.3 ms", measured, ours <= PIXCLOCK_NS);
    }
    if let (Some(ours), Some(best)) = (ours, best) {
        let better = best / ours;
        hold(
            "pixclock: at least 20 times better than paper-step2:50",
            format!("{better:.1} times"),
            better >= BETTER,
        );
    }
    if let Some(pulse) = pulse {
        let measured = format!("{:.3} µs", pulse / 1e3);
        hold("pixclock-pps: mean ≤ 0.5 µs", measured, pulse <= PULSE_NS);
    }
    if let (Some(mixed), Some(step1)) = (mixed, step1) {
        hold(
            "paper-default-mixed stands above paper-step1",
            format!("{:.2} ms, {:.2} ms", mixed / 1e6, step1 / 1e6),
            mixed > step1,
        );
    }
    bounds.extend(under_load(experiment));
    bounds.extend(by_usb(experiment));
    let mut hold = |text, measured, holds| {
        bounds.push(Bound {
            text,
            measured,
            holds,
        });
    };
    let missing: usize = experiment.runs.iter().map(Run::missing).sum();
    if experiment.rate_hz <= EASY_HZ {
        let measured = format!("{missing} missing");
        hold("every PING is answered", measured, missing == 0);
    } else {
        let full: Option<u32> = experiment.runs.iter().map(Run::line_full).sum();
        let measured = format!("{missing} missing, {} by their count", full.unwrap_or(0));
        let counted = full.is_some_and(|full| missing <= full as usize);
        hold(
            "answers are missing only where the boards' lines were full",
            measured,
            counted,
        );
    }
    bounds
}

/// What has to hold by USB, of our methods: the paper's read a clock that stands still between ticks.
fn by_usb(experiment: &Experiment) -> Option<Bound> {
    let cases = experiment.cases().into_iter();
    let ours = cases.filter(|case| case.link == Link::Usb && !case.method.is_papers());
    let beyond: Vec<_> = ours
        .filter_map(|case| beyond_telem1(experiment, case))
        .collect();
    let least = beyond.iter().map(|latency| latency.least).min()?;
    let greatest = beyond.iter().map(|latency| latency.greatest).max()?;
    Some(Bound {
        text: "by USB: stamped as by TELEM1 or later, by at most one frame of 1 ms",
        measured: format!(
            "{} to {}",
            with_sign(least as f64),
            with_sign(greatest as f64)
        ),
        // By TELEM1 a stamp is later than the PING by the time of a byte, and by USB no stamp is before the PING.
        holds: least >= -Link::Telem1.constant_ns() && greatest <= FRAME_NS,
    })
}

/// What has to hold where a load is built in.
fn under_load(experiment: &Experiment) -> Vec<Bound> {
    let mut bounds = Vec::new();
    let loaded = || experiment.runs.iter().filter(|run| run.case.load > 0);
    if loaded().next().is_none() {
        return bounds;
    }
    let mut hold = |text, measured, holds| {
        bounds.push(Bound {
            text,
            measured,
            holds,
        });
    };
    if let Some(overruns) = loaded().map(Run::overruns).sum::<Option<u32>>() {
        let measured = format!("{overruns} overruns");
        hold(
            "no line loses a byte, whatever the load",
            measured,
            overruns == 0,
        );
    }
    let lost = |is_wanted: fn(&Case) -> bool| {
        let mut runs = loaded().filter(|run| is_wanted(&run.case)).peekable();
        runs.peek()?;
        runs.map(Run::lost_ticks).sum::<Option<u32>>()
    };
    if let Some(lost) = lost(|case| !case.method.is_papers() && case.load <= OURS_PERCENT) {
        let measured = format!("{lost} ticks");
        hold("ours up to 60 %: no tick is lost", measured, lost == 0);
    }
    if let Some(lost) = lost(|case| matches!(case.method, Method::PaperStep2(_))) {
        let measured = format!("{lost} ticks");
        hold("step II loses no tick under any load", measured, lost == 0);
    }
    if let Some(lost) =
        lost(|case| case.method == Method::PaperTickOnly(50) && case.load >= Load::PX4_PERCENT)
    {
        let measured = format!("{lost} ticks");
        hold(
            "a tick of 50 µs alone loses some under px4",
            measured,
            lost > 0,
        );
    }
    let worst = |method| {
        let cases = experiment.cases().into_iter().filter(|case| {
            let is_loaded = case.load > 0 && case.load <= OURS_PERCENT;
            let is_whole = experiment
                .runs_of(*case)
                .all(|run| run.lasted_s >= WHOLE_TEST_S);
            let is_usual = case.receivers == Receivers::M8 && case.link != Link::Usb;
            case.method == method && is_loaded && is_whole && is_usual
        });
        let means = cases.filter_map(|case| experiment.estimate(case));
        means.map(|estimate| estimate.mean).max_by(f64::total_cmp)
    };
    if let Some(ours) = worst(Method::Pixclock) {
        let measured = format!("{:.1} µs", ours / 1e3);
        hold(
            "pixclock up to 60 %: mean ≤ 75 µs",
            measured,
            ours <= LOADED_NS,
        );
    }
    if let Some(pulse) = worst(Method::PixclockPps) {
        let measured = format!("{pulse:.1} ns");
        hold(
            "pixclock-pps up to 60 %: mean ≤ 35 ns",
            measured,
            pulse <= LOADED_PULSE_NS,
        );
    }
    bounds
}
