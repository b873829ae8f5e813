//! The published time line under every preemption that one core allows.
//!
//! *Purpose.* The proof of [`super`], by visiting: each access to a
//! shared word is a step, and at each step a context of higher priority may run
//! to its end. On one core there are no other interleavings.
//!
//! *Design.* The words call back before each access. A plan says at which access
//! of the running context which other one comes in; plans nest, so a thread's
//! reading is interrupted by the writer while that is interrupted by a reader.
//! The models come from a real clock whose rate swings from −400 to +400 ppm.
//!
//! *Limits.* Steps are in program order; that the compiler keeps it is what the
//! fences are for.

use std::boxed::Box;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::vec;
use std::vec::Vec;

use super::{TimeLine, Word};
use crate::model::ClockModel;
use crate::{Published, Settings, UtcClock, UtcNanos};
use timebase::{CORE_HZ, CivilTime, Cycles, TimeMark, Validity};

type Context = Box<dyn FnOnce()>;

/// Who comes in before which access: the innermost context's plan is the last.
#[derive(Default)]
struct Steps {
    plans: RefCell<Vec<Option<(usize, Context)>>>,
    accesses: Cell<usize>,
}

impl Steps {
    /// Runs `context`; `other` comes in before its access number `step`.
    /// Returns what it made and whether `other` has come in.
    fn run<T>(&self, step: usize, other: Context, context: impl FnOnce() -> T) -> (T, bool) {
        self.plans.borrow_mut().push(Some((step, other)));
        let made = context();
        let left = self.plans.borrow_mut().pop().expect("the plan made above");
        (made, left.is_none())
    }

    fn access(&self) {
        self.accesses.set(self.accesses.get() + 1);
        let due = match self.plans.borrow_mut().last_mut() {
            Some(plan) => match plan {
                Some((0, _)) => plan.take(),
                Some((step, _)) => {
                    *step -= 1;
                    None
                }
                None => None,
            },
            None => None,
        };
        if let Some((_, other)) = due {
            // The newcomer has no plan of its own unless it makes one.
            self.plans.borrow_mut().push(None);
            other();
            self.plans.borrow_mut().pop();
        }
    }
}

struct SteppedWord {
    value: Cell<u32>,
    steps: Rc<Steps>,
}

impl Word for SteppedWord {
    fn load(&self) -> u32 {
        self.steps.access();
        self.value.get()
    }

    fn store(&self, value: u32) {
        self.steps.access();
        self.value.set(value);
    }
}

struct World {
    steps: Rc<Steps>,
    line: Rc<TimeLine<SteppedWord>>,
    models: Rc<Vec<ClockModel>>,
}

/// The pieces of one clock's line, the unset one first.
fn models() -> Vec<ClockModel> {
    let line = Published::new();
    let mut clock = UtcClock::new(Settings::DEFAULT, line.take_writer().unwrap());
    let mut models = vec![ClockModel::BOOT];
    for i in 0..7_u8 {
        // Late by turns, so that it slews to and fro; all within the 10 s of a
        // stamp.
        let now = Cycles((3 + u64::from(i)) * u64::from(CORE_HZ));
        let mark = TimeMark {
            busy_us: 0,
            arrival: Cycles(now.0 - 1_000_000 * u64::from(1 + i % 2)),
            epoch: CivilTime {
                year: 2026,
                month: 11,
                day: 22,
                hour: 1,
                minute: 2,
                second: i,
                nano: 0,
            },
            t_acc_ns: 20,
            validity: Validity {
                date: true,
                time: true,
                fully_resolved: true,
                confirmed: true,
                leap_seconds_known: true,
            },
        };
        clock.handle_mark(&mark, now);
        models.push(line.line.newest());
    }
    models
}

impl World {
    /// With all models before number `published` published.
    fn new(models: &Rc<Vec<ClockModel>>, published: usize) -> Self {
        let steps = Rc::new(Steps::default());
        let line = TimeLine::over(|value| SteppedWord {
            value: Cell::new(value),
            steps: Rc::clone(&steps),
        });
        for model in &models[1..published] {
            line.publish(model);
        }
        steps.accesses.set(0);
        Self {
            steps,
            line: Rc::new(line),
            models: Rc::clone(models),
        }
    }

    /// The line as a whole: the newest model that has begun by `when`.
    fn truth(&self, when: Cycles) -> UtcNanos {
        line_at(&self.models, when)
    }

    fn reader(&self, how: Read, when: Cycles) -> impl FnOnce() -> UtcNanos + use<> {
        let line = Rc::clone(&self.line);
        move || match how {
            Read::Short => line.utc_of(when.stamp()),
            Read::Whole => line.reading_at(when).utc,
        }
    }
}

/// The newest of `models` that has begun by `when`; the first one prolonged, if
/// none has.
fn line_at(models: &[ClockModel], when: Cycles) -> UtcNanos {
    let in_force = models.iter().rev().find(|m| m.at() <= when);
    in_force.unwrap_or(&models[0]).utc_at(when)
}

