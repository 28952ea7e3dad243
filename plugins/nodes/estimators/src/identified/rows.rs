//! Decides how the rows of a fit, and the runs between them, become the evenly spaced samples that a model is identified from: the
//! same samples that are followed while it runs.

use athermal_core::node::TrainingReport;
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{Samples, Standardization};

use super::follow::{MOST_STEPS, part, steps};
use super::model::MOST_SERIES;

/// The rows of a fit, in order, and the runs between them.
#[derive(Debug, Default)]
pub(super) struct Rows {
    width: usize,
    rows: Vec<Row>,
    regressors: Vec<f64>,
    /// What each run predicts, and its inputs.
    runs: Vec<Instant>,
    inputs: Vec<f64>,
    /// Whether the last row ended a segment.
    ended: bool,
}

#[derive(Debug, Clone, Copy)]
struct Row {
    at: Instant,
    truth: f64,
    /// Whether a segment begins with it.
    begins: bool,
    /// How many of the runs come before it.
    runs: usize,
}

/// A run of the estimator in the fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<'a> {
    /// The instant that it predicts.
    pub(super) of: Instant,
    pub(super) inputs: &'a [f64],
    /// What was measured there, of a row.
    pub(super) truth: Option<f64>,
    /// Whether a segment begins with it.
    pub(super) begins: bool,
}

/// How gaps between truths are bridged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bridges {
    /// The most steps from one run to the next.
    pub(super) unseen: usize,
    /// How many samples may be missing in all.
    pub(super) missing: usize,
}

impl Rows {
    /// With so many regressors each.
    pub(super) fn new(width: usize) -> Self {
        Self {
            width,
            ..Self::default()
        }
    }

    pub(super) fn push(&mut self, at: Instant, regressors: &[f64], truth: f64) {
        let ended = std::mem::take(&mut self.ended);
        self.rows.push(Row {
            at,
            truth,
            begins: ended || self.rows.is_empty(),
            runs: self.runs.len(),
        });
        self.regressors.extend_from_slice(regressors);
    }

    /// Takes a run between the last row and the next.
    pub(super) fn run(&mut self, of: Instant, regressors: &[f64]) {
        self.runs.push(of);
        self.inputs.extend_from_slice(regressors);
    }

    /// The next row begins a segment.
    pub(super) fn segment(&mut self) {
        self.ended = true;
    }

    /// Lets go of the runs between rows.
    pub(super) fn forget_runs(&mut self) {
        (self.runs, self.inputs) = (Vec::new(), Vec::new());
        self.rows.iter_mut().for_each(|row| row.runs = 0);
    }

    pub(super) fn count(&self) -> usize {
        self.rows.len()
    }

    /// How many runs between rows there are.
    pub(super) fn runs(&self) -> usize {
        self.runs.len()
    }

    pub(super) const fn bytes_per_row(width: usize) -> usize {
        size_of::<Row>() + width * size_of::<f64>()
    }

    pub(super) fn last(&self) -> Option<Instant> {
        self.rows.last().map(|row| row.at)
    }

    /// One row after the other.
    pub(super) fn regressors(&self) -> &[f64] {
        &self.regressors
    }

