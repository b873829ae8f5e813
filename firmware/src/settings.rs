//! The settings that this image was built with; `build.rs` makes them from the
//! environment.

/// How the clock is kept (`PIXCLOCK_VARIANT`): our variant, and those that Shim, Joo and Kim (2021)
/// measured, to be measured beside it. The numbers are those of the parameter `PC_VARIANT`.
#[derive(Clone, Copy, PartialEq, Eq)]
#[expect(dead_code, reason = "an image has one of them")]
pub enum Variant {
    /// Ours: stamps, the envelope of the latency, the pulse.
    Pixclock = 0,
    /// PX4 1.9 as it comes: tick 1000 µs, all interrupts of one priority, a wait by the rate.
    PaperDefault = 1,
    /// The paper's step I: the same with a constant wait.
    PaperStep1 = 2,
    /// The paper's step II: beside that SysTick above everything, and a shorter tick.
    PaperStep2 = 3,
}

impl Variant {
    /// Whether it is one of the paper's.
    pub const fn is_papers(self) -> bool {
        !matches!(self, Self::Pixclock)
    }
}

include!(concat!(env!("OUT_DIR"), "/settings.rs"));
