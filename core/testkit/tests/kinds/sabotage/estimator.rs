//! An estimator that is sound, and the same with one fault at a time.

use std::sync::atomic::{AtomicU64, Ordering};

use super::*;

faulty! {
    /// Predicts the mean of the truths, or the quotient of it and the mean of the first feature times that feature.
    struct Ratio;
    /// Divides by what may be zero.
    Reckless,
    /// No two fits are the same.
    Unseeded,
    /// Part of what was learned is not written.
    Unwritten,
    /// Counts on ten rows or more.
    Panics,
    /// Counts on a model file that nobody has edited.
    Trusting,
    /// Says to be a linear form that it is not.
    Misstated,
    /// Says so once it goes on learning.
    Mislearnt,
    /// Is surer than sure.
    Negative,
    /// Says how sure it is, and never is.
    Unsure,
    /// Predicts from what it was not given.
    UsesOther,
    /// Finds all that it sees new.
    Startled,
    /// Finds nothing new.
    Worldly,
    /// Says that it knows what is new, and does not.
    Ignorant,
}

impl Estimator for Ratio {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what the prediction is made of"),
                InputPort::truth("what is predicted"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: vec![Duration::ZERO],
            ..Regressors::default()
        }
    }

    fn has_std_dev(&self) -> bool {
        matches!(self.fault, Fault::Negative | Fault::Unsure)
    }

    fn has_novelty(&self) -> bool {
        matches!(
            self.fault,
            Fault::Startled | Fault::Worldly | Fault::Ignorant
        )
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let regressors = setup
            .regressors
            .iter()
            .map(|regressor| regressor.name.clone());
        Box::new(Averaging {
            fault: self.fault,
            regressors: regressors.collect(),
            sum: 0.0,
            rows: 0,
            first: None,
            spread: 0.0,
        })
    }
}

struct Averaging {
    fault: Fault,
    regressors: Vec<String>,
    sum: f64,
    rows: usize,
    first: Option<f64>,
    spread: f64,
}

impl Trainer for Averaging {
    fn row(&mut self, _regressors: &[f64], truth: f64) {
        self.sum += truth;
        self.rows += 1;
        self.first.get_or_insert(truth);
        self.spread = self
            .first
            .map_or(0.0, |first| self.spread.max((truth - first).abs()));
    }

    fn finish(mut self: Box<Self>) -> Result<Trained, TrainingError> {
        static FITS: AtomicU64 = AtomicU64::new(0);
        assert!(self.fault != Fault::Panics || self.rows >= 10, "ten rows");
        if self.rows == 0 {
            return Err(TrainingError::TooFewRows { rows: 0, needed: 1 });
        }
        let mut mean = self.sum / self.rows as f64;
        if self.fault == Fault::Reckless {
            mean = mean * self.spread / self.spread;
        }
        if self.fault == Fault::Unseeded {
            mean += FITS.fetch_add(1, Ordering::Relaxed) as f64;
        }
        let written = self.fault != Fault::Unwritten;
        let width = self.regressors.len();
        if self.fault == Fault::UsesOther {
            self.regressors[0].push('!');
        }
        let fitted = Fitted {
            regressors: self.regressors,
            means: vec![if written { mean } else { 0.0 }],
            trusting: self.fault == Fault::Trusting,
            unsure: self.fault == Fault::Unsure,
            novelty: match self.fault {
                Fault::Startled => Some(5.0),
                Fault::Worldly => Some(0.5),
                _ => None,
            },
            misstated: (self.fault == Fault::Misstated).then(|| vec![0.0; width]),
            mislearnt: self.fault == Fault::Mislearnt,
            unwritten: if written { 0.0 } else { mean },
        };
        Ok(Trained {
            predictor: Box::new(fitted),
            report: TrainingReport::default(),
        })
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct Fitted {
    regressors: Vec<String>,
    /// Of the truths, the only one.
    means: Vec<f64>,
    trusting: bool,
    unsure: bool,
    novelty: Option<f64>,
    misstated: Option<Vec<f64>>,
    mislearnt: bool,
    #[serde(skip)]
    unwritten: f64,
}

impl Predictor for Fitted {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        if self.trusting {
            return Vec::new();
        }
        Mistake::of_lengths(1, &[("means", self.means.len())])
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        self.means[0] + self.unwritten
    }

    fn std_dev(&self, _regressors: &[f64]) -> f64 {
        if self.unsure {
            f64::NAN
        } else {
            -self.means[0].abs()
        }
    }

    fn novelty(&self, _regressors: &[f64]) -> f64 {
        self.novelty.unwrap_or(f64::NAN)
    }

    fn linear(&self) -> Option<LinearForm<'_>> {
        let coefficients = self.misstated.as_ref()?;
        Some(LinearForm {
            constant: 0.0,
            coefficients,
        })
    }