    pub(super) fn truths(&self) -> impl Iterator<Item = f64> + '_ {
        self.rows.iter().map(|row| row.truth)
    }

    /// The typical time from one truth to the next.
    pub(super) fn between(&self) -> Option<Duration> {
        let pairs = self.rows.windows(2).filter(|pair| !pair[1].begins);
        let mut between: Vec<Duration> = pairs.map(|pair| pair[1].at - pair[0].at).collect();
        between.sort_unstable();
        between
            .get(between.len() / 2)
            .copied()
            .filter(|&between| between > Duration::ZERO)
    }

    /// The rows as samples of several interleaved series, each as far apart as a step. Where one is missing, a series ends and
    /// another begins, unless that is bridged: then its inputs are those of the last run at or before it.
    pub(super) fn samples(
        &self,
        pace: Pace,
        standard: &Standardization,
        bridges: Option<Bridges>,
    ) -> Samples {
        let scaled = |inputs: &[f64]| {
            let mut inputs = inputs.to_vec();
            standard.apply(&mut inputs);
            inputs
        };
        let step = pace.step.secs();
        let mut samples = Samples::new(self.width);
        let mut from = 0;
        while from < self.rows.len() {
            let rest = &self.rows[from + 1..];
            let length = 1 + rest.iter().position(|row| row.begins).unwrap_or(rest.len());
            for series in 0..pace.series {
                let series = series * pace.truths / pace.series;
                samples.segment();
                let mut last: Option<usize> = None;
                for nth in (from + series..from + length).step_by(pace.truths) {
                    let Row { at, truth, .. } = self.rows[nth];
                    let apart = last.map(|last| at - self.rows[last].at);
                    let steps = apart.map_or(1.0, |apart| apart.secs() / step);
                    if steps < 0.5 {
                        continue;
                    }
                    if let (Some(last), true) = (last, steps >= 1.5) {
                        let lacking = steps.round() as usize - 1;
                        let bridged = bridges.is_some_and(|of| {
                            samples.missing().saturating_add(lacking) <= of.missing
                                && steps < MOST_STEPS as f64
                                && self.seen(last, nth, pace.step, of.unseen)
                        });
                        if bridged {
                            let (begin, steps) = (self.rows[last].at, steps.round() as i64);
                            for between in 1..steps {
                                let of = begin + part(at - begin, between, steps);
                                samples.push_missing(scaled(self.inputs_at(of, last, nth)));
                            }
                        } else {
                            samples.segment();
                        }
                    }
                    last = Some(nth);
                    samples.push(scaled(self.of_row(nth)), truth);
                }
            }
            from += length;
        }
        samples
    }

    /// All rows and runs, in order.
    pub(super) fn all(&self) -> impl Iterator<Item = Seen<'_>> {
        let before = std::iter::once(0).chain(self.rows.iter().map(|row| row.runs));
        let rows = self.rows.iter().zip(before).enumerate();
        rows.flat_map(|(nth, (row, from))| {
            let runs = (from..row.runs).map(|run| Seen {
                of: self.runs[run],
                inputs: self.of_run(run),
                truth: None,
                begins: false,
            });
            runs.chain([Seen {
                of: row.at,
                inputs: self.of_row(nth),
                truth: Some(row.truth),
                begins: row.begins,
            }])
        })
    }

    fn of_row(&self, nth: usize) -> &[f64] {
        &self.regressors[nth * self.width..(nth + 1) * self.width]
    }

    fn of_run(&self, run: usize) -> &[f64] {
        &self.inputs[run * self.width..(run + 1) * self.width]
    }

    /// The inputs of the last run that predicts this instant or one before, between two rows of a segment.
    fn inputs_at(&self, at: Instant, from: usize, to: usize) -> &[f64] {
        let row = from + self.rows[from..to].partition_point(|row| row.at <= at) - 1;
        let runs = self.rows[from].runs..self.rows[to].runs;
        let run = runs.start + self.runs[runs.clone()].partition_point(|&of| of <= at);
        match run.checked_sub(1) {
            Some(run) if runs.contains(&run) && self.runs[run] > self.rows[row].at => {
                self.of_run(run)
            }
            _ => self.of_row(row),
        }
    }

    /// Whether between two rows of a segment there are never more steps without a run; a model without inputs needs none.
    fn seen(&self, from: usize, to: usize, step: Duration, unseen: usize) -> bool {
        let rows = self.rows[from..=to].iter().map(|row| row.at);
        let runs = &self.runs[self.rows[from].runs..self.rows[to].runs];
        let mut all: Vec<Instant> = rows.chain(runs.iter().copied()).collect();
        all.sort_unstable();
        let apart = |pair: &[Instant]| steps(pair[1] - pair[0], step) <= unseen as i64;
        self.width == 0 || all.windows(2).all(apart)
    }
}

/// How samples follow each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    pub(super) step: Duration,
    /// How many truths come within a step.
    truths: usize,
    /// How many of them begin a series of their own: all, or so many of them at even distances.
    pub(super) series: usize,
}

impl Pace {
    pub(super) fn of(every: Option<Duration>, span: Duration, between: Duration) -> Self {
        let step = every.unwrap_or_else(|| span.max(between));
        let truths = ((step.secs() / between.secs()).round() as usize).max(1);
        Self {
            step,
            truths,
            series: truths.min(MOST_SERIES),
        }
    }

    pub(super) fn tell(self, report: &mut TrainingReport) {
        report.figure("step_s", self.step.secs());
        report.figure("series", self.series);
        report.figure("truths_within_a_step", self.truths);
        report.notes.push(self.note());
    }

