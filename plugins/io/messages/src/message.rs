//! `messages` of a source: which topics give which channels, and where they have them.

use std::collections::BTreeMap;

use athermal_core::document::{fill_placeholders, placeholders};
use athermal_core::node::Forms;
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use athermal_serve::connector::{Mapping, WiredChannel};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

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
    /// The unit of its values, but of those that name their own; that of the signal without.
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
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub enum ChannelOf {
    /// The channel, or a pattern of them.
    Named(String),
    /// The same, with its unit and how late it may be.
    Mapped(MappedChannel),
}

/// A channel, with what is said of its values.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MappedChannel {
    /// The channel, or a pattern of them.
    channel: String,
    /// The unit of the value; that of the message without, or of the signal.
    #[serde(default)]
    unit: Option<Unit>,
    /// A value no later than this is given to the next tick.
    #[serde(default)]
    late: Option<Duration>,
}

impl<'de> Deserialize<'de> for ChannelOf {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a channel, or a table with `channel`, `unit` and `late`")
            .text(Self::Named)
            .table(Self::Mapped)
            .read(deserializer)
    }
}

/// Where the time of a value stands.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub enum TimeForm {
    /// "arrival": nowhere, so that it is that of the arrival. What comes again after an outage is then taken for new.
    Arrival(Arrival),
    /// In the message.
    There(TimePlace),
}

/// Where a message has its time.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimePlace {
    /// Where, a JSON pointer.
    at: String,
    /// The unit of the number that stands there, counted from 1970-01-01T00:00:00Z; a text of RFC 3339 without.
    #[serde(default)]
    unit: Option<Unit>,
}

impl<'de> Deserialize<'de> for TimeForm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("\"arrival\", or a table with `at` and `unit`")
            .text(Self::Arrival)
            .table(Self::There)
            .read(deserializer)
    }
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
    /// What stands there for good values, such as `[192]` or `["good"]`.
    pub good: Vec<serde_json::Value>,
}

/// A mistake of parameters: where it stands below the source, and why it is one.
pub type Mistake = (Vec<String>, String);