    fn learner(&self) -> Option<Box<dyn Learner>> {
        self.mislearnt.then(|| {
            Box::new(Mislearnt {
                means: self.means.clone(),
                coefficients: vec![0.0; self.regressors.len()],
            }) as _
        })
    }
}

athermal_core::predictor!(Fitted, "sabotaged_estimator");

/// Predicts the last truth, and says to predict the mean of the fit.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Mislearnt {
    /// Of the fit, then all that followed.
    means: Vec<f64>,
    coefficients: Vec<f64>,
}

impl Learner for Mislearnt {
    fn predict(&self, _regressors: &[f64], _of: Instant) -> f64 {
        self.means[self.means.len() - 1]
    }

    fn linear(&self) -> Option<LinearForm<'_>> {
        Some(LinearForm {
            constant: self.means[0],
            coefficients: &self.coefficients,
        })
    }

    fn learn(&mut self, _regressors: &[f64], truth: f64, _at: Instant) {
        self.means.push(truth);
    }

    fn snapshot(&self) -> Box<dyn State> {
        Box::new(self.clone())
    }

    fn restore(&mut self, _state: Box<dyn State>) -> Restored {
        Restored::cold("it never learns")
    }
}

athermal_core::state!(Mislearnt, "mislearnt/1");
athermal_core::register!(Ratio, Estimator, "sabotaged_estimator");

fn with(fault: &str) -> Case {
    Case::new(format!("ahead = \"1min\"\nfault = \"{fault}\""))
}

#[test]
fn a_sound_estimator_breaks_no_rule() {
    breaks_only::<Ratio>(Case::new("ahead = \"1min\""), &[]);
}

#[test]
fn a_fit_on_nothing_is_an_error_in_words() {
    breaks::<Ratio>(with("panics"), Rule::Fits, "it panics: ten rows");
    breaks::<Ratio>(
        with("reckless"),
        Rule::Fits,
        "fitted on channels that never change",
    );
}

#[test]
fn a_fit_without_a_seed_is_another_every_time() {
    breaks::<Ratio>(with("unseeded"), Rule::Fits, "it is another");
}

#[test]
fn a_model_holds_all_that_predicts() {
    breaks_one::<Ratio>(with("unwritten"), Rule::Models, "predicts otherwise");
}

#[test]
fn a_model_that_was_edited_is_not_trusted() {
    breaks_one::<Ratio>(
        with("trusting"),
        Rule::Edited,
        "with the last dropped of /fitted/node/means, it panics: index out of bounds",
    );
}

#[test]
fn a_deviation_is_not_negative() {
    breaks_one::<Ratio>(
        with("negative"),
        Rule::Uncertainty,
        "`node:std_dev.a` is -0.8019520665777313 at 8.189 s",
    );
}

#[test]
fn a_deviation_that_is_promised_comes() {
    breaks_one::<Ratio>(
        with("unsure"),
        Rule::Uncertainty,
        "`node:std_dev.a` is never there in the second half of the run, though predictions are",
    );
}

#[test]
fn novelty_is_above_one_far_from_the_fit_and_hardly_ever_on_its_data() {
    breaks_one::<Ratio>(
        with("startled"),
        Rule::Novelty,
        "`node:novelty.a` is above 1 at ",
    );
    breaks_one::<Ratio>(
        with("worldly"),
        Rule::Novelty,
        "of 100 rows far outside of its fit the largest novelty is 0.5",
    );
    breaks::<Ratio>(
        with("ignorant"),
        Rule::Novelty,
        "it says `has_novelty`, and its fit gives none",
    );
}

#[test]
fn what_a_predictor_uses_is_among_what_it_was_given() {
    breaks_one::<Ratio>(
        with("uses_other"),
        Rule::Fits,
        "the fit of `node` uses `features.a!`, which the node does not have (it has features.a, features.b, features.c): fit the \
         graph again",
    );
}

#[test]
fn a_linear_form_is_what_is_predicted() {
    breaks_one::<Ratio>(
        with("misstated"),
        Rule::Linear,
        "of which its linear form is 0.0",
    );
    breaks_one::<Ratio>(with("mislearnt"), Rule::Linear, "its learner predicts");
}
