//! Every interleaving of a reader, the tick interrupt and a second interrupt.
//!
//! *Purpose.* Shows that `tick::now` lies between its call and its return and so
//! never goes back, whatever preempts it, and that the model is sharp enough to
//! convict readings that are wrong.
//!
//! *Design.* A machine with a short period. Every access to a counter or a shared word
//! is one step: time passes, wraps pend the tick, and whatever may preempt at that
//! point does so by running to its end right there, which is what preemption is on
//! a single core. At each step the machine *chooses*: whether the second
//! interrupt arrives, and whether the code stalls (a slow bus, a masked section,
//! an interrupt that is none of ours). A run is a sequence of choices; the test
//! walks through all sequences, from every phase of the period.
//!
//! *Limits.* Two or three readings a run, with up to two arrivals of the second
//! interrupt and two stalls; otherwise a step is one cycle.

use std::cell::{Cell, RefCell};

use timebase::Cycles;
use timebase::tick::{self, CounterPair, Word};

/// Cycles a wrap in the model, a witness of the same ratio as on the Pixhawk.
const PERIOD: u32 = 32;
const RATIO: u32 = 2;

/// A depth-first walk through all sequences of choices.
#[derive(Default)]
struct Choices {
    path: Vec<(u32, u32)>,
    depth: usize,
}

impl Choices {
    fn choose(&mut self, options: u32) -> u32 {
        if self.depth == self.path.len() {
            self.path.push((0, options));
        }
        let (choice, of) = self.path[self.depth];
        assert_eq!(of, options, "a replayed run must ask the same questions");
        self.depth += 1;
        choice
    }

    /// Moves on to the next sequence; false when all were walked.
    fn next(&mut self) -> bool {
        self.depth = 0;
        while let Some((choice, options)) = self.path.pop() {
            if choice + 1 < options {
                self.path.push((choice + 1, options));
                return true;
            }
        }
        false
    }
}

/// The priority of the second interrupt, compared with the tick's.
#[derive(Clone, Copy, PartialEq)]
enum Second {
    /// The tick preempts it, as with the firmware's priorities.
    Below,
    /// Neither preempts the other, as with the paper's default priorities.
    Equal,
}

type Reading = fn(&Machine) -> Cycles;

struct Machine {
    time: Cell<u64>,
    words: [Cell<u32>; 4],
    witness_offset: u32,
    pending: Cell<bool>,
    mask_depth: Cell<u32>,
    /// 0 thread, 1 second interrupt, 2 tick.
    level: Cell<u32>,
    second: Second,
    reading: Reading,
    arrivals_left: Cell<u32>,
    stalls_left: Cell<u32>,
    in_pair: Cell<bool>,
    choices: RefCell<Choices>,
    interrupts_taken: Cell<u64>,
    wraps: Cell<u64>,
}

impl Machine {
    /// A machine whose clock started `boot` cycles before the low word overflows,
    /// now `phase` cycles into a period.
    fn new(choices: Choices, second: Second, reading: Reading, boot: u64, phase: u32) -> Self {
        let witness_offset = 0xffff_fff0;
        let machine = Self {
            time: Cell::new(boot + u64::from(phase)),
            words: [const { Cell::new(0) }; 4],
            witness_offset,
            pending: Cell::new(false),
            mask_depth: Cell::new(0),
            level: Cell::new(0),
            second,
            reading,
            arrivals_left: Cell::new(2),
            stalls_left: Cell::new(2),
            in_pair: Cell::new(false),
            choices: RefCell::new(choices),
            interrupts_taken: Cell::new(0),
            wraps: Cell::new(0),
        };
        machine.words[Word::AnchorLow as usize].set(boot as u32);
        machine.words[Word::AnchorHigh as usize].set((boot >> 32) as u32);
        machine.words[Word::AnchorWitness as usize].set(machine.witness_at(boot));
        machine
    }

    fn witness_at(&self, time: u64) -> u32 {
        ((time / u64::from(RATIO)) as u32).wrapping_add(self.witness_offset)
    }

    fn pass(&self, cycles: u64) {
        let before = self.time.get();
        let after = before + cycles;
        self.time.set(after);
        let wraps = after / u64::from(PERIOD) - before / u64::from(PERIOD);
        if wraps > 0 {
            self.wraps.set(self.wraps.get() + wraps);
            self.pending.set(true);
        }
    }

