//! How the predictions of several graphs are set against each other: the same truths, on the instants at which all of them
//! are valid.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use athermal_core::compile::Plan;
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_run::score::{
    NoModel, PredictionTrace, RESTRICTS, Trace, TruthTrace, hide_much, if_few,
};
use serde::Serialize;

use crate::report::rms;

/// Into how many blocks of time the instants of a truth are cut for the standard error of a difference. Within 10 to 30 blocks
/// the choice matters little (Schmeiser 1982); these are the fewest, and so the longest, since what moves a machine lasts for hours.
pub const BLOCKS: usize = 10;

/// Two values of a truth that differ by more than this share of it are not the same measurement, computed twice.
const SAME: f64 = 1e-9;

/// A graph that takes part.
#[derive(Debug, Clone)]
pub struct Contender {
    /// What it is called in the comparison.
    pub name: String,
    /// Its plan.
    pub plan: Arc<Plan>,
    /// What it predicted of the test data.
    pub trace: Trace,
}

/// Predictions over one horizon of truths over one span.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The horizon in s.
    pub ahead_s: f64,
    /// The span of the truths in s.
    pub span_s: f64,
    /// The unit of the truths and of all errors.
    pub unit: String,
    /// The truths: a column each.
    pub truths: Vec<Column>,
    /// A row for each node of each graph, or for each of its predictions where it has several of one truth.
    pub rows: Vec<Row>,
}

/// A truth that is predicted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Column {
    /// The channel: `drift.Z1`.
    pub truth: String,
    /// Its name within its node: `Z1`.
    pub name: String,
    /// Instants scored: those at which every prediction of it that is valid at half of them or more has a value.
    pub n: usize,
    /// Instants at which the prediction that is there most often is not scored, since another is not there, and the row that is there
    /// least often of those that count; none where these are few, at most one in twenty.
    pub left_out: Option<(usize, usize)>,
    /// What no model predicts; none without an instant.
    pub no_model: Option<f64>,
    /// Whether that is zero or a mean.
    #[serde(skip)]
    pub no_model_is: NoModel,
    /// Root mean square of the truth less that: the error of no model.
    pub baseline_zero: Option<f64>,
    /// The error of the truth at the smallest lag that sees nothing of the answer.
    pub baseline_persistence: Option<f64>,
    /// How many of these instants that is the error on.
    pub persistence_n: usize,
    /// The row with the smallest error on these instants.
    pub best: Option<usize>,
    /// Graphs whose own truth of this name is another one than that of the first graph, which all are scored on.
    pub otherwise: Vec<String>,
}

impl Column {
    /// On how many instants the error of persistence is, where these are too few to compare it with the others.
    #[must_use]
    pub fn persistence_on_few(&self) -> Option<usize> {
        self.baseline_persistence?;
        if_few(self.persistence_n, self.n)
    }
}

/// A node of a graph.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The graph.
    pub graph: String,
    /// The node.
    pub node: String,
    /// Which of its predictions, where it has several of one truth: the channel, with `*` for the name of the truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// The root mean square error for each truth; none where the node does not predict it.
    pub rmse: Vec<Option<f64>>,
    /// For each truth whose prediction is valid at less than half of the instants those that it is scored on apart from the others.
    pub own: Vec<Option<Own>>,
    /// The standard error of the difference of that error and the smallest of the truth, on the instants at which both are valid;
    /// none where there are too few.
    pub difference_error: Vec<Option<f64>>,
    /// The share of all instants with a truth at which there is a prediction.
    pub valid: Vec<Option<f64>>,
}

/// The instants of a prediction that is seldom valid: nothing that is scored on others is comparable with it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Own {
    /// How many there are.
    pub n: usize,
    /// The error of no model on them.
    pub baseline_zero: Option<f64>,
}

/// A prediction of a truth by one of the contenders.
struct Entry<'a> {
    contender: &'a Contender,
    truth: &'a TruthTrace,
    of: &'a PredictionTrace,
}

/// What makes predictions comparable: horizon and span in ns, and unit.
type Key = (i64, i64, String);

