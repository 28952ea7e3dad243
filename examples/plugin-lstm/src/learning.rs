//! Decides what a network is trained on, when training stops and which weights are kept; not what is made of the network.

use athermal_core::node::{
    Figure, Predictor, Trained, Trainer, TrainingError, TrainingReport, TrainingSetup,
};
use athermal_core::prng::Prng;
use athermal_core::time::{Duration, Instant};

use crate::adam::Adam;
use crate::fit::{Fit, MOST_CHANNELS, Scale};
use crate::gradient::{Batch, Passage};
use crate::network::Network;
use crate::sequence::Layout;
use crate::training::Training;

/// Takes the rows of a fit and trains a network on them.
pub(crate) struct Learning {
    training: Training,
    units: usize,
    steps: usize,
    layout: Layout,
    span: Duration,
    unit: String,
    /// How many numbers may be kept.
    room: usize,
    /// Of so many rows one is kept.
    thinned: usize,
    seen: usize,
    rows: Rows,
    finish: fn(Fit) -> Box<dyn Predictor>,
}

/// Rows in order: when each truth was measured, what it was, and its sequence.
#[derive(Debug, Default)]
struct Rows {
    at: Vec<Instant>,
    truths: Vec<f64>,
    sequences: Vec<f64>,
}

/// Fewer rows than this are not worth a network.
const FEWEST_ROWS: usize = 40;

impl Learning {
    /// `finish` makes of the fit what predicts.
    pub(crate) fn new(
        training: Training,
        units: usize,
        lags: &[Duration],
        setup: &TrainingSetup,
        finish: fn(Fit) -> Box<dyn Predictor>,
    ) -> Self {
        Self {
            training,
            units,
            steps: lags.len(),
            layout: Layout::of(&setup.regressors, lags),
            span: setup.span,
            unit: setup.error_unit.clone(),
            room: setup.memory / size_of::<f64>(),
            thinned: 1,
            seen: 0,
            rows: Rows::default(),
            finish,
        }
    }

    /// Lets go of every other row: there are more than the stated memory holds.
    fn thin(&mut self) {
        let width = self.layout.places.len();
        let rows = std::mem::take(&mut self.rows);
        for nth in (0..rows.at.len()).step_by(2) {
            self.rows.at.push(rows.at[nth]);
            self.rows.truths.push(rows.truths[nth]);
            let sequence = &rows.sequences[nth * width..(nth + 1) * width];
            self.rows.sequences.extend_from_slice(sequence);
        }
        self.thinned *= 2;
    }
}

impl Trainer for Learning {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.row_at(Instant::from_ns(0), regressors, truth);
    }

    fn row_at(&mut self, at: Instant, regressors: &[f64], truth: f64) {
        let kept = self.seen.is_multiple_of(self.thinned);
        self.seen += 1;
        if !kept {
            return;
        }
        let sequence = self.layout.places.iter().map(|&place| regressors[place]);
        self.rows.sequences.extend(sequence);
        self.rows.at.push(at);
        self.rows.truths.push(truth);
        if self.rows.sequences.len() > self.room && self.rows.at.len() > 2 * FEWEST_ROWS {
            self.thin();
        }
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let rows = self.rows.at.len();
        if rows < FEWEST_ROWS {
            return Err(TrainingError::TooFewRows {
                rows,
                needed: FEWEST_ROWS,
            });
        }
        if self.layout.channels == 0 {
            return Err(TrainingError::Unsolvable {
                reason: "no channel that changes has a value at every step of the sequence"
                    .to_owned(),
            });
        }
        if self.layout.channels > MOST_CHANNELS {
            let reason = format!(
                "{} channels, and a sequence has at most {MOST_CHANNELS}",
                self.layout.channels
            );
            return Err(TrainingError::Unsolvable { reason });
        }
        self.train()
    }
}

impl Learning {
    /// How many of the first rows are trained on, and from which one on they are only predicted.
    ///
    /// Truths between them share some of their window with one that is predicted, and take part in neither.
    fn parts(&self) -> (usize, usize) {
        let at = &self.rows.at;
        let later = (at.len() as f64 * self.training.validation).ceil() as usize;
        let from = at.len() - later.clamp(1, at.len() - 1);
        let overlaps = |&&row: &&Instant| row <= at[from] && at[from] - row < self.span;
        let between = at[..from].iter().rev().take_while(overlaps).count();
        (from - between, from)
    }

