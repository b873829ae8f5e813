//! How the clock is kept, and what each variant leaves to choose.

/// The ticks that the firmware can have: those of the paper's table 3, and pixclock's at all of
/// them. \[µs\]
pub const TICKS_US: [u32; 4] = [1_000, 500, 200, 50];

/// The baud rates that PX4 uses with such receivers: the one that the paper sets, and the default
/// of a Here+. [Bd]
const PAPER_BAUDS: [u32; 2] = [DEFAULT_BAUD, 38_400];

/// The baud rate unless another one is asked for. [Bd]
pub(crate) const DEFAULT_BAUD: u32 = 115_200;

/// The greatest latency of a receiver that pixclock can correct. [µs]
const MAX_LATENCY_US: u32 = 500_000;

/// How the clock is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// pixclock: stamped bytes, the envelope of the latency, the time pulse.
    Pixclock {
        /// From tick to tick, one of [`TICKS_US`]. \[µs\]
        tick_us: u32,
    },
    /// PX4 1.9 as it is: a tick of 1000 µs, one priority for all interrupts, a wait that depends on
    /// the baud rate.
    PaperDefault,
    /// The paper's step I: the same with a constant wait.
    PaperStep1,
    /// The paper's step II: step I with SysTick above all other interrupts and a shorter tick.
    PaperStep2 {
        /// From tick to tick, one of [`TICKS_US`] below 1000. \[µs\]
        tick_us: u32,
    },
    /// Step II without its priority: the shorter tick with SysTick among the other interrupts, which is what
    /// the paper's step II argues against.
    PaperTickOnly {
        /// From tick to tick, one of [`TICKS_US`] below 1000. \[µs\]
        tick_us: u32,
    },
}

impl Variant {
    /// What is flashed unless another variant is asked for.
    pub const STANDARD: Self = Self::Pixclock { tick_us: 50 };

    /// The names of all variants, in the order of their numbers.
    pub const NAMES: [&str; 5] = [
        "pixclock",
        "paper-default",
        "paper-step1",
        "paper-step2",
        "paper-tick-only",
    ];

    /// The paper's variants with the ticks of its table 3, and the shortest of them without its priority.
    pub const PAPERS: [Self; 6] = [
        Self::PaperDefault,
        Self::PaperStep1,
        Self::PaperStep2 { tick_us: 500 },
        Self::PaperStep2 { tick_us: 200 },
        Self::PaperStep2 { tick_us: 50 },
        Self::PaperTickOnly { tick_us: 50 },
    ];

    /// Every variant at every tick that it has.
    pub fn all() -> impl Iterator<Item = Self> {
        TICKS_US
            .into_iter()
            .map(|tick_us| Self::Pixclock { tick_us })
            .chain(Self::PAPERS)
    }

    /// The variant of that name, with its shortest tick.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::all()
            .filter(|variant| variant.name() == name)
            .min_by_key(|variant| variant.tick_us())
    }

    /// The variant of that number, with that tick.
    #[must_use]
    pub fn numbered(number: u32, tick_us: u32) -> Option<Self> {
        Self::all().find(|variant| variant.number() == number && variant.tick_us() == tick_us)
    }

    /// The same variant with another tick, if it has that one.
    #[must_use]
    pub fn with_tick_us(self, tick_us: u32) -> Option<Self> {
        Self::numbered(self.number(), tick_us)
    }

    /// Its name, which is the value of the build setting `PIXCLOCK_VARIANT`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        let [
            pixclock,
            paper_default,
            paper_step1,
            paper_step2,
            paper_tick_only,
        ] = Self::NAMES;
        match self {
            Self::Pixclock { .. } => pixclock,
            Self::PaperDefault => paper_default,
            Self::PaperStep1 => paper_step1,
            Self::PaperStep2 { .. } => paper_step2,
            Self::PaperTickOnly { .. } => paper_tick_only,
        }
    }

    /// Its number, which is the value of the MAVLink parameter `PC_VARIANT`.
    #[must_use]
    pub const fn number(self) -> u32 {
        match self {
            Self::Pixclock { .. } => 0,
            Self::PaperDefault => 1,
            Self::PaperStep1 => 2,
            Self::PaperStep2 { .. } => 3,
            Self::PaperTickOnly { .. } => 4,
        }
    }

    /// From tick to tick. \[µs\]
    #[must_use]
    pub const fn tick_us(self) -> u32 {
        match self {
            Self::Pixclock { tick_us }
            | Self::PaperStep2 { tick_us }
            | Self::PaperTickOnly { tick_us } => tick_us,
            Self::PaperDefault | Self::PaperStep1 => 1_000,
        }
    }

    /// The ticks that this variant can have. \[µs\]
    pub fn ticks_us(self) -> impl Iterator<Item = u32> {
        TICKS_US
            .into_iter()
            .filter(move |&tick_us| self.with_tick_us(tick_us).is_some())
    }

    /// The baud rates that the receiver's line can have, the default first. \[Bd\]
    #[must_use]
    pub const fn gps_bauds(self) -> &'static [u32] {
        match self {
            Self::Pixclock { .. } => &[DEFAULT_BAUD],
            _ => &PAPER_BAUDS,
        }
    }

    /// The greatest latency of the receiver that can be corrected: the paper's variants correct
    /// none. \[µs\]
    #[must_use]
    pub const fn max_latency_us(self) -> u32 {
        if self.is_papers() { 0 } else { MAX_LATENCY_US }
    }

    /// Whether it is one of the paper's.
    #[must_use]
    pub const fn is_papers(self) -> bool {
        !matches!(self, Self::Pixclock { .. })
    }
}

/// The name, without the tick.
#[cfg(feature = "defmt")]
impl defmt::Format for Variant {
    fn format(&self, f: defmt::Formatter<'_>) {
        match self {
            Self::Pixclock { .. } => defmt::write!(f, "pixclock"),
            Self::PaperDefault => defmt::write!(f, "paper-default"),
            Self::PaperStep1 => defmt::write!(f, "paper-step1"),
            Self::PaperStep2 { .. } => defmt::write!(f, "paper-step2"),
            Self::PaperTickOnly { .. } => defmt::write!(f, "paper-tick-only"),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn a_number_is_the_place_of_the_name() {
        for variant in Variant::all() {
            assert_eq!(Variant::NAMES[variant.number() as usize], variant.name());
            let again = Variant::numbered(variant.number(), variant.tick_us());
            assert_eq!(again, Some(variant));
        }
        assert_eq!(Variant::numbered(5, 50), None);
    }

    #[test]
    fn a_name_alone_means_the_shortest_tick() {
        assert_eq!(Variant::named("pixclock"), Some(Variant::STANDARD));
        assert_eq!(Variant::named("paper-step1"), Some(Variant::PaperStep1));
        let shortest = Variant::PaperStep2 { tick_us: 50 };
        assert_eq!(Variant::named("paper-step2"), Some(shortest));
        assert_eq!(Variant::named("paper"), None);
    }

    #[test]
    fn only_step_2_and_pixclock_leave_a_choice_of_ticks() {
        let ticks = |variant: Variant| variant.ticks_us().collect::<Vec<_>>();
        assert_eq!(ticks(Variant::STANDARD), TICKS_US);
        assert_eq!(ticks(Variant::PaperDefault), [1_000]);
        assert_eq!(ticks(Variant::PaperStep1), [1_000]);
        assert_eq!(ticks(Variant::PaperStep2 { tick_us: 50 }), [500, 200, 50]);
        assert_eq!(Variant::STANDARD.with_tick_us(100), None);
    }
}
