//! A combiner that is sound, and one that changes its mind when it is asked.

use std::cell::Cell;

use athermal_core::node::{Combine, Combiner, InputPort, Votes as Cast};
use athermal_core::testkit::{Case, Rule};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{breaks, breaks_only};

/// The mean of the votes, or of the last two means.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Votes {
    /// Whether it remembers what it has answered.
    #[serde(default)]
    remembers: bool,
}

impl Combiner for Votes {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::held("voters", "predictions of the same truth")] }
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Answering {
            remembers: self.remembers,
            last: Cell::new(f64::NAN),
        })
    }
}

struct Answering {
    remembers: bool,
    last: Cell<f64>,
}

impl Combine for Answering {
    fn combine(&self, votes: Cast<'_>) -> f64 {
        let count = votes.present().count() as f64;
        let mean = votes.present().map(|(_, vote)| vote).sum::<f64>() / count;
        let last = self.last.replace(mean);
        if self.remembers && last.is_finite() {
            0.5 * (last + mean)
        } else {
            mean
        }
    }
}

athermal_core::register!(Votes, Combiner, "sabotaged_votes");

#[test]
fn a_sound_combiner_breaks_no_rule() {
    breaks_only::<Votes>(Case::new(""), &[]);
}

#[test]
fn an_answer_that_changes_later_ones_leaves_a_trace() {
    breaks::<Votes>(
        Case::new("remembers = true"),
        Rule::NoTrace,
        "answers that nobody wanted",
    );
}
