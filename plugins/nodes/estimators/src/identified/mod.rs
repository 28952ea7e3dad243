//! What the kinds share that are identified by the prediction error: their orders, and their mistakes.

mod choose;
mod coefficients;
mod follow;
mod model;
mod per_input;
mod predictor;
mod rehearse;
mod rows;
mod train;

use athermal_core::diagnostic::counted;
use athermal_core::node::{Mistake, Regressors, Runs, Trainer, TrainingSetup};
use athermal_core::time::Duration;
use athermal_numerics::{InputOrders, Orders};

use crate::features::too_many;
use crate::order::{LARGEST, Order};
pub use per_input::PerInput;
pub(crate) use train::{Found, IdentifiedTrainer, Identify};

/// Makes a kind known as an estimator that is what it has [`Asked`] for: its type, its name and its inputs beside `freeze`.
macro_rules! identified {
    ($kind:ty, $name:literal, [$($key:ident),+], [$($input:expr),+ $(,)?]) => {
        impl $kind {
            fn asked(&self) -> crate::identified::Asked {
                crate::identified::Asked {
                    $($key: self.$key.clone().into(),)+
                    ..Default::default()
                }
            }
        }

        identified!($kind, $name, [$($input),+]);
    };
    ($kind:ty, $name:literal, [$($input:expr),+ $(,)?]) => {
        impl athermal_core::node::Estimator for $kind {
            fn inputs() -> &'static [athermal_core::node::InputPort] {
                const { &[$($input,)+ athermal_core::node::InputPort::freeze()] }
            }

            fn regressors(&self) -> athermal_core::node::Regressors {
                self.asked().regressors()
            }

            fn mistakes(&self) -> Vec<athermal_core::node::Mistake> {
                self.asked().mistakes()
            }

            fn mistakes_for(&self, features: usize) -> Vec<athermal_core::node::Mistake> {
                self.asked().mistakes_for(features)
            }

            fn learns(&self) -> athermal_core::node::Learns {
                athermal_core::node::Learns::ByDefault
            }

            fn keeps_range(&self) -> bool {
                false
            }

            fn has_std_dev(&self) -> bool {
                true
            }

            fn has_novelty(&self) -> bool {
                !self.asked().regressors().feature_lags.is_empty()
            }

            fn trainer(
                &self,
                setup: &athermal_core::node::TrainingSetup,
            ) -> Box<dyn athermal_core::node::Trainer> {
                self.asked().trainer(setup)
            }
        }

        athermal_core::register!($kind, Estimator, $name);
    };
}
pub(crate) use identified;

pub(crate) fn one() -> usize {
    1
}

pub(crate) fn penalty() -> f64 {
    1.0
}

/// How often the noise is integrated.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) enum Differences {
    /// It has a level to return to.
    #[default]
    None,
    /// So often.
    Given(usize),
    /// Once or not at all, whichever is worth more.
    Chosen,
}

impl From<Option<usize>> for Differences {
    fn from(given: Option<usize>) -> Self {
        given.map_or(Self::Chosen, Self::Given)
    }
}

impl Differences {
    /// What is compared.
    fn tried(self) -> std::ops::RangeInclusive<usize> {
        match self {
            Self::None => 0..=0,
            Self::Given(differences) => differences..=differences,
            Self::Chosen => 0..=1,
        }
    }
}

/// What a kind asks for, in the letters of Ljung (1999), chapter 4; those that it does not have are none.
#[derive(Debug, Clone, Default)]
pub(crate) struct Asked {
    pub(crate) na: Option<usize>,
    pub(crate) nb: Option<PerInput>,
    pub(crate) nc: Option<usize>,
    pub(crate) nd: Option<usize>,
    pub(crate) nf: Option<PerInput>,
    pub(crate) nk: Option<PerInput>,
    pub(crate) differences: Differences,
    pub(crate) penalty: f64,
    pub(crate) every: Option<Duration>,
    pub(crate) order: Option<Order>,
    /// Where the inputs stand among the features: those without values are left out.
    pub(crate) places: Vec<usize>,
}

impl Asked {
    /// The features as the run saw them, where there can be any, which go on where a truth is missing.
    pub(crate) fn regressors(&self) -> Regressors {
        let every = self.every;
        let runs = self.nb.as_ref().map(|_| Runs::BetweenTruths { every });
        Regressors {
            runs: runs.unwrap_or_default(),
            feature_lags: self.nb.iter().map(|_| Duration::ZERO).collect(),
            every_tick: true,
            ..Regressors::default()
        }
    }

    /// The orders of inputs, by their letters.
    fn of_inputs(&self) -> [(&'static str, &Option<PerInput>); 3] {
        [("nb", &self.nb), ("nf", &self.nf), ("nk", &self.nk)]
    }

    pub(crate) fn mistakes(&self) -> Vec<Mistake> {
        let has = [
            self.na.is_some(),
            self.nb.is_some(),
            self.nc.is_some(),
            self.nd.is_some(),
            self.nf.is_some(),
            self.nk.is_some(),
        ];
        let order = self.order.as_ref();
        order.map_or_else(Vec::new, |order| {
            order.mistakes(has.map(|has| has.then_some(LARGEST)))
        })
    }

    /// Lists of orders that are not as long as there are features.
    pub(crate) fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        let mut mistakes = too_many(features, 1);
        for (name, orders) in self.of_inputs() {
            if let Some(PerInput::Each(list)) = orders
                && list.len() != features
            {
                let (orders, features) =
                    (counted(list.len(), "order"), counted(features, "feature"));
                let message = format!("`{name}` has {orders} for {features}");
                let mistake = Mistake::at(name, message);
                mistakes.push(mistake.help("one number stands for all"));
            }
        }
        mistakes
    }

    pub(crate) fn trainer(self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let asked = Self {
            places: setup.places.clone(),
            ..self
        };
        Box::new(IdentifiedTrainer::new(setup, asked))
    }

    /// The orders as they are given, those of the first input standing for all.
    fn given(&self) -> [usize; 6] {
        let first = |orders: &Option<PerInput>| orders.as_ref().map_or(0, |orders| orders.of(0));
        [
            self.na.unwrap_or(0),
            first(&self.nb),
            self.nc.unwrap_or(0),
            self.nd.unwrap_or(0),
            first(&self.nf),
            first(&self.nk),
        ]
    }

    /// The orders of a model, the open ones as in `chosen`, its noise integrated so often.
    fn orders(&self, chosen: &[usize; 6], differences: usize) -> Orders {
        let open = self.order.as_ref().map_or([false; 6], Order::open);
        let of = |orders: &Option<PerInput>, letter: usize, nth: usize| match orders {
            Some(orders) if !open[letter] => orders.of(nth),
            _ => chosen[letter],
        };
        Orders {
            na: chosen[0],
            inputs: self
                .places
                .iter()
                .map(|&nth| InputOrders {
                    nb: of(&self.nb, 1, nth),
                    nf: of(&self.nf, 4, nth),
                    nk: of(&self.nk, 5, nth),
                })
                .collect(),
            nc: chosen[2],
            nd: chosen[3],
            differences,
        }
    }
}
