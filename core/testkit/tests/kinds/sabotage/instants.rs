//! A combiner that goes by how long ago something was, and forgets that a break is no time.

use super::*;

/// The mean of the votes, the larger the longer it has been told of truths.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Aged {}

impl Combiner for Aged {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("voters", "predictions of the same truth"),
                InputPort::truth("what they predict"),
            ]
        }
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Ageing::default())
    }
}

#[derive(Default)]
struct Ageing {
    first: Option<Instant>,
    newest: Option<Instant>,
}

impl Combine for Ageing {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        let ages = self.first.zip(self.newest);
        let age = ages.map_or(Duration::ZERO, |(first, newest)| newest - first);
        let count = votes.present().count() as f64;
        votes.present().map(|(_, vote)| vote).sum::<f64>() / count * (1.0 + age.secs())
    }

    fn observe(&mut self, _votes: Votes<'_>, _truth: f64, arrived: Instant) {
        self.first.get_or_insert(arrived);
        self.newest = Some(arrived);
    }
}

athermal_core::register!(Aged, Combiner, "sabotaged_instants");

#[test]
fn instants_that_do_not_move_with_a_break_are_found() {
    breaks::<Aged>(
        Case::new(""),
        Rule::Segments,
        "where that begins an hour later",
    );
}
