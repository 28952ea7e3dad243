//! Sensors that are compared, and what truths say of one that contradicts the others.

use athermal_control::CrossCheck;
use athermal_core::compile::{PlannedFit, PlannedNode};
use athermal_core::engine::Engine;
use athermal_core::time::Duration;
use serde::Deserialize;

use super::features::Planned;
use super::{Lowering, Refused, refuse, unfitted, unknown};
use crate::form::{Field, Record};

/// How sensors go together, as models hold it.
#[derive(Deserialize)]
pub(super) struct Learned {
    uses: Vec<String>,
    #[serde(default)]
    agreement: Option<Agreement>,
    #[serde(default)]
    answers: Vec<Answer>,
}

/// What the truth was predicted from: all columns, or those of all sensors but one.
#[derive(Deserialize)]
struct Answer {
    #[serde(default)]
    without: Option<i64>,
    constant: f64,
    coefficients: Vec<f64>,
}

/// The numbers of predictions from all columns, and without each channel by its columns; nothing where not all are there.
fn answers(all: &[Answer], own: &[i64], columns: usize) -> Option<Vec<f64>> {
    let firsts = own.iter().step_by(2).copied();
    let each = std::iter::once(None).chain(firsts.map(Some));
    let rows = each.map(|without| match without {
        Some(-1) => Some(vec![0.0; columns + 1]),
        _ => {
            let answer = all.iter().find(|of| of.without == without)?;
            let numbers = [answer.constant].into_iter();
            Some(numbers.chain(answer.coefficients.iter().copied()).collect())
        }
    });
    Some(rows.collect::<Option<Vec<_>>>()?.concat())
}

/// Nothing was learned where it has no columns.
#[derive(Default, Deserialize)]
struct Agreement {
    means: Vec<f64>,
    scales: Vec<f64>,
    matrix: Vec<f64>,
    usual: f64,
}

/// The fit of a node that compares sensors.
pub(super) fn learned(engine: &Engine, node: &PlannedNode) -> Result<Learned, Refused> {
    let Some(predictor) = engine.fitted().get(&node.instance()) else {
        return unfitted();
    };
    let written = serde_json::to_value(&**predictor).and_then(serde_json::from_value);
    written.or_else(|error| {
        refuse(
            format!("its fit cannot be read: {error}"),
            "export it with the version that knows it",
        )
    })
}

impl Lowering<'_> {
    pub(super) fn cross_check(
        &mut self,
        of: &Planned<'_>,
        spec: &CrossCheck,
        fit: Option<&PlannedFit>,
        learned: Learned,
    ) -> Result<Record, Refused> {
        let (channels, signal) = of.port("signal");
        let count = channels.len();
        let Learned {
            uses, agreement, ..
        } = learned;
        let regressors = fit.map_or(&[][..], |fit| &fit.regressors);
        let mut places = Vec::with_capacity(uses.len());
        for name in &uses {
            match regressors.iter().position(|known| known.name == *name) {
                Some(place) => places.push(place as i64),
                None => return unknown(name),
            }
        }
        // One that compares what is only predicted from was made by nobody, and compares nothing.
        let agreement = agreement.filter(|of| {
            let mut compared = places.iter().take(of.means.len());
            compared.all(|&place| (place as usize) < 2 * count)
        });
        let agreement = agreement.unwrap_or_default();
        let columns = agreement.means.len();
        let compared = &places[..columns.min(places.len())];
        let mut own = Vec::with_capacity(2 * count);
        for channel in 0..count {
            let of_channel = |&(_, &place): &(usize, &i64)| place as usize % count == channel;
            let mut columns = compared.iter().enumerate().filter(of_channel);
            let mut next = || columns.next().map_or(-1, |(column, _)| column as i64);
            own.extend([next(), next()]);
        }
        self.scratch(2 * count + columns * columns + 2 * columns);
        let hindsight = of
            .inputs
            .hindsight
            .zip(answers(&learned.answers, &own, places.len()));
        let (judges, answers) = hindsight.unzip();
        let predicting = judges.map_or(0, |_| places.len());
        let place = |nth: usize| {
            let gather = judges.and_then(|judges| of.gathers.get(judges.port + nth));
            Field::Int(gather.map_or(-1, |gather| *gather as i64))
        };
        let time = |of: Option<Duration>| Field::Int(of.map_or(0, Duration::as_ns));
        Ok(of
            .record("cross_check")
            .int("signal", signal)
            .int("slot", of.slot())
            .int("channels", count)
            .int("columns", columns)
            .with("places", Field::Ints(places))
            .with("own", Field::Ints(own))
            .reals("mean", agreement.means)
            .reals("scale", agreement.scales)
            .reals("matrix", agreement.matrix)
            .real("usual", agreement.usual)
            .real("limit", spec.limit)
            .with("lag", Field::Int(spec.lag.as_ns()))
            .with("after", Field::Int(spec.after.as_ns()))
            .with("recover", Field::Int(spec.recover.as_ns()))
            .with("longest", Field::Int(spec.longest.as_ns()))
            .with("before", place(0))
            .with("later", place(1))
            .int("predicting", predicting)
            .with("delay", time(judges.map(|of| of.delay)))
            .with("span", time(judges.map(|of| of.span)))
            .reals("answers", answers.unwrap_or_default())
            .int("ints", self.ints(10 * count + 4))
            .int("reals", self.reals(3 * count + 2)))
    }
}
