//! How the rows of many machines become a prior: what each of their fits sees is summed beside it. Decides which estimators are
//! pooled and which machines have a part in each; the mathematics are those of [`athermal_numerics::pool`].

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use athermal_core::compile::Plan;
use athermal_core::node::{
    Estimator, InputPort, Learns, Mistake, NodeSpec, PlannedRow, Predictor, Regressor, Regressors,
    Role, Trained, Trainer, TrainingError, TrainingSetup,
};
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use athermal_numerics::{
    FEWEST_MACHINES, Gram, GramBlocks, LeastSquares, MachineRows, Novelty, NumericsError, Pooled,
    Standardization, logarithmic_grid, pool,
};

use crate::prior::{EstimatorPrior, Prior, PriorNoise, PriorRegressor};

/// The kinds whose coefficients can be pooled, where their solver is ridge.
const KINDS: [&str; 3] = ["linear", "ar", "arx"];
/// So many stretches of all machines together test a penalty, at most; of each machine two at least.
const STRETCHES: usize = 360;
/// So many rows of each machine say how far from all of them a row may be.
const ROWS: usize = 400;
/// The penalties that are tried, in variances of the residuals, and how many to each factor of ten.
const PENALTIES: (f64, f64, u32) = (0.1, 1e4, 4);

/// Takes in machines one after the other, and gives what they have in common.
#[derive(Debug)]
pub struct Pooling {
    stretch: Duration,
    /// Of each instance, what is the same for all machines, and the machines that were fitted.
    estimators: BTreeMap<String, Pool>,
    of: usize,
}

#[derive(Debug)]
struct Pool {
    truth: String,
    unit: String,
    ahead: Duration,
    alpha: f64,
    machines: Vec<(String, Seen)>,
}

/// What a trainer saw of a machine.
#[derive(Debug, Clone, Default)]
struct Seen {
    regressors: Vec<Regressor>,
    stretches: Vec<Gram>,
    /// Every so many rows.
    rows: Vec<(Vec<f64>, f64)>,
    every: usize,
    count: usize,
    first: Option<Instant>,
}

type Shared = Arc<Mutex<Seen>>;

/// What was found for one estimator.
#[derive(Debug, Clone, PartialEq)]
pub struct PoolFit {
    /// The estimator's instance.
    pub instance: String,
    /// How many machines have a part in it.
    pub machines: usize,
    /// Those that have none, since they lack regressors that most others have.
    pub left_out: Vec<String>,
    /// What came of it, or why nothing did.
    pub outcome: Result<PoolErrors, NumericsError>,
    /// The unit of the errors.
    pub unit: String,
}

/// How well a stretch of a machine's own rows predicts its other rows: geometric means over machines and stretches of the root mean
/// square error, with a prior of the other machines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoolErrors {
    /// With the prior.
    pub with_prior: f64,
    /// Of the other machines' mean, without a fit.
    pub of_mean: f64,
    /// Without the prior.
    pub without: f64,
    /// The best penalty, in squares of the unit.
    pub penalty: f64,
    /// Whether it is the smallest or largest that was tried.
    pub at_edge: bool,
}

impl Pooling {
    /// For so many machines; a new one is thought to have rows of so long.
    #[must_use]
    pub fn new(machines: usize, stretch: Duration) -> Self {
        Self {
            stretch,
            estimators: BTreeMap::new(),
            of: machines,
        }
    }

    /// The plan with which a machine is to be fitted: its fit is the same, and what its estimators see is summed. Nothing where no
    /// estimator of the plan can be pooled.
    #[must_use]
    pub fn watched(&self, plan: &Plan) -> Option<Watch> {
        let mut plan = plan.clone();
        let mut watched = Vec::new();
        for node in &mut plan.nodes {
            let parameters = node.spec.parameters();
            if !KINDS.contains(&node.kind.name) || parameters["solver"]["type"] != "ridge" {
                continue;
            }
            let seen = Shared::default();
            let spec = Watched {
                spec: Arc::clone(&node.spec),
                seen: Arc::clone(&seen),
                stretch: self.stretch,
            };
            node.spec = Arc::new(spec);
            let Some(fit) = node.role.fit() else { continue };
            let truth = &plan.channels[fit.truth.slot];
            watched.push(WatchedNode {
                instance: node.instance(),
                truth: truth.name.clone(),
                unit: truth.channel.unit.difference(),
                ahead: fit.truth.ahead,
                // One that each machine chooses for itself says nothing of all.
                alpha: parameters["solver"]["alpha"].as_f64().unwrap_or(1.0),
                seen,
            });
        }
        (!watched.is_empty()).then(|| Watch {
            plan: Arc::new(plan),
            watched,
        })
    }

