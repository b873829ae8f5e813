//! PX4's figures: how long what keeps the core busy, and how often, at the load `px4`.
//!
//! *Interrupts and masked sections.* PX4's histogram of how late the interrupt of its timer comes, before and
//! after PX4-Autopilot#12718 ([`PX4_BEFORE`](crate::PX4_BEFORE), [`PX4_AFTER`](crate::PX4_AFTER)). An
//! event at any moment comes `x` late or later when it falls into a busy stretch of which `x` is left, so the
//! density of the lateness at `x` is the rate of stretches times the share of them that is longer than `x`.
//! The tails below are that density, with the histogram's share in each bucket. What the change took away are
//! the sensors that are read inside the timer's interrupt (PX4-Autopilot#7569): they are the interrupts
//! here, and what is left after it are the masked sections. Stretches below 5 µs are left out: PX4 has
//! tens of thousands a second, which delay by less than what anybody here measures.
//!
//! *Tasks.* Those of PX4's `top` on FMUv2, in the order of their priorities, with the run times of
//! PX4-Autopilot#7020 (mean and largest). A task without a figure there has that of a neighbour, and its
//! rate is such that its share of the core is within what PX4-Autopilot#1148, #2255, #2883, #2968,
//! #3204 and #4688 show. Together with interrupts and masks they are 55 % of the core.
//!
//! *Limits.* How long a task runs between its mean and its largest is not known: 31 of 32 times it is the
//! mean here, else it is drawn with a density that falls to 0 at the largest.

/// Where a piece of the load stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// In an interrupt of the load itself.
    Interrupt,
    /// In a section that masks such interrupts.
    Masked,
    /// In a task above the GNSS task.
    Above,
    /// In a task between the GNSS and the MAVLink task.
    Between,
    /// In a task below both.
    Below,
}

/// How long something lasts: below which time, in µs, which share of all is longer; linear in between.
pub type Tail = &'static [(u32, f32)];

/// Something that comes at random moments.
#[derive(Clone, Copy, Debug)]
pub struct Stretches {
    /// In a second, at the load `px4`. \[Hz\]
    pub rate_hz: u32,
    /// How long each lasts.
    pub tail: Tail,
}

/// What interrupts take: #12718's row before less that after it.
pub const INTERRUPTS: Stretches = Stretches {
    rate_hz: 3_090,
    tail: &[
        (5, 1.0),
        (10, 0.254),
        (20, 0.192),
        (50, 0.166),
        (100, 0.031),
        (600, 0.0),
    ],
};

/// What masked sections take: #12718's row after it.
pub const MASKED: Stretches = Stretches {
    rate_hz: 9_620,
    tail: &[(5, 1.0), (10, 0.599), (20, 0.015), (50, 0.0)],
};

/// A task that runs again and again.
#[derive(Clone, Copy, Debug)]
pub struct Task {
    /// PX4's name for it.
    pub name: &'static str,
    /// Where it stands.
    pub level: Level,
    /// In a second, at the load `px4`. \[Hz\]
    pub rate_hz: u32,
    /// How long it runs as a rule. \[µs\]
    pub mean_us: u32,
    /// How long it runs at most. \[µs\]
    pub largest_us: u32,
}

/// Of this many runs of a task one is longer than its mean.
pub const LONGER_IN: u32 = 32;

const fn task(name: &'static str, level: Level, rate_hz: u32, us: (u32, u32)) -> Task {
    Task {
        name,
        level,
        rate_hz,
        mean_us: us.0,
        largest_us: us.1,
    }
}

/// PX4's tasks: priorities above 220 (the GPS task's), between it and 175 (the MAVLink receiver's), and below.
pub const TASKS: [Task; 9] = [
    // 3 to 17 % of the core; run times as px4io's.
    task("sensors", Level::Above, 230, (328, 3_465)),
    task("attitude control", Level::Above, 250, (108, 417)),
    task("px4io transfer", Level::Above, 100, (328, 3_465)),
    // Run times as MAVLink's loop.
    task("estimator", Level::Between, 220, (312, 3_607)),
    task("commander", Level::Between, 100, (312, 3_607)),
    task("hpwork", Level::Between, 140, (142, 3_607)),
    task("MAVLink", Level::Below, 100, (312, 3_607)),
    task("px4io update", Level::Below, 20, (740, 55_096)),
    task("navigator", Level::Below, 50, (45, 3_910)),
];

/// The longest that a task above the executors may run. \[µs\]
pub const LONGEST_ABOVE_US: u32 = 5_000;

#[cfg(test)]
mod tests {
    use super::*;

    /// What the tail makes of the core, as a share.
    fn share(stretches: &Stretches) -> f32 {
        let least = stretches.tail[0].0 as f32;
        let beyond: f32 = stretches
            .tail
            .windows(2)
            .map(|pair| {
                let [(from, above), (to, below)] = [pair[0], pair[1]];
                (to - from) as f32 * (above + below) / 2.0
            })
            .sum();
        stretches.rate_hz as f32 * (least + beyond) * 1e-6
    }

    fn share_of_tasks() -> f32 {
        let each = TASKS.iter().map(|task| {
            let longer = (task.largest_us - task.mean_us) as f32 / 3.0 / LONGER_IN as f32;
            task.rate_hz as f32 * (task.mean_us as f32 + longer) * 1e-6
        });
        each.sum()
    }

    #[test]
    fn together_they_are_55_percent_of_the_core() {
        let parts = [share(&INTERRUPTS), share(&MASKED), share_of_tasks()];
        let all: f32 = parts.iter().sum();
        assert!((0.54..0.56).contains(&all), "{parts:?}");
    }

    #[test]
    fn no_task_above_the_executors_is_longer_than_5_ms_and_tails_fall() {
        for task in TASKS {
            assert!(task.mean_us <= task.largest_us, "{task:?}");
            let is_above = task.level == Level::Above;
            assert!(!is_above || task.largest_us <= LONGEST_ABOVE_US, "{task:?}");
        }
        for stretches in [INTERRUPTS, MASKED] {
            assert!(stretches.tail.is_sorted_by(|a, b| a.0 < b.0 && a.1 > b.1));
            assert_eq!(stretches.tail[0].1, 1.0);
            assert_eq!(stretches.tail.last().map(|last| last.1), Some(0.0));
        }
    }
}
