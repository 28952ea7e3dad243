//! Estimators: whatever was fitted to a linear form, with how far it heeds that a row is outside of its fit.

use athermal_core::compile::{Outside, PlannedNode, PlannedRole};
use athermal_core::engine::Engine;
use athermal_core::node::Predictor;
use serde::Deserialize;

use super::{Lowering, Options, Refused, first, refuse, unfitted, unknown, ways};
use crate::form::{Entry, Field, Record};

/// How far a row is outside, as models hold it.
#[derive(Deserialize)]
struct Novelty {
    edge: f64,
    means: Vec<f64>,
    scales: Vec<f64>,
    directions: Vec<f64>,
}

/// A prediction as a linear form, or as its only regressor.
struct Fit {
    constant: f64,
    coefficients: Vec<f64>,
    same: bool,
    centre: f64,
    novelty: Option<Record>,
}

impl Lowering<'_> {
    pub(super) fn estimator(
        &mut self,
        engine: &Engine,
        node: &PlannedNode,
        options: &Options,
    ) -> Result<Record, Refused> {
        let PlannedRole::Estimator {
            fit,
            gathers,
            every_tick,
            learning,
            std_dev,
            novelty,
            outside,
        } = &node.role
        else {
            return refuse("it is no estimator", "report this");
        };
        if let Some(way) = ways::around_estimator(node) {
            let why = format!("what `{}` is fitted to is no linear form", node.kind.name);
            return refuse(why, way);
        }
        if std_dev.is_some() {
            self.unread(node, "std_dev");
        }
        let names = || fit.regressors.iter().map(|of| &of.name);
        let heeded = novelty.is_some() || *outside != Outside::Pass;
        let predictor = engine.fitted().get(&node.instance());
        let found = match predictor {
            Some(predictor) => {
                fitted(node, &**predictor, heeded).map(|fit| (fit, predictor.uses().to_vec()))
            }
            None => fixed(node, names().cloned().collect()),
        };
        // Where its fit has no place either, something else has to take its own.
        if learning.is_some() && !options.frozen && (found.is_ok() || predictor.is_none()) {
            let why = "it goes on learning while it runs".to_owned();
            let way = "`--frozen` exports it as it was fitted".to_owned();
            self.also.push((why, way));
        }
        let (found, used) = found?;
        let mut all = Vec::new();
        for &gather in gathers {
            all.extend_from_slice(&self.gathers[gather].entries);
        }
        let mut entries: Vec<Entry> = Vec::new();
        for name in &used {
            match names().position(|known| known == name) {
                Some(place) => entries.push(all[place]),
                None => return unknown(name),
            }
        }
        let directions = found
            .novelty
            .as_ref()
            .map_or(0, |of| of.place_of("directions"));
        self.scratch(used.len() + directions);
        let outside = match outside {
            Outside::Pass => 0,
            Outside::Shrink => 1,
            Outside::Absent => 2,
        };
        Ok(Record::new("linear", node.instance())
            .maybe("trigger", gathers.first().copied().filter(|_| !every_tick))
            .int("slot", first(&node.slots))
            .maybe("novelty_slot", *novelty)
            .int("width", used.len())
            .int("same", usize::from(found.same))
            .with("entries", Field::Entries(entries))
            .real("constant", found.constant)
            .with("coefficients", Field::Reals(found.coefficients, used))
            .with("novelty", Field::Struct(found.novelty.map(Box::new)))
            .int("outside", outside)
            .real("centre", found.centre))
    }
}

/// What needs no fit.
fn fixed(node: &PlannedNode, regressors: Vec<String>) -> Result<(Fit, Vec<String>), Refused> {
    let nothing = Fit {
        constant: 0.0,
        coefficients: Vec::new(),
        same: false,
        centre: 0.0,
        novelty: None,
    };
    match (node.kind.package, node.kind.name) {
        ("athermal-estimators", "zero") => Ok((nothing, Vec::new())),
        ("athermal-estimators", "persistence") => {
            let same = Fit {
                same: true,
                coefficients: vec![1.0],
                ..nothing
            };
            Ok((same, regressors))
        }
        _ => unfitted(),
    }
}

fn fitted(node: &PlannedNode, predictor: &dyn Predictor, heeded: bool) -> Result<Fit, Refused> {
    let form = predictor
        .linear()
        .filter(|form| form.coefficients.len() == predictor.uses().len());
    let Some(form) = form.filter(|_| !predictor.takes_absent()) else {
        return refuse(
            format!("what `{}` was fitted to is no linear form", node.kind.name),
            "use `linear`, `ar` or `arx`, or run the graph with `athermal serve`",
        );
    };
    let written = serde_json::to_value(predictor).unwrap_or_default();
    let novelty = match &written["novelty"] {
        _ if !heeded => None,
        serde_json::Value::Null => {
            if !predictor
                .novelty(&vec![0.0; form.coefficients.len()])
                .is_nan()
            {
                return refuse(
                    "how far it heeds that it is outside of its fit is not known",
                    "set `outside = \"pass\"`",
                );
            }
            None
        }
        novelty => match serde_json::from_value(novelty.clone()) {
            Ok(novelty) => Some(lowered(&novelty, node)),
            Err(error) => {
                return refuse(
                    format!("its novelty cannot be read: {error}"),
                    "set `outside = \"pass\"`",
                );
            }
        },
    };
    Ok(Fit {
        constant: form.constant,
        coefficients: form.coefficients.to_vec(),
        same: false,
        centre: predictor.centre(),
        novelty,
    })
}

/// By regressor what it contributes, so that one pass over a row is enough.
fn lowered(novelty: &Novelty, node: &PlannedNode) -> Record {
    let width = novelty.means.len().max(1);
    let directions = novelty.directions.len() / width;
    let along = (0..width)
        .flat_map(|column| (0..directions).map(move |nth| (column, nth)))
        .map(|(column, nth)| novelty.directions[nth * width + column]);
    Record::new("novelty", node.instance())
        .int("directions", directions)
        .real("edge", novelty.edge)
        .reals("mean", novelty.means.clone())
        .reals(
            "inverse",
            novelty.scales.iter().map(|scale| 1.0 / scale).collect(),
        )
        .reals("along", along.collect())
}
