//! What is asked of the service, and since when nothing may be said.

use std::time::{Instant as Clock, SystemTime};

use athermal_core::figures;
use athermal_http::client::{Address, escaped};
use serde_json::{Value, json};

/// How much of the past is shown, in s.
pub(crate) const SPANS_S: [f64; 5] = [120.0, 600.0, 3_600.0, 21_600.0, 86_400.0];
/// How many points a curve has.
const POINTS: usize = 400;

/// What is known of a service, and what of it is shown.
pub(crate) struct Known {
    address: Address,
    pub(crate) asked: Clock,
    pub(crate) status: Value,
    pub(crate) now: Value,
    pub(crate) channels: Value,
    pub(crate) outputs: Value,
    pub(crate) alarms: Value,
    pub(crate) history: Value,
    /// Since when there is no answer, and why.
    pub(crate) lost: Option<(f64, String)>,
    /// What was last said of an order.
    pub(crate) said: Option<String>,
    pub(crate) axis: usize,
    pub(crate) span: usize,
    pub(crate) first_sensor: usize,
    pub(crate) is_held: bool,
}

/// The curves of an axis: what they show, the name of the channel, and how they look.
pub(crate) const CURVES: [&str; 3] = ["measured", "predicted", "left"];

fn host_s() -> f64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.map_or(0.0, |of| of.as_secs_f64())
}

impl Known {
    pub(crate) fn new(address: Address) -> Self {
        Self {
            address,
            asked: Clock::now(),
            status: Value::Null,
            now: Value::Null,
            channels: Value::Null,
            outputs: Value::Null,
            alarms: Value::Null,
            history: Value::Null,
            lost: None,
            said: None,
            axis: 0,
            span: 1,
            first_sensor: 0,
            is_held: false,
        }
    }

    /// Asks for all of it.
    pub(crate) fn ask(&mut self) {
        let done = self.ask_all();
        self.asked = Clock::now();
        let before = self.lost.take();
        self.lost = done
            .err()
            .map(|why| (before.map_or_else(host_s, |(since, _)| since), why));
    }

    fn ask_all(&mut self) -> Result<(), String> {
        self.status = self.get("/v1/status")?;
        self.now = self.get("/v1/axes")?;
        self.channels = self.get("/v1/channels")?;
        self.outputs = self.get("/v1/outputs")?;
        // A machine without alarms has none.
        self.alarms = self.get("/v1/alarms").unwrap_or(Value::Null);
        let names: Vec<_> = self.curves().into_iter().map(|(_, name)| name).collect();
        self.history = Value::Null;
        if let Some(last) = self.now["last_s"].as_f64().filter(|_| !names.is_empty()) {
            let mut path = format!(
                "/v1/history?from={}&to={last}&points={POINTS}",
                last - SPANS_S[self.span]
            );
            for name in names {
                path += "&channel=";
                path += &escaped(&name);
            }
            self.history = self.get(&path).unwrap_or(Value::Null);
        }
        Ok(())
    }

    fn get(&self, path: &str) -> Result<Value, String> {
        let reply = self.address.get(path).map_err(|error| error.to_string())?;
        match reply.status {
            200 => Ok(reply.json()),
            status => Err(format!("the service answers {status}")),
        }
    }

    /// Why there has never been an answer.
    pub(crate) fn never(&self) -> Option<String> {
        let (_, why) = self.lost.as_ref().filter(|_| self.status.is_null())?;
        Some(why.clone())
    }

    pub(crate) fn axes(&self) -> &[Value] {
        self.now["axes"].as_array().map_or(&[], Vec::as_slice)
    }

    /// The axis that is shown.
    pub(crate) fn shown(&self) -> Option<&Value> {
        self.axes().get(self.axis).or(self.axes().first())
    }

    /// The curves of the axis that is shown, each with its channel.
    pub(crate) fn curves(&self) -> Vec<(&'static str, String)> {
        let channels = self.shown().map(|axis| &axis["channels"]);
        let channel = |what: &'static str| Some((what, channels?[what][0].as_str()?.to_owned()));
        CURVES.into_iter().filter_map(channel).collect()
    }

    /// Why nothing may be said now, and since when.
    pub(crate) fn doubt(&self) -> Option<String> {
        let since = |s: f64| figures::instant(s);
        if let Some((at, why)) = &self.lost {
            return Some(format!("connection lost since {}: {why}", since(*at)));
        }
        let stale = &self.now["stale"];
        let why = stale["why"].as_str()?;
        Some(format!(
            "{why}, since {}",
            since(stale["since_s"].as_f64().unwrap_or_default())
        ))
    }

    /// Acknowledges the first alarm that is raised.
    pub(crate) fn acknowledge(&mut self) {
        let alarms = self.alarms["alarms"].as_array();
        let raised = alarms
            .into_iter()
            .flatten()
            .find(|of| of["state"] == "raised");
        let Some(name) = raised.and_then(|of| of["name"].as_str()) else {
            self.said = Some("no alarm is raised".to_owned());
            return;
        };
        let done = self
            .address
            .post("/v1/alarms/acknowledge", &json!({ "name": name }));
        self.said = Some(match done {
            Ok(reply) if reply.status == 200 => format!("{name} is acknowledged"),
            Ok(reply) => reply.json()["error"]
                .as_str()
                .unwrap_or("it was refused")
                .to_owned(),
            Err(error) => error.to_string(),
        });
    }
}