    /// Takes in a machine that has been fitted with the plan of a watch.
    pub fn add(&mut self, machine: &str, watch: Watch) {
        let most = (STRETCHES / self.of.max(1)).clamp(2, 12);
        for node in watch.watched {
            let seen = std::mem::take(&mut *lock(&node.seen));
            if seen.count == 0 {
                continue;
            }
            let pool = self
                .estimators
                .entry(node.instance)
                .or_insert_with(|| Pool {
                    truth: node.truth,
                    unit: node.unit.to_string(),
                    ahead: node.ahead,
                    alpha: node.alpha,
                    machines: Vec::new(),
                });
            let (total, stretches) = thinned(&seen.stretches, most);
            let stretches = [vec![total], stretches].concat();
            pool.machines
                .push((machine.to_owned(), Seen { stretches, ..seen }));
        }
    }

    /// Takes a machine out again.
    pub fn leave_out(&mut self, machine: &str) {
        let pools = self.estimators.values_mut();
        pools.for_each(|pool| pool.machines.retain(|(of, _)| of != machine));
    }

    /// The prior of all estimators that could be pooled, and what was found for each.
    #[must_use]
    pub fn finish(self) -> (Prior, Vec<PoolFit>) {
        let (mut priors, mut fits) = (BTreeMap::new(), Vec::new());
        for (instance, pool) in self.estimators {
            let (fit, prior) = pool.finish(instance.clone(), self.stretch);
            priors.extend(prior.map(|prior| (instance, prior)));
            fits.push(fit);
        }
        (Prior::new(priors), fits)
    }
}

/// All rows, and at most so many stretches, evenly spaced, of those that are whole.
fn thinned(stretches: &[Gram], most: usize) -> (Gram, Vec<Gram>) {
    let mut total = Gram::new(stretches.first().map_or(0, Gram::width));
    for stretch in stretches {
        // They are of one width.
        let _ = total.merge(stretch);
    }
    let mean = total.count() / stretches.len().max(1) as u64;
    let whole = stretches
        .iter()
        .filter(|of| 2 * of.count() >= mean && of.count() > 2);
    let whole: Vec<&Gram> = whole.collect();
    let count = most.min(whole.len());
    let places = (0..count).map(|nth| (2 * nth + 1) * whole.len() / (2 * count));
    (total, places.map(|place| whole[place].clone()).collect())
}

impl Pool {
    fn finish(self, instance: String, stretch: Duration) -> (PoolFit, Option<EstimatorPrior>) {
        let names = |seen: &Seen| -> Vec<String> {
            seen.regressors.iter().map(|of| of.name.clone()).collect()
        };
        let mut sets: Vec<(Vec<String>, usize)> = Vec::new();
        for (_, seen) in &self.machines {
            let own = names(seen);
            match sets.iter_mut().find(|(set, _)| *set == own) {
                Some((_, count)) => *count += 1,
                None => sets.push((own, 1)),
            }
        }
        // Of several that are as frequent the first.
        let usual = sets.iter().reduce(|a, b| if b.1 > a.1 { b } else { a });
        let usual = usual.map(|(set, _)| set.clone()).unwrap_or_default();
        let (part, apart): (Vec<_>, Vec<_>) = self
            .machines
            .into_iter()
            .partition(|(_, seen)| names(seen) == usual);
        let rows = part.iter().map(|(_, seen)| MachineRows {
            total: seen.stretches[0].clone(),
            stretches: seen.stretches[1..].to_vec(),
        });
        let rows: Vec<MachineRows> = rows.collect();
        let (smallest, largest, per_decade) = PENALTIES;
        let grid = logarithmic_grid(smallest, largest, per_decade);
        let pooled = pool(&rows, self.alpha, &grid);
        let outcome = pooled.as_ref().map(|pooled| PoolErrors {
            with_prior: pooled.errors[pooled.place],
            of_mean: pooled.error_of_mean,
            without: without_prior(&rows, self.alpha),
            penalty: pooled.penalty,
            at_edge: pooled.place == 0 || pooled.place == grid.len() - 1,
        });
        let fit = PoolFit {
            instance,
            machines: part.len(),
            left_out: apart.into_iter().map(|(machine, _)| machine).collect(),
            outcome: outcome.map_err(Clone::clone),
            unit: self.unit.clone(),
        };
        let prior = pooled.ok().map(|pooled| {
            let Pooled {
                prior,
                shrinkage,
                penalty,
                ..
            } = pooled;
            let regressors = part[0].1.regressors.iter();
            EstimatorPrior {
                machines: part.len(),
                truth: self.truth,
                unit: self.unit,
                ahead: self.ahead,
                stretch,
                penalty,
                shrinkage,
                regressors: regressors
                    .map(|of| PriorRegressor {
                        name: of.name.clone(),
                        unit: of.unit.clone(),
                    })
                    .collect(),
                coefficients: prior,
                novelty: novelty(&part),
                noise: PriorNoise::of(&noises(&rows, self.alpha)),
            }
        });
        (fit, prior)
    }
}

