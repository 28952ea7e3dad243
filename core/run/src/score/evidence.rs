//! Decides which combiners are told of as going by too few truths to do what they are for.

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
    pub told: u64,
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
    /// A sentence for each; for members of a node of which the same is to be told, one.
    #[must_use]
    pub fn warnings(lacks: &[Self]) -> Vec<String> {
        let mut groups: Vec<(&Self, usize)> = Vec::new();
        for lack in lacks {
            match groups.iter_mut().find(|(told, _)| told.is_like(lack)) {
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
            told,
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
        let came = count(told);
        if (*told as f64) < *needed {
            return format!("{needs} the data have {came} for it, so it acted on none");
        }
        let most = match (most * 10.0).round() / 10.0 {
            0.0 => "any".to_owned(),
            most => format!("more than {}", count(most)),
        };
        format!(
            "{needs} never had {most} of the {came} that came, so it acted on none; {remedy} lets more count"
        )
    }

    /// Whether another member of the same node is to be told of in the same words.
    fn is_like(&self, other: &Self) -> bool {
        let names = [self, other].map(|lack| lack.node.split('.').next());
        names[0] == names[1] && self.what() == other.what()
    }
}

/// What is to be told of all combiners.
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
    /// One for each combiner that is told truths.
    pub(super) fn all(plan: &Plan) -> Vec<Self> {
        let nodes = plan.nodes.iter().enumerate();
        let told = nodes
            .filter(|(_, node)| matches!(node.role, PlannedRole::Combiner { truth: Some(_), .. }));
        told.map(|(node, planned)| Self {
            node,
            lack: Lack {
                node: planned.instance(),
                told: 0,
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
        let Some((told, evidence)) = engine.evidence(self.node) else {
            return;
        };
        let lack = &mut self.lack;
        (lack.told, lack.needed, lack.remedy) = (told, evidence.needed, evidence.remedy);
        lack.most = lack.most.max(evidence.truths);
        let enough = evidence.truths >= evidence.needed;
        if enough || self.ticks > 0 {
            self.ticks += 1;
            self.enough += u64::from(enough);
        }
    }

    /// What is to be told of it, if anything.
    fn lack(&self) -> Option<Lack> {
        let enough = self.enough as f64 / self.ticks.max(1) as f64;
        let lacks = self.lack.told > 0 && enough < MOSTLY;
        lacks.then(|| Lack {
            enough,
            ..self.lack.clone()
        })
    }
}
