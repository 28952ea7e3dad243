//! `messages` of a source: which topics give which channels, and where they have them.

use std::collections::BTreeMap;

use athermal_core::document::fill_placeholders;
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use athermal_serve::connector::{Mapping, WiredChannel};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::payload::{Form, Quality, Time, Values};
use crate::topic::{self, Topic};

/// Messages of some topics, and what they say of channels.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Messages {
    /// The topic. `{set}` is a member of a set, any other name in braces is one level; `+` and `#` are as in MQTT.
    pub topic: String,
    /// The channel, or a pattern of them with `{set}`, that one value of a message is of.
    #[serde(default)]
    pub channel: Option<String>,
    /// Where the value stands: a JSON pointer such as "/value"; without it the whole message is a number. With `each` within one of the list.
    #[serde(default)]
    pub value: Option<String>,
    /// The unit of the value; that of the signal without.
    #[serde(default)]
    pub unit: Option<Unit>,
    /// A value no later than this is given to the next tick.
    #[serde(default)]
    pub late: Option<Duration>,
    /// Several channels of one message: for each JSON pointer, or for each name with `each`, its channel.
    #[serde(default)]
    pub channels: BTreeMap<String, ChannelOf>,
    /// Where a list of objects stands that have a name and a value each: a JSON pointer, "" for the message itself.
    #[serde(default)]
    pub each: Option<String>,
    /// With `each`: where an object has its name, a JSON pointer.
    #[serde(default)]
    pub name: Option<String>,
    /// Where the time stands, if elsewhere than the source says.
    #[serde(default)]
    pub time: Option<TimeForm>,
    /// How a message says that a value is good; what is not is left out.
    #[serde(default)]
    pub quality: Option<QualityForm>,
    /// Where a message has a number that grows by one, a JSON pointer: what is missing is reported as a gap.
    #[serde(default)]
    pub sequence: Option<String>,
}

/// A channel of several of one message.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ChannelOf {
    /// The channel, or a pattern of them.
    Named(String),
    /// The same, with its unit and how late it may be.
    Mapped {
        /// The channel, or a pattern of them.
        channel: String,
        /// The unit of the value; that of the signal without.
        #[serde(default)]
        unit: Option<Unit>,
        /// A value no later than this is given to the next tick.
        #[serde(default)]
        late: Option<Duration>,
    },
}

/// Where the time of a value stands.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum TimeForm {
    /// "arrival": nowhere, so that it is that of the arrival. What comes again after an outage is then taken for new.
    Arrival(Arrival),
    /// In the message.
    There {
        /// Where, a JSON pointer.
        at: String,
        /// The unit of the number that stands there, counted from 1970-01-01T00:00:00Z; a text of RFC 3339 without.
        #[serde(default)]
        unit: Option<Unit>,
    },
}

/// That of the arrival.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Arrival {
    /// That of the arrival.
    Arrival,
}

/// How a message says that a value is good.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QualityForm {
    /// Where, a JSON pointer.
    pub at: String,
    /// What stands there for good values, such as [192] or ["good"].
    pub good: Vec<serde_json::Value>,
}

/// A mistake of parameters: where it stands below the source, and why it is one.
pub type Mistake = (Vec<String>, String);

impl Messages {
    /// The channels that it names, in the order of [`mappings`](Self::mappings).
    fn named(&self) -> Vec<(&str, &str, Option<&Unit>, Option<Duration>)> {
        let several = self.channels.iter().map(|(key, of)| match of {
            ChannelOf::Named(channel) => (key.as_str(), channel.as_str(), None, None),
            ChannelOf::Mapped {
                channel,
                unit,
                late,
            } => (key.as_str(), channel.as_str(), unit.as_ref(), *late),
        });
        let one = self.channel.as_deref();
        let one = one.map(|channel| ("", channel, self.unit.as_ref(), self.late));
        one.into_iter().chain(several).collect()
    }

    /// What it says of channels, as the service knows them. `nth` is its number in the list.
    pub fn mappings(&self, nth: usize) -> Vec<Mapping> {
        let own = ["messages".to_owned(), nth.to_string()];
        let mapping = |(key, channel, unit, late): (&str, &str, Option<&Unit>, _)| {
            let (more, place) = match key {
                "" => (
                    vec!["channel".to_owned()],
                    self.value.as_deref().unwrap_or(""),
                ),
                key => (vec!["channels".to_owned(), key.to_owned()], key),
            };
            Mapping {
                at: [&own[..], &more].concat(),
                channel: channel.to_owned(),
                address: match place {
                    "" => self.topic.clone(),
                    place => format!("{} at {place}", self.topic),
                },
                unit: unit.cloned(),
                late,
            }
        };
        self.named().into_iter().map(mapping).collect()
    }

