//! How what is kept is cut into stretches for a picture. No extreme is lost: of each stretch there is the lowest and the highest value.

use std::collections::{BTreeMap, BTreeSet};

use athermal_http::{Asked, Refused, Reply};
use athermal_serve::companion::Beside;
use schemars::JsonSchema;
use serde::Serialize;

use crate::settings::Kept;
use crate::store::{Part, STRETCH, Store, WHOLE};

/// How many stretches there may be, and how many there are without `points`.
const POINTS: (i64, i64) = (2_000, 600);
/// How many channels may be asked for at once.
const CHANNELS: usize = 64;

/// What was measured and put out.
#[derive(Debug, Default, Serialize, JsonSchema)]
pub struct Stretches {
    /// From this instant on, in s.
    pub from_s: f64,
    /// Up to this one.
    pub to_s: f64,
    /// How long a stretch is, in s. Those without a tick are left out.
    pub step_s: f64,
    /// The channels.
    pub channels: Vec<Channel>,
    /// The instant of the last tick of each stretch, in s.
    pub time_s: Vec<f64>,
    /// The lowest value in each, by channel; `null` is absent.
    pub lowest: Vec<Vec<Option<f64>>>,
    /// The highest.
    pub highest: Vec<Vec<Option<f64>>>,
    /// The last one.
    pub last: Vec<Vec<Option<f64>>>,
}

/// A channel that is kept.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Channel {
    /// Its name.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// How long a value counts without a newer one, in s; `null` where that is not known.
    pub max_age_s: Option<f64>,
}

/// What is asked for.
#[derive(Debug, Default)]
pub(crate) struct Wanted {
    pub(crate) channels: Vec<String>,
    pub(crate) from: Option<i64>,
    pub(crate) to: Option<i64>,
    pub(crate) points: Option<i64>,
}

pub(crate) fn answer(beside: &Beside, asked: &Asked) -> Result<Reply, Refused> {
    let wanted = Wanted::read(asked)?;
    let lacks = || Refused::not_now("no history is kept");
    let kept = beside.shared.find::<Kept>().ok_or_else(lacks)?;
    let store = kept.store();
    let of = store.asked(&wanted);
    drop(store);
    let text = serde_json::to_string(&of.map_err(|words| Refused::not_understood(&words))?);
    Ok(Reply::text("application/json", text.unwrap_or_default()))
}

impl Wanted {
    fn read(asked: &Asked) -> Result<Self, Refused> {
        let mut wanted = Self::default();
        let wrong = |key: &str| {
            let words = format!(
                "`{key}` is to be a number: `from` and `to` in s since 1970, `points` from 1 to {}",
                POINTS.0
            );
            Refused::not_understood(&words)
        };
        let ns = |key: &str, text: &str| {
            let s: f64 = text.parse().map_err(|_| wrong(key))?;
            // As far as instants go.
            let is_instant = s.is_finite() && s.abs() < 9.2e9;
            is_instant
                .then_some((s * 1e9) as i64)
                .ok_or_else(|| wrong(key))
        };
        for (key, value) in asked.parts()? {
            match key {
                "channel" if wanted.channels.len() < CHANNELS => wanted.channels.push(value),
                "from" => wanted.from = Some(ns(key, &value)?),
                "to" => wanted.to = Some(ns(key, &value)?),
                "points" => {
                    let points = value.parse().map_err(|_| wrong(key))?;
                    let fits = (1..=POINTS.0).contains(&points);
                    wanted.points = Some(fits.then_some(points).ok_or_else(|| wrong(key))?);
                }
                _ => {
                    let words = format!(
                        "`channel=NAME`, {CHANNELS} times at most, `from`, `to` and `points` are what there is"
                    );
                    return Err(Refused::not_understood(&words));
                }
            }
        }
        Ok(wanted)
    }
}

/// What is in a stretch, by channel.
struct Bin {
    last: i64,
    /// Lowest, highest and last.
    values: Vec<[f64; 3]>,
}

