//! Which properties of a plan count, and when two of them mean the same.

use std::collections::{BTreeMap, HashMap};
use std::sync::OnceLock;

use indexmap::IndexMap;
use serde_json::Value;

use super::ParameterChange;
use crate::compile::plan::{NOVELTY, Plan, PlannedNode, PlannedRole, TruthLink};
use crate::document::{TimeBase, TimeForm};
use crate::node::{FREEZE, Kind, NodeKind, Read, Role, TruthLags};
use crate::quantity::Quantity;
use crate::registry::all;
use crate::time::Duration;
use crate::unit::Unit;

/// The properties of one thing, by path.
#[derive(Debug, Clone, Default)]
pub(super) struct Facts(IndexMap<String, Fact>);

/// A property.
#[derive(Debug, Clone, PartialEq)]
struct Fact {
    value: Value,
    /// Whether texts in it may be units or quantities, which are equal when they mean the same.
    measured: bool,
}

impl Facts {
    fn plain(&mut self, path: impl Into<String>, value: impl Into<Value>) {
        self.insert(path.into(), value.into(), false);
    }

    fn measured(&mut self, path: impl Into<String>, value: impl Into<Value>) {
        self.insert(path.into(), value.into(), true);
    }

    fn insert(&mut self, path: String, value: Value, measured: bool) {
        self.0.insert(path, Fact { value, measured });
    }

    /// Takes the leaves of a tree of parameters; lists stay whole, and null is the absence of a value.
    fn parameters(&mut self, path: &str, value: Value, measured: bool) {
        match value {
            Value::Null => {}
            Value::Object(entries) => {
                for (key, value) in entries {
                    self.parameters(&format!("{path}.{key}"), value, measured);
                }
            }
            value => self.insert(path.to_owned(), value, measured),
        }
    }

    /// The properties as data, which are the same where [`Self::changes_to`] finds nothing.
    pub(super) fn meaning(self, texts: &mut Texts) -> Value {
        let meaning = |(path, fact): (String, Fact)| (path, texts.of(fact));
        let sorted: BTreeMap<_, _> = self.0.into_iter().map(meaning).collect();
        sorted.into_iter().collect()
    }

    /// What differs, in the order of what there is now, then what is gone.
    pub(super) fn changes_to(&self, to: &Self, texts: &mut Texts) -> Vec<ParameterChange> {
        let change = |path: &String, from: Option<&Fact>, to: Option<&Fact>| ParameterChange {
            path: path.clone(),
            from: from.map(|fact| fact.value.clone()),
            to: to.map(|fact| fact.value.clone()),
        };
        // The parameters of one kind mean nothing to another.
        if let (Some(before), Some(after)) = (self.0.get("type"), to.0.get("type"))
            && before != after
        {
            return vec![change(&"type".to_owned(), Some(before), Some(after))];
        }
        let mut changes = Vec::new();
        for (path, after) in &to.0 {
            let before = self.0.get(path);
            if !before.is_some_and(|before| texts.are_one(before, after)) {
                changes.push(change(path, before, Some(after)));
            }
        }
        for (path, before) in self.0.iter().filter(|(path, _)| !to.0.contains_key(*path)) {
            changes.push(change(path, Some(before), None));
        }
        changes
    }
}

/// What texts that may be units or quantities mean; each is read once.
#[derive(Default)]
pub(super) struct Texts(HashMap<String, String>);

impl Texts {
    fn of(&mut self, fact: Fact) -> Value {
        match fact.measured {
            true => self.meaning(fact.value),
            false => fact.value,
        }
    }

    /// Whether two properties mean the same. Lists are compared one by one, though one text may stand for all of a list.
    fn are_one(&mut self, a: &Fact, b: &Fact) -> bool {
        let lengths = |of: &Fact| of.value.as_array().map(Vec::len);
        let differ = lengths(a).zip(lengths(b)).is_some_and(|(a, b)| a != b);
        a == b || (!differ && self.of(a.clone()) == self.of(b.clone()))
    }