    fn note(self) -> String {
        let Self {
            step,
            truths,
            series,
        } = self;
        match series {
            1 => format!("a step is {step}"),
            series if series == truths => {
                format!("a step is {step}, in {series} interleaved series")
            }
            series => format!(
                "a step is {step}, in {series} interleaved series of the {truths} truths within one; the others are \
                 not used"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_numerics::Standardizer;

    #[test]
    fn of_truths_that_come_much_faster_than_a_step_the_samples_are_a_step_apart() {
        let at = |nth: i64| Instant::from_ns(0) + Duration::from_ns(nth * 2_000_000_000);
        let mut rows = Rows::new(0);
        (0..500).for_each(|nth| rows.push(at(nth), &[], 2.0 * nth as f64));
        let pace = Pace::of(None, Duration::from_ns(99_000_000_000), at(1) - at(0));
        let samples = rows.samples(pace, &Standardizer::new(0).standardization(), None);
        let mut series = 0;
        for record in samples.records() {
            series += 1;
            let apart = record.outputs.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(apart.into_iter().all(|apart| apart == 100.0));
        }
        assert_eq!(series, MOST_SERIES);
        let told = "16 interleaved series of the 50 truths within one; the others are not used";
        assert!(pace.note().ends_with(told), "{}", pace.note());
    }

    /// A second after the first instant, two and so on.
    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    /// The inputs of the samples that become of rows and runs at these instants, each its own input, in brackets where the value is
    /// missing; and in how many pieces they are.
    fn samples(rows: &[i64], runs: &[i64], unseen: usize) -> (String, usize) {
        let mut all = Rows::new(1);
        let mut runs = runs.iter().peekable();
        for &row in rows {
            while let Some(&run) = runs.next_if(|run| **run < row) {
                all.run(s(run), &[run as f64]);
            }
            all.push(s(row), &[row as f64], 1.0);
        }
        let step = Duration::from_ns(10_000_000_000);
        let bridges = Bridges {
            unseen,
            missing: usize::MAX,
        };
        let standard = Standardizer::new(1).standardization();
        let pace = Pace::of(Some(step), step, step);
        let samples = all.samples(pace, &standard, Some(bridges));
        let told = samples.all().map(|(inputs, value)| match value {
            Some(_) => format!("{}", inputs[0]),
            None => format!("({})", inputs[0]),
        });
        let told: Vec<String> = told.collect();
        (told.join(" "), samples.pieces())
    }

    #[test]
    fn where_a_truth_is_missing_inputs_are_those_of_the_last_run_at_or_before_it() {
        let told = |rows: &[i64], runs: &[i64]| samples(rows, runs, 10);
        let whole = |told: &str| (told.to_owned(), 1);
        assert_eq!(told(&[0, 10, 20], &[5, 15]), whole("0 10 20"));
        let runs = [11, 14, 17, 20, 23, 26, 29, 32, 35, 38];
        assert_eq!(told(&[0, 10, 40], &runs), whole("0 10 (20) (29) 40"));
        // Those before the row are older than it.
        assert_eq!(told(&[0, 10, 30], &[5, 21]), whole("0 10 (10) 30"));
        // Samples between two truths are as far apart as these allow.
        let runs = [15, 25, 27, 35];
        assert_eq!(told(&[0, 10, 44], &runs), whole("0 10 (15) (27) 44"));
    }

    #[test]
    fn a_gap_without_runs_is_bridged_as_long_as_a_model_is_followed_through_one() {
        let told = |rows: &[i64], runs: &[i64]| samples(rows, runs, 3).1;
        assert_eq!(told(&[0, 10, 40, 50], &[]), 1);
        assert_eq!(told(&[0, 10, 50, 60], &[]), 2);
        assert_eq!(told(&[0, 10, 50, 60], &[20]), 1);
        assert_eq!(told(&[0, 10, 90, 100], &[20, 60]), 2);
        assert_eq!(told(&[0, 10, 90, 100], &[40, 70]), 1);
    }

    #[test]
    fn without_room_for_samples_that_are_missing_a_gap_ends_a_piece() {
        let mut rows = Rows::new(0);
        for at in [0, 10, 30, 40, 60, 70] {
            rows.push(s(at), &[], 1.0);
        }
        let step = Duration::from_ns(10_000_000_000);
        let standard = Standardizer::new(0).standardization();
        let pieces = |bridges: Option<Bridges>| {
            let samples = rows.samples(Pace::of(Some(step), step, step), &standard, bridges);
            (samples.pieces(), samples.missing())
        };
        let room = |missing| Some(Bridges { unseen: 1, missing });
        assert_eq!(pieces(room(10)), (1, 2));
        assert_eq!(pieces(room(1)), (2, 1));
        assert_eq!(pieces(None), (3, 0));
    }
}