    /// One step of whatever runs: time passes, and what may preempt does.
    fn step(&self) {
        self.pass(1);
        if self.stalls_left.get() > 0 {
            // Between the two counters only the bus can stall, by a few cycles.
            let lengths: &[u32] = if self.in_pair.get() {
                &[0, PERIOD / 8]
            } else if self.mask_depth.get() > 0 || !self.tick_may_preempt() {
                &[0, PERIOD - 1, 3 * PERIOD + 5]
            } else {
                &[0, PERIOD / 2]
            };
            let choice = self.choices.borrow_mut().choose(lengths.len() as u32);
            if choice > 0 {
                self.stalls_left.set(self.stalls_left.get() - 1);
                self.pass(u64::from(lengths[choice as usize]));
            }
        }
        self.preempt();
    }

    fn preempt(&self) {
        if self.mask_depth.get() > 0 {
            return;
        }
        self.take_ticks();
        if self.level.get() == 0
            && self.arrivals_left.get() > 0
            && self.choices.borrow_mut().choose(2) == 1
        {
            self.arrivals_left.set(self.arrivals_left.get() - 1);
            self.at_level(1, || checked_reading(self));
            // What could not preempt the second interrupt runs after it.
            self.take_ticks();
        }
    }

    fn tick_may_preempt(&self) -> bool {
        match self.second {
            Second::Below => self.level.get() < 2,
            Second::Equal => self.level.get() == 0,
        }
    }

    fn take_ticks(&self) {
        while self.tick_may_preempt() && self.pending.get() {
            self.pending.set(false);
            self.interrupts_taken.set(self.interrupts_taken.get() + 1);
            self.at_level(2, || {
                if tick::on_tick(self).is_none() {
                    tick::repair(self);
                }
            });
        }
    }

    fn at_level(&self, level: u32, run: impl FnOnce()) {
        let before = self.level.replace(level);
        run();
        self.level.set(before);
    }
}

impl CounterPair for Machine {
    const PERIOD: u32 = PERIOD;
    const RATIO: u32 = RATIO;

    fn read_pair(&self) -> (u32, u32) {
        let witness = self.read_witness();
        self.in_pair.set(true);
        self.step();
        self.in_pair.set(false);
        let into = (self.time.get() % u64::from(PERIOD)) as u32;
        (witness, (PERIOD - into) % PERIOD)
    }

    fn read_witness(&self) -> u32 {
        self.step();
        self.witness_at(self.time.get())
    }

    fn load(&self, word: Word) -> u32 {
        self.step();
        self.words[word as usize].get()
    }

    fn store(&self, word: Word, value: u32) {
        self.step();
        self.words[word as usize].set(value);
    }

    fn masked<R>(&self, section: impl FnOnce() -> R) -> R {
        self.mask_depth.set(self.mask_depth.get() + 1);
        let result = section();
        self.mask_depth.set(self.mask_depth.get() - 1);
        self.preempt();
        result
    }
}

/// A reading must lie between its call and its return. Two readings of which one
/// ends before the other begins are then in order, too.
fn checked_reading(machine: &Machine) {
    let called = machine.time.get();
    let now = (machine.reading)(machine).0;
    let returned = machine.time.get();
    assert!(
        called <= now && now <= returned,
        "read {now} between {called} and {returned}"
    );
}

/// Walks through all runs and returns how many there were.
fn walk(second: Second, reading: Reading, thread: impl Fn(&Machine)) -> u64 {
    let mut runs = 0;
    // The low word overflows within the run, or far from it.
    for boot in [
        u64::from(PERIOD) * 1_000,
        (1 << 32) - u64::from(PERIOD),
        (1 << 32) - 3 * u64::from(PERIOD),
    ] {
        for phase in 0..PERIOD {
            let mut choices = Choices::default();
            loop {
                let machine = Machine::new(choices, second, reading, boot, phase);
                thread(&machine);
                finish(&machine);
                runs += 1;
                choices = machine.choices.into_inner();
                if !choices.next() {
                    break;
                }
            }
        }
    }
    runs
}

