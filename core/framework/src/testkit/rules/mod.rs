//! Decides what is tried of a node, rule by rule.

mod absence;
mod allocation;
mod edited;
mod explained;
mod fitting;
mod names;
mod parameters;
mod past;
mod repeat;
mod schema;
mod shapes;
mod snapshots;
mod traces;
mod units;
mod votes;

pub(super) use explained::explained;
pub(super) use names::shared;

use super::case::Given;
use super::compared::course;
use super::fixture::Fixture;
use super::samples::{Coming, samples};
use super::{Case, Rule};
use crate::engine::{Engine, Fitted};
use crate::fit::{FitOptions, Outcome, fit};
use crate::node::{Kind, Role};
use crate::recording::{Event, Table};

/// How many ticks a run has.
const TICKS: usize = 600;

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
}

/// What finds a rule broken, and says so. The others are the same kind in its other cases.
type Check = fn(&Subject<'_>, others: &[Subject<'_>]) -> Result<(), String>;

/// The rules that are tried in every case.
pub(super) const ALL: [(Rule, Check); 23] = [
    (Rule::Names, |subject, _| names::names(subject)),
    (Rule::Answers, |subject, _| subject.answers()),
    (Rule::ReadsBack, |subject, _| parameters::read_back(subject)),
    (Rule::Ranges, |subject, _| parameters::ranges(subject)),
    (Rule::Deterministic, |subject, _| {
        repeat::deterministic(subject)
    }),
    (Rule::LongRun, |subject, _| repeat::long_run(subject)),
    (Rule::Restores, |subject, _| snapshots::restores(subject)),
    (Rule::Versions, snapshots::versions),
    (Rule::Absence, |subject, _| absence::absence(subject)),
    (Rule::Infinity, |subject, _| absence::infinity(subject)),
    (Rule::Past, |subject, _| past::past(subject)),
    (Rule::Segments, |subject, _| repeat::segments(subject)),
    (Rule::Wanted, |subject, _| shapes::wanted(subject)),
    (Rule::Widths, |subject, _| shapes::widths(subject)),
    (Rule::Units, |subject, _| units::units(subject)),
    (Rule::Allocation, |subject, _| {
        allocation::allocation(subject)
    }),
    (Rule::Votes, |subject, _| votes::votes(subject)),
    (Rule::Uncertainty, |subject, _| votes::uncertainty(subject)),
    (Rule::NoTrace, |subject, _| traces::no_trace(subject)),
    (Rule::Fits, |subject, _| fitting::fits(subject)),
    (Rule::Models, |subject, _| fitting::models(subject)),
    (Rule::Linear, |subject, _| fitting::linear(subject)),
    (Rule::Edited, |subject, _| edited::edited(subject)),
];

impl<'a> Subject<'a> {
    /// Compiles a case and, of an estimator, fits it.
    pub(super) fn new(kind: &'static Kind, case: &'a Case) -> Result<Self, String> {
        let parameters: toml::Table = toml::from_str(&case.parameters)
            .map_err(|error| format!("the parameters of the case are no TOML: {error}"))?;
        let given = case.given(kind);
        let fixture = Fixture::new(kind, &parameters, &given)?;
        let table = samples(kind, &given, TICKS, Coming::WithGaps);
        let mut subject = Self {
            kind,
            case,
            parameters,
            given,
            fixture,
            fitted: Fitted::new(),
            table,
        };
        subject.fitted = subject.fit(&subject.table, 1)?;
        Ok(subject)
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

    /// Whether the port of a slot may have something to say of nothing.
    fn speaks(&self, slot: usize) -> bool {
        let port = self.fixture.port(slot);
        self.case.without_input.iter().any(|name| name == port)
    }

    /// A channel of the node, as the graph calls it.
    pub(super) fn name(&self, number: usize) -> &str {
        &self.fixture.plan.channels[self.fixture.slots().start + number].name
    }

    fn answers(&self) -> Result<(), String> {
        let course = course(&self.fixture, &mut self.engine(), self.events());
        let answers = |number| course.values(number).any(f64::is_finite);
        if self.fixture.slots().is_empty() {
            return Err("the node has no output".to_owned());
        }
        if (0..self.fixture.slots().len()).any(answers) {
            Ok(())
        } else {
            Err(format!(
                "nothing comes out of the node in {TICKS} ticks over about {} min",
                TICKS / 6
            ))
        }
    }
}
