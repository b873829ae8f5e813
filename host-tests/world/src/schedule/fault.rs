//! What can go wrong with a receiver.

use std::fmt;

/// The count that is right since 2017: GPS less UTC, in s.
pub const LEAP_COUNT: i8 = 18;

/// Something that goes wrong for a while.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// Its first moment, in s.
    pub from_s: f64,
    /// The first moment after it, in s.
    pub until_s: f64,
    /// What it is.
    pub kind: FaultKind,
}

impl Fault {
    /// Whether it is there at a moment, in s.
    #[must_use]
    pub fn is_at(&self, at_s: f64) -> bool {
        (self.from_s..self.until_s).contains(&at_s)
    }

    /// How much of a fault that comes and goes within `edge_s` is there at a moment, 0
    /// to 1.
    pub(super) fn share(&self, at_s: f64, edge_s: f64) -> f64 {
        if !self.is_at(at_s) {
            return 0.0;
        }
        let inside_s = (at_s - self.from_s).min(self.until_s - at_s);
        (inside_s / edge_s.max(1e-9)).min(1.0)
    }
}

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// The least latency is another one.
    FloorStep {
        /// How far, in ms.
        by_ms: f64,
    },
    /// The least latency moves away and back.
    FloorRamp {
        /// How far, in ms.
        by_ms: f64,
        /// How fast each way, in s.
        edge_s: f64,
    },
    /// The least latency goes up and down.
    FloorBreathe {
        /// From its middle to its end, in ms.
        by_ms: f64,
        /// How often, in s.
        period_s: f64,
    },
    /// Other messages leave before each mark.
    Queue {
        /// For how long, in ms.
        by_ms: f64,
        /// How fast they grow and shrink, in s.
        edge_s: f64,
    },
    /// The line is full: all messages come later and later, until it drains.
    Lag {
        /// How far at most, in s.
        peak_s: f64,
        /// How long it grows, in s; 0 if it is there before the start.
        rise_s: f64,
        /// How long it ebbs, in s.
        fall_s: f64,
    },
    /// The first marks are less late than they should be (or more, below 0): their
    /// labels are ahead.
    FirstMarks {
        /// How many.
        marks: u8,
        /// How far, in ms.
        by_ms: f64,
    },
    /// The label of the first mark in the span is ahead.
    LabelOnce {
        /// How far, in ms.
        by_ms: f64,
    },
    /// All labels are ahead.
    Labels {
        /// How far, in ns.
        by_ns: i64,
        /// TIM-TP has the same, where it is whole seconds.
        is_in_tim_tp: bool,
    },
    /// The receiver applies a leap second that is months away.
    LeapEarly,
    /// The leap count does not come from the sky.
    LeapUnresolved {
        /// What it is meanwhile, in s.
        count: i8,
        /// What NAV-TIMELS calls its source.
        source: u8,
        /// NAV-PVT's `valid` and TIM-TP say that it is not known.
        is_told: bool,
    },
    /// The receiver starts anew.
    Restart {
        /// For so long it says nothing, in s.
        silent_s: f64,
        /// And then, until the span ends, it does not know the time.
        lie: RestartLie,
        /// What its pulse does meanwhile.
        pulse: RestartPulse,
    },
    /// No messages; the pulse goes on.
    Silence,
    /// A switch takes another receiver, as good as the first.
    OtherReceiver {
        /// How far its least latency changes, in ms.
        floor_by_ms: f64,
        /// How much later its pulse comes, in ns.
        pulse_by_ns: f64,
    },
    /// The pulse, of our width, runs freely.
    PulseFreeRun {
        /// How far behind the second it begins, in ms.
        phase_ms: f64,
        /// How slow it is, in ppm.
        ppm: f64,
        /// What TIM-TP has to say of it.
        word: PulseWord,
    },
    /// The pulse is at another phase, and TIM-TP has nothing to say against it.
    PulseShifted {
        /// So many ms behind the second.
        phase_ms: f64,
    },
    /// Each pulse is followed by another one.
    PulseDoubled {
        /// So many ms later.
        after_ms: f64,
        /// So many ms wide.
        width_ms: f64,
    },
    /// The pulse comes more than once a second.
    PulseRate {
        /// In Hz.
        hz: u32,
        /// TIM-TP announces it; else it is another device's.
        is_told: bool,
    },
    /// The pulse has the other polarity.
    PulseInverted,
    /// The pulse has another width.
    PulseWidth {
        /// In ms.
        width_ms: f64,
    },
    /// The wire is another device's, which makes a pulse a second.
    PulseSwap {
        /// How far behind the second it begins, in ms.
        phase_ms: f64,
        /// How slow it is, in ppm.
        ppm: f64,
        /// So many ms wide.
        width_ms: f64,
    },
    /// The pulse's wire is cut.
    PulseCut,
    /// By chance a pulse is missing.
    PulseMissing {
        /// One in this number.
        one_in: u32,
    },
    /// By chance a pulse comes at some other moment of its second.
    PulseOdd {
        /// One in this number.
        one_in: u32,
    },
    /// TIM-TP's qErr is nonsense.
    QErr(QErrNonsense),
    /// TIM-TP names the pulse's second in another way, or wrongly.
    TimTpLie(TimTpLie),
    /// A forged sky that is smooth from the start: labels, TIM-TP and pulse agree.
    ForgedSky {
        /// How far all of it is ahead, in ns.
        by_ns: i64,
    },
    /// The pulse is dragged off its second by somebody who forges TIM-TP, too.
    PulseDragged {
        /// So many ns a second.
        ppb: f64,
    },
}