impl Store {
    /// What is kept of some channels, or which channels there are; why not otherwise.
    pub(crate) fn asked(&self, wanted: &Wanted) -> Result<Stretches, String> {
        let to = wanted.to.or_else(|| self.newest()).unwrap_or_default();
        let from = wanted.from.unwrap_or(to.saturating_sub(WHOLE));
        if from >= to && wanted.from.is_some() {
            return Err("`from` is to be before `to`".to_owned());
        }
        let channels = match wanted.channels.is_empty() {
            true => self.channels(),
            false => wanted
                .channels
                .iter()
                .map(|of| self.channel(of))
                .collect::<Result<_, _>>()?,
        };
        let points = wanted.points.unwrap_or(POINTS.1);
        let step = ((to - from) / points).max(1);
        let (bins, has_stretches) = match wanted.channels.is_empty() {
            true => (BTreeMap::new(), false),
            false => self.bins(&wanted.channels, from..=to, step),
        };
        let step = if has_stretches {
            step.max(STRETCH)
        } else {
            step
        };
        let some = |value: f64| Some(value).filter(|of| of.is_finite());
        let column = |place: usize, of: usize| {
            let values = bins.values().map(|bin| some(bin.values[place][of]));
            values.collect::<Vec<_>>()
        };
        let columns = |of: usize| {
            (0..wanted.channels.len())
                .map(|place| column(place, of))
                .collect()
        };
        let s = |ns: i64| ns as f64 / 1e9;
        Ok(Stretches {
            from_s: s(from),
            to_s: s(to),
            step_s: s(step),
            channels,
            time_s: bins.values().map(|bin| s(bin.last)).collect(),
            lowest: columns(0),
            highest: columns(1),
            last: columns(2),
        })
    }

    /// All channels that are kept, those of the newest graph first.
    fn channels(&self) -> Vec<Channel> {
        let mut known = BTreeSet::new();
        let parts = self.parts.iter().rev().map(|of| &of.columns);
        let all = parts.flat_map(|of| (0..of.width()).map(move |place| (of, place)));
        let new = all.filter(|(of, place)| known.insert(&of.names[*place]));
        new.map(|(of, place)| of.channel(place)).collect()
    }

    fn channel(&self, name: &str) -> Result<Channel, String> {
        let mut parts = self.parts.iter().rev().map(|of| &of.columns);
        let found = parts.find_map(|of| Some(of.channel(of.place(name)?)));
        let channel = found.ok_or_else(|| {
            format!("`{name}` is not kept; without a channel `/v1/history` says what is")
        })?;
        Ok(Channel {
            channel: name.to_owned(),
            ..channel
        })
    }

    /// The stretches, and whether any is made of what is not kept whole.
    fn bins(
        &self,
        names: &[String],
        within: std::ops::RangeInclusive<i64>,
        step: i64,
    ) -> (BTreeMap<i64, Bin>, bool) {
        let mut bins = BTreeMap::new();
        let mut has_stretches = false;
        for part in &self.parts {
            let places: Vec<_> = names.iter().map(|of| part.columns.place(of)).collect();
            let whole_from = part.rows.times.front().copied();
            let stretches = part.stretches.times.iter().enumerate();
            for (nth, &last) in stretches.filter(|(_, at)| within.contains(at)) {
                if whole_from.is_none_or(|from| last < from) {
                    has_stretches = true;
                    let at =
                        |place, of| part.stretches.value(nth, of * part.columns.width() + place);
                    put(&mut bins, last.div_euclid(step), last, &places, at);
                }
            }
            let rows = part.rows.times.iter().enumerate();
            for (nth, &at) in rows.filter(|(_, at)| within.contains(at)) {
                let value = |place, _| part.rows.value(nth, place);
                put(&mut bins, at.div_euclid(step), at, &places, value);
            }
        }
        (bins, has_stretches)
    }
}

/// Puts values into their stretch.
fn put(
    bins: &mut BTreeMap<i64, Bin>,
    number: i64,
    at: i64,
    places: &[Option<usize>],
    value: impl Fn(usize, usize) -> f64,
) {
    let bin = bins.entry(number).or_insert_with(|| Bin {
        last: i64::MIN,
        values: vec![[f64::NAN; 3]; places.len()],
    });
    let is_last = at >= bin.last;
    bin.last = bin.last.max(at);
    for (kept, place) in bin.values.iter_mut().zip(places) {
        let Some(place) = *place else { continue };
        kept[0] = kept[0].min(value(place, 0));
        kept[1] = kept[1].max(value(place, 1));
        let value = value(place, 2);
        if is_last && !value.is_nan() {
            kept[2] = value;
        }
    }
}

impl Part {
    /// Those of the last stretches that may not change any more: all but the newest, unless the part has ended.
    pub(crate) fn closed(&self, has_ended: bool) -> std::ops::Range<usize> {
        let count = self.stretches.len();
        let begin = count - self.unwritten.1;
        begin..if has_ended {
            count
        } else {
            count.saturating_sub(1).max(begin)
        }
    }
}
