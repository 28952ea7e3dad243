//! Decides what the author of a fitted estimator or encoder implements, and how that stands in a model file.

use std::any::Any;
use std::fmt::Debug;

use serde::de::{Deserialize, Deserializer, Error as _};
use serde::ser::{Serialize, Serializer};
use serde_json::{Map, Value};

use crate::registry::{Sort, find};

use super::{Coefficients, Learner, LinearForm, Mistake, TrainedRange};

/// A fitted estimator, or what an [`Encoder`](super::Encoder) was fitted to. Predicting never changes what was learned.
///
/// It is a serde struct, written into models under the name that [`predictor!`](crate::predictor) gives it.
pub trait Predictor: InModel + Any + Debug + Send + Sync {
    /// The names of the regressors that [`predict`](Predictor::predict) takes, in order.
    fn uses(&self) -> &[String];

    /// What of it does not fit together, all of it, each at its path in the model file; asked for when a model is read, which
    /// may have been edited by hand. Where there is any, nothing else is asked of it.
    fn mistakes(&self) -> Vec<Mistake> {
        Vec::new()
    }

    /// The prediction, from present values of the used regressors.
    fn predict(&self, regressors: &[f64]) -> f64;

    /// What its prediction is, where that is a [`LinearForm`] and nothing else, to the bit: the engine then sums those of several
    /// estimators that read the same values at once, and does not ask each for its prediction.
    fn linear(&self) -> Option<LinearForm<'_>> {
        None
    }

    /// Whether it predicts from the regressors that are there, NaN standing for the others, while there is any.
    fn takes_absent(&self) -> bool {
        false
    }

    /// The standard deviation of the truth about the prediction from these regressors, in the unit of the truth; NaN where
    /// it is not known. Only asked of kinds that say [`Estimator::has_std_dev`](super::Estimator::has_std_dev).
    fn std_dev(&self, _regressors: &[f64]) -> f64 {
        f64::NAN
    }

    /// How far these regressors are outside of the rows of the fit: 1 at their edge, more outside, NaN where it is not known. Only
    /// asked of kinds that say [`Estimator::has_novelty`](super::Estimator::has_novelty).
    fn novelty(&self, _regressors: &[f64]) -> f64 {
        f64::NAN
    }

    /// What it predicts in the middle of the rows of the fit, the mean of their truths: where a prediction outside of them goes that is
    /// not trusted. Only asked of kinds that say [`Estimator::has_novelty`](super::Estimator::has_novelty).
    fn centre(&self) -> f64 {
        0.0
    }

    /// What it consists of, for people; none for one that says nothing of it.
    fn coefficients(&self) -> Option<Coefficients> {
        None
    }

    /// What goes on learning from here; none for one that stays as it was fitted.
    fn learner(&self) -> Option<Box<dyn Learner>> {
        None
    }

    /// The range of the used regressors in the fit, where it is known: outside, nothing is learned.
    fn trained_range(&self) -> Option<&TrainedRange> {
        None
    }
}

/// What stands in model files under a name; [`predictor!`](crate::predictor) makes a [`Predictor`] such a thing.
#[doc(hidden)]
#[typetag::serialize(tag = "type")]
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no name under which a model holds it",
    label = "give it one: `athermal_core::predictor!({Self}, \"name\")`"
)]
pub trait InModel {}

/// How a predictor of one name is read. A reader of one format alone is a tenth of the code of one for any format.
#[doc(hidden)]
pub struct PredictorForm {
    pub read: fn(Value) -> Result<Box<dyn Predictor>, serde_json::Error>,
}

impl Sort for PredictorForm {
    const ONE: &'static str = "fit";
    const MANY: &'static str = "fits";
}

impl Serialize for dyn Predictor {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let in_model: &dyn InModel = self;
        in_model.serialize(to)
    }
}

impl<'de> Deserialize<'de> for Box<dyn Predictor> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let mut written = Map::deserialize(from)?;
        let name = written.remove("type");
        let name = name.as_ref().and_then(Value::as_str);
        let name = name.ok_or_else(|| D::Error::missing_field("type"))?;
        let form = find::<PredictorForm>(name).map_err(D::Error::custom)?;
        (form.read)(Value::Object(written)).map_err(D::Error::custom)
    }
}

/// Gives a [`Predictor`], which is a serde struct, the name under which models hold it: `predictor!(Fitted, "kernel")`.
///
/// All crates of a program share the names: begin one with that of the kind.
#[macro_export]
macro_rules! predictor {
    ($predictor:ty, $name:literal) => {
        const _: () = {
            use $crate::__private::typetag;

            #[typetag::serialize(name = $name)]
            impl $crate::node::InModel for $predictor {}
        };

        $crate::__private::list!(
            $crate::node::PredictorForm,
            $name,
            $crate::__private::no_schema,
            $crate::node::PredictorForm {
                read: |written| {
                    let fit: $predictor = $crate::__private::serde_json::from_value(written)?;
                    Ok(Box::new(fit))
                },
            }
        );
    };
}