/// What TIM-TP says of a pulse that runs freely.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PulseWord {
    /// Nothing: it is missing.
    Nothing,
    /// That there is no UTC.
    NoUtc,
    /// A time of week that is no whole second.
    Fraction,
}

/// What the pulse of a receiver does while that starts anew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RestartPulse {
    /// There is none.
    Silent,
    /// It runs freely, this far behind the second, in ms.
    RunsFreely(f64),
    /// It goes on as if nothing had happened, and so does TIM-TP but for its date.
    GoesOn,
}

/// What a receiver that has started anew sends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RestartLie {
    /// The right time.
    Nothing,
    /// The date of its memory, off by whole days.
    Date {
        /// Below 0 in the past.
        by_days: i32,
    },
    /// The leap count of its memory, in s.
    Count {
        /// In place of [`LEAP_COUNT`].
        count: i8,
    },
}

/// Kinds of a qErr that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QErrNonsense {
    /// Always the same, in ps: more than any receiver's tick.
    Constant(i32),
    /// Any of 32 bits.
    Random,
    /// Of the other sign.
    Negated,
    /// Random, and flagged as invalid.
    Invalid,
}

/// Ways for TIM-TP to name another second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimTpLie {
    /// In GPS time, and it says so.
    GpsBase,
    /// Three hours ahead, in UTC by its word.
    Glonass,
    /// 1 024 weeks back.
    Week,
    /// RAIM is not active.
    NoRaim,
    /// It says that there is no UTC, and the pulse is right all the same.
    NoUtc,
    /// It is missing, and the pulse is right all the same.
    Missing,
}

impl FaultKind {
    /// In one or two words.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::FloorStep { .. } => "floor steps",
            Self::FloorRamp { .. } => "floor ramps",
            Self::FloorBreathe { .. } => "floor breathes",
            Self::Queue { .. } => "messages before marks",
            Self::Lag { .. } => "lag",
            Self::FirstMarks { .. } => "first marks",
            Self::LabelOnce { .. } => "one label",
            Self::Labels { .. } => "labels",
            Self::LeapEarly => "leap early",
            Self::LeapUnresolved { .. } => "leap unresolved",
            Self::Restart { .. } => "restart",
            Self::Silence => "silence",
            Self::OtherReceiver { .. } => "other receiver",
            Self::PulseFreeRun { .. } => "pulse free-running",
            Self::PulseShifted { .. } => "pulse shifted",
            Self::PulseDoubled { .. } => "pulse doubled",
            Self::PulseRate { .. } => "pulse rate",
            Self::PulseInverted => "pulse inverted",
            Self::PulseWidth { .. } => "pulse width",
            Self::PulseSwap { .. } => "pulse swapped",
            Self::PulseCut => "pulse cut",
            Self::PulseMissing { .. } => "pulses missing",
            Self::PulseOdd { .. } => "pulses odd",
            Self::QErr(_) => "qErr",
            Self::TimTpLie(_) => "TIM-TP lies",
            Self::ForgedSky { .. } => "forged sky",
            Self::PulseDragged { .. } => "pulse dragged",
        }
    }

    /// Whether it says where the pulse's edges are.
    #[must_use]
    pub const fn shapes_pulse(&self) -> bool {
        matches!(
            self,
            Self::PulseFreeRun { .. }
                | Self::PulseShifted { .. }
                | Self::PulseDoubled { .. }
                | Self::PulseRate { .. }
                | Self::PulseInverted
                | Self::PulseWidth { .. }
                | Self::PulseSwap { .. }
                | Self::PulseCut
                | Self::PulseMissing { .. }
                | Self::PulseOdd { .. }
                | Self::PulseDragged { .. }
        )
    }

    /// Whether it moves the least latency of messages.
    #[must_use]
    pub const fn moves_floor(&self) -> bool {
        matches!(
            self,
            Self::FloorStep { .. } | Self::FloorRamp { .. } | Self::FloorBreathe { .. }
        )
    }

    /// Whether labels contradict a clock that knows the second.
    #[must_use]
    pub(super) const fn is_contradiction(&self) -> bool {
        match *self {
            Self::Labels { by_ns, .. } => by_ns.abs() > 500_000_000,
            Self::LeapEarly | Self::Restart { .. } => true,
            _ => false,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            from_s,
            until_s,
            kind,
        } = self;
        write!(f, "{from_s:.1}-{until_s:.1} s: {kind:?}")
    }
}
