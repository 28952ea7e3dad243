//! `[sources.NAME]`: which there are, and which channels each gives.

use std::collections::HashMap;
use std::path::PathBuf;

use athermal_run::recording::{Left, Thinning};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::channels::{ChannelsForm, Claim, GraphChannels};
use super::problem::{ChannelTwice, KindTwice, NoAddress, NoSource, UnfitParameter, UnknownKind};
use super::{DeclaredChannel, DeclaredSource, keys};
use crate::compile::Plan;
use crate::connector::{ConnectorKind, Source, SourceKind};
use crate::diagnostic::{Diagnostics, Place, Sources};
use crate::document::problem::MissingKey;
use crate::document::{Entry, GraphFile, Table, Value};
use crate::registry::{Registered, Sort, all, find};
use crate::sequencer::{ClockRemedy, ClockRule};
use crate::time::Duration;

/// The longest pause after a failure, unless the file says another.
pub(super) const RETRY: Duration = Duration::from_ns(30_000_000_000);

/// The keys that every source has.
pub(super) const KEYS: [&str; 8] = [
    "channels", "silent", "retry", "clock", "late", "mean", "last", "median",
];

/// The keys that every source has.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SourceKeys {
    /// The channels that it gives, a list of patterns such as "temperature.*" or "position.{axis}", or a table of where it has each. All
    /// that no other source names without.
    #[serde(rename = "channels")]
    #[schemars(with = "Option<ChannelsForm>")]
    _channels: IgnoredAny,
    /// A source that is away so long is not waited for. One that is connected and silent so long is dropped and started over.
    #[schemars(extend("exclusiveMinimum" = 0))]
    silent: Duration,
    /// The longest pause after a failure: 0.5 s at first, then ever longer ones up to this.
    #[schemars(extend("exclusiveMinimum" = 0))]
    retry: Duration,
    /// How its clock is judged by the time at which samples arrive; not at all without.
    clock: Option<ClockKeys>,
    /// A sample no later than this is given to the next tick; a channel may have its own.
    late: Duration,
    /// The graph is given the mean of the samples of each such time, with the stamp of its end; each sample without.
    #[schemars(extend("exclusiveMinimum" = 0))]
    mean: Option<Duration>,
    /// The same with the last sample.
    #[schemars(extend("exclusiveMinimum" = 0))]
    last: Option<Duration>,
    /// The same with the median.
    #[schemars(extend("exclusiveMinimum" = 0))]
    median: Option<Duration>,
}

impl SourceKeys {
    /// How it is thinned; what is said twice is reported.
    fn thinning(&self, table: &Value, diagnostics: &mut Diagnostics) -> Option<Thinning> {
        let ways = [
            (Left::Mean, self.mean),
            (Left::Last, self.last),
            (Left::Median, self.median),
        ];
        let named = ways.into_iter().filter_map(|(left, every)| {
            Some(Thinning {
                left,
                every: every?,
            })
        });
        let named: Vec<_> = named.collect();
        if named.len() > 1 {
            let (words, advice) = (
                "it is thinned in two ways",
                "keep one of `mean`, `last` and `median`",
            );
            let (words, advice) = (words.to_owned(), advice.to_owned());
            diagnostics.report(table.place, UnfitParameter { words, advice });
        }
        named.first().copied()
    }
}

/// How the clock of a source is judged.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ClockKeys {
    /// How far a stamp and its arrival may be apart.
    #[schemars(extend("exclusiveMinimum" = 0))]
    within: Duration,
    /// What becomes of samples where they are further apart.
    #[serde(rename = "else", default)]
    otherwise: Remedy,
}

/// What becomes of samples of a clock that is wrong.
#[derive(Debug, Clone, Copy, Default, Deserialize, serde::Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Remedy {
    /// They are refused.
    #[default]
    Refuse,
    /// Their stamps are shifted by one offset, so that distances stay.
    Shift,
    /// They are stamped with their arrival.
    Arrival,
}

impl Default for SourceKeys {
    fn default() -> Self {
        Self {
            _channels: IgnoredAny,
            silent: Duration::from_ns(30_000_000_000),
            retry: RETRY,
            clock: None,
            late: Duration::ZERO,
            mean: None,
            last: None,
            median: None,
        }
    }
}

impl From<ClockKeys> for ClockRule {
    fn from(keys: ClockKeys) -> Self {
        Self {
            within: keys.within,
            otherwise: match keys.otherwise {
                Remedy::Refuse => ClockRemedy::Refuse,
                Remedy::Shift => ClockRemedy::Shift,
                Remedy::Arrival => ClockRemedy::Arrival,
            },
        }
    }
}

