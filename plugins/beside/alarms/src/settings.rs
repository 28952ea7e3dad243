//! `[alarms.NAME]`: what is looked for, and who is to know of it.

use athermal_core::compile::Plan;
use athermal_core::diagnostic::Diagnostics;
use athermal_core::document::Value;
use athermal_core::node::Forms;
use athermal_core::quantity::Quantity;
use athermal_core::time::Duration;
use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::ConnectorError;
use athermal_serve::deployment::problem::UnfitParameter;
use athermal_serve::deployment::{DeclaredSink, Secret};
use athermal_serve::register_companion;
use athermal_serve::shown::{Shown, place_of};
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::alarm::Limit;

/// The alarms of a service, by their names.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Alarms(pub IndexMap<String, Alarm>);

/// An alarm: of one of `above`, `below` and `absent`. A value that is absent neither raises nor clears one of the others.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Alarm {
    /// An output or a channel, such as "now.Z"; of "now" each of its channels has the alarm.
    pub of: String,
    /// A value above this is one: "80 nm/min", or a number in the unit of the channel.
    #[serde(default)]
    pub above: Option<Threshold>,
    /// A value below this is one.
    #[serde(default)]
    pub below: Option<Threshold>,
    /// That there is no value is one.
    #[serde(default)]
    pub absent: bool,
    /// How long it must last, such as "2min"; at once without, and a minute for `absent`.
    #[serde(default, rename = "for")]
    pub lasts: Option<Duration>,
    /// How far back from its limit a value must be until the alarm is gone.
    #[serde(default)]
    pub hysteresis: Option<Threshold>,
    /// What it means, for people.
    #[serde(default)]
    pub text: Option<String>,
    /// The MQTT topic to which it is published, over a sink that speaks MQTT.
    #[serde(default)]
    pub topic: Option<String>,
    /// That sink, where there are several.
    #[serde(default)]
    pub sink: Option<String>,
    /// The address to which it is posted as JSON, until it is taken there: { file = "…" } or { env = "…" }. It is a secret.
    #[serde(default)]
    pub webhook: Option<Secret>,
}

/// A size in a unit, or a number in that of the channel.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
#[schemars(untagged)]
pub enum Threshold {
    /// In the unit of the channel.
    Number(f64),
    /// With a unit of its own.
    Quantity(Quantity),
}

impl<'de> Deserialize<'de> for Threshold {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a quantity such as \"80 nm/min\", or a number")
            .number(Self::Number)
            .text(Self::Quantity)
            .read(deserializer)
    }
}

register_companion!(Alarms, "alarms");

impl Threshold {
    /// In the unit of a channel; why not otherwise. `is_size`: it is a difference.
    fn read(&self, plan: &Plan, shown: Shown, is_size: bool) -> Result<f64, String> {
        let unit = &plan.channels[shown.slot(plan)].channel.unit;
        let unit = if is_size {
            unit.difference()
        } else {
            unit.clone()
        };
        match self {
            Self::Number(number) if number.is_finite() => Ok(*number),
            Self::Number(number) => Err(format!("{number} is no limit")),
            Self::Quantity(quantity) => {
                let value = match is_size {
                    true => quantity.as_difference(&unit),
                    false => quantity.in_unit(&unit),
                };
                let Quantity {
                    value: found,
                    unit: of,
                } = quantity;
                let name = shown.name(plan);
                value.ok_or_else(|| format!("`{name}` is in {unit}, and \"{found} {of}\" is not"))
            }
        }
    }
}

impl Alarm {
    /// What is looked for of a channel, and by how much a value must be back; what is wrong, and at which key.
    pub(crate) fn limit(
        &self,
        plan: &Plan,
        shown: Shown,
    ) -> Result<(Limit, f64), (&'static str, String)> {
        let read =
            |key, of: &Threshold, is_size| of.read(plan, shown, is_size).map_err(|why| (key, why));
        let limit = match (&self.above, &self.below, self.absent) {
            (Some(above), None, false) => Limit::Above(read("above", above, false)?),
            (None, Some(below), false) => Limit::Below(read("below", below, false)?),
            (None, None, true) => Limit::Absent,
            _ => {
                return Err((
                    "of",
                    "an alarm is of one of `above`, `below` and `absent = true`".to_owned(),
                ));
            }
        };
        let hysteresis = self.hysteresis.as_ref();
        let hysteresis = hysteresis.map_or(Ok(0.0), |of| read("hysteresis", of, true))?;
        if hysteresis < 0.0 || hysteresis > 0.0 && limit == Limit::Absent {
            return Err((
                "hysteresis",
                "`hysteresis` is how far back from a limit a value must be".to_owned(),
            ));
        }
        if self.lasts.is_some_and(|of| of < Duration::ZERO) {
            return Err(("for", "`for` is how long it must last".to_owned()));
        }
        Ok((limit, hysteresis))
    }

    /// How long it must last.
    pub(crate) fn lasts(&self) -> Duration {
        let usual = if self.absent { 60_000_000_000 } else { 0 };
        self.lasts.unwrap_or(Duration::from_ns(usual))
    }

    /// The sink that its topic goes over, among the names of those that send messages; why not otherwise.
    pub(crate) fn over<'a>(&self, sinks: &[&'a str]) -> Result<Option<&'a str>, String> {
        if self.topic.is_none() {
            return match &self.sink {
                Some(_) => {
                    Err("`sink` is the one over which a `topic` goes, and there is none".to_owned())
                }
                None => Ok(None),
            };
        }
        let there_are = format!("those that send messages are: {}", sinks.join(", "));
        match (&self.sink, sinks) {
            (Some(name), _) => {
                let found = sinks.iter().find(|of| *of == name);
                let found =
                    found.ok_or_else(|| format!("no sink `{name}` sends messages; {there_are}"));
                found.map(|of| Some(*of))
            }
            (None, [one]) => Ok(Some(one)),
            (None, []) => {
                Err("a `topic` goes over a sink that speaks MQTT, and there is none".to_owned())
            }
            (None, _) => Err(format!(
                "over which sink does the `topic` go? Name it as `sink`; {there_are}"
            )),
        }
    }
}

impl Companion for Alarms {
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        if self.0.is_empty() {
            return Ok(Box::new(()));
        }
        crate::watch::start(self, beside)
    }

    fn check(
        &self,
        section: &Value,
        plan: &Plan,
        sinks: &[DeclaredSink],
        diagnostics: &mut Diagnostics,
    ) {
        let sinks = sinks.iter().filter(|of| of.parameters.messages().is_some());
        let sinks: Vec<_> = sinks.map(|of| &*of.name).collect();
        for (name, alarm) in &self.0 {
            let table = section
                .as_table()
                .and_then(|of| of.get(name))
                .unwrap_or(section);
            let what = format!("[alarms.{name}]");
            let named = (&*alarm.of, place_of(table, "of"));
            let all = Shown::declared(plan, named, &what, diagnostics);
            let limit = all.iter().find_map(|(_, of)| alarm.limit(plan, *of).err());
            let over = alarm.over(&sinks).err().map(|words| ("topic", words));
            for (key, words) in limit.into_iter().chain(over) {
                let advice = "an alarm takes `of`, one of `above`, `below` and `absent`, and `for`, `hysteresis`, `text`, `topic`, `sink`, `webhook`".to_owned();
                let words = format!("{what}: {words}");
                diagnostics.report(place_of(table, key), UnfitParameter { words, advice });
            }
        }
    }
}