#[derive(Clone, Copy, Debug)]
enum Read {
    Short,
    Whole,
}

const READS: [Read; 2] = [Read::Short, Read::Whole];

/// Stamps about the beginnings of the models that are kept when `published` are
/// out and one is being written, one older than all, and none that is later than
/// the call's moment.
fn stamps(models: &[ClockModel], published: usize) -> Vec<Cycles> {
    let kept = &models[published.saturating_sub(3)..published];
    let next = models[published].at();
    let mut stamps: Vec<_> = kept
        .iter()
        .flat_map(|m| [m.at(), m.at().plus(1), m.at().plus(12_345)])
        .chain(kept.iter().map(|m| Cycles(m.at().0.saturating_sub(1))))
        .chain([Cycles(kept[0].at().0.saturating_sub(1_000_000))])
        .chain([Cycles(next.0 - 1)])
        .collect();
    stamps.sort();
    stamps
}

#[test]
fn a_reader_that_interrupts_the_writer_reads_at_once_and_right() {
    let models = Rc::new(models());
    for published in 1..models.len() {
        for how in READS {
            for when in stamps(&models, published) {
                for step in 0.. {
                    let world = World::new(&models, published);
                    let seen = Rc::new(Cell::new(None));
                    let reader = {
                        let (seen, steps) = (Rc::clone(&seen), Rc::clone(&world.steps));
                        let read = world.reader(how, when);
                        move || {
                            let before = steps.accesses.get();
                            seen.set(Some((read(), steps.accesses.get() - before)));
                        }
                    };
                    let writer = || world.line.publish(&models[published]);
                    let ((), interrupted) = world.steps.run(step, Box::new(reader), writer);
                    if !interrupted {
                        assert!(step > 8, "each word is a step");
                        break;
                    }
                    let (utc, accesses) = seen.get().expect("it ran");
                    let kept = &models[published.saturating_sub(3)..published];
                    assert_eq!(utc, line_at(kept, when), "{published} {how:?} {step}");
                    // The number twice and at most three models: it never spins.
                    // The short way has looked at one before it takes the long, which
                    // first looks how far away the newest is.
                    let before = (2 + 5) + (1 + 8);
                    assert!(accesses <= before + 2 + 3 * 8, "{accesses} accesses");
                    // And the answer stays the same when the writer is through,
                    // unless the oldest model was needed and is gone now.
                    if models[published.saturating_sub(2)].at() <= when {
                        assert_eq!(world.reader(how, when)(), utc);
                    }
                }
            }
        }
    }
}

/// Up to three publications come in at each step of a reading, and a reader of
/// still higher priority at each step of those.
#[test]
fn a_reader_that_the_writer_interrupts_reads_again_and_right() {
    let models = Rc::new(models());
    for published in 1..models.len() {
        for burst in 1..=(models.len() - published).min(6) {
            for how in READS {
                for when in stamps(&models, published) {
                    interrupted_by_a_burst(&models, published, burst, how, when);
                }
            }
        }
    }
}

fn interrupted_by_a_burst(
    models: &Rc<Vec<ClockModel>>,
    published: usize,
    burst: usize,
    how: Read,
    when: Cycles,
) {
    for step in 0.. {
        for inner_step in 0.. {
            let world = World::new(models, published);
            let inner_seen = Rc::new(Cell::new(None));
            let inner_came = Rc::new(Cell::new(false));
            let writer = {
                let (models, line) = (Rc::clone(models), Rc::clone(&world.line));
                let steps = Rc::clone(&world.steps);
                let inner = world.reader(how, when);
                let seen = Rc::clone(&inner_seen);
                let came = Rc::clone(&inner_came);
                move || {
                    let inner: Context = Box::new(move || seen.set(Some(inner())));
                    let ((), in_time) = steps.run(inner_step, inner, || {
                        for model in &models[published..published + burst] {
                            line.publish(model);
                        }
                    });
                    came.set(in_time);
                }
            };
            let read = world.reader(how, when);
            let (utc, interrupted) = world.steps.run(step, Box::new(writer), read);
            if !interrupted {
                assert!(step >= 7, "the number twice and five words are steps");
                return;
            }
            // Whatever came in where, it is what an undisturbed reading says
            // either before or after, and the truth as long as the models kept
            // reach so far back.
            let after = world.reader(how, when)();
            let before = World::new(models, published).reader(how, when)();
            let newest = published + burst - 1;
            let covered = models[newest.saturating_sub(2)].at() <= when;
            assert!(utc == after || utc == before, "{step} {inner_step}");
            if covered {
                assert_eq!(utc, world.truth(when));
                if let Some(inner) = inner_seen.get() {
                    assert_eq!(inner, world.truth(when));
                }
            }
            if !inner_came.get() {
                break;
            }
        }
    }
}
