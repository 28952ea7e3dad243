//! Decides what is tried of a node, rule by rule.

mod absence;
#[cfg(feature = "allocation")]
mod allocation;
mod answers;
mod edited;
mod explained;
mod fitting;
mod memory;
mod names;
mod novelty;
mod parameters;
mod past;
mod repeat;
mod shapes;
mod snapshots;
mod stamps;
mod traces;
mod units;
mod votes;

pub(super) use explained::explained;
pub(super) use names::shared;

use std::sync::OnceLock;

use Check::{Alone, Among};

use super::case::Given;
use super::compared::{Course, course};
use super::fixture::Fixture;
use super::samples::{Coming, samples};
use super::{Case, Rule};
use crate::compile::PlannedRole;
use crate::engine::{Engine, Fitted};
use crate::fit::{FitOptions, Outcome, fit};
use crate::node::{Kind, Role};
use crate::recording::{Event, Table};

/// A kind in one of its cases, ready to be tried.
#[derive(Debug)]
pub(super) struct Subject<'a> {
    pub(super) kind: &'static Kind,
    pub(super) case: &'a Case,
    pub(super) parameters: toml::Table,
    pub(super) given: Vec<Given>,
    pub(super) fixture: Fixture,
    pub(super) fitted: Fitted,
    pub(super) table: Table,
    usual: OnceLock<Course>,
}

/// What finds a rule broken, and says so.
#[derive(Clone, Copy)]
pub(super) enum Check {
    /// By one case.
    Alone(fn(&Subject<'_>) -> Result<(), String>),
    /// By one case, and all of the same kind.
    Among(fn(&Subject<'_>, &[Subject<'_>]) -> Result<(), String>),
}

/// The rules that are tried in every case.
pub(super) const ALL: &[(Rule, Check)] = &[
    (Rule::Names, Alone(names::names)),
    (Rule::Answers, Among(answers::answers)),
    (Rule::ReadsBack, Alone(parameters::read_back)),
    (Rule::Ranges, Alone(parameters::ranges)),
    (Rule::Deterministic, Alone(repeat::deterministic)),
    (Rule::LongRun, Alone(repeat::long_run)),
    (Rule::Restores, Alone(snapshots::restores)),
    (Rule::Versions, Among(snapshots::versions)),
    (Rule::Absence, Alone(absence::absence)),
    (Rule::Infinity, Alone(absence::infinity)),
    (Rule::Past, Alone(past::past)),
    (Rule::Stamps, Alone(stamps::stamps)),
    (Rule::Memory, Alone(memory::memory)),
    (Rule::Segments, Alone(repeat::segments)),
    (Rule::Wanted, Alone(shapes::wanted)),
    (Rule::Widths, Alone(shapes::widths)),
    (Rule::Units, Alone(units::units)),
    #[cfg(feature = "allocation")]
    (Rule::Allocation, Alone(allocation::allocation)),
    (Rule::Votes, Alone(votes::votes)),
    (Rule::Uncertainty, Alone(votes::uncertainty)),
    (Rule::Novelty, Alone(novelty::novelty)),
    (Rule::NoTrace, Alone(traces::no_trace)),
    (Rule::Fits, Alone(fitting::fits)),
    (Rule::Models, Alone(fitting::models)),
    (Rule::Linear, Alone(fitting::linear)),
    (Rule::Edited, Alone(edited::edited)),
];

impl Check {
    pub(super) fn run(self, subject: &Subject<'_>, all: &[Subject<'_>]) -> Result<(), String> {
        match self {
            Alone(check) => check(subject),
            Among(check) => check(subject, all),
        }
    }
}