    /// What is wrong with it.
    pub fn mistakes(&self, has_time: bool) -> Vec<Mistake> {
        let mut all = Vec::new();
        let mut wrong = |key: &str, why: String| all.push((vec![key.to_owned()], why));
        if let Some(why) = topic::mistake(&self.topic) {
            wrong("topic", why);
        }
        if self.channel.is_some() != self.channels.is_empty() {
            wrong(
                "topic",
                "it names either one `channel`, or several `channels`".to_owned(),
            );
        }
        if self.each.is_some()
            && (self.channel.is_some() || self.name.is_none() || self.value.is_none())
        {
            let why = "a list needs `name`, `value` and `channels`: where one of it has its name and value, and the channel of each name";
            wrong("each", why.to_owned());
        }
        if self.each.is_none() && self.name.is_some() {
            wrong(
                "name",
                "`name` is of a list: `each` says where it stands".to_owned(),
            );
        }
        if self.each.is_none() && self.channel.is_none() && self.value.is_some() {
            wrong(
                "value",
                "the keys of `channels` say where their values stand".to_owned(),
            );
        }
        let pointers = [
            ("value", self.value.as_deref()),
            ("name", self.name.as_deref()),
            ("each", self.each.as_deref()),
            ("sequence", self.sequence.as_deref()),
        ];
        let keys = self.channels.keys().filter(|_| self.each.is_none());
        let keys = keys.map(|key| ("channels", Some(key.as_str())));
        for (key, pointer) in pointers.into_iter().chain(keys) {
            if let Some(pointer) = pointer.filter(|of| !of.is_empty() && !of.starts_with('/')) {
                wrong(
                    key,
                    format!("\"{pointer}\" is no JSON pointer: write \"/{pointer}\""),
                );
            }
        }
        let is_plain = self.channel.is_some() && self.value.is_none();
        match &self.time {
            _ if is_plain && !matches!(self.time, Some(TimeForm::Arrival(_))) => {
                let why = "a message that is a number has no time: write `time = \"arrival\"`, or where the `value` stands";
                wrong("topic", why.to_owned());
            }
            None if !has_time => {
                let why = "where the time stands is not known: write `time = { at = \"/…\" }`, or `time = \"arrival\"`";
                wrong("topic", why.to_owned());
            }
            Some(form) => {
                if let Some(why) = form.mistake() {
                    wrong("time", why);
                }
            }
            None => {}
        }
        all
    }

    /// The forms of its messages, each with the topic: one for each topic that its sets give. `wired` are the channels of this one, by
    /// their numbers, each with which of [`mappings`](Self::mappings) it is of.
    pub fn forms(
        &self,
        time: Option<&TimeForm>,
        wired: &[(usize, usize, &WiredChannel)],
    ) -> Vec<(Topic, Form)> {
        let named = self.named();
        let mut forms: Vec<(Topic, Form)> = Vec::new();
        for &(channel, nth, of) in wired {
            let members = of.mapped.as_ref().map_or(&[][..], |of| &of.members);
            let topic = Topic::new(&self.topic, members);
            let pairs: Vec<_> = members
                .iter()
                .map(|(name, of)| (name.as_str(), of.as_str()))
                .collect();
            let key = named.get(nth).map_or("", |(key, ..)| key);
            let key = fill_placeholders(key, &pairs);
            let there = forms.iter().position(|(known, _)| *known == topic);
            // One value has a form of its own; those of one message share it.
            let place = there.filter(|_| self.channel.is_none()).unwrap_or_else(|| {
                forms.push((topic, self.empty_form(time, channel)));
                forms.len() - 1
            });
            match &mut forms[place].1.values {
                Values::Fields(fields) => fields.push((key, channel)),
                Values::Each { channels, .. } => {
                    channels.insert(key, channel);
                }
                Values::Plain(_) | Values::One(..) => {}
            }
        }
        forms
    }

    fn empty_form(&self, time: Option<&TimeForm>, channel: usize) -> Form {
        let text = |of: &Option<String>| of.clone().unwrap_or_default();
        let values = match (&self.each, &self.value) {
            (Some(list), _) => Values::Each {
                list: list.clone(),
                name: text(&self.name),
                value: text(&self.value),
                channels: std::collections::HashMap::new(),
            },
            (None, _) if self.channel.is_none() => Values::Fields(Vec::new()),
            (None, Some(at)) => Values::One(at.clone(), channel),
            (None, None) => Values::Plain(channel),
        };
        Form {
            time: self
                .time
                .as_ref()
                .or(time)
                .map_or(Time::Arrival, TimeForm::time),
            sequence: self.sequence.clone(),
            quality: self.quality.as_ref().map(|of| Quality {
                at: of.at.clone(),
                good: of.good.clone(),
            }),
            values,
        }
    }

    /// Whether its values have the time of their arrival.
    pub fn is_stamped_at_arrival(&self, time: Option<&TimeForm>) -> bool {
        matches!(self.time.as_ref().or(time), Some(TimeForm::Arrival(_)))
    }
}

impl TimeForm {
    fn unit_ns(unit: &Unit) -> Option<i64> {
        let ns = unit.factor_to(&Unit::second())? * 1e9;
        (1.0..1e18).contains(&ns).then(|| ns.round() as i64)
    }

    /// Why it is none, if so.
    pub fn mistake(&self) -> Option<String> {
        let Self::There { at, unit } = self else {
            return None;
        };
        if !at.starts_with('/') {
            return Some(format!("\"{at}\" is no JSON pointer: write \"/{at}\""));
        }
        let unit = unit.as_ref().filter(|unit| Self::unit_ns(unit).is_none())?;
        Some(format!(
            "{unit} is no unit of time: write \"s\", \"ms\", \"us\" or \"ns\""
        ))
    }

    /// How it is read.
    fn time(&self) -> Time {
        match self {
            Self::Arrival(_) => Time::Arrival,
            Self::There { at, unit } => Time::At(at.clone(), unit.as_ref().and_then(Self::unit_ns)),
        }
    }
}
