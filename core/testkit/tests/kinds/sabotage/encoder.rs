//! A feature that is fitted and sound, and the same with one fault at a time.

use super::*;

faulty! {
    /// The first feature, as a share of its largest value in the fit.
    struct Share;
    /// Gives something before it is fitted.
    SpeaksUnfitted,
    /// Is not fitted, whatever its port says.
    NoEncoder,
}

impl Feature for Share {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what is scaled"),
                InputPort::truth("what it is fitted beside"),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        Ok(share_of(inputs))
    }

    fn encoder(&self) -> Option<&dyn Encoder> {
        (self.fault != Fault::NoEncoder).then_some(self)
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Scaling {
            largest: match inputs.fit::<Largest>() {
                Some((fit, _)) => fit.largest,
                None if self.fault == Fault::SpeaksUnfitted => 1.0,
                None => f64::NAN,
            },
        })
    }
}

impl Encoder for Share {
    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let names = setup.regressors.iter();
        Box::new(Largest {
            uses: names.map(|regressor| regressor.name.clone()).collect(),
            largest: 0.0,
        })
    }
}

/// An encoder that no truth reaches.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Untold {}

impl Feature for Untold {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::held("features", "what is scaled")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        Ok(share_of(inputs))
    }

    fn encoder(&self) -> Option<&dyn Encoder> {
        Some(self)
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Scaling { largest: 1.0 })
    }
}

impl Encoder for Untold {
    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Share { fault: Fault::None }.trainer(setup)
    }
}

fn share_of(inputs: &Inputs) -> Vec<OutputPort> {
    let mut channels = inputs.port("features").to_vec();
    channels.truncate(1);
    for channel in &mut channels {
        channel.unit = Unit::one();
    }
    vec![OutputPort {
        name: "share",
        channels,
    }]
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Largest {
    uses: Vec<String>,
    #[serde(with = "athermal_core::node::number")]
    largest: f64,
}

impl Trainer for Largest {
    fn row(&mut self, regressors: &[f64], _truth: f64) {
        self.largest = self.largest.max(regressors[0].abs());
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        Ok(Trained {
            predictor: self,
            report: TrainingReport::default(),
        })
    }
}

impl Predictor for Largest {
    fn uses(&self) -> &[String] {
        &self.uses
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        f64::NAN
    }
}

athermal_core::predictor!(Largest, "sabotaged_share");

struct Scaling {
    largest: f64,
}

impl Operator for Scaling {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        outputs.set(0, tick.port(0)[0] / self.largest);
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Share, Feature, "sabotaged_fitted_feature");
athermal_core::register!(Untold, Feature, "sabotaged_untold_feature");

fn with(fault: &str) -> Case {
    Case::new(format!("ahead = \"30s\"\nfault = \"{fault}\""))
}

#[test]
fn a_sound_one_breaks_no_rule() {
    breaks_only::<Share>(with("none"), &[]);
}

#[test]
fn one_that_speaks_before_it_is_fitted_is_found() {
    breaks::<Share>(
        with("speaks_unfitted"),
        Rule::Fits,
        "before it has been fitted",
    );
}

#[test]
fn a_truth_that_nobody_learns_from_is_found() {
    breaks::<Share>(
        with("no_encoder"),
        Rule::Fits,
        "no encoder that learns from it",
    );
}

#[test]
fn an_encoder_without_a_truth_is_found() {
    breaks::<Untold>(Case::new(""), Rule::Fits, "`InputPort::truth`");
}
