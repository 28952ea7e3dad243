//! Which runs between two truths a trainer sees that asks for them.
//!
//! Runs come far more often than truths, and where truths come as usual a trainer learns nothing from them. It sees those between two
//! truths only where one is missing. What is usual is known from the truths until then.

use std::collections::VecDeque;

use crate::time::{Duration, Instant};

/// So many times as far apart as usual, truths have something between them.
const UNUSUAL: (i64, i64) = (5, 4);
/// Of the runs within a usual distance so many are kept.
const RUNS_WITHIN: i64 = 16;
/// Of so many distances the typical one is usual.
const DISTANCES: usize = 64;
/// How often that is worked out anew, in truths, once there are as many.
const RENEWED: usize = 16;
/// The most runs that are kept until a truth comes; of more, the last ones.
const MOST: usize = 1 << 14;

/// The runs of an estimator since the truth that it last learned from.
pub(super) struct Between {
    /// How far apart truths are wanted, where that is stated.
    every: Option<Duration>,
    width: usize,
    last: Option<Instant>,
    distances: VecDeque<Duration>,
    truths: usize,
    typical: Option<Duration>,
    /// What each predicts, and its regressors.
    runs: VecDeque<Instant>,
    rows: VecDeque<f64>,
}

impl Between {
    /// Of runs with so many regressors.
    pub(super) fn new(every: Option<Duration>, width: usize) -> Self {
        Self {
            every,
            width,
            last: None,
            distances: VecDeque::new(),
            truths: 0,
            typical: None,
            runs: VecDeque::new(),
            rows: VecDeque::new(),
        }
    }

    /// How far apart truths are where none is missing.
    fn usual(&self) -> Option<Duration> {
        let both = self.every.into_iter().chain(self.typical);
        both.filter(|of| *of > Duration::ZERO).min()
    }

    /// Takes a run, which predicts the truth at `of`.
    pub(super) fn run<'a>(&mut self, of: Instant, parts: impl Iterator<Item = &'a [f64]>) {
        let apart = self.usual().map_or(0, |usual| usual.as_ns() / RUNS_WITHIN);
        let last = self.runs.back();
        if last.is_some_and(|&last| (of - last).as_ns() < apart) {
            return;
        }
        if self.runs.len() == MOST {
            self.forget(1);
        }
        self.runs.push_back(of);
        parts.for_each(|part| self.rows.extend(part));
    }

    /// A truth from which something is learned: hands over the runs between the last such truth and this one, if these are further
    /// apart than usual.
    pub(super) fn truth(&mut self, at: Instant, mut take: impl FnMut(Instant, &[f64])) {
        let before = |runs: &VecDeque<Instant>, at: Instant| runs.partition_point(|&of| of < at);
        if let Some(last) = self.last {
            self.forget(before(&self.runs, last + Duration::from_ns(1)));
            let distance = at - last;
            let unusual = |usual: Duration| {
                let (times, of) = UNUSUAL;
                i128::from(distance.as_ns()) * i128::from(of)
                    >= i128::from(usual.as_ns()) * i128::from(times)
            };
            if self.usual().is_some_and(unusual) {
                let count = before(&self.runs, at);
                let (runs, rows) = (&self.runs, self.rows.make_contiguous());
                for (nth, &of) in runs.iter().take(count).enumerate() {
                    take(of, &rows[nth * self.width..(nth + 1) * self.width]);
                }
            }
            self.learn(distance);
        }
        self.forget(before(&self.runs, at));
        self.last = Some(at);
    }

    /// What comes next has nothing to do with what was; how far apart truths are stays known.
    pub(super) fn segment(&mut self) {
        self.forget(self.runs.len());
        self.last = None;
    }

    fn learn(&mut self, distance: Duration) {
        if self.distances.len() == DISTANCES {
            self.distances.pop_front();
        }
        self.distances.push_back(distance);
        self.truths += 1;
        if self.distances.len() < RENEWED || self.truths.is_multiple_of(RENEWED) {
            let mut sorted: Vec<Duration> = self.distances.iter().copied().collect();
            sorted.sort_unstable();
            self.typical = sorted.get(sorted.len() / 2).copied();
        }
    }

    fn forget(&mut self, count: usize) {
        self.runs.drain(..count);
        self.rows.drain(..count * self.width);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    fn d(seconds: i64) -> Duration {
        Duration::from_ns(seconds * 1_000_000_000)
    }

    /// The runs that are given for truths at these instants, with a run at every second.
    fn runs(every: Option<Duration>, truths: &[i64]) -> Vec<i64> {
        let mut between = Between::new(every, 1);
        let (mut runs, mut ran) = (Vec::new(), 0);
        for &truth in truths {
            while ran <= truth + 5 {
                between.run(s(ran), [&[ran as f64][..]].into_iter());
                ran += 1;
            }
            between.truth(s(truth), |of, row| {
                assert_eq!(of, s(row[0] as i64));
                runs.push(row[0] as i64);
            });
        }
        runs
    }

    #[test]
    fn only_where_a_truth_is_missing_runs_are_given() {
        assert!(runs(None, &[0, 10, 20, 30, 41, 50]).is_empty());
        let expected: Vec<i64> = (31..50).collect();
        assert_eq!(runs(None, &[0, 10, 20, 30, 50, 60]), expected);
        // From the first two alone it is not known what is usual.
        assert!(runs(None, &[0, 20, 30, 40, 50]).is_empty());
    }

    #[test]
    fn where_it_is_stated_how_far_apart_truths_are_wanted_that_is_usual() {
        let expected: Vec<i64> = (1..10).chain(11..20).collect();
        assert_eq!(runs(Some(d(5)), &[0, 10, 20]), expected);
        assert!(runs(Some(d(60)), &[0, 10, 20, 30]).is_empty());
    }

    #[test]
    fn of_many_runs_those_a_sixteenth_of_the_usual_distance_apart_are_given() {
        let mut truths: Vec<i64> = (0..8).map(|nth| nth * 160).collect();
        truths.push(9 * 160);
        let runs = runs(None, &truths);
        assert_eq!(runs.len(), 2 * 16, "{runs:?}");
        assert!(
            runs.windows(2).all(|pair| pair[1] - pair[0] == 10),
            "{runs:?}"
        );
    }

    #[test]
    fn no_more_runs_are_kept_than_it_takes_and_none_across_segments() {
        let mut between = Between::new(Some(d(1)), 1);
        between.truth(s(0), |_, _| {});
        for of in 1..40_000 {
            between.run(s(of), [&[0.0][..]].into_iter());
        }
        assert_eq!((between.runs.len(), between.rows.len()), (MOST, MOST));
        between.segment();
        between.truth(s(50_000), |_, _| panic!("there was no truth before"));
        assert!(between.runs.is_empty() && between.rows.is_empty());
    }
}
