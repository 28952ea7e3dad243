//! Warns of a fit that explains a truth to below its noise: what it is made of holds the truth.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

use athermal_analysis::diagnosis::noise::of_second_differences;
use athermal_analysis::figures::number;
use athermal_core::compile::Plan;
use athermal_core::compile::origins::{applied, of_truths, sources_of};
use athermal_core::engine::Fitted;
use athermal_core::message::Message;
use athermal_core::node::Duty;
use athermal_core::unit::Unit;
use athermal_run::fit::{EstimatorFit, FitReport, Outcome};
use athermal_run::recording::{Event, Recording, Samples};

/// Below this share of the noise an error is no chance.
const BELOW: f64 = 0.8;
/// Fewer samples say nothing of noise, and so many say enough.
const FEWEST: usize = 100;
const ENOUGH: usize = 50_000;

/// The sensors that a fit uses, where none of them is a temperature, or there is only one; none where it may well be honest.
fn doubted(plan: &Plan, fit: &EstimatorFit, fitted: &Fitted) -> Option<BTreeSet<String>> {
    let node = plan.nodes.iter().find(|node| node.instance() == fit.node)?;
    let uses = fitted.get(&fit.node)?.uses();
    let regressors = node.role.fit()?.regressors.iter();
    let used = regressors.filter(|of| uses.contains(&of.name) && !of.of_truth);
    let sensors: BTreeSet<String> = used.flat_map(|of| of.sensors.iter().cloned()).collect();
    let is_temperature = |name: &String| {
        let mut channels = plan.channels.iter().take(plan.sources.len());
        let unit = channels
            .find(|of| of.name == *name)
            .map(|of| &of.channel.unit);
        unit.is_some_and(|unit| unit.measures_same(&Unit::kelvin()))
    };
    let is_doubted = sensors.len() == 1 || !sensors.iter().any(is_temperature);
    (is_doubted && !sensors.is_empty()).then_some(sensors)
}

/// The last two samples of a channel, and second differences of even steps with the sum of these in seconds.
#[derive(Default)]
struct Course {
    last: Vec<(f64, f64)>,
    second: Vec<f64>,
    sum_s: f64,
}

impl Course {
    fn push(&mut self, at_s: f64, value: f64) {
        self.last.push((at_s, value));
        if let [(a, x), (b, y), (c, z)] = self.last[..] {
            self.last.remove(0);
            // Of uneven steps, what drifts would count.
            if ((c - b) - (b - a)).abs() <= 0.1 * (b - a) {
                self.sum_s += c - b;
                self.second.push(x - 2.0 * y + z);
            }
        }
    }

    /// The noise of a sample, and the time between two in seconds.
    fn noise(self) -> Option<(f64, f64)> {
        let step_s = self.sum_s / self.second.len() as f64;
        let is_known = self.second.len() >= FEWEST;
        is_known.then(|| (of_second_differences(self.second.into_iter()), step_s))
    }
}

/// The noises of what truths are made of, by its first rows, and the times between two samples in seconds.
fn noises(rows: &dyn Recording, plan: &Plan) -> Option<BTreeMap<usize, (f64, f64)>> {
    let sources = of_truths(plan)
        .into_iter()
        .enumerate()
        .filter(|(_, is)| *is);
    let mut courses: BTreeMap<usize, Course> =
        sources.map(|(of, _)| (of, Course::default())).collect();
    let (mut samples, mut rows) = (Samples::default(), rows.open(plan).ok()?);
    while let Some(event) = rows.next(&mut samples).ok()?
        && courses.values().any(|of| of.second.len() < ENOUGH)
    {
        for (&source, course) in &mut courses {
            match (event, samples.values.get(source)) {
                (Event::Segment, _) => course.last.clear(),
                (Event::Row(at), Some(value)) if !value.is_nan() => {
                    course.push(at.as_ns() as f64 / 1e9, *value);
                }
                _ => {}
            }
        }
    }
    let known = courses.into_iter();
    Some(
        known
            .filter_map(|(of, course)| Some((of, course.noise()?)))
            .collect(),
    )
}

/// The noise of a truth in its unit: of a position itself, or of its slope over a window, `σ √12 / (Δt √(n(n² − 1)))` of `n` samples. None of
/// a truth that is made of something else, or of several.
fn of_truth(plan: &Plan, truth: usize, noises: &BTreeMap<usize, (f64, f64)>) -> Option<f64> {
    let channel = &plan.channels[truth];
    let is_slope = match channel.node.map(|node| plan.nodes[node].kind.duty()) {
        None | Some(Duty::PutBack) => false,
        Some(Duty::Slope) => true,
        Some(_) => return None,
    };
    let behind = sources_of(plan, truth)
        .into_iter()
        .zip(applied(plan))
        .enumerate();
    let mut behind = behind.filter(|(_, (of, put_back))| *of && !put_back);
    let (source, _) = behind.next().filter(|_| behind.next().is_none())?;
    let &(mut noise, step_s) = noises.get(&source)?;
    let mut unit = plan.channels[source].channel.unit.difference();
    if is_slope {
        let n = (channel.channel.span.as_ns() as f64 / 1e9 / step_s + 1.0).max(2.0);
        noise *= (12.0 / (n * (n * n - 1.0))).sqrt() / step_s;
        unit = unit.per(&Unit::second());
    }
    Some(noise * unit.factor_to(&channel.channel.unit.difference())?)
}

/// The warnings of fits without a temperature, or on one sensor alone, that are better than the noise of their truth allows.
pub fn warnings(
    rows: &dyn Recording,
    plan: &Plan,
    fitted: &Fitted,
    report: &FitReport,
) -> Vec<Message> {
    let known = OnceCell::new();
    let warning = |fit: &EstimatorFit| {
        let sensors: Vec<String> = doubted(plan, fit, fitted)?.into_iter().collect();
        let Outcome::Fitted(of) = &fit.outcome else {
            return None;
        };
        let error = of.in_sample_rmse?;
        let truth = plan.channels.iter().position(|of| of.name == fit.truth)?;
        let noises = known.get_or_init(|| noises(rows, plan).unwrap_or_default());
        let noise = of_truth(plan, truth, noises).filter(|noise| error < BELOW * noise)?;
        let text = format!(
            "{} explains {} to {} {}, below its noise of {}: {} holds what is measured there and is no cause of it; leave it out",
            fit.node,
            fit.truth,
            number(error),
            fit.unit,
            number(noise),
            sensors.join(", ")
        );
        Some(text.into())
    };
    report.estimators.iter().filter_map(warning).collect()
}
