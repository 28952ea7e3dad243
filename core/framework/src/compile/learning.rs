//! Whether an estimator goes on learning while it runs, and what it never learns from.

use super::estimator::about;
use super::instance::Instance;
use super::keys::{Learn, LearnLimits};
use super::plan::PlannedLearning;
use super::problem;
use super::resolver::Resolver;
use crate::channel::Channel;
use crate::node::{Estimator, FREEZE, InputPort, LearningLimits, Learns, Mistake, OutputPort};
use crate::time::Duration;

impl Resolver<'_> {
    /// Whether an estimator learns while it runs, and how; `None` when an error about it has been reported.
    pub(super) fn learning(
        &mut self,
        instance: &Instance<'_>,
        estimator: &dyn Estimator,
    ) -> Option<Option<PlannedLearning>> {
        let learns = estimator.learns();
        let limits = match (instance.read.estimator.learn, learns) {
            (None, Learns::ByDefault) => Some(LearnLimits::default()),
            (None, _) | (Some(Learn::Switch(false)), _) => None,
            (Some(_), Learns::Never { help }) => {
                let kind = instance.kind.name;
                let problem = problem::NeverLearns { kind, help };
                let place = instance.parameter_place("learn");
                self.diagnostics.report(place, problem);
                return None;
            }
            (Some(Learn::Switch(true)), _) => Some(LearnLimits::default()),
            (Some(Learn::Within(limits)), _) => Some(limits),
        };
        let Some(limits) = limits else {
            if instance.input(FREEZE).is_some() {
                let doubt = Mistake::at(
                    format!("inputs.{FREEZE}"),
                    "there is nothing to freeze: the node does not learn while it runs",
                );
                self.doubts(instance, vec![doubt.help("say `learn = true`")]);
            }
            return Some(None);
        };
        let mistakes = limits.mistakes(estimator.keeps_range());
        let sound = mistakes.is_empty();
        self.mistakes(instance, mistakes);
        let port = InputPort::freeze();
        let slots = self.slots(instance, &port)?;
        let freeze = if slots.is_empty() {
            None
        } else {
            Some(self.gather(instance, &port, &slots, &[Duration::ZERO], None)?)
        };
        sound.then_some(Some(PlannedLearning {
            limits: LearningLimits {
                outliers: limits.outliers,
                margin: limits.margin.unwrap_or(1.0),
            },
            freeze,
        }))
    }
}

/// The port of the outcome of the newest truth.
pub(super) fn port(of: &Channel) -> OutputPort {
    OutputPort {
        name: "learning",
        channels: vec![about(of, of.name.clone())],
    }
}