/// The kind of a source or sink and its parameters, as far as they are right; what is wrong is reported.
pub(super) fn of_kind<S: ?Sized>(
    (role, name): (&'static str, &str),
    entry: &Entry,
    parameters: &Value,
    generic: &[&str],
    diagnostics: &mut Diagnostics,
) -> Option<(&'static Registered<ConnectorKind<S>>, Box<S>)>
where
    ConnectorKind<S>: Sort,
{
    let what = format!("the {role} `{name}`");
    let Some(written) = entry.value.as_table()?.get("type") else {
        let problem = MissingKey {
            key: "type".to_owned(),
            what,
            advice: Some(format!(
                "name its kind, such as type = \"{}\"; `athermal nodes` lists the kinds of {role}s",
                all::<ConnectorKind<S>>()
                    .next()
                    .map_or("", |kind| kind.name)
            )),
        };
        diagnostics.report(entry.key, problem);
        return None;
    };
    let Some(text) = written.as_text() else {
        super::channels::wrong_type(written, "type", "a kind in quotes", diagnostics);
        return None;
    };
    let kind = match find::<ConnectorKind<S>>(text) {
        Ok(kind) => kind,
        Err(why) => {
            match why.is_twice() {
                true => diagnostics.report(written.place, KindTwice { why }),
                false => diagnostics.report(written.place, UnknownKind { why }),
            }
            return None;
        }
    };
    let elsewhere = [&["type"], generic].concat();
    let read = (kind.read)(parameters, &what, &elsewhere, diagnostics)?;
    keys::is_in_range((kind.schema)(), parameters, diagnostics).then_some((kind, read))
}

/// A source as far as it could be read.
struct Part<'a> {
    name: &'a str,
    place: Place,
    kind: Option<(&'static Registered<SourceKind>, Box<dyn Source>)>,
    keys: Option<SourceKeys>,
    thinning: Option<Thinning>,
    folder: PathBuf,
    /// Where its `channels` stand; at its name without.
    at: Place,
    /// None where it takes all that no other names.
    claims: Option<Vec<Claim>>,
}

/// Reads all sources; what is wrong is reported.
pub(super) fn read(
    section: &Value,
    graph: &GraphFile,
    plan: &Plan,
    files: &Sources,
    diagnostics: &mut Diagnostics,
) -> Vec<DeclaredSource> {
    let channels = GraphChannels::new(graph);
    let before = diagnostics.error_count();
    let named = section.as_table().into_iter().flat_map(Table::iter);
    let parts = named.map(|(name, entry)| part(name, entry, &channels, files, diagnostics));
    let mut parts: Vec<Part<'_>> = parts.collect();
    let is_whole = diagnostics.error_count() == before;
    let taken = share(&mut parts, &channels, diagnostics);
    // Where some are not read, what lacks a source may be theirs.
    if is_whole {
        let lacks =
            |channel: &usize| !plan.sources[*channel].optional && !taken.contains_key(channel);
        let mut lacking = (0..plan.sources.len()).filter(lacks);
        if let Some(first) = lacking.next() {
            let problem = NoSource {
                channel: plan.sources[first].name.clone(),
                more: lacking.count(),
            };
            diagnostics.report(section.place, problem);
        }
    }
    let declared = parts
        .into_iter()
        .filter_map(|part| declared(part, plan, diagnostics));
    declared.collect()
}

fn part<'a>(
    name: &'a str,
    entry: &'a Entry,
    channels: &GraphChannels<'_>,
    files: &Sources,
    diagnostics: &mut Diagnostics,
) -> Part<'a> {
    let (own, others) = keys::split(&entry.value, &KEYS);
    let (_, parameters) = keys::split(&others, &["type"]);
    let (named, own) = keys::split(&own, &["channels"]);
    let what = format!("the source `{name}`");
    let named = named.as_table().and_then(|table| table.get("channels"));
    let role = ("source", name);
    let kind = of_kind::<dyn Source>(role, entry, &parameters, &KEYS, diagnostics);
    let mut claims = named.map(|value| channels.read(value, diagnostics));
    let addressed = claims.as_ref().map_or(0, Vec::len);
    let remarks = kind.as_ref().map(|(_, source)| source.remarks(addressed));
    keys::report(remarks.unwrap_or_default(), &entry.value, diagnostics);
    let mappings = kind.as_ref().map(|(_, source)| source.mappings());
    for (nth, mapping) in mappings.iter().flatten().enumerate() {
        let own = channels.own(nth, mapping, &parameters, diagnostics);
        claims.get_or_insert_default().extend(own);
    }
    let keys = keys::read::<SourceKeys>(&own, &what, diagnostics);
    let thinning = keys
        .as_ref()
        .and_then(|of| of.thinning(&entry.value, diagnostics));
    Part {
        name,
        place: entry.key,
        kind,
        keys,
        thinning,
        folder: files.resolve(entry.value.place_of("path"), ""),
        at: named.map_or(entry.key, |value| value.place),
        claims,
    }
}

