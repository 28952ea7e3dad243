//! `channels` of a source: which channels of the graph it gives, where it has them, and in which unit.

use std::collections::BTreeMap;
use std::sync::Arc;

use indexmap::{IndexMap, IndexSet};
use schemars::JsonSchema;
use serde::Deserialize;

use super::keys;
use super::problem::{NoChannel, OtherUnit};
use crate::connector::{Mapped, Mapping};
use crate::diagnostic::{Diagnostics, Names, Place};
use crate::document::problem::{OneColumn, UnknownPlaceholder, UnknownSet, WrongType};
use crate::document::{
    Data, Entry, GraphFile, Hint, Pattern, SignalDecl, Table, Value, fill_placeholders,
    placeholders,
};
use crate::time::Duration;
use crate::unit::Unit;

/// The form of `channels`, for the schema.
#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code)] // it is read with places, from the tree
pub(super) enum ChannelsForm {
    /// Channels, by patterns: each is in the column that its signal names.
    Names(Vec<String>),
    /// For each channel where the source has it.
    Addresses(BTreeMap<String, AddressForm>),
}

#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code)]
pub(super) enum AddressForm {
    /// Where the source has it: a column, a topic, a node.
    Address(String),
    /// The same, with its unit and how late it may be.
    Mapped(MappedKeys),
}

/// What is said of a channel.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MappedKeys {
    /// Where the source has it: a column, a topic, a node. `{set}` is the member, `{channel}` the channel. The signal's column without.
    from: Option<String>,
    /// The unit in which the source gives it; that of the signal without.
    unit: Option<Unit>,
    /// A sample no later than this is given to the next tick.
    late: Option<Duration>,
}

/// The channels of a graph, in the order of the sources of its plan.
pub(super) struct GraphChannels<'a> {
    sets: &'a IndexMap<String, Vec<String>>,
    all: Vec<GraphChannel<'a>>,
    /// Their names, and those of the signals.
    names: Arc<Names>,
}

/// A channel of a graph.
pub(super) struct GraphChannel<'a> {
    pub(super) name: String,
    channel: &'a str,
    signal: &'a SignalDecl,
    /// Whether it is from when on values of a planned channel apply.
    is_instant: bool,
}

/// A channel that a source is to give.
#[derive(Debug, Clone)]
pub(super) struct Claim {
    /// Its number among [`GraphChannels`], and among the sources of the plan.
    pub(super) channel: usize,
    /// Where the file says so.
    pub(super) place: Place,
    /// Where the source has it; in the signal's column without.
    pub(super) address: Option<String>,
    pub(super) conversion: Option<(f64, f64)>,
    pub(super) late: Option<Duration>,
    pub(super) mapped: Option<Mapped>,
}

impl Claim {
    /// A channel that is in its signal's column.
    pub(super) fn column(channel: usize, place: Place) -> Self {
        Self {
            channel,
            place,
            address: None,
            conversion: None,
            late: None,
            mapped: None,
        }
    }
}

/// The texts that one with `{set}` in it stands for, each with its members.
pub(super) fn expand<'a>(
    text: &str,
    place: Place,
    sets: &'a IndexMap<String, Vec<String>>,
    diagnostics: &mut Diagnostics,
) -> Vec<(String, Vec<(&'a str, &'a str)>)> {
    let mut all = vec![Vec::new()];
    for name in placeholders(text).collect::<IndexSet<_>>() {
        let Some((set, members)) = sets.get_key_value(name) else {
            let problem = UnknownSet {
                name: name.to_owned(),
                known: Arc::new(sets.keys().cloned().collect()),
                or: Some("write `*` for any channel".to_owned()),
            };
            diagnostics.report(place, problem);
            return Vec::new();
        };
        let with = |pairs: &Vec<(&'a str, &'a str)>| {
            let pairs = pairs.clone();
            let member = |member: &'a String| [&pairs[..], &[(set, member)]].concat();
            members.iter().map(member).collect::<Vec<_>>()
        };
        all = all.iter().flat_map(with).collect();
    }
    let filled = |pairs: Vec<_>| (fill_placeholders(text, &pairs), pairs);
    all.into_iter().map(filled).collect()
}

/// A list of texts, each with its place; what is none is reported.
pub(super) fn texts<'a>(
    value: &'a Value,
    key: &str,
    expected: &str,
    diagnostics: &mut Diagnostics,
) -> Vec<(&'a str, Place)> {
    let one = std::slice::from_ref(value);
    let texts = value.as_list().unwrap_or(one).iter().filter_map(|value| {
        let text = value.as_text();
        if text.is_none() {
            wrong_type(value, key, expected, diagnostics);
        }
        Some((text?, value.place))
    });
    texts.collect()
}

pub(super) fn wrong_type(value: &Value, key: &str, expected: &str, diagnostics: &mut Diagnostics) {
    let problem = WrongType {
        key: Some(key.to_owned()),
        expected: expected.to_owned(),
        found: value.found(),
        hint: None::<Hint>,
    };
    diagnostics.report(value.place, problem);
}

