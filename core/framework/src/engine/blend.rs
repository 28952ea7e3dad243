//! Decides how an output passes from an old graph's value to a new one's without a step.

use serde::{Deserialize, Serialize};

use crate::compile::PlannedOutput;
use crate::time::{Duration, Instant};
use crate::unit::Unit;

/// What is added to an output while it passes over.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Blending {
    /// What was put out last, by whichever graph, and when.
    last: Option<(Instant, f64)>,
    /// Set at a hand-over until the new graph has its first value.
    begins: bool,
    /// What is still added, and falls to nothing at the stated rate.
    offset: f64,
}

/// An output's rate, in its unit per second; none where the output steps over at once.
pub(crate) fn rate(output: &PlannedOutput, unit: &Unit) -> Option<f64> {
    output
        .blend
        .as_ref()?
        .in_unit(&unit.difference().per(&Unit::second()))
}

impl Blending {
    /// The value to put out where the graph has `value`.
    pub(crate) fn pass(&mut self, now: Instant, value: f64, rate: f64) -> f64 {
        let elapsed = self.last.map_or(Duration::ZERO, |(at, _)| now - at).secs();
        if self.begins {
            self.begins = false;
            self.offset = self.last.map_or(0.0, |(_, last)| last - value);
        }
        let most = rate * elapsed;
        self.offset = if self.offset.abs() <= most {
            0.0
        } else {
            self.offset - most.copysign(self.offset)
        };
        let shown = value + self.offset;
        self.last = Some((now, shown));
        shown
    }

    /// Takes over what another graph put out last.
    pub(crate) fn hand_over(&mut self, from: &Self) {
        *self = Self {
            begins: from.last.is_some(),
            ..*from
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    #[test]
    fn an_output_passes_over_at_its_rate_and_then_follows() {
        let mut old = Blending::default();
        assert_eq!(old.pass(s(0), 200.0, 5.0), 200.0);
        let mut new = Blending::default();
        new.hand_over(&old);
        assert_eq!(new.pass(s(1), 0.0, 5.0), 195.0);
        assert_eq!(new.pass(s(2), 1.0, 5.0), 191.0);
        for t in 3..60 {
            new.pass(s(t), 1.0, 5.0);
        }
        assert_eq!(new.pass(s(60), 1.0, 5.0), 1.0);
        assert_eq!(
            new.pass(s(61), 300.0, 5.0),
            300.0,
            "a step of the new graph itself is its own business"
        );
    }

    #[test]
    fn without_a_value_before_there_is_nothing_to_pass_over_from() {
        let mut new = Blending::default();
        new.hand_over(&Blending::default());
        assert_eq!(new.pass(s(1), 7.0, 5.0), 7.0);
    }
}
