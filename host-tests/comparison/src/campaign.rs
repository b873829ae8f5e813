//! Many trials on all cores.
//!
//! *Purpose.* Every seed at every temperature of a case.
//!
//! *Design.* Threads take the next trial until none is left; each result has its
//! place, so that the figures do not depend on the order.
//!
//! *Limits.* A case's trials are all held until they are pooled.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

use crate::case::{Case, Temperature};
use crate::figures::Figures;
use crate::trial;

/// How many trials a case has over `seeds`.
#[must_use]
pub fn trials(case: &Case, seeds: &Range<u64>) -> usize {
    case.temperatures.len() * (seeds.end - seeds.start) as usize
}

/// Runs a case over `seeds`; `progress` is called after each trial. None if there
/// are no seeds.
pub fn run(case: &'static Case, seeds: &Range<u64>, progress: &dyn Fn()) -> Option<Figures> {
    let jobs: Vec<(u64, Temperature)> = seeds
        .clone()
        .flat_map(|seed| case.temperatures.iter().map(move |&kind| (seed, kind)))
        .collect();
    let next = AtomicUsize::new(0);
    let (sender, results) = mpsc::channel();
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let mut done = Vec::with_capacity(jobs.len());
    thread::scope(|scope| {
        for _ in 0..cores {
            let (sender, jobs, next) = (sender.clone(), &jobs, &next);
            scope.spawn(move || {
                while let Some(&(seed, kind)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let trial = trial::run(case, kind, seed);
                    // The receiver is gone once the campaign has been given up.
                    let _ = sender.send(((seed, kind as usize), trial));
                }
            });
        }
        drop(sender);
        for result in results {
            done.push(result);
            progress();
        }
    });
    done.sort_by_key(|(job, _)| *job);
    Figures::of(case, done.into_iter().map(|(_, trial)| trial).collect())
}