/// The geometric mean of the errors that fits to single stretches have on a machine's other rows.
fn without_prior(machines: &[MachineRows], alpha: f64) -> f64 {
    let (mut log, mut tests) = (0.0, 0.0);
    for machine in machines {
        for stretch in &machine.stretches {
            let columns: Vec<usize> = (0..stretch.width()).collect();
            let scales = Standardization::of(stretch).scales;
            let fit = LeastSquares::ridge(alpha).solve(stretch, &columns, &scales, None);
            let Ok(fit) = fit else { continue };
            let errors = |gram: &Gram| squared_errors(gram, fit.intercept, &fit.coefficients);
            let left = errors(&machine.total) - errors(stretch);
            let rest = machine.total.weight() - stretch.weight();
            if rest > 0.0 {
                log += 0.5 * (left.max(f64::MIN_POSITIVE) / rest).ln();
                tests += 1.0;
            }
        }
    }
    (log / tests).exp()
}

/// The variances of what machines' own fits leave.
fn noises(machines: &[MachineRows], alpha: f64) -> Vec<f64> {
    let of = machines.iter().filter_map(|MachineRows { total, .. }| {
        let columns: Vec<usize> = (0..total.width()).collect();
        let scales = Standardization::of(total).scales;
        let fit = LeastSquares::ridge(alpha).solve(total, &columns, &scales, None);
        Some(fit.ok()?.residual_sum_of_squares / total.weight())
    });
    of.filter(|of| *of > 0.0).collect()
}

/// The sum of the squared errors of a model of all columns.
fn squared_errors(gram: &Gram, intercept: f64, coefficients: &[f64]) -> f64 {
    let width = gram.width();
    let mut about = vec![0.0; width];
    about.push(intercept);
    let moments = gram.moments_about(&about);
    let weights: Vec<f64> = coefficients.iter().map(|b| -b).chain([1.0]).collect();
    let cells = (0..=width).flat_map(|i| (0..=width).map(move |j| (i, j)));
    cells
        .map(|(i, j)| weights[i] * weights[j] * moments[(i, j)])
        .sum()
}

/// How far regressors are from those of all machines.
fn novelty(machines: &[(String, Seen)]) -> Option<Novelty> {
    let width = machines.first()?.1.regressors.len();
    let mut blocks = GramBlocks::with_row_memory(width, usize::MAX);
    for (regressors, truth) in machines.iter().flat_map(|(_, seen)| &seen.rows) {
        blocks.push(regressors, *truth);
    }
    let total = blocks.total();
    let columns: Vec<usize> = (0..width).collect();
    Novelty::of(
        &total,
        &Standardization::of(&total),
        &columns,
        blocks.rows()?,
    )
}

/// A plan whose estimators are watched.
#[derive(Debug)]
pub struct Watch {
    /// The plan.
    pub plan: Arc<Plan>,
    watched: Vec<WatchedNode>,
}

#[derive(Debug)]
struct WatchedNode {
    instance: String,
    truth: String,
    unit: Unit,
    ahead: Duration,
    alpha: f64,
    seen: Shared,
}

impl Watch {
    /// Whether there are machines enough to pool.
    #[must_use]
    pub fn fewest_machines() -> usize {
        FEWEST_MACHINES
    }
}

