//! `[sinks.NAME]`: which there are, and which outputs each is given.

use std::collections::BTreeMap;
use std::sync::Arc;

use indexmap::IndexSet;
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::channels::{expand, texts};
use super::problem::{CommandFedBack, NoOutput, NotACommand, OtherRate, Unbounded};
use super::sources::{RETRY, of_kind};
use super::{DeclaredSink, keys};
use crate::compile::{Plan, PlannedOutput, fed_back};
use crate::connector::{Purpose, Sink};
use crate::diagnostic::{Diagnostics, Names, Place, Sources};
use crate::document::{Data, Entry, GraphFile, Pattern, Table, Value, decode};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

/// The keys that every sink has.
pub(super) const KEYS: [&str; 4] = ["outputs", "behind", "rate", "retry"];

/// How far behind a tick may lie that is a command.
const BEHIND: Duration = Duration::from_ns(5_000_000_000);

/// The keys that every sink has.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SinkKeys {
    /// The outputs that it is given, or columns of them, such as "correction" or "correction.Z1"; all without.
    #[serde(rename = "outputs")]
    #[schemars(with = "Option<OutputsForm>")]
    _outputs: IgnoredAny,
    /// Only of commands: a tick that lies further behind is not put out; 5 s without.
    #[schemars(extend("exclusiveMinimum" = 0))]
    behind: Option<Duration>,
    /// The longest pause after a failure: 0.5 s at first, then ever longer ones up to this; 30 s without.
    #[schemars(extend("exclusiveMinimum" = 0))]
    retry: Option<Duration>,
    /// Only of commands: by how much they may change in a time, such as "5 nm/s", for all outputs or each; the `blend` of an output
    /// without.
    #[serde(rename = "rate")]
    #[schemars(with = "Option<RateForm>")]
    _rate: IgnoredAny,
}

#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code)] // it is read with places, from the tree
enum OutputsForm {
    /// One output.
    One(String),
    /// Several.
    Several(Vec<String>),
}

#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code)] // it is read with places, from the tree
enum RateForm {
    /// For all outputs.
    All(Quantity),
    /// By output.
    Each(BTreeMap<String, Quantity>),
}

/// What a sink may be given.
struct Outputs<'a> {
    graph: &'a GraphFile,
    plan: &'a Plan,
    /// Columns, each with its unit per second, and its `blend` in that.
    columns: Vec<(String, Unit, Option<f64>)>,
    /// Outputs and columns.
    names: Arc<Names>,
}

/// Reads all sinks; what is wrong is reported.
pub(super) fn read(
    section: &Value,
    graph: &GraphFile,
    plan: &Plan,
    files: &Sources,
    diagnostics: &mut Diagnostics,
) -> Vec<DeclaredSink> {
    let column = |of: &PlannedOutput| {
        let unit = &plan.channels[of.slot].channel.unit;
        let unit = unit.difference().per(&Unit::second());
        let blend = of.blend.as_ref().and_then(|rate| rate.in_unit(&unit));
        (of.name.clone(), unit, blend)
    };
    let columns: Vec<_> = plan.outputs.iter().map(column).collect();
    let names = graph.outputs.iter().map(|of| of.name.clone());
    let names = names.chain(columns.iter().map(|(name, ..)| name.clone()));
    let outputs = Outputs {
        graph,
        plan,
        names: Arc::new(names.collect()),
        columns,
    };
    let named = section.as_table().into_iter().flat_map(Table::iter);
    let sinks = named.filter_map(|(name, entry)| sink(name, entry, &outputs, files, diagnostics));
    sinks.collect()
}

fn sink(
    name: &str,
    entry: &Entry,
    outputs: &Outputs<'_>,
    files: &Sources,
    diagnostics: &mut Diagnostics,
) -> Option<DeclaredSink> {
    let before = diagnostics.error_count();
    let (own, others) = keys::split(&entry.value, &KEYS);
    let (_, parameters) = keys::split(&others, &["type"]);
    let (by_hand, own) = keys::split(&own, &["outputs", "rate"]);
    let by_hand = |key: &str| by_hand.as_table().and_then(|table| table.get(key));
    let role = ("sink", name);
    let kind = of_kind::<dyn Sink>(role, entry, &parameters, &KEYS, diagnostics);
    let what = format!("the sink `{name}`");
    let keys = keys::read::<SinkKeys>(&own, &what, diagnostics);
    let columns = match by_hand("outputs") {
        Some(value) => outputs.read(value, diagnostics),
        None => (0..outputs.columns.len()).collect(),
    };
    let mut rate = outputs.rates(by_hand("rate"), &columns, diagnostics);
    let (kind, sink) = kind?;
    keys::report(sink.remarks(), &parameters, diagnostics);
    let parameters = sink;
    let is_command = parameters.purpose() == Purpose::Command;
    for key in ["behind", "rate"].into_iter().filter(|_| !is_command) {
        if let Some(entry) = entry.value.as_table().and_then(|table| table.entry(key)) {
            let kind = kind.name;
            diagnostics.report(entry.key, NotACommand { key, kind });
        }
    }
    if is_command {
        let found = columns.iter().find_map(|nth| {
            let channel = outputs.moves(*nth)?;
            Some((outputs.columns[*nth].0.clone(), channel))
        });
        if let Some((output, channel)) = found {
            diagnostics.report(entry.key, CommandFedBack { output, channel });
        }
    }
    // What no command is bounded by is not stated either.
    if !is_command {
        rate.fill(None);
    }
    let mut unbounded = columns.iter().zip(&rate).filter(|(_, rate)| rate.is_none());
    if is_command
        && diagnostics.error_count() == before
        && let Some((&first, _)) = unbounded.next()
    {
        let output = outputs.columns[first].0.clone();
        let more = unbounded.count();
        diagnostics.report(entry.key, Unbounded { output, more });
    }
    Some(DeclaredSink {
        name: name.to_owned(),
        kind,
        parameters: parameters.into(),
        folder: files.resolve(entry.value.place_of("path"), ""),
        outputs: columns
            .iter()
            .map(|&column| outputs.columns[column].0.clone())
            .collect(),
        retry: keys.as_ref().and_then(|of| of.retry).unwrap_or(RETRY),
        behind: is_command.then_some(keys?.behind.unwrap_or(BEHIND)),
        rate,
    })
}