    fn train(self) -> Result<Trained, TrainingError> {
        let (until, from) = self.parts();
        if until < FEWEST_ROWS / 2 {
            return Err(TrainingError::TooFewRows {
                rows: until,
                needed: FEWEST_ROWS / 2,
            });
        }
        let channels = self.layout.channels;
        let width = channels * self.steps;
        let of_channel = |channel: usize| {
            let values = &self.rows.sequences[..until * width];
            Scale::of(values.iter().skip(channel).step_by(channels).copied())
        };
        let inputs: Vec<Scale> = (0..channels).map(of_channel).collect();
        let truth = Scale::of(self.rows.truths[..until].iter().copied());
        let steps = self.rows.sequences.chunks_exact(channels);
        let sequences: Vec<f64> = steps
            .flat_map(|step| step.iter().zip(&inputs).map(|(x, scale)| scale.scaled(*x)))
            .collect();
        let truths: Vec<f64> = self.rows.truths.iter().map(|&y| truth.scaled(y)).collect();
        let rows = Batch {
            sequences: &sequences,
            truths: &truths,
        };

        let Training {
            epochs,
            patience,
            batch,
            rate,
            seed,
            ..
        } = self.training;
        let mut network = Network::random(channels, self.units, seed);
        let mut order = Shuffled::new(until, seed);
        let mut course = Course::new(&network, self.steps, batch, rate);
        let mut best = (
            course.error(&network, rows.part(from, truths.len())),
            network.clone(),
            0,
        );
        let mut gone = 0;
        while gone < epochs && gone - best.2 < patience {
            course.epoch(&mut network, rows, order.again());
            gone += 1;
            let error = course.error(&network, rows.part(from, truths.len()));
            if error < best.0 {
                best = (error, network.clone(), gone);
            }
        }
        let (error, network, kept) = best;
        let all = course.error(&network, rows);
        if !(error.is_finite() && all.is_finite()) {
            return Err(TrainingError::Unsolvable {
                reason:
                    "the weights of the network grew beyond all bounds: a smaller `rate` may help"
                        .to_owned(),
            });
        }
        let rmse = |mean_square: f64| truth.deviation * mean_square.sqrt();
        let mut report = TrainingReport {
            in_sample_rmse: Some(rmse(all)),
            ..TrainingReport::default()
        };
        report.figure("rows_trained_on", until);
        report.figure("rows_judged_by", truths.len() - from);
        report.figure("rmse_on_those", rmse(error));
        report.figure("epochs", gone);
        report.figure("epoch_kept", kept);
        report.notes.push(format!(
            "trained on {until} rows for {gone} of {epochs} epochs; kept are the weights after {kept}, which predict the {} \
             rows after them within {:.3} {}",
            truths.len() - from,
            rmse(error),
            self.unit
        ));
        if self.thinned > 1 {
            report.figure("rows_apart", self.thinned);
            report.notes.push(format!(
                "of {} rows one was kept, for want of memory",
                self.thinned
            ));
        }
        if !self.layout.incomplete.is_empty() {
            let missing = self.layout.incomplete.join(", ");
            report.figure("left_out", Figure::names(self.layout.incomplete.clone()));
            report.notes.push(format!(
                "left out, since steps of it are too often absent: {missing}"
            ));
        }
        let fit = Fit {
            uses: self.layout.names,
            inputs,
            truth,
            network,
        };
        Ok(Trained {
            predictor: (self.finish)(fit),
            report,
        })
    }
}

/// The rows in an order that is another each time.
struct Shuffled {
    order: Vec<usize>,
    random: Prng,
}

impl Shuffled {
    fn new(rows: usize, seed: u64) -> Self {
        Self {
            order: (0..rows).collect(),
            random: Prng::stream(seed, "order"),
        }
    }

    /// By Fisher and Yates.
    fn again(&mut self) -> &[usize] {
        for last in (1..self.order.len()).rev() {
            let other = (self.random.uniform() * (last + 1) as f64) as usize;
            self.order.swap(last, other);
        }
        &self.order
    }
}

/// The way of the weights.
struct Course {
    batch: usize,
    steps: usize,
    passage: Passage,
    adam: Adam,
    gradient: Vec<f64>,
    sequences: Vec<f64>,
    truths: Vec<f64>,
}

impl Course {
    fn new(network: &Network, steps: usize, batch: usize, rate: f64) -> Self {
        let weights = network.weights().len();
        Self {
            batch,
            steps,
            passage: Passage::new(network, steps, batch),
            adam: Adam::new(weights, rate),
            gradient: vec![0.0; weights],
            sequences: Vec::new(),
            truths: Vec::new(),
        }
    }

