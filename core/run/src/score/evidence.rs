//! Combiners that go by too few truths to do what they are for.

use serde::Serialize;

use crate::compile::{Plan, PlannedRole};
use crate::diagnostic::{count, counted};
use crate::engine::Engine;

/// A combiner that had as many truths as it takes at less than this share of the ticks since it first had them lacks them.
const MOSTLY: f64 = 0.5;

/// A combiner that went by fewer truths than it takes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lack {
    /// The combiner: `guard.Z1`.
    pub node: String,
    /// How many truths came.
    #[serde(rename = "told")]
    pub came: u64,
    /// How many it takes.
    pub needed: f64,
    /// The most that counted at a tick.
    pub most: f64,
    /// At which share of the ticks since there first were enough there were; 0 where there never were.
    pub enough: f64,
    /// What lets more truths count: "a longer `memory`".
    pub remedy: &'static str,
}

impl Lack {
    /// A sentence for each; one for all members of a node of which the same is true.
    #[must_use]
    pub fn warnings(lacks: &[Self]) -> Vec<String> {
        let mut groups: Vec<(&Self, usize)> = Vec::new();
        for lack in lacks {
            match groups.iter_mut().find(|(of, _)| of.is_like(lack)) {
                Some((_, more)) => *more += 1,
                None => groups.push((lack, 0)),
            }
        }
        let sentence = |(lack, more): (&Self, usize)| {
            let Self { node, .. } = lack;
            let what = lack.what();
            match more {
                0 => format!("{node} {what}"),
                more => format!("{node} (and {more} more like it) {what}"),
            }
        };
        groups.into_iter().map(sentence).collect()
    }

    /// What it lacks, whichever combiner it is.
    fn what(&self) -> String {
        let Self {
            came,
            needed,
            most,
            enough,
            remedy,
            ..
        } = self;
        let needs = format!("needs {} and", counted(*needed, "truth"));
        if *enough > 0.0 {
            let share = 100.0 * enough;
            return format!(
                "{needs} had as many at only {share:.0}% of the ticks since it first did; {remedy} lets more count"
            );
        }
        let in_all = count(came);
        if (*came as f64) < *needed {
            return format!("{needs} the data have {in_all} for it, so it acted on none");
        }
        let most = match (most * 10.0).round() / 10.0 {
            0.0 => "any".to_owned(),
            most => format!("more than {}", count(most)),
        };
        format!(
            "{needs} never had {most} of the {in_all} that came, so it acted on none; {remedy} lets more count"
        )
    }

    /// Whether another member of the same node lacks the same.
    fn is_like(&self, other: &Self) -> bool {
        let names = [self, other].map(|lack| lack.node.split('.').next());
        names[0] == names[1] && self.what() == other.what()
    }
}

/// What the combiners lack.
pub(super) fn lacks(tallies: &[Tally]) -> Vec<Lack> {
    tallies.iter().filter_map(Tally::lack).collect()
}

/// What is counted of one combiner.
#[derive(Debug)]
pub(super) struct Tally {
    node: usize,
    lack: Lack,
    /// Ticks since there first were enough truths, and those at which there were.
    ticks: u64,
    enough: u64,
}

impl Tally {
    /// One for each combiner that sees truths.
    pub(super) fn all(plan: &Plan) -> Vec<Self> {
        let nodes = plan.nodes.iter().enumerate();
        let seeing = nodes
            .filter(|(_, node)| matches!(node.role, PlannedRole::Combiner { truth: Some(_), .. }));
        seeing
            .map(|(node, planned)| Self {
                node,
                lack: Lack {
                    node: planned.instance(),
                    came: 0,
                    needed: 0.0,
                    most: 0.0,
                    enough: 0.0,
                    remedy: "",
                },
                ticks: 0,
                enough: 0,
            })
            .collect()
    }

    /// Looks at what a tick did.
    pub(super) fn look(&mut self, engine: &Engine) {
        let Some((came, evidence)) = engine.evidence(self.node) else {
            return;
        };
        let lack = &mut self.lack;
        (lack.came, lack.needed, lack.remedy) = (came, evidence.needed, evidence.remedy);
        lack.most = lack.most.max(evidence.truths);
        let enough = evidence.truths >= evidence.needed;
        if enough || self.ticks > 0 {
            self.ticks += 1;
            self.enough += u64::from(enough);
        }
    }

    /// What it lacks, if anything.
    fn lack(&self) -> Option<Lack> {
        let enough = self.enough as f64 / self.ticks.max(1) as f64;
        let lacks = self.lack.came > 0 && enough < MOSTLY;
        lacks.then(|| Lack {
            enough,
            ..self.lack.clone()
        })
    }
}