impl Entry<'_> {
    fn key(&self) -> Key {
        let channel = &self.contender.plan.channels[self.truth.slot].channel;
        let unit = channel.unit.difference().to_string();
        (self.of.ahead.as_ns(), channel.span.as_ns(), unit)
    }

    fn truth_name(&self) -> &str {
        &self.contender.plan.channels[self.truth.slot].name
    }

    /// The graph and the node.
    fn node(&self) -> (&str, &str) {
        let node = &self.contender.plan.nodes[self.of.node];
        (&self.contender.name, &node.name)
    }

    /// The channel, with `*` for the name of the truth: `*-front` of `X-front`, where `X` is predicted.
    fn channel(&self) -> String {
        let channels = &self.contender.plan.channels;
        let own = &channels[self.of.slot].name;
        let own = own.split_once('.').map_or(&**own, |(_, channel)| channel);
        let truth = &channels[self.truth.slot].channel.name;
        starred(own, truth)
    }

    /// Its row, yet empty.
    fn row(&self, several: bool) -> Row {
        let (graph, node) = self.node();
        Row {
            graph: graph.to_owned(),
            node: node.to_owned(),
            channel: several.then(|| self.channel()),
            kind: self.contender.plan.nodes[self.of.node].kind.name,
            rmse: Vec::new(),
            own: Vec::new(),
            difference_error: Vec::new(),
            valid: Vec::new(),
        }
    }
}

/// A channel with `*` for the name of the truth, where that stands alone: it may have parts joined by `-` itself.
fn starred(channel: &str, truth: &str) -> String {
    let around = |at: usize| (&channel[..at], &channel[at + truth.len()..]);
    let stands_alone = |(before, after): &(&str, &str)| {
        (before.is_empty() || before.ends_with('-')) && (after.is_empty() || after.starts_with('-'))
    };
    let places = channel.match_indices(truth).map(|(at, _)| around(at));
    match places.into_iter().find(stands_alone) {
        Some((before, after)) => format!("{before}*{after}"),
        None => channel.to_owned(),
    }
}

impl Row {
    fn is_of(&self, entry: &Entry<'_>) -> bool {
        let channel = self.channel.as_ref();
        (&*self.graph, &*self.node) == entry.node()
            && channel.is_none_or(|of| *of == entry.channel())
    }

    /// What it is called: `thermal`, or `thermal.*-front` of several.
    #[must_use]
    pub fn label(&self) -> String {
        match &self.channel {
            Some(channel) => format!("{}.{channel}", self.node),
            None => self.node.clone(),
        }
    }
}

/// Sets contenders against each other. Truths at or above `below` in size do not count.
#[must_use]
pub fn compare(contenders: &[Contender], below: Option<&Quantity>) -> Vec<Comparison> {
    let mut tables: BTreeMap<Key, Vec<Entry<'_>>> = BTreeMap::new();
    for contender in contenders {
        for truth in &contender.trace.truths {
            for of in &truth.predictions {
                let entry = Entry {
                    contender,
                    truth,
                    of,
                };
                tables.entry(entry.key()).or_default().push(entry);
            }
        }
    }
    let tables = tables.into_iter();
    tables
        .map(|(key, entries)| table(key, &entries, below))
        .collect()
}

