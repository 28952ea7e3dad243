//! An estimator that goes on learning where it is told to and is sound, and the same with one fault at a time.

use super::*;

faulty! {
    /// Predicts the mean of the truths of the fit, and the mean of all that came since.
    struct Level;
    /// Panics once it has learned.
    Panics,
    /// Takes any state, and none of it.
    Forgets,
    /// Says that it keeps the range of its regressors.
    NoRange,
    /// Learns unless told, and panics where it does not.
    Learned,
}

impl Estimator for Level {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what the prediction is made of"),
                InputPort::truth("what is predicted"),
                InputPort::freeze(),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: vec![Duration::ZERO],
            ..Regressors::default()
        }
    }

    fn learns(&self) -> Learns {
        if self.fault == Fault::Learned {
            Learns::ByDefault
        } else {
            Learns::OnRequest
        }
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let names = setup.regressors.iter();
        Box::new(Averaging {
            fault: self.fault,
            range: TrainedRange::new(setup.regressors.len()),
            regressors: names.map(|regressor| regressor.name.clone()).collect(),
            sum: 0.0,
            rows: 0,
        })
    }
}

struct Averaging {
    fault: Fault,
    regressors: Vec<String>,
    range: TrainedRange,
    sum: f64,
    rows: usize,
}

impl Trainer for Averaging {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.range.include(regressors);
        self.sum += truth;
        self.rows += 1;
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        if self.rows == 0 {
            return Err(TrainingError::TooFewRows { rows: 0, needed: 1 });
        }
        let fitted = Fitted {
            fault: self.fault,
            mean: self.sum / self.rows as f64,
            range: self.range,
            regressors: self.regressors,
        };
        Ok(Trained {
            predictor: Box::new(fitted),
            report: TrainingReport::default(),
        })
    }
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Fitted {
    fault: Fault,
    regressors: Vec<String>,
    range: TrainedRange,
    mean: f64,
}

impl Predictor for Fitted {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        self.range.mistakes(self.regressors.len())
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        assert!(self.fault != Fault::Learned, "it has not learned");
        self.mean
    }

    fn learner(&self) -> Option<Box<dyn Learner>> {
        Some(Box::new(Learning {
            fault: self.fault,
            known: Known {
                mean: self.mean,
                truths: 1.0,
            },
        }))
    }

    fn trained_range(&self) -> Option<&TrainedRange> {
        (self.fault != Fault::NoRange).then_some(&self.range)
    }
}

athermal_core::predictor!(Fitted, "sabotaged_learning");

#[derive(Debug)]
struct Learning {
    fault: Fault,
    known: Known,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Known {
    mean: f64,
    truths: f64,
}

impl Learner for Learning {
    fn predict(&self, _regressors: &[f64], _of: Instant) -> f64 {
        let learned = self.known.truths > 30.0;
        assert!(!(learned && self.fault == Fault::Panics), "it has learned");
        self.known.mean
    }

    fn learn(&mut self, _regressors: &[f64], truth: f64, _at: Instant) {
        self.known.truths += 1.0;
        self.known.mean += (truth - self.known.mean) / self.known.truths;
    }

    fn snapshot(&self) -> Box<dyn State> {
        Box::new(self.known.clone())
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        if self.fault == Fault::Forgets {
            return Restored::Accepted;
        }
        state.replace(&mut self.known)
    }
}

athermal_core::state!(Known, "sabotaged_learning/1");
athermal_core::register!(Level, Estimator, "sabotaged_learning");

fn with(fault: &str) -> Case {
    Case::new(format!("ahead = \"1min\"\nfault = \"{fault}\""))
}

#[test]
fn a_sound_learner_breaks_no_rule() {
    breaks_only::<Level>(with("none"), &[]);
}

#[test]
fn what_goes_wrong_only_with_learning_is_found_by_a_case_without() {
    breaks::<Level>(with("panics"), Rule::Answers, "it panics: it has learned");
    breaks_only::<Level>(with("forgets"), &[Rule::Restores, Rule::Versions]);
    breaks::<Level>(with("forgets"), Rule::Restores, "restored after");
}

#[test]
fn what_goes_wrong_only_without_learning_is_found_by_a_case_with_it() {
    breaks::<Level>(
        with("learned"),
        Rule::Answers,
        "it panics: it has not learned",
    );
}

#[test]
fn a_range_that_is_said_to_be_kept_is_there() {
    breaks_one::<Level>(with("no_range"), Rule::Fits, "has no `trained_range`");
}

#[test]
fn a_case_of_the_kit_says_what_it_is() {
    let broken = broken::<Level>(&[with("panics")]);
    let told = broken[0].case.as_deref();
    assert_eq!(
        told,
        Some("learn = true # as the kit tries of itself\nahead = \"1min\"\nfault = \"panics\"")
    );
}