impl Messages {
    /// The channels that it names, in the order of [`mappings`](Self::mappings).
    fn named(&self) -> Vec<(&str, &str, Option<&Unit>, Option<Duration>)> {
        let (unit, late) = (self.unit.as_ref(), self.late);
        let several = self.channels.iter().map(|(key, of)| match of {
            ChannelOf::Named(channel) => (key.as_str(), channel.as_str(), unit, late),
            ChannelOf::Mapped(of) => {
                let own = (of.unit.as_ref().or(unit), of.late.or(late));
                (key.as_str(), of.channel.as_str(), own.0, own.1)
            }
        });
        let one = self.channel.as_deref();
        let one = one.map(|channel| ("", channel, unit, late));
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
    pub fn mistakes(&self, time: Option<&TimeForm>) -> Vec<Mistake> {
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
        for (key, text, channel) in self.places() {
            let known: Vec<_> = channel
                .into_iter()
                .flat_map(placeholders)
                .chain(channel.map(|_| "channel"))
                .collect();
            if let Some(name) = placeholders(text).find(|name| !known.contains(name)) {
                let why = match channel {
                    Some(channel) => {
                        format!("`{{{name}}}` stands for nothing: it is no set of `{channel}`")
                    }
                    None => format!("`{{{name}}}` stands for nothing that all `channels` share"),
                };
                wrong(key, why);
            }
        }
        let is_plain = self.channel.is_some() && self.value.is_none();
        for (key, is_there) in [
            ("quality", self.quality.is_some()),
            ("sequence", self.sequence.is_some()),
        ] {
            if is_plain && is_there {
                wrong(
                    key,
                    format!(
                        "a message that is a number has no {key}: say where its `value` stands"
                    ),
                );
            }
        }
        match &self.time {
            _ if is_plain && !self.is_stamped_at_arrival(time) => {
                let why = "a message that is a number has no time: write `time = \"arrival\"`, or where the `value` stands";
                wrong("topic", why.to_owned());
            }
            None if time.is_none() => {
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

    /// Places in a message that may have sets in them, with their keys, and the channels whose sets they are.
    fn places(&self) -> Vec<(&str, &str, Option<&str>)> {
        let time = self.time.as_ref().and_then(|of| match of {
            TimeForm::Arrival(_) => None,
            TimeForm::There(of) => Some(&of.at),
        });
        let own = [
            ("value", self.value.as_ref()),
            ("name", self.name.as_ref()),
            ("each", self.each.as_ref()),
            ("sequence", self.sequence.as_ref()),
            ("time", time),
            ("quality", self.quality.as_ref().map(|of| &of.at)),
        ];
        let channel = self.channel.as_deref();
        let own = own
            .into_iter()
            .filter_map(|(key, text)| Some((key, text?.as_str(), channel)));
        let named = self.named().into_iter().filter(|(key, ..)| !key.is_empty());
        let keys = named.map(|(key, channel, ..)| ("channels", key, Some(channel)));
        own.chain(keys).collect()
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
                forms.push((topic, self.empty_form(time, channel, &pairs)));
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

    fn empty_form(
        &self,
        time: Option<&TimeForm>,
        channel: usize,
        members: &[(&str, &str)],
    ) -> Form {
        let fill = |of: &str| fill_placeholders(of, members);
        let text = |of: &Option<String>| of.as_deref().map(fill).unwrap_or_default();
        let values = match (&self.each, &self.value) {
            (Some(list), _) => Values::Each {
                list: fill(list),
                name: text(&self.name),
                value: text(&self.value),
                channels: std::collections::HashMap::new(),
            },
            (None, _) if self.channel.is_none() => Values::Fields(Vec::new()),
            (None, Some(at)) => Values::One(fill(at), channel),
            (None, None) => Values::Plain(channel),
        };
        Form {
            time: self
                .time
                .as_ref()
                .or(time)
                .map_or(Time::Arrival, |of| of.time(fill)),
            sequence: self.sequence.as_deref().map(fill),
            quality: self.quality.as_ref().map(|of| Quality {
                at: fill(&of.at),
                good: of.good.clone(),
            }),
            values,
            instants: Box::default(),
            flags: Box::default(),
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
        let Self::There(TimePlace { at, unit }) = self else {
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
    fn time(&self, fill: impl Fn(&str) -> String) -> Time {
        match self {
            Self::Arrival(_) => Time::Arrival,
            Self::There(TimePlace { at, unit }) => {
                Time::At(fill(at), unit.as_ref().and_then(Self::unit_ns))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(text: &str) -> Messages {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn a_unit_of_a_message_is_that_of_all_its_values_but_of_those_that_have_their_own() {
        let of = messages(
            "topic = \"a\"\nunit = \"degF\"\nlate = \"2s\"\n\
             channels = { \"/x\" = \"temperature.x\", \"/y\" = { channel = \"temperature.y\", unit = \"Cel\" } }",
        );
        let units: Vec<_> = of
            .mappings(0)
            .into_iter()
            .map(|of| (of.unit.map(|of| of.text().to_owned()), of.late))
            .collect();
        let late = Some(Duration::from_ns(2_000_000_000));
        assert_eq!(units.len(), 2);
        assert_eq!(units[0].1, late);
        assert_eq!(units[1].1, late);
        let fahrenheit: Unit = Unit::parse("degF").unwrap();
        assert_eq!(units[0].0.as_deref(), Some(fahrenheit.text()));
        assert_eq!(units[1].0.as_deref(), Some("Cel"));
    }

    #[test]
    fn a_key_that_is_none_is_refused_also_within_a_channel_or_a_time() {
        for text in [
            "topic = \"a\"\nchannels = { \"/x\" = { channel = \"t.x\", units = \"Cel\" } }",
            "topic = \"a\"\ntime = { at = \"/t\", units = \"ms\" }",
            "topic = \"a\"\ntime = \"departure\"",
        ] {
            let read = toml::from_str::<Messages>(text);
            let error = read.unwrap_err().to_string();
            let is_named = error.contains("units") || error.contains("departure");
            assert!(is_named, "{error}");
        }
    }

    #[test]
    fn what_a_number_cannot_say_and_what_stands_for_nothing_is_a_mistake() {
        let plain = "topic = \"a\"\nchannel = \"t.x\"\ntime = \"arrival\"\n";
        let one =
            "topic = \"a/{s}\"\nchannel = \"t.{s}\"\ntime = \"arrival\"\nvalue = \"/{s}/v\"\n";
        let several = "topic = \"a\"\ntime = \"arrival\"\nchannels = { \"/T/{s}\" = \"t.{s}\" }\n";
        for (text, key) in [
            (plain.to_owned(), None),
            (format!("{plain}sequence = \"/n\""), Some("sequence")),
            (
                format!("{plain}quality = {{ at = \"/q\", good = [192] }}"),
                Some("quality"),
            ),
            (one.to_owned(), None),
            (one.replace("/{s}/v", "/{other}/v"), Some("value")),
            (several.to_owned(), None),
            (several.replace("/T/{s}", "/T/{other}"), Some("channels")),
            (
                format!("{several}sequence = \"/{{s}}/n\""),
                Some("sequence"),
            ),
        ] {
            let mistakes = messages(&text).mistakes(None);
            let keys: Vec<_> = mistakes.iter().map(|(at, _)| at[0].as_str()).collect();
            assert_eq!(keys, Vec::from_iter(key), "{text}: {mistakes:?}");
        }
    }

    #[test]
    fn plain_numbers_have_the_time_of_their_arrival_where_the_source_says_so() {
        let (arrival, there) = (
            TimeForm::Arrival(Arrival::Arrival),
            TimeForm::There(TimePlace {
                at: "/t".to_owned(),
                unit: None,
            }),
        );
        let plain = "topic = \"x/{s}\"\nchannel = \"t.{s}\"\n";
        let own = format!("{plain}time = {{ at = \"/t\" }}\n");
        for (text, time, mistakes) in [
            (plain, Some(&arrival), 0),
            (plain, Some(&there), 1),
            (plain, None, 1),
            (&own, Some(&arrival), 1),
        ] {
            let found = messages(text).mistakes(time);
            assert_eq!(found.len(), mistakes, "{text}: {found:?}");
        }
        let form = messages(plain).empty_form(Some(&arrival), 0, &[]);
        let at = athermal_core::time::Instant::from_ns(7);
        assert_eq!(form.read(b"21.5", at).given[0].stamp, at);
    }

    #[test]
    fn a_set_in_the_place_of_a_value_is_filled_in() {
        let of = messages(
            "topic = \"a\"\nchannel = \"t.{s}\"\nvalue = \"/{s}/v\"\ntime = { at = \"/{s}/t\", unit = \"s\" }",
        );
        let form = of.empty_form(None, 0, &[("s", "plate")]);
        let read = form.read(
            br#"{"plate": {"v": 21.5, "t": 7}}"#,
            athermal_core::time::Instant::from_ns(0),
        );
        assert_eq!(read.given.len(), 1, "{read:?}");
        assert_eq!(read.given[0].value.to_bits(), 21.5_f64.to_bits());
        assert_eq!(read.given[0].stamp.as_ns(), 7_000_000_000);
    }
}