/// Lets a last pending tick be taken; then every wrap is counted, and the lost
/// ones are exactly those that had no interrupt.
fn finish(machine: &Machine) {
    machine.stalls_left.set(0);
    machine.arrivals_left.set(0);
    machine.preempt();
    let low = machine.words[Word::AnchorLow as usize].get();
    let high = machine.words[Word::AnchorHigh as usize].get();
    let anchor = u64::from(high) << 32 | u64::from(low);
    let time = machine.time.get();
    assert_eq!(anchor, time - time % u64::from(PERIOD), "anchor at {time}");
    let lost = machine.words[Word::LostTicks as usize].get();
    assert_eq!(
        u64::from(lost),
        machine.wraps.get() - machine.interrupts_taken.get(),
        "lost ticks"
    );
}

fn read_twice(machine: &Machine) {
    checked_reading(machine);
    checked_reading(machine);
}

/// A masked section of the thread's own that reads the clock inside.
fn read_masked(machine: &Machine) {
    machine.masked(|| {
        for _ in 0..2 {
            machine.step();
            checked_reading(machine);
        }
    });
    checked_reading(machine);
}

#[test]
fn a_reading_lies_between_call_and_return() {
    for second in [Second::Below, Second::Equal] {
        let runs = walk(second, tick::now, read_twice);
        assert!(runs > 100_000, "only {runs} runs");
    }
}

#[test]
fn masked_sections_of_several_periods_lose_nothing() {
    for second in [Second::Below, Second::Equal] {
        let runs = walk(second, tick::now, read_masked);
        assert!(runs > 100_000, "only {runs} runs");
    }
}

#[test]
fn start_makes_the_last_wrap_cycle_zero_from_any_phase() {
    for phase in 0..PERIOD {
        let machine = Machine::new(Choices::default(), Second::Below, tick::now, 0, phase);
        machine.stalls_left.set(0);
        machine.arrivals_left.set(0);
        tick::start(&machine);
        // The down-counter is the second thing that `start` reads.
        let boot = u64::from((phase + 2) / PERIOD * PERIOD);
        for _ in 0..5 * PERIOD {
            let called = machine.time.get();
            let now = tick::now(&machine).0 + boot;
            assert!(called <= now && now <= machine.time.get(), "phase {phase}");
        }
    }
}

#[test]
fn a_stamp_is_the_low_word_of_the_reading() {
    let reading: Reading = |machine| {
        let called = machine.time.get();
        let stamp = tick::stamp(machine);
        // Extending needs a later moment; the machine's own clock is one.
        let now = stamp.extend(Cycles(machine.time.get()));
        assert!(now.0 >= called);
        now
    };
    walk(Second::Below, reading, read_twice);
}

/// Readings that others use, and that this model must convict.
mod wrong {
    use super::*;

    fn anchor(machine: &Machine) -> u64 {
        let high = machine.load(Word::AnchorHigh);
        u64::from(high) << 32 | u64::from(machine.load(Word::AnchorLow))
    }

    fn into_period(machine: &Machine) -> u64 {
        let (_, down_count) = machine.read_pair();
        u64::from((PERIOD - down_count) % PERIOD)
    }

    /// Reads the software count before and after the counter.
    fn double_read(machine: &Machine) -> Cycles {
        loop {
            let before = anchor(machine);
            let into = into_period(machine);
            if anchor(machine) == before {
                return Cycles(before + into);
            }
        }
    }

    /// Trusts the software count in a masked section.
    fn without_witness(machine: &Machine) -> Cycles {
        machine.masked(|| Cycles(anchor(machine) + into_period(machine)))
    }

    /// Takes the two words and the counters without masking interrupts.
    fn unmasked(machine: &Machine) -> Cycles {
        let anchor = anchor(machine);
        let witness = machine.load(Word::AnchorWitness);
        let coarse = machine.read_witness().wrapping_sub(witness) * RATIO;
        Cycles(anchor + u64::from(coarse))
    }

    fn is_convicted(reading: Reading) -> bool {
        std::panic::catch_unwind(|| {
            walk(Second::Below, reading, |machine| {
                read_twice(machine);
                read_masked(machine);
            })
        })
        .is_err()
    }

    #[test]
    fn readings_are_convicted() {
        assert!(is_convicted(double_read), "double read");
        assert!(is_convicted(without_witness), "without a witness");
        assert!(is_convicted(unmasked), "unmasked");
    }
}