impl<'a> GraphChannels<'a> {
    pub(super) fn new(graph: &'a GraphFile) -> Self {
        let of = |signal: &'a SignalDecl, port: &'static str| {
            let channels = signal.channels.iter();
            channels.map(move |(channel, _)| GraphChannel {
                name: format!("{}{port}.{channel}", signal.name),
                channel,
                signal,
                is_instant: !port.is_empty(),
            })
        };
        let (signals, planned) = (graph.signals.iter(), graph.signals.iter());
        let planned = planned.filter(|signal| signal.known_ahead.is_some());
        let planned = planned.flat_map(|signal| of(signal, ":applies_at"));
        let all: Vec<_> = signals
            .flat_map(|signal| of(signal, ""))
            .chain(planned)
            .collect();
        let signals = graph.signals.iter().map(|signal| signal.name.clone());
        let names = all
            .iter()
            .map(|of| of.name.clone())
            .chain(signals)
            .collect();
        Self {
            sets: &graph.sets,
            all,
            names: Arc::new(names),
        }
    }

    pub(super) fn all(&self) -> &[GraphChannel<'a>] {
        &self.all
    }

    /// From when on values of a channel apply, where it is planned: one source gives both.
    fn applies_at(&self, channel: usize) -> Option<usize> {
        let of = &self.all[channel];
        let is_its = |other: &GraphChannel<'_>| {
            other.is_instant && other.signal.name == of.signal.name && other.channel == of.channel
        };
        let mut all = self.all.iter();
        all.position(|other| !of.is_instant && is_its(other))
    }

    /// The channels that a source is to give; what else stands there is reported.
    pub(super) fn read(&self, value: &Value, diagnostics: &mut Diagnostics) -> Vec<Claim> {
        match &value.data {
            Data::Table(table) => {
                let entries = self.flat(table);
                let claims = entries
                    .iter()
                    .flat_map(|(key, entry)| self.mapped(key, entry, diagnostics));
                claims.collect()
            }
            Data::List(_) => {
                let expected = "a pattern of channels, such as \"temperature.*\"";
                let mut named = IndexMap::new();
                for (text, place) in texts(value, "channels", expected, diagnostics) {
                    for (channel, _) in self.find(text, place, diagnostics) {
                        named.entry(channel).or_insert(place);
                        if let Some(applies_at) = self.applies_at(channel) {
                            named.entry(applies_at).or_insert(place);
                        }
                    }
                }
                let claims = named.into_iter();
                claims
                    .map(|(channel, place)| Claim::column(channel, place))
                    .collect()
            }
            _ => {
                let expected = "a list of channels, or a table of their addresses";
                wrong_type(value, "channels", expected, diagnostics);
                Vec::new()
            }
        }
    }

    /// The entries of a table of addresses; what TOML made a table of, since `temperature.room` was not in quotes, with its channels.
    fn flat(&self, table: &Table) -> Vec<(String, Entry)> {
        let mut flat = Vec::new();
        for (key, entry) in table.iter() {
            let is_signal = self.all.iter().any(|of| of.signal.name == key);
            match entry.value.as_table().filter(|inner| {
                is_signal
                    && !["from", "unit", "late"]
                        .iter()
                        .any(|key| inner.contains(key))
            }) {
                Some(inner) => flat.extend(
                    inner
                        .iter()
                        .map(|(channel, entry)| (format!("{key}.{channel}"), entry.clone())),
                ),
                None => flat.push((key.to_owned(), entry.clone())),
            }
        }
        flat
    }

    /// The channels that a pattern names, each with the members that it stands for. One that names none is reported.
    fn find(
        &self,
        text: &str,
        place: Place,
        diagnostics: &mut Diagnostics,
    ) -> Vec<(usize, Vec<(&'a str, &'a str)>)> {
        let mut found = Vec::new();
        for (name, pairs) in expand(text, place, self.sets, diagnostics) {
            let pattern = Pattern::new(&name);
            let before = found.len();
            for (nth, of) in self.all.iter().enumerate() {
                let is_whole = !of.is_instant && pattern.matches(&of.signal.name);
                if pattern.matches(&of.name) || is_whole {
                    found.push((nth, pairs.clone()));
                }
            }
            if found.len() == before {
                let known = Arc::clone(&self.names);
                let pattern = name;
                diagnostics.report(place, NoChannel { pattern, known });
            }
        }
        found
    }

    /// The channels that an entry of a table of addresses names.
    fn mapped(&self, key: &str, entry: &Entry, diagnostics: &mut Diagnostics) -> Vec<Claim> {
        let (keys, at) = match &entry.value.data {
            Data::Text(address) => {
                let from = Some(address.clone());
                let keys = MappedKeys {
                    from,
                    ..MappedKeys::default()
                };
                (Some(keys), entry.value.place)
            }
            Data::Table(_) => {
                let what = format!("the channel `{key}`");
                let keys = keys::read::<MappedKeys>(&entry.value, &what, diagnostics);
                (keys, entry.value.place_of("from"))
            }
            _ => {
                let expected = "an address, or a table with `from`, `unit` and `late`";
                wrong_type(&entry.value, key, expected, diagnostics);
                (None, entry.value.place)
            }
        };
        let found = self.find(key, entry.key, diagnostics);
        let (Some(keys), Some((_, pairs))) = (keys, found.first()) else {
            return Vec::new();
        };
        let before = diagnostics.error_count();
        if let Some(from) = &keys.from {
            let sets = pairs.iter().map(|(set, _)| (*set).to_owned());
            let known: Vec<_> = sets.chain(["channel".to_owned()]).collect();
            for name in placeholders(from).filter(|name| !known.iter().any(|of| of == name)) {
                let problem = UnknownPlaceholder {
                    name: name.to_owned(),
                    known: known.clone(),
                    what: format!("the address of `{key}`"),
                    instead: None,
                };
                diagnostics.report(at, problem);
            }
        }
        let is_sound = diagnostics.error_count() == before;
        let places = [entry.key, at, entry.value.place_of("unit")];
        self.claims(found, &keys, places, is_sound, diagnostics)
    }

    /// The channels that a source names by a parameter of its own, which stands in this table.
    pub(super) fn own(
        &self,
        nth: usize,
        mapping: &Mapping,
        parameters: &Value,
        diagnostics: &mut Diagnostics,
    ) -> Vec<Claim> {
        let (value, place, around) = keys::find(parameters, &mapping.at);
        let part = |key: &str| value.and_then(Value::as_table)?.get(key);
        let place = part("channel").map_or(place, |of| of.place);
        let unit = part("unit").map_or(around.place_of("unit"), |of| of.place);
        let keys = MappedKeys {
            from: Some(mapping.address.clone()),
            unit: mapping.unit.clone(),
            late: mapping.late,
        };
        let found = self.find(&mapping.channel, place, diagnostics);
        let members: Vec<_> = found.iter().map(|(_, pairs)| pairs.clone()).collect();
        let mut claims = self.claims(found, &keys, [place, place, unit], true, diagnostics);
        for (claim, pairs) in claims.iter_mut().zip(members) {
            let channel = ("channel", self.all[claim.channel].channel);
            let members = pairs.into_iter().chain([channel]);
            claim.mapped = Some(Mapped {
                mapping: nth,
                members: members
                    .map(|(name, member)| (name.to_owned(), member.to_owned()))
                    .collect(),
            });
        }
        claims
    }

    /// What is claimed of channels, each with the members that its pattern stands for. The places are those of the pattern, of the
    /// address and of the unit.
    fn claims(
        &self,
        found: Vec<(usize, Vec<(&'a str, &'a str)>)>,
        keys: &MappedKeys,
        [place, at, unit_place]: [Place; 3],
        is_sound: bool,
        diagnostics: &mut Diagnostics,
    ) -> Vec<Claim> {
        let address = |channel: usize, mut pairs: Vec<(&'a str, &'a str)>| {
            pairs.push(("channel", self.all[channel].channel));
            Some(fill_placeholders(keys.from.as_ref()?, &pairs))
        };
        let mut claims = Vec::new();
        // Of an entry for several channels one has what is wrong with its unit.
        let mut unit = keys.unit.as_ref();
        for (channel, pairs) in found {
            let before = diagnostics.error_count();
            let conversion = self.conversion(channel, unit, unit_place, diagnostics);
            unit = unit.filter(|_| diagnostics.error_count() == before);
            claims.push(Claim {
                address: address(channel, pairs),
                conversion,
                late: keys.late,
                ..Claim::column(channel, place)
            });
        }
        let distinct: IndexSet<_> = claims.iter().map(|claim| &claim.address).collect();
        if let Some(pattern) = keys
            .from
            .clone()
            .filter(|_| is_sound && distinct.len() < claims.len())
        {
            let channels = claims.len();
            diagnostics.report(at, OneColumn { pattern, channels });
        }
        claims
    }

    /// How values in a unit become those of a channel's signal.
    fn conversion(
        &self,
        channel: usize,
        unit: Option<&Unit>,
        place: Place,
        diagnostics: &mut Diagnostics,
    ) -> Option<(f64, f64)> {
        let (unit, of) = (unit?, &self.all[channel]);
        let expected = &of.signal.unit;
        let (Some(factor), Some(offset)) = (unit.factor_to(expected), unit.convert(0.0, expected))
        else {
            let problem = OtherUnit {
                channel: of.name.clone(),
                found: unit.clone(),
                expected: expected.clone(),
                place: of.signal.unit_place,
            };
            diagnostics.report(place, problem);
            return None;
        };
        unit.is_another_than(expected).then_some((factor, offset))
    }
}