    fn meaning(&mut self, value: Value) -> Value {
        match value {
            Value::Array(values) => {
                let values: Vec<_> = values.into_iter().map(|v| self.meaning(v)).collect();
                match values.first() {
                    // Each channel's own, differently spelt, is one for all.
                    Some(one @ Value::String(_)) if values.iter().all(|value| value == one) => {
                        one.clone()
                    }
                    _ => Value::Array(values),
                }
            }
            Value::String(text) => {
                let read = self.0.entry(text).or_insert_with_key(|text| of_text(text));
                read.as_str().into()
            }
            other => other,
        }
    }
}

fn of_text(text: &str) -> String {
    if let Ok(quantity) = text.parse::<Quantity>() {
        let base = quantity.unit.base();
        let value = quantity.in_unit(&base).unwrap_or(quantity.value);
        // Neither zero has a sign here.
        return format!("{:.11e} {base}", value + 0.0);
    }
    Unit::parse(text).map_or_else(|_| text.to_owned(), |unit| unit.meaning())
}

pub(super) fn time(plan: &Plan) -> Facts {
    let mut facts = Facts::default();
    let TimeBase::Column { column, form, zone } = &plan.time;
    facts.plain("column", column.to_string());
    match form {
        TimeForm::Numbers { unit } => facts.plain("unit", unit.to_string()),
        TimeForm::Rfc3339 => facts.plain("unit", "RFC 3339"),
        TimeForm::Elapsed => facts.plain("unit", "h:min:s"),
        TimeForm::Since { unit, origin_ns } => {
            facts.plain("unit", format!("{unit}, from {origin_ns} ns before 1970"));
        }
        TimeForm::Format(format) => facts.plain("format", format.as_str()),
        TimeForm::Samples { step } => {
            facts.plain("unit", "sample");
            if let Some(step) = step {
                facts.plain("step", step.to_string());
            }
        }
    }
    if let Some(zone) = zone {
        facts.plain("zone", zone.as_str());
    }
    facts
}

pub(super) fn signals(plan: &Plan) -> IndexMap<String, Facts> {
    let channels = plan.sources.iter().zip(&plan.channels);
    let signals = channels.map(|(source, planned)| {
        let mut facts = Facts::default();
        let unit = &planned.channel.unit;
        facts.measured("unit", unit.to_string());
        facts.plain("column", source.column.as_str());
        if source.optional {
            facts.plain("optional", true);
        }
        let (low, high) = source.range;
        for (path, end) in [("range.low", low), ("range.high", high)] {
            if end.is_finite() {
                facts.measured(path, format!("{end} {unit}"));
            }
        }
        if let Some(age) = planned.channel.max_age {
            facts.plain("max_age", age.to_string());
        }
        if let Some(planned) = source.planned {
            facts.plain("known_ahead", planned.known_ahead.to_string());
        }
        (source.name.clone(), facts)
    });
    signals.collect()
}

pub(super) fn outputs(plan: &Plan) -> IndexMap<String, Facts> {
    let outputs = plan.outputs.iter().map(|output| {
        let mut facts = Facts::default();
        let from = &plan.channels[output.slot];
        facts.plain("from", from.name.as_str());
        facts.measured("unit", from.channel.unit.to_string());
        if let Some(blend) = &output.blend {
            facts.measured("blend", blend.to_string());
        }
        (output.name.clone(), facts)
    });
    outputs.collect()
}

pub(super) fn nodes(plan: &Plan) -> IndexMap<String, Facts> {
    let nodes = plan.nodes.iter();
    nodes
        .map(|node| (node.instance(), node_facts(plan, node)))
        .collect()
}