impl<'a> Subject<'a> {
    /// Compiles a case and, of an estimator, fits it.
    pub(super) fn new(kind: &'static Kind, case: &'a Case) -> Result<Self, String> {
        let parameters: toml::Table = toml::from_str(&case.parameters)
            .map_err(|error| format!("the parameters of the case are no TOML: {error}"))?;
        let given = case.given(kind);
        let fixture = Fixture::new(kind, &parameters, &given)?;
        let table = samples(kind, &given, case.ticks, case.every, Coming::WithGaps);
        let fitted = Fitted::new();
        let subject = Self {
            kind,
            case,
            parameters,
            given,
            fixture,
            fitted,
            table,
            usual: OnceLock::new(),
        };
        subject.fitted()
    }

    /// The same case with other channels or units, of which other samples come; not fitted yet.
    pub(super) fn fed(&self, given: Vec<Given>, fixture: Fixture, table: Table) -> Self {
        let (parameters, fitted) = (self.parameters.clone(), Fitted::new());
        Self {
            parameters,
            given,
            fixture,
            fitted,
            table,
            usual: OnceLock::new(),
            ..*self
        }
    }

    /// The same, fitted on its samples where it is to be fitted.
    ///
    /// # Errors
    /// What the fit says where it gives nothing.
    pub(super) fn fitted(mut self) -> Result<Self, String> {
        self.fitted = self.fit(&self.table, 1)?;
        Ok(self)
    }

    /// Fits on a recording.
    ///
    /// # Errors
    /// What the fit says where it gives nothing.
    pub(super) fn fit(&self, table: &Table, threads: usize) -> Result<Fitted, String> {
        let options = FitOptions {
            threads,
            ..FitOptions::default()
        };
        let (fitted, report) = fit(&self.fixture.plan, table, &options, &mut |_| ())
            .map_err(|error| error.to_string())?;
        for estimator in &report.estimators {
            if let Outcome::Failed(error) = &estimator.outcome {
                return Err(format!("it cannot be fitted: {error}"));
            }
        }
        Ok(fitted)
    }

    /// Whether what was fitted can be put into the graph that it was fitted in.
    pub(super) fn belongs(&self) -> Result<(), String> {
        let made = Engine::new(self.fixture.plan.clone(), &self.fitted);
        made.map(|_| ()).map_err(|error| error.to_string())
    }

    /// An engine, cold.
    pub(super) fn engine(&self) -> Engine {
        self.fixture.engine(&self.fitted)
    }

    /// How many ticks a run has.
    pub(super) fn ticks(&self) -> usize {
        self.case.ticks
    }

    /// Samples of all channels at every tick, twice as often.
    pub(super) fn without_gaps(&self, ticks: usize) -> Table {
        let every = self.case.every;
        samples(self.kind, &self.given, ticks, every, Coming::Always)
    }

    /// What the node gives where it is fed all of it in one run.
    pub(super) fn usual(&self) -> &Course {
        let run = || course(&self.fixture, &mut self.engine(), self.events());
        self.usual.get_or_init(run)
    }

    /// What is fed.
    pub(super) fn events(&self) -> &[(Event, Vec<f64>)] {
        self.table.events()
    }

    /// Whether the node is a feature, to which a segment is a new beginning.
    pub(super) fn is_feature(&self) -> bool {
        matches!(self.fixture.plan.nodes[0].spec.role(), Role::Feature(_))
    }

    /// Whether the node learns from a fit.
    pub(super) fn is_fitted(&self) -> bool {
        !self.fitted.is_empty()
    }

    /// Whether it is an estimator that goes on learning while it runs.
    pub(super) fn learns(&self) -> bool {
        let role = &self.fixture.plan.nodes[0].role;
        matches!(role, PlannedRole::Estimator { learning, .. } if learning.is_some())
    }

    /// Whether the port of a slot may have something to say of nothing.
    fn speaks(&self, slot: usize) -> bool {
        let port = self.fixture.port(slot);
        self.case.without_input.iter().any(|name| name == port)
    }

    /// A channel of the node, as the graph calls it.
    pub(super) fn name(&self, number: usize) -> &str {
        &self.fixture.plan.channels[self.fixture.slots().start + number].name
    }
}
