//! Decides whether an estimator goes on learning while it runs, and what it never learns from.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use super::instance::Instance;
use super::plan::PlannedLearning;
use super::problem::CompileProblem;
use super::resolver::Resolver;
use crate::channel::Channel;
use crate::node::{Estimator, FREEZE, Forms, InputPort, Learns, Mistake, OutputPort};
use crate::time::Duration;
use crate::unit::Unit;

/// The key `learn` of an estimator.
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema)]
#[schemars(untagged)]
pub(crate) enum Learn {
    /// Whether it goes on learning while it runs.
    Switch(bool),
    /// It does, within these limits.
    Within(LearnLimits),
}

/// What is not learned from.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct LearnLimits {
    /// Truths that miss their prediction by more than this multiple of the recent root mean square error, above 1.
    #[schemars(extend("exclusiveMinimum" = 1.0))]
    pub(crate) outliers: f64,
    /// Rows of which a regressor lies farther outside the range of the fit than this multiple of its width.
    #[schemars(range(min = 0.0))]
    pub(crate) margin: f64,
}

impl Default for LearnLimits {
    fn default() -> Self {
        Self {
            outliers: 6.0,
            margin: 0.0,
        }
    }
}

impl<'de> Deserialize<'de> for Learn {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("true, false or a table of limits")
            .truth(Self::Switch)
            .table(Self::Within)
            .read(deserializer)
    }
}

impl LearnLimits {
    pub(super) fn mistakes(self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        let Self { outliers, margin } = self;
        if outliers.is_nan() || outliers <= 1.0 {
            let message = format!("`outliers` is {outliers} and must be above 1");
            let mistake = Mistake::at("learn.outliers", message);
            mistakes.push(mistake.help("4 to 10 keeps spikes out; inf lets everything in"));
        }
        if margin.is_nan() || margin < 0.0 {
            let message = format!("`margin` is {margin} and must be 0 or more");
            let mistake = Mistake::at("learn.margin", message);
            mistakes.push(mistake.help("0 is the range of the fit itself, inf any"));
        }
        mistakes
    }
}

impl Resolver<'_> {
    /// Whether an estimator learns while it runs, and how; `None` when an error about it has been told.
    pub(super) fn learning(
        &mut self,
        instance: &Instance<'_>,
        estimator: &dyn Estimator,
    ) -> Option<Option<PlannedLearning>> {
        let learns = estimator.learns();
        let limits = match (instance.read.estimator.learn, learns) {
            (None, Learns::UnlessTold) => Some(LearnLimits::default()),
            (None, _) | (Some(Learn::Switch(false)), _) => None,
            (Some(_), Learns::Never { help }) => {
                let kind = instance.kind.name;
                let problem = CompileProblem::NeverLearns { kind, help };
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
        let mistakes = limits.mistakes();
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
            outliers: limits.outliers,
            margin: limits.margin,
            freeze,
        }))
    }
}

/// The port that tells what became of the newest truth.
pub(super) fn port(of: &Channel) -> OutputPort {
    OutputPort {
        name: "learning",
        channels: vec![Channel {
            name: of.name.clone(),
            unit: Unit::one(),
            span: Duration::ZERO,
            ahead: Duration::ZERO,
            max_age: of.default_max_age(),
        }],
    }
}
