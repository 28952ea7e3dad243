//! Between which values samples have lain, and when others lie far outside.

use serde::{Deserialize, Serialize};

use super::Engine;

/// The lowest and the highest sample of a measured channel that counted, in the unit of its signal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SampleRange {
    /// The channel: `temperature.plate1`.
    pub channel: String,
    /// The lowest sample.
    pub lowest: f64,
    /// The highest sample.
    pub highest: f64,
}

impl SampleRange {
    /// By how many of its own widths samples from `lowest` to `highest` reach beyond it, on the side where they do more; 0 where they
    /// lie within, and where it has no width, so that nothing is known of what is usual.
    #[must_use]
    pub fn exceeded_by(&self, lowest: f64, highest: f64) -> f64 {
        let width = self.highest - self.lowest;
        if width <= 0.0 {
            return 0.0;
        }
        let beyond = (highest - self.highest).max(self.lowest - lowest);
        beyond.max(0.0) / width
    }

    /// Whether samples from `lowest` to `highest` reach farther beyond it than it is wide.
    #[must_use]
    pub fn is_far_from(&self, lowest: f64, highest: f64) -> bool {
        self.exceeded_by(lowest, highest) > 1.0
    }
}

impl Engine {
    /// Between which values the samples of each measured channel lay that counted, in the order of the plan; without those of which
    /// none has come.
    #[must_use]
    pub fn sample_ranges(&self) -> Vec<SampleRange> {
        let extremes = self.plan.sources.iter().zip(&self.extremes);
        extremes
            .filter(|(_, of)| of.lowest <= of.highest)
            .map(|(source, of)| SampleRange {
                channel: source.name.clone(),
                lowest: of.lowest,
                highest: of.highest,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::SampleRange;

    fn range(lowest: f64, highest: f64) -> SampleRange {
        SampleRange {
            channel: "temperature.plate".to_owned(),
            lowest,
            highest,
        }
    }

    #[test]
    fn a_range_is_exceeded_by_as_many_widths_as_another_lies_outside() {
        let usual = range(20.0, 25.0);
        assert_eq!(usual.exceeded_by(21.0, 24.0), 0.0);
        assert_eq!(usual.exceeded_by(10.0, 26.0), 2.0);
        assert!(usual.is_far_from(10.0, 26.0) && !usual.is_far_from(15.0, 30.0));
        assert_eq!(usual.exceeded_by(295.0, 300.0), 55.0);
    }

    #[test]
    fn what_never_changed_has_no_usual_range() {
        assert_eq!(range(20.0, 20.0).exceeded_by(300.0, 301.0), 0.0);
    }
}
