//! What a prediction is made of now, by voter and by sensor.

use athermal_core::compile::Plan;
use athermal_core::engine::Contribution;
use athermal_http::{Asked, Refused, Reply};
use athermal_serve::service::Service;
use athermal_serve::shown::{Shown, member};
use schemars::JsonSchema;
use serde::Serialize;

/// What an output is made of at the last tick. Parts and the rest add up to its value.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct MadeOf {
    /// The output, or the channel.
    output: String,
    /// The instant of the tick, in s.
    time_s: Option<f64>,
    /// Its value.
    value: f64,
    /// The unit of that, and of all parts.
    unit: String,
    /// The parts, the largest first.
    parts: Vec<MadeOfPart>,
    /// What no sensor explains: constants, and what is no linear form.
    rest: f64,
}

/// A part of a prediction.
#[derive(Debug, Serialize, JsonSchema)]
struct MadeOfPart {
    /// The estimator that gave it.
    voter: String,
    /// What that weighs.
    weight: f64,
    /// The channel that was measured; what several follow from has its own name.
    sensor: String,
    /// How much it adds.
    value: f64,
}

pub(crate) fn answer(service: &mut Service, asked: &Asked) -> Result<Reply, Refused> {
    let name = match &asked.parts()?[..] {
        [("output", name)] => name.clone(),
        _ => return Err(Refused::not_understood("`output=NAME` is what there is")),
    };
    let no_copy = || {
        Refused::not_now(
            "there is no copy of what runs yet; open a stream of events, and ask again",
        )
    };
    let engine = service.replica().ok_or_else(no_copy)?;
    let plan = engine.plan();
    let shown = Shown::named(plan, &name);
    let shown = shown.ok_or_else(|| {
        Refused::nothing_here(&format!(
            "the graph has neither an output nor a channel `{name}`"
        ))
    })?;
    let slot = shown.slot(plan);
    let parts = engine.contributions(slot).ok_or_else(|| {
        Refused::not_now(&format!(
            "`{name}` has no new value at this tick, or is not predicted"
        ))
    })?;
    let value = engine.value(slot);
    let mut made = MadeOf {
        output: name,
        time_s: engine.last().map(|of| of.as_ns() as f64 / 1e9),
        value,
        unit: shown.unit(plan),
        parts: Vec::new(),
        rest: 0.0,
    };
    for part in &parts {
        made.add(plan, part);
    }
    made.parts
        .sort_by(|one, other| other.value.abs().total_cmp(&one.value.abs()));
    Ok(Reply::json(&made))
}

impl MadeOf {
    fn add(&mut self, plan: &Plan, part: &Contribution) {
        let Some(slot) = part.regressor else {
            self.rest += part.value;
            return;
        };
        let voter = plan.nodes[part.node].instance();
        let behind = plan.behind([slot]);
        let own = &plan.channels[slot].name;
        let names = plan.sources.iter().zip(&behind);
        let names = names.filter_map(|(of, is_behind)| is_behind.then_some(&of.name));
        // Of several, as where sensors are compared, the one that it is named after.
        let named = names.clone().filter(|of| member(of) == member(own));
        let one = |mut of: Box<dyn Iterator<Item = &String> + '_>| {
            of.next().filter(|_| of.next().is_none()).cloned()
        };
        let sensor = one(Box::new(names)).or_else(|| one(Box::new(named)));
        let sensor = sensor.unwrap_or_else(|| own.clone());
        let known = self
            .parts
            .iter_mut()
            .find(|of| of.voter == voter && of.sensor == sensor);
        match known {
            Some(known) => known.value += part.value,
            None => self.parts.push(MadeOfPart {
                voter,
                weight: part.weight,
                sensor,
                value: part.value,
            }),
        }
    }
}