fn lock(seen: &Shared) -> std::sync::MutexGuard<'_, Seen> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An estimator that is fitted as it would be, and what it sees is summed.
#[derive(Debug)]
struct Watched {
    spec: Arc<dyn NodeSpec>,
    seen: Shared,
    stretch: Duration,
}

impl Watched {
    fn estimator(&self) -> Option<&dyn Estimator> {
        match self.spec.role() {
            Role::Estimator(estimator) => Some(estimator),
            Role::Feature(_) | Role::Combiner(_) => None,
        }
    }
}

impl NodeSpec for Watched {
    fn role(&self) -> Role<'_> {
        match self.spec.role() {
            Role::Estimator(_) => Role::Estimator(self),
            other => other,
        }
    }

    fn parameters(&self) -> serde_json::Value {
        self.spec.parameters()
    }

    fn kind_name() -> &'static str {
        "watched"
    }
}

impl Estimator for Watched {
    fn inputs() -> &'static [InputPort] {
        &[]
    }

    fn regressors(&self) -> Regressors {
        self.estimator()
            .map(Estimator::regressors)
            .unwrap_or_default()
    }

    fn mistakes_of_row(&self, row: &PlannedRow<'_>) -> Vec<Mistake> {
        self.estimator()
            .map(|of| of.mistakes_of_row(row))
            .unwrap_or_default()
    }

    fn fixed(&self, regressors: &[String]) -> Option<Box<dyn Predictor>> {
        self.estimator()?.fixed(regressors)
    }

    fn learns(&self) -> Learns {
        self.estimator()
            .map_or(Learns::Never { help: None }, Estimator::learns)
    }

    fn has_std_dev(&self) -> bool {
        self.estimator().is_some_and(Estimator::has_std_dev)
    }

    fn has_novelty(&self) -> bool {
        self.estimator().is_some_and(Estimator::has_novelty)
    }

    fn needs_constants(&self) -> bool {
        self.estimator().is_some_and(Estimator::needs_constants)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(Watching {
            trainer: self.estimator().map(|of| of.trainer(setup)),
            seen: Seen {
                regressors: setup.regressors.clone(),
                every: 1,
                ..Seen::default()
            },
            shared: Arc::clone(&self.seen),
            stretch: self.stretch,
        })
    }
}

struct Watching {
    trainer: Option<Box<dyn Trainer>>,
    seen: Seen,
    shared: Shared,
    stretch: Duration,
}

impl Seen {
    fn take(&mut self, at: Instant, stretch: Duration, regressors: &[f64], truth: f64) {
        let first = *self.first.get_or_insert(at);
        let since = at.as_ns() - first.as_ns();
        let nth = usize::try_from(since / stretch.as_ns().max(1)).unwrap_or(0);
        while self.stretches.len() <= nth && self.stretches.len() < MOST_STRETCHES {
            self.stretches.push(Gram::new(regressors.len()));
        }
        if let Some(gram) = self.stretches.get_mut(nth.min(MOST_STRETCHES - 1)) {
            gram.push(regressors, truth);
        }
        if self.count.is_multiple_of(self.every) {
            self.rows.push((regressors.to_vec(), truth));
            if self.rows.len() >= 2 * ROWS {
                self.every *= 2;
                let mut nth = 0_usize;
                self.rows.retain(|_| {
                    nth += 1;
                    nth % 2 == 1
                });
            }
        }
        self.count += 1;
    }
}

/// A year of two hours each; what comes later counts as one.
const MOST_STRETCHES: usize = 4383;

impl Trainer for Watching {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.row_at(Instant::from_ns(0), regressors, truth);
    }

    fn row_at(&mut self, at: Instant, regressors: &[f64], truth: f64) {
        self.seen.take(at, self.stretch, regressors, truth);
        if let Some(trainer) = &mut self.trainer {
            trainer.row_at(at, regressors, truth);
        }
    }

    fn segment(&mut self) {
        if let Some(trainer) = &mut self.trainer {
            trainer.segment();
        }
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let Self {
            trainer,
            seen,
            shared,
            ..
        } = *self;
        // Fits for folds see fewer rows than the whole one.
        let mut before = lock(&shared);
        if seen.count >= before.count {
            *before = seen;
        }
        drop(before);
        match trainer {
            Some(trainer) => trainer.finish(),
            None => Err(TrainingError::Unsolvable {
                reason: "it is no estimator".to_owned(),
            }),
        }
    }
}
