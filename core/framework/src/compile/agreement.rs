//! Which channels are predictions, and which may stand for the same quantity.

use super::conversion::{factor, mismatch};
use super::instance::Declared;
use super::plan::PlannedRole;
use super::problem;
use super::reference::Reference;
use super::resolver::Resolver;
use super::scope::Found;
use crate::diagnostic::Problem;

impl Resolver<'_> {
    /// Whether no voter is what an estimator or combiner gives beside its prediction. What else there is may vote: a feature of
    /// a prediction, such as its `scale`, is one for all that is known.
    pub(super) fn are_predictions(&mut self, instance: &Declared<'_>, input: &str) -> bool {
        let mut all = true;
        for (text, place) in instance
            .input(input)
            .map_or(&[][..], |input| &input.references)
        {
            let Ok(Found::Slots(slots)) = self.scopes.look_up(text) else {
                continue;
            };
            let mut beside = slots
                .iter()
                .map(|&slot| (slot, self.prediction_beside(slot)));
            let Some((slot, Some(prediction))) = beside.find(|(_, of)| of.is_some()) else {
                continue;
            };
            let reference = Reference::parse(text);
            let problem = problem::NoPrediction {
                channel: self.channels[slot].name.clone(),
                prediction: match reference.channel {
                    Some(_) => self.channels[prediction].name.clone(),
                    None => reference.node.to_owned(),
                },
            };
            self.diagnostics.report(*place, problem);
            all = false;
        }
        all
    }

    /// The prediction beside which an estimator or combiner gives this slot.
    pub(super) fn prediction_beside(&self, slot: usize) -> Option<usize> {
        let node = &self.nodes[self.channels[slot].node?];
        let (_, predictions) = node.ports.first()?;
        let predicts = !matches!(node.role, PlannedRole::Feature { .. });
        (predicts && !predictions.contains(&slot)).then_some(predictions.start)
    }

    /// Whether predictions may be put together.
    pub(super) fn votes_agree(
        &mut self,
        instance: &Declared<'_>,
        input: &str,
        voters: &[usize],
    ) -> bool {
        let mut agree = true;
        for &other in voters.iter().skip(1) {
            agree &= self.agree(instance, input, voters[0], other, true);
        }
        agree
    }

    /// Whether two channels are different members of the same port or signal, as `drift.X` and `drift.Y` are. Of other channels,
    /// such as two slopes of the same position, it is not known whether they are the same quantity.
    fn are_members(&self, one: usize, other: usize) -> bool {
        let of = |slot: usize| self.channels[slot].name.split_once('.').map(|(of, _)| of);
        one != other && of(one).is_some() && of(one) == of(other)
    }

    /// Whether two channels may stand for the same quantity, and where both are votes, for the same instant. The second is another
    /// vote, or the truth.
    pub(super) fn agree(
        &mut self,
        instance: &Declared<'_>,
        input: &str,
        first: usize,
        second: usize,
        votes: bool,
    ) -> bool {
        let (a, b) = (&self.channels[first], &self.channels[second]);
        let problem: Box<dyn Problem> = if factor(&b.channel.unit, &a.channel.unit).is_none() {
            mismatch(&b.name, &b.channel.unit, &a.name, &a.channel.unit)
        } else if a.channel.span != b.channel.span {
            Box::new(problem::Spans {
                first: a.name.clone(),
                first_span: a.channel.span,
                second: b.name.clone(),
                second_span: b.channel.span,
            })
        } else if votes && a.channel.ahead != b.channel.ahead {
            Box::new(problem::Horizons {
                first: a.name.clone(),
                first_ahead: a.channel.ahead,
                second: b.name.clone(),
                second_ahead: b.channel.ahead,
            })
        } else if let Some(of_first) = a.predicts
            && let Some(of_second) = if votes { b.predicts } else { Some(second) }
            && self.are_members(of_first, of_second)
        {
            let name = |slot: usize| self.channels[slot].name.clone();
            Box::new(problem::Truths {
                first: a.name.clone(),
                first_truth: name(of_first),
                second: b.name.clone(),
                second_truth: name(of_second),
            })
        } else {
            return true;
        };
        self.diagnostics
            .report(instance.input_place(input), problem);
        false
    }
}
