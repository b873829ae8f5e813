//! The edge: how densely marks lie just above the floor.
//!
//! *Purpose.* How far above the floor the lowest of a window is likely to be: the estimate's
//! uncertainty, and how long the window has to be.
//!
//! *Design.* Marks at a density of λ a second and a ns leave a gap of 1/λW, on average, between the
//! floor and the lowest of a window of W seconds; and just such gaps between the lowest few of
//! them. So the *scale* is the mean of those gaps: order statistics, which know nothing of our own
//! line and so cannot lock it below the edge.
//!
//! An edge whose density begins at 0 is soft: its lowest mark comes nearer to the floor only as a
//! root of the number of marks, and lies several gaps above it. Gaps inside of bins of 2 s beside
//! gaps in a whole window tell: by the *sharpness*, the exponent between the two. Jitter that is
//! correlated has dense bins and a blunt window, and counts as soft, too.
//!
//! *Limits.* Both are averages over minutes.

/// Lowest points of a window that the scale is read from.
const LOWEST: usize = 9;

/// What is taken for a gap where too few marks are known, in ns: the width of an M8's jitter.
const UNKNOWN_NS: f32 = 30e6;

/// The first bins' gaps are averaged with so many of a guess.
const GUESSES: f32 = 2.0;
const GUESS_NS: f32 = 5e6;
/// And then over so many bins.
const GAPS_OVER: f32 = 150.0;

/// Ten marks of a bin of 2 s: their lowest two are 1/2λ apart, more than half of it where the edge
/// is half a bell. So many ns·s are 1/λ for each ns of gap.
const GAP_S: f32 = 1.4;

/// Bins over which the sharpness is averaged.
const SHARPNESS_OVER: f32 = 30.0;
/// What counts as sharp: half a bell's lowest marks are not quite even. Tuned.
const SHARP: f32 = 0.96;
/// How many scales the floor is away with 95 %: ln 20 and a little for a sharp edge, and more for
/// soft ones. Tuned.
const SCALES: f32 = 3.85;
const SCALES_SOFT: f32 = 38.0;

/// How densely marks lie above the floor.
#[derive(Clone, Copy, Debug)]
pub(super) struct ArrivalDensity {
    scale_ns: f32,
    sharpness: f32,
    gap_ns: f32,
    gaps: f32,
    /// The second lowest of the bin that is being filled.
    second_ns: Option<i32>,
}

impl ArrivalDensity {
    pub(super) const fn new() -> Self {
        Self {
            scale_ns: UNKNOWN_NS,
            sharpness: 1.0,
            gap_ns: GUESS_NS,
            gaps: GUESSES,
            second_ns: None,
        }
    }

    /// A new floor: what is known of single bins stays.
    pub(super) const fn begin(&mut self) {
        self.scale_ns = UNKNOWN_NS;
        self.second_ns = None;
    }

    /// A mark that is not the lowest of its bin is so far above the line.
    pub(super) fn note(&mut self, excess_ns: i32) {
        let second_ns = self
            .second_ns
            .map_or(excess_ns, |second| second.min(excess_ns));
        self.second_ns = Some(second_ns);
    }

    /// A bin of so many seconds is full; its lowest mark is so far above the line.
    pub(super) fn close_bin(&mut self, lowest_ns: i32, lasted_s: f32) {
        if let Some(second_ns) = self.second_ns.take() {
            // The gap that one of 2 s has.
            let gap_ns = second_ns.saturating_sub(lowest_ns).max(0) as f32 * lasted_s / 2.0;
            self.gaps = (self.gaps + 1.0).min(GAPS_OVER);
            self.gap_ns += (gap_ns - self.gap_ns) / self.gaps;
        }
    }

    /// Measures itself on the lowest of the bins of a window of `span_s`.
    pub(super) fn measure(&mut self, lowest: &Lowest, span_s: f32) {
        let spacing_ns = lowest.spacing_ns().unwrap_or(UNKNOWN_NS);
        self.scale_ns = spacing_ns.max(self.gap_in(span_s));
        if span_s > 8.0 {
            let sharpness = libm::log2f((self.gap_ns * GAP_S / self.scale_ns).max(1.0))
                / libm::log2f(span_s / 2.0);
            self.sharpness += (sharpness - self.sharpness) / SHARPNESS_OVER;
        }
    }

    /// The mean gap above the floor in a window, in ns.
    pub(super) const fn scale_ns(&self) -> f32 {
        self.scale_ns
    }

    /// The same for a window of `span_s`, by what single bins say; in ns.
    pub(super) fn gap_in(&self, span_s: f32) -> f32 {
        self.gap_ns * GAP_S / span_s.max(2.0)
    }

    /// How far the lowest of the window may be above the floor, in ns.
    pub(super) fn uncertainty_ns(&self) -> f32 {
        let softness = (SHARP - self.sharpness).clamp(0.0, 0.5);
        (SCALES + SCALES_SOFT * softness) * self.scale_ns
    }
}

/// The lowest few of a row of numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lowest {
    sorted: [i32; LOWEST],
    count: usize,
}

impl Lowest {
    pub(super) const fn new() -> Self {
        Self {
            sorted: [i32::MAX; LOWEST],
            count: 0,
        }
    }

    pub(super) fn add(&mut self, value: i32) {
        self.count = (self.count + 1).min(LOWEST);
        if self
            .sorted
            .last()
            .is_some_and(|greatest| value >= *greatest)
        {
            return;
        }
        // In the greatest's place, and down to its own.
        if let Some(greatest) = self.sorted.last_mut() {
            *greatest = value;
        }
        for upper in (1..LOWEST).rev() {
            let Some([lower, upper]) = self.sorted.get_mut(upper - 1..=upper) else {
                return;
            };
            if *lower <= *upper {
                return;
            }
            core::mem::swap(lower, upper);
        }
    }

    /// The mean distance from one to the next, in ns; none where there are no two.
    fn spacing_ns(&self) -> Option<f32> {
        let steps = self.count.checked_sub(1).filter(|steps| *steps > 0)?;
        let (least, greatest) = (self.sorted.first()?, self.sorted.get(steps)?);
        Some(greatest.wrapping_sub(*least) as f32 / steps as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_few_of_many() {
        let mut lowest = Lowest::new();
        assert_eq!(lowest.spacing_ns(), None);
        lowest.add(700);
        assert_eq!(lowest.spacing_ns(), None);
        // 900, 890 … 10: the lowest nine are 10 apart.
        for tens in (1..=90).rev() {
            lowest.add(tens * 10);
        }
        assert_eq!(lowest.spacing_ns(), Some(10.0));
    }

    #[test]
    fn the_guess_is_soon_forgotten() {
        let mut edge = ArrivalDensity::new();
        for _ in 0..2_000 {
            edge.note(1_000);
            edge.note(400);
            edge.close_bin(100, 2.0);
        }
        let gap_ns = edge.gap_in(GAP_S * 2.0) * 2.0;
        assert!((gap_ns - 300.0).abs() < 30.0, "{gap_ns}");
    }
}