/// The parameters of each kind that have units or quantities anywhere in them.
fn measured_parameters(kind: &'static Kind) -> &'static [String] {
    // By name alone, since no plan has a kind of a name that two crates brought.
    static KNOWN: OnceLock<HashMap<&str, OnceLock<Vec<String>>>> = OnceLock::new();
    let known = KNOWN.get_or_init(|| {
        all::<NodeKind>()
            .map(|kind| (kind.name, OnceLock::new()))
            .collect()
    });
    let Some(measured) = known.get(kind.name) else {
        return &[];
    };
    // A schema takes long to make: only those of the kinds that a graph has are.
    measured.get_or_init(|| {
        let schema = (kind.schema)();
        let parameters = schema["properties"].as_object().into_iter().flatten();
        let definitions = &schema["$defs"];
        let measured =
            parameters.filter(|(_, schema)| is_measured(schema, definitions, &mut Vec::new()));
        measured.map(|(name, _)| name.clone()).collect()
    })
}

fn node_facts(plan: &Plan, node: &PlannedNode) -> Facts {
    let mut facts = Facts::default();
    facts.plain("type", node.kind.name);
    if let Some(fit) = node.role.fit() {
        facts.plain("ahead", fit.truth.ahead.to_string());
        let unit = &plan.channels[fit.truth.slot].channel.unit;
        for (path, limit, none) in [
            ("train.abs_truth.below", fit.training.below, f64::INFINITY),
            ("train.abs_truth.above", fit.training.above, 0.0),
        ] {
            if limit != none {
                facts.measured(path, format!("{limit} {unit}"));
            }
        }
    }
    if let PlannedRole::Estimator {
        learning: Some(learning),
        ..
    } = &node.role
    {
        facts.plain("learn.outliers", learning.limits.outliers.to_string());
        facts.plain("learn.margin", learning.limits.margin.to_string());
    }
    if let PlannedRole::Estimator { outside, .. } = &node.role
        && node.port(NOVELTY).is_some()
    {
        facts.plain("outside", outside.name());
    }
    if let Value::Object(parameters) = node.spec.parameters() {
        let measured = measured_parameters(node.kind);
        for (key, value) in parameters {
            facts.parameters(&key, value, measured.contains(&key));
        }
    }
    inputs(plan, node, &mut facts);
    if let PlannedRole::Feature { wanted, .. } = &node.role {
        // The first port is always computed; whether another is decides what state there is.
        for ((port, _), _) in node.ports.iter().zip(wanted).skip(1).filter(|(_, w)| **w) {
            facts.plain(format!("outputs.{port}"), "computed");
        }
    }
    facts
}

/// Whether a parameter has units or quantities anywhere in it, be it by way of the definitions that it names.
fn is_measured<'a>(schema: &'a Value, definitions: &'a Value, followed: &mut Vec<&'a str>) -> bool {
    match schema {
        Value::String(text) => match text.strip_prefix("#/$defs/") {
            Some("Unit" | "Quantity") => true,
            Some(name) if !followed.contains(&name) => {
                followed.push(name);
                is_measured(&definitions[name], definitions, followed)
            }
            _ => false,
        },
        Value::Array(parts) => parts
            .iter()
            .any(|part| is_measured(part, definitions, followed)),
        Value::Object(parts) => parts
            .values()
            .any(|part| is_measured(part, definitions, followed)),
        _ => false,
    }
}

fn inputs(plan: &Plan, node: &PlannedNode, facts: &mut Facts) {
    let (gathers, link) = match &node.role {
        PlannedRole::Estimator { gathers, fit, .. } => {
            // The gathers after the first read the same channels at other lags, which are parameters.
            let first = gathers.first().filter(|_| reads_features(node));
            (first.copied().into_iter().collect(), Some(fit.truth))
        }
        role => (role.inputs().collect::<Vec<_>>(), role.truth().copied()),
    };
    let ports = (node.kind.inputs)();
    let data = ports
        .iter()
        .filter(|port| port.read != Read::Truth && port.name != FREEZE);
    for (port, gather) in data.zip(gathers) {
        let gather = &plan.gathers[gather];
        // Lags are parameters.
        let first = gather.entries.first().map(|entry| entry.lag);
        let entries = gather.entries.iter();
        let entries: Vec<_> = entries.filter(|entry| Some(entry.lag) == first).collect();
        let slots: Vec<usize> = entries.iter().map(|entry| entry.slot).collect();
        let ages = (gather.read != Read::Fresh)
            .then(|| entries.iter().map(|entry| entry.max_age).collect());
        input(plan, port.name, &slots, ages, facts);
    }
    if let Some(gather) = freeze(&node.role) {
        let entries = &plan.gathers[gather].entries;
        let slots: Vec<usize> = entries.iter().map(|entry| entry.slot).collect();
        let ages = entries.iter().map(|entry| entry.max_age).collect();
        input(plan, FREEZE, &slots, Some(ages), facts);
    }
    if let Some(TruthLink { slot, limit, .. }) = link {
        let age = held_truth(plan, node).unwrap_or(limit);
        input(plan, "truth", &[slot], Some(vec![age]), facts);
    }
}