    /// Goes through rows once, in this order.
    fn epoch(&mut self, network: &mut Network, rows: Batch<'_>, order: &[usize]) {
        let width = self.steps * network.channels();
        for part in order.chunks(self.batch) {
            self.sequences.clear();
            self.truths.clear();
            for &row in part {
                let sequence = &rows.sequences[row * width..(row + 1) * width];
                self.sequences.extend_from_slice(sequence);
                self.truths.push(rows.truths[row]);
            }
            let batch = Batch {
                sequences: &self.sequences,
                truths: &self.truths,
            };
            self.passage.gradient(network, batch, &mut self.gradient);
            self.adam.step(network.weights_mut(), &self.gradient);
        }
    }

    /// The mean of the squared errors.
    fn error(&mut self, network: &Network, rows: Batch<'_>) -> f64 {
        let batches = rows.truths.len().div_ceil(self.batch);
        let part = |nth: usize| {
            let end = rows.truths.len().min((nth + 1) * self.batch);
            rows.part(nth * self.batch, end)
        };
        let sum: f64 = (0..batches)
            .map(|nth| self.passage.error(network, part(nth)))
            .sum();
        sum / rows.truths.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What learns from three steps of one channel, and may keep so many numbers.
    fn learning(room: usize, training: Training) -> Learning {
        Learning {
            training,
            units: 4,
            steps: 3,
            layout: Layout {
                channels: 1,
                places: vec![0, 1, 2],
                names: ["f.a lag 20s", "f.a lag 10s", "f.a"]
                    .map(str::to_owned)
                    .into(),
                incomplete: Vec::new(),
            },
            span: Duration::from_ns(100_000_000_000),
            unit: "nm".to_owned(),
            room,
            thinned: 1,
            seen: 0,
            rows: Rows::default(),
            finish: crate::estimator::predictor,
        }
    }

    /// A truth that hangs on the product of two steps, which no linear model of them finds.
    fn feed(learning: &mut Learning, rows: i64) {
        let mut random = Prng::stream(5, "rows");
        for row in 0..rows {
            let x = [(); 3].map(|()| random.between(-1.0, 1.0));
            let at = Instant::from_ns(row * 10_000_000_000);
            learning.row_at(at, &x, 50.0 + 20.0 * x[0] * x[2]);
        }
    }

    #[test]
    fn a_product_of_steps_is_learned() {
        let training = Training {
            epochs: 300,
            patience: 40,
            rate: 0.02,
            ..Training::default()
        };
        let mut learning = learning(1 << 20, training);
        feed(&mut learning, 1500);
        let trained = Box::new(learning).finish().unwrap();
        // Without a model the error would be 20/3.
        let rmse = trained.report.in_sample_rmse.unwrap();
        assert!(rmse < 1.0, "{rmse} {:?}", trained.report.notes);
        let prediction = trained.predictor.predict(&[0.8, 0.0, 0.9]);
        assert!(
            (prediction - (50.0 + 20.0 * 0.72)).abs() < 2.0,
            "{prediction}"
        );
    }

    #[test]
    fn what_shares_its_window_with_the_later_rows_is_not_trained_on() {
        let mut learning = learning(1 << 20, Training::default());
        feed(&mut learning, 100);
        // A truth spans ten rows, and a fifth of the rows comes later.
        assert_eq!(learning.parts(), (71, 80));
    }

    #[test]
    fn rows_that_do_not_fit_into_the_memory_are_thinned() {
        let mut learning = learning(3 * 100, Training::default());
        feed(&mut learning, 1000);
        assert!((50..=100).contains(&learning.rows.at.len()));
        let apart = learning.rows.at[1] - learning.rows.at[0];
        let all: Vec<_> = learning
            .rows
            .at
            .windows(2)
            .map(|two| two[1] - two[0])
            .collect();
        assert!(all.iter().all(|&each| each == apart), "{all:?}");
    }

    #[test]
    fn nothing_is_learned_from_noise() {
        let mut learning = learning(
            1 << 20,
            Training {
                patience: 3,
                ..Training::default()
            },
        );
        let mut random = Prng::stream(9, "noise");
        for row in 0..400 {
            let x = [(); 3].map(|()| random.normal());
            learning.row_at(Instant::from_ns(row * 10_000_000_000), &x, random.normal());
        }
        let trained = Box::new(learning).finish().unwrap();
        let told = &trained.report.notes[0];
        assert!(!told.contains("40 of 40 epochs"), "{told}");
    }
}
