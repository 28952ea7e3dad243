//! What is asked of alarms, and what is answered.

use std::sync::Arc;

use athermal_http::{Answerer, Asked, Gives, Refused, Reply, Route};
use athermal_serve::companion::Beside;
use athermal_serve::{facts, register_facts};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::alarm::Became;
use crate::watch::{Watch, Watched};

/// Something that became of an alarm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Change {
    /// Its number, from 1 on.
    pub number: u64,
    /// The instant of the tick, in s.
    pub time_s: f64,
    /// When the host's clock said so, in s since 1970.
    pub host_s: f64,
    /// The alarm.
    pub alarm: String,
    /// What became of it.
    pub change: Became,
    /// What it means, for people.
    pub text: Option<String>,
    /// The output or channel.
    pub of: String,
    /// Its value; `null` where it has none.
    pub value: Option<f64>,
    /// The unit of that.
    pub unit: String,
    /// Who acknowledged it.
    pub by: Option<String>,
}

/// What a receiver is given.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Message {
    /// The machine.
    pub machine: String,
    /// How many changes this is about.
    pub count: u64,
    /// How many of them are left out, since there are too many.
    pub left_out: u64,
    /// The changes, the oldest first.
    pub changes: Vec<Change>,
}

/// The alarms now.
#[derive(Debug, Serialize, JsonSchema)]
pub struct AlarmsNow {
    /// The alarms.
    pub alarms: Vec<AlarmNow>,
    /// The last changes, the oldest first.
    pub changes: Vec<Change>,
}

/// An alarm now.
#[derive(Debug, Serialize, JsonSchema)]
pub struct AlarmNow {
    /// Its name.
    pub name: String,
    /// What it means, for people.
    pub text: Option<String>,
    /// The output or channel.
    pub of: String,
    /// The unit of that.
    pub unit: String,
    /// `clear`, `raised` or `acknowledged`.
    pub state: &'static str,
    /// Since when, by the host's clock, in s since 1970.
    pub since_s: Option<f64>,
    /// Who acknowledged it.
    pub by: Option<String>,
    /// The value at the last tick that had one.
    pub value: Option<f64>,
}

facts! {
    /// The alarms.
    AlarmsFacts(of: &Watch) {
        /// The alarms.
        alarms: Vec<AlarmFacts> = of.now().iter().map(AlarmFacts::read).collect();
        /// Who is to know of them.
        receivers: Vec<ReceiverFacts> = of.receivers().into_iter().map(|(name, waiting, failed)| ReceiverFacts::read(name, waiting, failed)).collect();
        /// Changes that came faster than they could be taken down.
        missed: u64 [counter "athermal_alarms_missed_total"] = of.missed();
        /// Why they cannot be written.
        failed: Option<String> [line "alarms cannot be written: {failed}"] = of.failed();
    }

    /// An alarm.
    AlarmFacts(of: &AlarmNow) {
        /// Its name.
        alarm: String [label] = of.name.clone();
        /// `clear`, `raised` or `acknowledged`.
        state: &'static str [gauge "athermal_alarm" |of: &Self| Some(f64::from(u8::from(of.state != "clear")))] = of.state;
        /// What it means, for people.
        text: Option<String> = of.text.clone();
    }

    /// A receiver of alarms.
    ReceiverFacts(name: String, waiting: u64, failed: Option<String>) {
        /// Its name.
        receiver: String [label] = name;
        /// Changes that it has not taken.
        waiting: u64 [gauge "athermal_alarm_changes_waiting"] = waiting;
        /// Why it does not take them.
        failed: Option<String> [line "alarms wait for {receiver}: {failed}"] = failed;
    }
}

register_facts!(AlarmsFacts, "alarms");

/// `POST /v1/alarms/acknowledge`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Acknowledge {
    /// The alarm.
    name: String,
}

athermal_http::mount!(Route::get(
    "/v1/alarms",
    "The alarms, and what became of them last.",
    Gives::json::<AlarmsNow>(),
    Answerer::Beside(answer),
));

athermal_http::mount!(Route::post(
    "/v1/alarms/acknowledge",
    "Says that somebody knows of an alarm that is raised.",
    |of| of.subschema_for::<Acknowledge>(),
    Gives::json::<Change>(),
    Answerer::Beside(acknowledge),
));

fn watch(beside: &Beside) -> Result<Arc<Watch>, Refused> {
    let lacks = || Refused::nothing_here("the machine file declares no alarms");
    beside.shared.find::<Watch>().ok_or_else(lacks)
}

fn answer(beside: &Beside, _: &Asked) -> Result<Reply, Refused> {
    let watch = watch(beside)?;
    Ok(Reply::json(&AlarmsNow {
        alarms: watch.now(),
        changes: watch.changes(),
    }))
}

fn acknowledge(beside: &Beside, asked: &Asked) -> Result<Reply, Refused> {
    let Acknowledge { name } = asked.read()?;
    let done = watch(beside)?.acknowledge(&name, &asked.by);
    Ok(Reply::json(
        &done.map_err(|words| Refused::not_now(&words))?,
    ))
}

impl Watched {
    /// How it is now, with what became of it last.
    pub(crate) fn now(&self, last: Option<&Change>) -> AlarmNow {
        let state = last.map(|of| of.change);
        AlarmNow {
            name: self.name.clone(),
            text: self.alarm.text.clone(),
            of: self.of.clone(),
            unit: self.unit.clone(),
            state: match state {
                Some(Became::Raised) => "raised",
                Some(Became::Acknowledged) => "acknowledged",
                Some(Became::Gone) | None => "clear",
            },
            since_s: last.map(|of| of.host_s),
            by: last.and_then(|of| of.by.clone()),
            value: Some(self.value).filter(|of| !of.is_nan()),
        }
    }
}
