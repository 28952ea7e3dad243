//! Decides how a single node is tried by hand: fed samples, asked what it gave.

use super::Case;
use super::fixture::Fixture;
use crate::engine::{Engine, Fitted};
use crate::fit::{FitOptions, Outcome, fit};
use crate::node::{Kind, NodeKind, NodeSpec};
use crate::recording::Table;
use crate::registry::all;
use crate::time::Instant;

/// A node in a graph of its own, fed by hand and stepped by the real engine.
///
/// ```
/// # use athermal_core::node::prelude::*;
/// # /// The largest of the votes, as an example of a node.
/// # #[derive(Debug, Serialize, Deserialize, JsonSchema)]
/// # pub struct Largest {}
/// # impl Combiner for Largest {
/// #     fn inputs() -> &'static [InputPort] {
/// #         const { &[InputPort::held("voters", "predictions")] }
/// #     }
/// #     fn build(&self, _voters: usize) -> Box<dyn Combine> {
/// #         Box::new(Max)
/// #     }
/// # }
/// # struct Max;
/// # impl Combine for Max {
/// #     fn combine(&self, votes: Votes<'_>) -> f64 {
/// #         votes.present().map(|(_, vote)| vote).fold(f64::NAN, f64::max)
/// #     }
/// # }
/// # athermal_core::register!(Largest, Combiner, "largest");
/// # fn main() {
/// use athermal_testkit::Bench;
///
/// let mut bench = Bench::of(&Largest {}).input("voters", 2, "nm");
/// bench.feed([(0.0, [1.0, f64::NAN]), (10.0, [1.0, 7.0])]);
/// assert_eq!(bench.output("node.a"), [1.0, 7.0]);
/// # }
/// ```
#[derive(Debug)]
pub struct Bench {
    kind: &'static Kind,
    parameters: toml::Table,
    case: Case,
    running: Option<(Fixture, Engine)>,
    fitted: Fitted,
    given: Vec<Vec<f64>>,
}

impl Bench {
    /// A node, fed like a [`Case`] where nothing else is said.
    ///
    /// # Panics
    /// Where its parameters cannot be written.
    #[must_use]
    pub fn of<T: NodeSpec>(node: &T) -> Self {
        let written = node.parameters();
        let parameters = crate::node::as_toml(&written)
            .and_then(|parameters| parameters.as_table().cloned())
            .unwrap_or_else(|| panic!("{written} are no parameters"));
        Self {
            kind: all::<NodeKind>()
                .find(|kind| kind.name == T::kind_name())
                .expect("a type with a specification is registered"),
            parameters,
            case: Case::new(""),
            running: None,
            fitted: Fitted::new(),
            given: Vec::new(),
        }
    }

    /// The same, with so many channels in this unit at a port; they are called `a`, `b` ….
    #[must_use]
    pub fn input(mut self, port: &str, channels: usize, unit: &str) -> Self {
        self.case = self.case.input(port, channels, unit);
        self
    }

    /// The same, with what the framework reads of a node beside its own parameters: `ahead = "5min"`.
    ///
    /// # Panics
    /// Where that is no TOML.
    #[must_use]
    pub fn with(mut self, framework: &str) -> Self {
        let more: toml::Table = toml::from_str(framework).unwrap_or_else(|error| panic!("{error}"));
        self.parameters.extend(more);
        self
    }

    /// The same, fitted on rows: times in s, and the samples of all ports, in the order in which the kind declares them; NaN for none.
    ///
    /// # Panics
    /// Where the graph is refused or the fit fails, with what a user would read.
    #[must_use]
    pub fn fitted_on<S: AsRef<[f64]>>(mut self, rows: impl IntoIterator<Item = (f64, S)>) -> Self {
        let mut table = Table::default();
        for (seconds, samples) in rows {
            table.push(at(seconds), samples.as_ref());
        }
        let plan = self.running().0.plan.clone();
        let (fitted, report) = fit(&plan, &table, &FitOptions::default(), &mut |_| ())
            .unwrap_or_else(|error| panic!("{error}"));
        for estimator in &report.estimators {
            if let Outcome::Failed(error) = &estimator.outcome {
                panic!("the fit fails: {error}");
            }
        }
        self.fitted = fitted;
        self.running = None;
        self
    }

    /// Steps through rows: times in s, and the samples of all ports, in the order in which the kind declares them; NaN for none.
    ///
    /// # Panics
    /// Where the graph is refused, with what a user would read; where times do not rise or are none, or a row is too short or
    /// long.
    pub fn feed<S: AsRef<[f64]>>(&mut self, rows: impl IntoIterator<Item = (f64, S)>) -> &mut Self {
        for (seconds, samples) in rows {
            let (fixture, engine) = self.running();
            engine
                .step(at(seconds), samples.as_ref())
                .unwrap_or_else(|error| panic!("{error}"));
            let row: Vec<f64> = fixture.slots().map(|slot| engine.value(slot)).collect();
            self.given.push(row);
        }
        self
    }

    /// Goes on in another segment.
    pub fn segment(&mut self) -> &mut Self {
        self.running().1.segment();
        self
    }

    /// What came out so far: a row per tick, with all channels of all output ports; NaN for none.
    #[must_use]
    pub fn outputs(&self) -> &[Vec<f64>] {
        &self.given
    }

    /// What came out of one channel so far, by the name that the graph gives it: `node.a`, `node:why.a`.
    ///
    /// # Panics
    /// Where there is no such channel; it says which there are.
    #[must_use]
    pub fn output(&self, name: &str) -> Vec<f64> {
        let Some((fixture, _)) = &self.running else {
            return Vec::new();
        };
        let name_of = |slot: usize| fixture.plan.channels[slot].name.as_str();
        let names: Vec<&str> = fixture.slots().map(name_of).collect();
        let place = names.iter().position(|known| *known == name);
        let place = place.unwrap_or_else(|| panic!("`{name}` is none of {names:?}"));
        self.given.iter().map(|row| row[place]).collect()
    }

    /// The engine with its graph, made where there is none yet.
    fn running(&mut self) -> &mut (Fixture, Engine) {
        if self.running.is_none() {
            let fixture = self.fixture();
            let engine = fixture.engine(&self.fitted);
            self.running = Some((fixture, engine));
        }
        self.running.as_mut().expect("it has just been made")
    }

    fn fixture(&self) -> Fixture {
        let given = self.case.given(self.kind);
        Fixture::new(self.kind, &self.parameters, &given).unwrap_or_else(|why| panic!("{why}"))
    }
}

fn at(seconds: f64) -> Instant {
    let ns = (seconds * 1e9).round();
    // Written so that NaN fails.
    assert!(
        ns.abs() < i64::MAX as f64,
        "{seconds} is no time: a row begins with one in seconds, less than 9.2e9"
    );
    Instant::from_ns(ns as i64)
}
