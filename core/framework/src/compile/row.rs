//! What the rows of an estimator are made of, features and past truths at their lags, and that none of it sees the future.

use super::instance::Instance;
use super::plan::TruthLink;
use super::provenance::{ONE_SAMPLE, leaks, persistence_lag};
use super::resolver::{Resolver, Suspect};
use crate::node::{InputPort, Mistake, Regressor, TruthLags};
use crate::time::Duration;
use crate::unit::Unit;

/// The most regressors of features that an estimator may have; a few hundred bytes each. What a fit has room for is its kind's to say
/// ([`Estimator::mistakes_for`](crate::node::Estimator::mistakes_for)).
const MOST_REGRESSORS: usize = 1_000_000;

/// What a row is made of.
#[derive(Default)]
pub(super) struct Row {
    pub(super) gathers: Vec<usize>,
    pub(super) regressors: Vec<Regressor>,
    /// The slot of each with its lag.
    pub(super) behind: Vec<(usize, Duration)>,
}

impl Resolver<'_> {
    /// Adds features at each lag, in the port's unit where there is one; whether all could be added.
    pub(super) fn features_of_row(
        &mut self,
        instance: &Instance<'_>,
        (port, features): (&InputPort, &[usize]),
        lags: &[Duration],
        unit: Option<Unit>,
        link: &TruthLink,
        row: &mut Row,
    ) -> bool {
        let count = features.len().saturating_mul(lags.len());
        if count > MOST_REGRESSORS {
            let message = format!(
                "it would learn from {count} regressors, more than the {MOST_REGRESSORS} that there is room for"
            );
            let help = "give it fewer features or lags: a `pick` passes on some channels of a node";
            let at = format!("inputs.{}", port.name);
            self.mistakes(instance, vec![Mistake::at(at, message).help(help)]);
            return false;
        }
        let mut whole = true;
        for &lag in lags {
            let regressors = self.regressors(features, lag, unit.as_ref());
            row.regressors.extend(regressors);
            row.behind.extend(features.iter().map(|&slot| (slot, lag)));
            self.suspect(instance, port.name, features.to_vec(), lag, link);
            match self.gather(instance, port, features, &[lag], unit.as_ref()) {
                Some(gather) => row.gathers.push(gather),
                None => whole = false,
            }
        }
        whole
    }

    /// Adds past truths; whether all could be added.
    pub(super) fn truths_of_row(
        &mut self,
        instance: &Instance<'_>,
        port: &InputPort,
        lags: TruthLags,
        link: &TruthLink,
        row: &mut Row,
    ) -> bool {
        let truth = link.slot;
        let lags = match lags {
            TruthLags::None => Vec::new(),
            TruthLags::At(lags) => lags,
            TruthLags::SmallestLegal => vec![persistence_lag(link.span, link.ahead)],
        };
        let mut whole = true;
        for &lag in &lags {
            if leaks(lag, link.span, link.ahead) {
                let nth = lags.iter().position(|&other| other == lag).unwrap_or(0);
                let place = instance.parameter_place(&format!("lags.{nth}"));
                let problem = self.leak((truth, lag), (lag, Duration::ZERO), link, Vec::new());
                self.diagnostics.report(place, problem);
                whole = false;
            }
            row.regressors.push(self.regressor(truth, lag, true));
            row.behind.push((truth, lag));
        }
        if !lags.is_empty() {
            match self.gather(instance, port, &[truth], &lags, None) {
                Some(gather) => row.gathers.push(gather),
                None => whole = false,
            }
        }
        whole
    }

    /// Channels as regressors at a lag, in the port's unit where there is one.
    pub(super) fn regressors(
        &self,
        slots: &[usize],
        lag: Duration,
        unit: Option<&Unit>,
    ) -> Vec<Regressor> {
        let unit = unit.map(Unit::to_string);
        let regressor = |&slot: &usize| {
            let own = self.regressor(slot, lag, false);
            let unit = unit.clone().unwrap_or(own.unit);
            Regressor { unit, ..own }
        };
        slots.iter().map(regressor).collect()
    }

    /// Notes what may see the answer, which is looked for once all is known.
    pub(super) fn suspect(
        &mut self,
        instance: &Instance<'_>,
        input: &str,
        features: Vec<usize>,
        lag: Duration,
        link: &TruthLink,
    ) {
        self.suspects.push(Suspect {
            place: instance.input_place(input),
            context: instance.context(),
            features,
            lag,
            link: *link,
        });
    }

    pub(super) fn regressor(&self, slot: usize, lag: Duration, of_truth: bool) -> Regressor {
        let from = &self.channels[slot];
        let name = if of_truth && lag == ONE_SAMPLE {
            format!("{} one sample ago", from.name)
        } else if of_truth || lag > Duration::ZERO {
            format!("{} lag {lag}", from.name)
        } else {
            from.name.clone()
        };
        Regressor {
            name,
            unit: from.channel.unit.to_string(),
            sensors: Vec::new(),
            lag,
            of_truth,
        }
    }
}