fn table(key: Key, entries: &[Entry<'_>], below: Option<&Quantity>) -> Comparison {
    let mut truths: Vec<&str> = Vec::new();
    let mut rows: Vec<Row> = Vec::new();
    for entry in entries {
        if !truths.contains(&entry.truth_name()) {
            truths.push(entry.truth_name());
        }
        if !rows.iter().any(|row| row.is_of(entry)) {
            let mut of_node = entries.iter().filter(|other| other.node() == entry.node());
            let mut predicted = BTreeSet::new();
            let several = !of_node.all(|other| predicted.insert(other.truth_name()));
            rows.push(entry.row(several));
        }
    }
    for row in &mut rows {
        row.rmse.resize(truths.len(), None);
        row.own.resize(truths.len(), None);
        row.difference_error.resize(truths.len(), None);
        row.valid.resize(truths.len(), None);
    }
    let columns = truths.iter().enumerate().map(|(nth, truth)| {
        let of_truth: Vec<&Entry<'_>> = entries
            .iter()
            .filter(|entry| entry.truth_name() == *truth)
            .collect();
        column(nth, &of_truth, &mut rows, below)
    });
    let truths = columns.collect();
    let (ahead, span, unit) = key;
    Comparison {
        ahead_s: Duration::from_ns(ahead).secs(),
        span_s: Duration::from_ns(span).secs(),
        unit,
        truths,
        rows,
    }
}

/// The instants of a truth that count, each with the place of every entry's prediction of it.
fn instants(entries: &[&Entry<'_>], below: Option<f64>) -> Vec<Vec<usize>> {
    let mut places: BTreeMap<(u32, Instant), Vec<usize>> = BTreeMap::new();
    for entry in entries {
        for (place, &at) in entry.truth.times.iter().enumerate() {
            let fits = below.is_none_or(|below| entry.truth.values[place].abs() < below);
            if fits {
                places.entry(at).or_default().push(place);
            }
        }
    }
    // A graph that drops samples as out of range has fewer truths than another.
    let all = places.into_values();
    all.filter(|places| places.len() == entries.len()).collect()
}

fn column(
    nth: usize,
    entries: &[&Entry<'_>],
    rows: &mut [Row],
    below: Option<&Quantity>,
) -> Column {
    let first = entries[0];
    let channel = &first.contender.plan.channels[first.truth.slot].channel;
    let limit = below.and_then(|below| below.as_difference(&channel.unit));
    let counted = instants(entries, limit);
    let value = |entry: usize, places: &[usize]| entries[entry].of.values[places[entry]];
    let valid: Vec<f64> = (0..entries.len())
        .map(|entry| {
            let there = counted.iter().filter(|at| !value(entry, at).is_nan());
            there.count() as f64 / counted.len().max(1) as f64
        })
        .collect();
    let common: Vec<&Vec<usize>> = counted
        .iter()
        .filter(|at| {
            (0..entries.len()).all(|entry| valid[entry] < RESTRICTS || !value(entry, at).is_nan())
        })
        .collect();
    let truth = |places: &[usize]| first.truth.values[places[0]];
    let no_model_is = first.truth.no_model;
    let no_model = no_model_is.value(common.iter().map(|at| truth(at)));
    let mut errors: Vec<(usize, Vec<f64>)> = Vec::new();
    for (entry, of) in entries.iter().enumerate() {
        let Some(row) = rows.iter().position(|row| row.is_of(of)) else {
            continue;
        };
        rows[row].valid[nth] = (!counted.is_empty()).then_some(valid[entry]);
        if valid[entry] < RESTRICTS {
            let there = || counted.iter().filter(|at| !value(entry, at).is_nan());
            rows[row].rmse[nth] = rms(there().map(|at| value(entry, at) - truth(at)));
            rows[row].own[nth] = Some(Own {
                n: there().count(),
                baseline_zero: rms(there().map(|at| truth(at) - no_model)),
            });
            continue;
        }
        let of_entry: Vec<f64> = common
            .iter()
            .map(|at| value(entry, at) - truth(at))
            .collect();
        rows[row].rmse[nth] = rms(of_entry.iter().copied());
        errors.push((row, of_entry));
    }
    let size = |row: &usize| rows[*row].rmse[nth].unwrap_or(f64::INFINITY);
    let comparable = (0..rows.len()).filter(|&row| rows[row].own[nth].is_none());
    let best = comparable.min_by(|a, b| size(a).total_cmp(&size(b)));
    let of_best = errors.iter().find(|(row, _)| Some(*row) == best);
    if let Some((_, of_best)) = of_best {
        for (row, of_entry) in &errors {
            rows[*row].difference_error[nth] = difference_error(of_entry, of_best);
        }
    }
    let other = |entry: usize, places: &[usize]| {
        let own = entries[entry].truth.values[places[entry]];
        (own - truth(places)).abs() > SAME * truth(places).abs()
    };
    let mut otherwise: Vec<String> = Vec::new();
    for (entry, of) in entries.iter().enumerate() {
        let name = &of.contender.name;
        if !otherwise.contains(name) && counted.iter().any(|at| other(entry, at)) {
            otherwise.push(name.clone());
        }
    }
    let there = |row: &usize| rows[*row].valid[nth].unwrap_or(0.0);
    let by_valid = |a: &usize, b: &usize| there(a).total_cmp(&there(b));
    let scored = || errors.iter().map(|(row, _)| *row);
    let most = scored().max_by(by_valid).map_or(0.0, |row| there(&row));
    let most = (most * counted.len() as f64).round() as usize;
    let left_out = most.saturating_sub(common.len());
    let left_out = scored()
        .min_by(by_valid)
        .map(|row| (left_out, row))
        .filter(|_| hide_much(left_out, most));
    let persistence = first.truth.persistence.get(&first.of.ahead);
    let lasting = |at: &&Vec<usize>| persistence.map(|values| values[at[0]] - truth(at));
    let lasting = common.iter().filter_map(lasting);
    let lasting: Vec<f64> = lasting.filter(|error| !error.is_nan()).collect();
    Column {
        truth: first.truth_name().to_owned(),
        name: channel.name.clone(),
        n: common.len(),
        left_out,
        no_model: (!common.is_empty()).then_some(no_model),
        no_model_is,
        baseline_zero: rms(common.iter().map(|at| truth(at) - no_model)),
        persistence_n: lasting.len(),
        baseline_persistence: rms(lasting.into_iter()),
        best: best.filter(|&best| rows[best].rmse[nth].is_some()),
        otherwise,
    }
}

/// The standard error of the difference of the root mean squares of two series of errors, which stand side by side: that of the mean
/// over [`BLOCKS`] blocks in a row (batch means; Law and Kelton, Simulation Modeling and Analysis, section 9.5.3). Errors that
/// last from one instant to the next count within their block as what they are, one error. Of a block counts
/// `mean(a²) / 2 rms(a) − mean(b²) / 2 rms(b)`, by which it moves the difference to the first order.
fn difference_error(a: &[f64], b: &[f64]) -> Option<f64> {
    let both = a.iter().zip(b).filter(|(a, b)| !(*a + *b).is_nan());
    let both: Vec<[f64; 2]> = both.map(|(&a, &b)| [a, b]).collect();
    if both.len() < 2 * BLOCKS {
        return None;
    }
    let mean_square = |of: &[[f64; 2]], side: usize| {
        of.iter().map(|errors| errors[side].powi(2)).sum::<f64>() / of.len() as f64
    };
    let sizes = [0, 1].map(|side| mean_square(&both, side).sqrt());
    let moved = |of: &[[f64; 2]], side: usize| match sizes[side] {
        // Where nothing is wrong, no block is.
        0.0 => 0.0,
        size => mean_square(of, side) / (2.0 * size),
    };
    let blocks = (0..BLOCKS).map(|nth| {
        let [from, to] = [nth, nth + 1].map(|nth| nth * both.len() / BLOCKS);
        moved(&both[from..to], 0) - moved(&both[from..to], 1)
    });
    let blocks: Vec<f64> = blocks.collect();
    let n = BLOCKS as f64;
    let mean = blocks.iter().sum::<f64>() / n;
    let spread: f64 = blocks.iter().map(|block| (block - mean).powi(2)).sum();
    Some((spread / (n - 1.0) / n).sqrt())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_a_truth_whose_name_has_parts_too() {
        assert_eq!(starred("Z1-front-150s", "Z1-front"), "*-150s");
        assert_eq!(starred("room-Z1-front", "Z1-front"), "room-*");
        assert_eq!(starred("Z1-front", "Z1-front"), "*");
        assert_eq!(starred("XZ1-front-Z1", "Z1"), "XZ1-front-*");
        assert_eq!(starred("Z1-frontal", "Z1-front"), "Z1-frontal");
    }

    #[test]
    fn a_series_differs_from_itself_by_nothing_for_sure() {
        let errors: Vec<f64> = (0..50).map(|nth| f64::from(nth).sin()).collect();
        assert_eq!(difference_error(&errors, &errors), Some(0.0));
        assert_eq!(difference_error(&[0.0; 50], &[0.0; 50]), Some(0.0));
        assert_eq!(difference_error(&errors[..19], &errors[..19]), None);
    }

    #[test]
    fn a_difference_that_comes_and_goes_by_blocks_is_as_sure_as_their_number_makes_it() {
        // Ten blocks of 4: of one series the first five have errors of 2 and the others none, rms √2; the other's are all 1.
        let a: Vec<f64> = (0..40)
            .map(|nth| if nth < 20 { 2.0 } else { 0.0 })
            .collect();
        let b: Vec<f64> = (0..40)
            .map(|nth| if nth % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        // Blocks move the difference by 4 / 2√2 − 1/2 or by −1/2: five times √2/2 to either side of their mean.
        let variance = 10.0 * 0.5 / 9.0;
        let expected = (variance / 10.0_f64).sqrt();
        assert!((difference_error(&a, &b).unwrap() - expected).abs() < 1e-15);
        // Instants at which one of them is not valid count for neither.
        let with = |of: &[f64], gap: f64| of.iter().flat_map(|&it| [it, gap]).collect::<Vec<_>>();
        let gaps = difference_error(&with(&a, f64::NAN), &with(&b, 7.0));
        assert_eq!(gaps, difference_error(&a, &b));
    }
}