/// The gather of the channels that freeze the learning of an estimator.
fn freeze(role: &PlannedRole) -> Option<usize> {
    match role {
        PlannedRole::Estimator { learning, .. } => learning.as_ref()?.freeze,
        PlannedRole::Feature { .. } | PlannedRole::Combiner { .. } => None,
    }
}

fn reads_features(node: &PlannedNode) -> bool {
    match node.spec.role() {
        Role::Estimator(estimator) => !estimator.regressors().feature_lags.is_empty(),
        Role::Feature(_) | Role::Combiner(_) => false,
    }
}

/// How long a held truth counts where it is a regressor.
fn held_truth(plan: &Plan, node: &PlannedNode) -> Option<Duration> {
    let (PlannedRole::Estimator { gathers, .. }, Role::Estimator(estimator)) =
        (&node.role, node.spec.role())
    else {
        return None;
    };
    let is_regressor = estimator.regressors().truth_lags != TruthLags::None;
    // Its lags are the last of a row.
    let last = gathers.last().filter(|_| is_regressor)?;
    Some(plan.gathers[*last].entries.first()?.max_age)
}

/// What an input reads: which channels, what they carry, and how long a held value counts.
fn input(plan: &Plan, port: &str, slots: &[usize], ages: Option<Vec<Duration>>, facts: &mut Facts) {
    if slots.is_empty() {
        return;
    }
    let path = format!("inputs.{port}");
    let channels = || slots.iter().map(|&slot| &plan.channels[slot]);
    let names: Vec<Value> = channels().map(|from| from.name.as_str().into()).collect();
    let carried = |of: &dyn Fn(&crate::channel::Channel) -> String| {
        one_or_all(channels().map(|from| of(&from.channel)).collect())
    };
    facts.plain(path.as_str(), names);
    facts.measured(format!("{path}.unit"), carried(&|c| c.unit.to_string()));
    facts.plain(format!("{path}.span"), carried(&|c| c.span.to_string()));
    facts.plain(format!("{path}.ahead"), carried(&|c| c.ahead.to_string()));
    if let Some(ages) = ages {
        let ages = ages.iter().map(ToString::to_string).collect();
        facts.plain(format!("{path}.max_age"), one_or_all(ages));
    }
}

/// One text where all are the same, else each.
fn one_or_all(texts: Vec<String>) -> Value {
    match texts.first() {
        Some(first) if texts.iter().all(|text| text == first) => first.as_str().into(),
        _ => texts.into(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn texts_mean_the_same_exactly_where_they_measure_the_same() {
        let alike = [
            &["150 nm/min", "0.15 um/min", "2.5 nm/s"][..],
            &["20 Cel", "293.15 K"],
            &["20 K"],
            &["0 nm", "-0 nm"],
            &["0 K"],
            &["K"],
            &["Cel"],
            &["mK/min", "mK.min-1"],
            &["uK/min"],
            &["1 dB"],
            &["ridge"],
            &["lasso"],
        ];
        let all = || {
            alike
                .iter()
                .enumerate()
                .flat_map(|(nth, of)| of.iter().map(move |text| (nth, *text)))
        };
        for (a, one) in all() {
            for (b, other) in all() {
                assert_eq!(of_text(one) == of_text(other), a == b, "{one} and {other}");
            }
        }
        let fact = |value: Value| Fact {
            value,
            measured: true,
        };
        let are_one = |a, b| Texts::default().are_one(&fact(a), &fact(b));
        assert!(are_one(json!(["1 K", "1000 mK"]), json!("1 K")));
        assert!(!are_one(json!(["1 K", "2 K"]), json!("1 K")));
        assert!(!are_one(
            json!(["1 K", "1 K"]),
            json!(["1 K", "1 K", "1 K"])
        ));
    }
}
