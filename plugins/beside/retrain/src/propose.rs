//! Whether a new fit is worth proposing: on whole sensors, on enough rows, and no worse on a part that it has not seen.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use athermal_core::compile::Plan;
use athermal_core::engine::{Engine, EngineError, Fitted};
use athermal_core::time::{Duration, Instant};
use athermal_core::watch::Watch;
use athermal_jobs::fit::FitOutcome;
use athermal_run::fit::{FitError, FitOptions};
use athermal_run::model::{Card, DataCard, Model};
use athermal_run::recording::{Event, Recording, SourceError, Table, pass};
use athermal_run::score::{PairedPrediction, link};

use crate::sensors::{Broken, broken};

/// How much of the data is held out to judge by.
const HELD_OUT: f64 = 0.2;
/// A fit on fewer rows than this part of the last one's says less.
const ROWS: f64 = 0.5;

/// What a fit is made on, and how it is judged.
#[derive(Debug, Clone, Copy)]
pub struct Terms {
    /// On how much of the past.
    pub on: Duration,
    /// By how much its error may be larger: 0.05 for 5 %.
    pub margin: f64,
}

/// A new fit.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// The graph with it.
    pub model: Model,
    /// Its error on the part that was held out, relative to that of what runs.
    pub ratio: f64,
}

/// Why nothing is proposed.
#[derive(Debug)]
pub enum NotProposed {
    /// The data cannot be read.
    Unreadable(SourceError),
    /// There are none.
    NoData,
    /// Sensors are broken in them.
    Broken(Vec<Broken>),
    /// There are too few rows.
    FewRows {
        /// So many.
        rows: u64,
        /// So many the last fit had.
        before: u64,
    },
    /// It cannot be fitted.
    Unfit(FitError),
    /// Nothing predicts a truth that was measured in the part that was held out.
    NothingToCompare,
    /// Its error is larger.
    Worse {
        /// Relative to that of what runs.
        ratio: f64,
    },
}

/// Fits the graph of what runs anew on the end of a recording, and reports what may be wrong with it as every fit does.
///
/// # Errors
/// When that is not worth proposing, and why.
pub fn propose(
    running: &Model,
    recording: &dyn Recording,
    terms: &Terms,
    created: Option<String>,
    host: &dyn Watch,
) -> Result<Proposal, NotProposed> {
    let plan = &running.plan;
    let data = Table::read(recording, plan).map_err(NotProposed::Unreadable)?;
    let newest = newest(&data).ok_or(NotProposed::NoData)?;
    let data = between(&data, newest - terms.on, newest);
    let card = running.card.as_ref();
    let fitted = card.map_or(&[][..], |of| &of.ranges);
    let broken = broken(plan, &data, fitted);
    if !broken.is_empty() {
        return Err(NotProposed::Broken(broken));
    }
    let (rows, before) = (times(&data).count() as u64, card.map_or(0, |of| of.ticks));
    if (rows as f64) < before as f64 * ROWS {
        return Err(NotProposed::FewRows { rows, before });
    }
    let oldest = oldest(&data).ok_or(NotProposed::NoData)?;
    let held_out = Duration::from_ns(((newest - oldest).as_ns() as f64 * HELD_OUT) as i64);
    let cut = newest - held_out;
    // Judged by a fit that has not seen the end; proposed is one that has seen all.
    let options = FitOptions {
        threads: 1,
        ..FitOptions::default()
    };
    let fitted_on =
        |data: &Table| FitOutcome::of(plan, data, &options, host).map_err(NotProposed::Unfit);
    let judged = fitted_on(&between(&data, oldest, cut))?;
    let new = errors(plan, &judged.fitted, &data, cut)?;
    let old = errors(plan, &running.fitted, &data, cut)?;
    let ratio = ratio(&old, &new).ok_or(NotProposed::NothingToCompare)?;
    if ratio.is_nan() || ratio > 1.0 + terms.margin {
        return Err(NotProposed::Worse { ratio });
    }
    let all = fitted_on(&data)?;
    all.warn(plan, host);
    let mut model = running.clone();
    model.fitted = all.fitted;
    let of = DataCard {
        path: "journal".to_owned(),
        rows,
        ..DataCard::default()
    };
    model.card = Some(Card::of(&all.report, vec![of], created));
    Ok(Proposal { model, ratio })
}

