//! What has to hold.
//!
//! *Purpose.* The bounds of the experiment on virtual boards, judged on what was run.
//!
//! *Design.* Each bound is there only when the methods that it speaks of were run. Means
//! are over all runs of a method.
//!
//! *Limits.* How the paper's own steps rank among each other is no bound: what their
//! receivers, oscillators and load were is not known.

use crate::method::Method;
use crate::run::{Experiment, Place, Run};

/// pixclock's mean difference. \[ns\]
const PIXCLOCK_NS: f64 = 300_000.0;
/// How much better than the paper's best method pixclock is.
const BETTER: f64 = 20.0;
/// The same on the pulse, as seen through PINGs. \[ns\]
const PULSE_NS: f64 = 500.0;

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
    let mean = |method| experiment.estimate(method).map(|estimate| estimate.mean);
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