/// Gives each channel to its source: those that are named first, then the others. Those with two are reported. What is given, by number.
fn share<'a>(
    parts: &mut [Part<'a>],
    channels: &GraphChannels<'_>,
    diagnostics: &mut Diagnostics,
) -> HashMap<usize, (&'a str, Place)> {
    let mut taken: HashMap<usize, (&str, Place)> = HashMap::new();
    let (named, open): (Vec<_>, Vec<_>) = parts.iter_mut().partition(|of| of.claims.is_some());
    for part in named {
        // By where a channel is named the second time, and the first.
        let mut twice: Vec<(Place, ChannelTwice)> = Vec::new();
        let claims = part.claims.iter_mut().flatten();
        for claim in claims {
            let Some(&(first, place)) = taken.get(&claim.channel) else {
                taken.insert(claim.channel, (part.name, claim.place));
                continue;
            };
            let mut known = twice.iter_mut();
            match known.find(|(at, of)| *at == claim.place && of.place == place) {
                Some((_, of)) => of.more += 1,
                None => twice.push((
                    claim.place,
                    ChannelTwice {
                        channel: channels.all()[claim.channel].name.clone(),
                        more: 0,
                        first: first.to_owned(),
                        place,
                    },
                )),
            }
        }
        for (place, problem) in twice {
            diagnostics.report(place, problem);
        }
    }
    let rest: Vec<usize> = (0..channels.all().len())
        .filter(|channel| !taken.contains_key(channel))
        .collect();
    for (nth, part) in open.into_iter().enumerate() {
        let (name, place) = (part.name, part.place);
        if let (1.., Some(channel)) = (nth, rest.first()) {
            let (first, at) = taken[channel];
            let problem = ChannelTwice {
                channel: channels.all()[*channel].name.clone(),
                more: rest.len() - 1,
                first: first.to_owned(),
                place: at,
            };
            diagnostics.report(place, problem);
            continue;
        }
        let claim = |&channel: &usize| Claim::column(channel, place);
        part.claims = Some(rest.iter().map(claim).collect());
        for channel in &rest {
            taken.insert(*channel, (name, place));
        }
    }
    taken
}

fn declared(part: Part<'_>, plan: &Plan, diagnostics: &mut Diagnostics) -> Option<DeclaredSource> {
    let (kind, parameters) = part.kind?;
    let mut claims = part.claims?;
    claims.sort_by_key(|claim| claim.channel);
    if parameters.needs_addresses() {
        let mut without = claims.iter().filter(|claim| claim.address.is_none());
        if let Some(claim) = without.next() {
            let problem = NoAddress {
                kind: kind.name,
                channel: plan.sources[claim.channel].name.clone(),
                more: without.count(),
            };
            diagnostics.report(part.at, problem);
            return None;
        }
    }
    for claim in claims.iter().filter(|of| of.mapped.is_none()) {
        let remark = claim.address.as_ref().and_then(|of| parameters.remark(of));
        keys::report_at(claim.place, remark, diagnostics);
    }
    let keys = part.keys?;
    let channel = |claim: Claim| {
        let channel = plan.sources[claim.channel].clone();
        DeclaredChannel {
            address: claim.address.unwrap_or_else(|| channel.column.clone()),
            channel,
            mapped: claim.mapped,
            conversion: claim.conversion,
            late: claim.late.unwrap_or(keys.late),
        }
    };
    Some(DeclaredSource {
        name: part.name.to_owned(),
        kind,
        parameters,
        folder: part.folder,
        silent: keys.silent,
        retry: keys.retry,
        channels: claims.into_iter().map(channel).collect(),
        clock: keys.clock.map(ClockRule::from),
        thinning: part.thinning,
    })
}
