//! How an output passes from an old graph's value to a new one's without a step.

use serde::{Deserialize, Serialize};

use crate::compile::PlannedOutput;
use crate::time::{Duration, Instant};
use crate::unit::Unit;

/// How an output passes over, and what it must know for the next hand-over.
///
/// The difference between two graphs is what is passed over, so that a new graph that gives what the old one gave changes
/// nothing. Where both had a value at the same tick, that is their difference there; else the first value of the new graph
/// begins where the last one shown was.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Blending {
    /// What was shown last, by whichever graph, and when.
    shown: Option<(Instant, f64)>,
    /// What the graph itself gave last, and when.
    own: Option<(Instant, f64)>,
    /// Set at a hand-over whose difference is known only once the new graph has its first value.
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
    /// Of an output that has shown a value of its own graph as it is.
    pub(crate) fn at_once(at: Instant, value: f64) -> Self {
        Self {
            shown: Some((at, value)),
            own: Some((at, value)),
            ..Self::default()
        }
    }

    /// The value to show where the graph has `value`, the rate being in its unit per second.
    ///
    /// Between two values that are shown, the offset falls by no more than the rate times the time between them. Where time
    /// starts again, no time has passed.
    pub(crate) fn pass(&mut self, now: Instant, value: f64, rate: f64) -> f64 {
        if std::mem::take(&mut self.begins) {
            self.offset = self.shown.map_or(0.0, |(_, shown)| shown - value);
        }
        if !self.offset.is_finite() {
            // No rate would ever take such a difference away.
            self.offset = 0.0;
        }
        let elapsed = self.shown.map_or(Duration::ZERO, |(at, _)| now - at);
        let most = rate * elapsed.max(Duration::ZERO).secs();
        self.offset = if self.offset.abs() <= most {
            0.0
        } else {
            self.offset - most.copysign(self.offset)
        };
        // Adding zero would turn −0 into 0.
        let shown = if self.offset == 0.0 {
            value
        } else {
            value + self.offset
        };
        self.own = Some((now, value));
        self.shown = Some((now, shown));
        shown
    }

    /// Takes over from another graph, both having been stepped to the same tick.
    pub fn hand_over(&mut self, from: &Self) {
        let own = self.own;
        *self = *from;
        self.own = own;
        match (own, from.own) {
            (Some((at, value)), Some((same, before))) if at == same && !from.begins => {
                self.offset += before - value;
            }
            _ => {
                self.begins = from.shown.is_some();
                self.offset = 0.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    const RATE: f64 = 5.0;

    #[test]
    fn a_difference_too_large_for_a_number_is_stepped_over() {
        let (mut old, mut new) = (Blending::default(), Blending::default());
        old.pass(s(0), f64::MAX, RATE);
        new.pass(s(0), f64::MIN, RATE);
        new.hand_over(&old);
        assert_eq!(new.pass(s(1), 1.0, RATE), 1.0);
    }

    #[test]
    fn the_difference_at_the_hand_over_falls_at_the_rate() {
        let (mut old, mut new) = (Blending::default(), Blending::default());
        assert_eq!(old.pass(s(0), 200.0, RATE), 200.0);
        new.pass(s(0), 0.0, RATE);
        new.hand_over(&old);
        assert_eq!(new.pass(s(1), 0.0, RATE), 195.0);
        assert_eq!(
            new.pass(s(2), 1.0, RATE),
            191.0,
            "the new graph's own step of 1 on top of 190"
        );
        for t in 3..60 {
            new.pass(s(t), 1.0, RATE);
        }
        assert_eq!(new.pass(s(60), 1.0, RATE), 1.0);
        assert_eq!(
            new.pass(s(61), 300.0, RATE),
            300.0,
            "a step of the new graph itself is its own business"
        );
    }

    #[test]
    fn a_graph_that_gives_the_same_passes_over_nothing_even_in_the_middle_of_passing() {
        let mut old = Blending::default();
        old.pass(s(0), 100.0, RATE);
        let mut new = Blending::default();
        new.pass(s(0), 0.1, RATE);
        new.hand_over(&old);
        new.pass(s(1), 0.1, RATE);
        let mut same = Blending::default();
        same.pass(s(1), 0.1, RATE);
        same.hand_over(&new);
        for t in 2..40 {
            assert_eq!(
                same.pass(s(t), (t as f64).sin(), RATE).to_bits(),
                new.pass(s(t), (t as f64).sin(), RATE).to_bits()
            );
        }
    }

    #[test]
    fn a_first_value_that_comes_late_begins_where_the_last_one_was() {
        let mut old = Blending::default();
        old.pass(s(0), 200.0, RATE);
        let mut new = Blending::default();
        new.hand_over(&old);
        assert_eq!(new.pass(s(8), 0.0, RATE), 160.0);
    }

    #[test]
    fn while_time_starts_again_nothing_is_passed_over() {
        let (mut old, mut new) = (Blending::default(), Blending::default());
        old.pass(s(1000), 200.0, RATE);
        new.pass(s(1000), 0.0, RATE);
        new.hand_over(&old);
        assert_eq!(new.pass(s(0), 0.0, RATE), 200.0);
        assert_eq!(new.pass(s(1), 0.0, RATE), 195.0);
    }

    #[test]
    fn the_rate_of_the_new_graph_counts_where_the_old_one_had_none() {
        let old = Blending::at_once(s(1), 200.0);
        let mut new = Blending::at_once(s(1), 0.0);
        new.hand_over(&old);
        assert_eq!(new.pass(s(3), 0.0, RATE), 190.0);
    }

    #[test]
    fn without_a_value_before_there_is_nothing_to_pass_over_from() {
        let mut new = Blending::default();
        new.hand_over(&Blending::default());
        assert_eq!(new.pass(s(1), 7.0, RATE), 7.0);
    }
}