fn times(data: &Table) -> impl Iterator<Item = Instant> + '_ {
    data.events().iter().filter_map(|(event, _)| match event {
        Event::Row(at) => Some(*at),
        Event::Segment => None,
    })
}

fn newest(data: &Table) -> Option<Instant> {
    times(data).last()
}

fn oldest(data: &Table) -> Option<Instant> {
    times(data).next()
}

/// The rows of a table from one instant up to another.
fn between(data: &Table, from: Instant, to: Instant) -> Table {
    let mut part = Table::default();
    for (event, row) in data.events() {
        match event {
            Event::Row(at) if *at >= from && *at <= to => part.push(*at, row),
            Event::Row(_) => {}
            Event::Segment => part.segment(),
        }
    }
    part
}

/// The root mean square error of each prediction of an output behind an instant.
type Errors = BTreeMap<String, f64>;

/// The errors of a fit behind an instant of a recording, which it is stepped through from its beginning on.
fn errors(
    plan: &Arc<Plan>,
    fitted: &Fitted,
    data: &Table,
    from: Instant,
) -> Result<Errors, NotProposed> {
    let engine = Engine::new(Arc::clone(plan), fitted);
    let mut engine = engine.map_err(|error: EngineError| NotProposed::Unfit(error.into()))?;
    let mut pairs: Vec<_> = plan
        .outputs
        .iter()
        .filter_map(|of| Pair::new(plan, &of.name, of.slot))
        .collect();
    let passed = pass(&mut engine, data, |engine, event, _| {
        for pair in &mut pairs {
            match event {
                Event::Row(at) => pair.look(engine, at, at > from),
                Event::Segment => pair.paired.clear(),
            }
        }
    });
    passed.map_err(NotProposed::Unreadable)?;
    let errors = pairs.into_iter().filter(|of| of.count > 0);
    Ok(errors
        .map(|of| (of.name, (of.squares / of.count as f64).sqrt()))
        .collect())
}

/// A prediction, and the truth that it is of.
struct Pair {
    name: String,
    truth: usize,
    paired: PairedPrediction,
    squares: f64,
    count: u64,
}

impl Pair {
    fn new(plan: &Plan, name: &str, slot: usize) -> Option<Self> {
        let link = link(plan, slot)?;
        Some(Self {
            name: name.to_owned(),
            truth: link.slot,
            paired: PairedPrediction::new(slot, &link),
            squares: 0.0,
            count: 0,
        })
    }

    fn look(&mut self, engine: &Engine, now: Instant, counts: bool) {
        let error = self.paired.error(engine, now, engine.value(self.truth));
        if counts && !error.is_nan() {
            self.squares += error.powi(2);
            self.count += 1;
        }
    }
}

/// Root mean square over the outputs of both of the new error relative to the old one.
fn ratio(old: &Errors, new: &Errors) -> Option<f64> {
    let both = old
        .iter()
        .filter_map(|(name, old)| Some((*old, *new.get(name)?)));
    let squares: Vec<f64> = both
        .map(|(old, new)| if old == new { 1.0 } else { (new / old).powi(2) })
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

impl fmt::Display for NotProposed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable(error) => error.fmt(f),
            Self::NoData => f.write_str("the journal has no ticks"),
            Self::Broken(all) => {
                f.write_str("sensors are broken in the data")?;
                all.iter().try_for_each(|of| write!(f, "; {of}"))
            }
            Self::FewRows { rows, before } => {
                write!(
                    f,
                    "there are {rows} rows, and the last fit had {before}: less than half"
                )
            }
            Self::Unfit(error) => error.fmt(f),
            Self::NothingToCompare => {
                f.write_str("no truth was measured in the last fifth of the data that both predict")
            }
            Self::Worse { ratio } => write!(
                f,
                "on the last fifth of the data, which it had not seen, its error is {ratio:.3} times that of what runs"
            ),
        }
    }
}

impl std::error::Error for NotProposed {}