impl Outputs<'_> {
    /// The position that a column moves and goes by, where it is a prediction that is sent.
    fn moves(&self, column: usize) -> Option<String> {
        let channels = &self.plan.channels;
        let slot = self.plan.outputs[column].slot;
        channels[slot].predicts?;
        let moved = fed_back::moved(self.plan, [slot]);
        // What is sent to a chiller moves no position.
        let is_position =
            |slot: &&usize| !channels[**slot].channel.unit.measures_same(&Unit::kelvin());
        let first = moved.iter().find(is_position)?;
        Some(channels[*first].name.clone())
    }

    /// The columns that an output, a column or a pattern names.
    fn find(&self, text: &str, place: Place, diagnostics: &mut Diagnostics) -> Vec<usize> {
        let mut found = Vec::new();
        for (name, _) in expand(text, place, &self.graph.sets, diagnostics) {
            let before = found.len();
            let pattern = Pattern::new(&name);
            let columns = self.columns.iter().enumerate();
            found.extend(
                columns
                    .filter(|(_, (column, ..))| {
                        let output = column.split_once('.').map_or("", |(output, _)| output);
                        pattern.matches(column) || pattern.matches(output)
                    })
                    .map(|(nth, _)| nth),
            );
            if found.len() == before {
                let problem = NoOutput {
                    output: name,
                    is_of_sink: false,
                    known: Arc::clone(&self.names),
                };
                diagnostics.report(place, problem);
            }
        }
        found
    }

    fn read(&self, value: &Value, diagnostics: &mut Diagnostics) -> Vec<usize> {
        let texts = texts(value, "outputs", "the name of an output", diagnostics);
        let found = texts
            .into_iter()
            .flat_map(|(text, place)| self.find(text, place, diagnostics));
        let distinct: IndexSet<usize> = found.collect();
        distinct.into_iter().collect()
    }

    /// The rate of each column of a sink.
    fn rates(
        &self,
        value: Option<&Value>,
        columns: &[usize],
        diagnostics: &mut Diagnostics,
    ) -> Vec<Option<f64>> {
        let blends = columns.iter().map(|&column| self.columns[column].2);
        let mut rates: Vec<_> = blends.collect();
        let Some(value) = value else {
            return rates;
        };
        let Data::Table(each) = &value.data else {
            let all: Vec<usize> = (0..columns.len()).collect();
            self.rate(value, columns, &all, &mut rates, diagnostics);
            return rates;
        };
        // What is said of a column holds against what is said of its output.
        let (of_columns, of_outputs): (Vec<_>, Vec<_>) =
            each.iter().partition(|(key, _)| key.contains('.'));
        for (key, entry) in of_outputs.into_iter().chain(of_columns) {
            let found = self.find(key, entry.key, diagnostics);
            let places = columns.iter().enumerate();
            let places = places.filter(|(_, column)| found.contains(column));
            let places: Vec<usize> = places.map(|(nth, _)| nth).collect();
            if places.is_empty() && !found.is_empty() {
                let given = columns.iter().map(|&nth| self.columns[nth].0.clone());
                let problem = NoOutput {
                    output: key.to_owned(),
                    is_of_sink: true,
                    known: Arc::new(given.collect()),
                };
                diagnostics.report(entry.key, problem);
            }
            self.rate(&entry.value, columns, &places, &mut rates, diagnostics);
        }
        rates
    }

    /// A rate in the unit of each of these columns per second.
    fn rate(
        &self,
        value: &Value,
        columns: &[usize],
        places: &[usize],
        rates: &mut [Option<f64>],
        diagnostics: &mut Diagnostics,
    ) {
        let Some(rate) = decode::<Quantity>(value, "`rate`", diagnostics) else {
            return;
        };
        for &nth in places {
            let (column, unit, _) = &self.columns[columns[nth]];
            let per_second = rate.in_unit(unit).filter(|rate| *rate > 0.0);
            if per_second.is_none() {
                let problem = OtherRate {
                    output: column.clone(),
                    found: rate.clone(),
                    expected: unit.clone(),
                };
                diagnostics.report(value.place, problem);
                return;
            }
            rates[nth] = per_second;
        }
    }
}
