//! Who is to know of alarms: the journal, topics of MQTT, webhooks. Each has a thread of its own, and is given what it has not taken until
//! it has it.

use std::path::Path;
use std::sync::{Arc, PoisonError};
use std::time::Duration as Wait;

use athermal_core::figures;
use athermal_serve::companion::Beside;
use athermal_serve::connector::{BackOff, ConnectorError, Messages, Sink, SinkWiring, Stop};
use athermal_serve::service::ServiceHandle;

use crate::alarm::Became;
use crate::asked::{Change, Message};
use crate::settings::{Alarm, Alarms};
use crate::watch::Watch;
use crate::webhook::Webhook;

/// How many changes stand in a message; of more it has the newest, and their number.
const MOST: usize = 100;
/// How long the journal may take for a note. A service that ends answers no more, and waits for this.
const PATIENCE: Wait = Wait::from_secs(2);
/// How long is waited for news.
const WAITS: Wait = Wait::from_secs(1);
/// The name of the receiver that is the journal.
const JOURNAL: &str = "journal";

/// A receiver.
pub(crate) struct Receiver {
    /// Its name, in which there is no secret.
    pub(crate) name: String,
    machine: String,
    /// The alarms that it is given, as the machine file names them; all of them for the journal.
    alarms: Option<Vec<String>>,
    way: Way,
}

enum Way {
    Journal(ServiceHandle),
    Messages(Box<dyn Messages>),
}

/// The receivers of all alarms.
pub(crate) fn all(settings: &Alarms, beside: &Beside) -> Result<Vec<Receiver>, ConnectorError> {
    let mut all = vec![Receiver {
        name: JOURNAL.to_owned(),
        machine: beside.name.clone(),
        alarms: None,
        way: Way::Journal(beside.handle.clone()),
    }];
    let mut give =
        |name: String,
         alarm: &str,
         open: &dyn Fn() -> Result<Box<dyn Messages>, ConnectorError>| {
            if let Some(known) = all.iter_mut().find(|of| of.name == name) {
                known.alarms.get_or_insert_default().push(alarm.to_owned());
                return Ok(());
            }
            let failed = |error| ConnectorError::new(format_args!("[alarms.{alarm}] {error}"));
            all.push(Receiver {
                name,
                machine: beside.name.clone(),
                alarms: Some(vec![alarm.to_owned()]),
                way: Way::Messages(open().map_err(failed)?),
            });
            Ok::<_, ConnectorError>(())
        };
    for (name, alarm) in &settings.0 {
        for (receiver, open) in ways(name, alarm, &beside.sinks, &beside.machine, "-alarms")? {
            give(receiver, name, &*open)?;
        }
    }
    Ok(all)
}

type Open<'a> = Box<dyn Fn() -> Result<Box<dyn Messages>, ConnectorError> + 'a>;

/// The ways out of an alarm beside the journal, each with its name. `suffix` tells connections apart.
pub(crate) fn ways<'a>(
    name: &str,
    alarm: &'a Alarm,
    sinks: &'a [(Arc<dyn Sink>, SinkWiring)],
    machine: &Path,
    suffix: &'a str,
) -> Result<Vec<(String, Open<'a>)>, ConnectorError> {
    let mut ways: Vec<(String, Open<'a>)> = Vec::new();
    let failed = |words: String| ConnectorError::new(format_args!("[alarms.{name}] {words}"));
    let speak = sinks.iter().filter(|(of, _)| of.messages().is_some());
    let names: Vec<_> = speak.clone().map(|(_, wiring)| &*wiring.name).collect();
    let over = alarm.over(&names).map_err(failed)?;
    let sink = over.and_then(|name| speak.clone().find(|(_, wiring)| wiring.name == name));
    if let (Some((sink, wiring)), Some(topic)) = (sink, &alarm.topic) {
        let open = move || {
            let lacks = || ConnectorError::new("the sink sends no messages");
            sink.messages()
                .ok_or_else(lacks)?
                .open(wiring, suffix, topic)
        };
        ways.push((format!("mqtt {}: {topic}", wiring.name), Box::new(open)));
    }
    if let Some(secret) = &alarm.webhook {
        let folder = machine.parent().unwrap_or(machine);
        let address = secret.read(folder).map_err(failed)?;
        let webhook = Webhook::new(&address).map_err(failed)?;
        // Two at one host have different names, without their secrets.
        let mark = athermal_core::engine::fnv_1a(address.as_bytes()) as u16;
        let host = webhook.host().to_owned();
        let open = move || Ok::<Box<dyn Messages>, _>(Box::new(webhook.clone()));
        ways.push((format!("webhook {host} #{mark:04x}"), Box::new(open)));
    }
    Ok(ways)
}

impl Receiver {
    /// Gives what waits, until it is asked to stop.
    pub(crate) fn run(mut self, nth: usize, watch: &Watch, stop: &Stop) {
        let mut back_off = BackOff::default();
        while !stop.is_asked() {
            let book = watch.book.lock().unwrap_or_else(PoisonError::into_inner);
            let (changes, count) = book.waiting(&self.name, MOST);
            if count == 0 {
                let _ = watch.news.wait_timeout(book, WAITS);
                continue;
            }
            drop(book);
            let last = changes.last().map_or(0, |of| of.number);
            let given = self.give(changes, count);
            let mut away = watch.away.lock().unwrap_or_else(PoisonError::into_inner);
            away[nth] = given.as_ref().err().map(ToString::to_string);
            drop(away);
            match given {
                Ok(()) => {
                    back_off = BackOff::default();
                    let mut book = watch.book.lock().unwrap_or_else(PoisonError::into_inner);
                    book.taken(&self.name, last);
                }
                Err(_) => _ = stop.wait(back_off.after(Wait::ZERO)),
            }
        }
    }

    fn give(&mut self, mut changes: Vec<Change>, count: u64) -> Result<(), ConnectorError> {
        let left_out = count.saturating_sub(changes.len() as u64);
        if let Some(own) = &self.alarms {
            let is_own = |name: &str| {
                let of = |alarm: &String| {
                    let rest = name.strip_prefix(&**alarm);
                    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
                };
                own.iter().any(of)
            };
            changes.retain(|of| is_own(&of.alarm));
        }
        if changes.is_empty() && left_out == 0 {
            return Ok(());
        }
        match &mut self.way {
            Way::Journal(handle) => {
                let mut notes: Vec<_> = changes.iter().map(words).collect();
                if left_out > 0 {
                    notes.insert(0, format!("{left_out} changes of alarms are left out here"));
                }
                let noted = handle.ask(PATIENCE, move |service| {
                    notes.iter().for_each(|note| service.note(note));
                });
                noted.map_err(|error| ConnectorError::new(error.to_string()))
            }
            Way::Messages(messages) => {
                let message = Message {
                    machine: self.machine.clone(),
                    count: changes.len() as u64 + left_out,
                    left_out,
                    changes,
                };
                let text = serde_json::to_string(&message).unwrap_or_default();
                messages.send(&text)
            }
        }
    }
}

/// A change as a note of the journal.
fn words(change: &Change) -> String {
    let Change {
        alarm, of, unit, ..
    } = change;
    let text = change
        .text
        .as_ref()
        .map_or_else(String::new, |text| format!(": {text}"));
    let value = change.value.map_or_else(
        || format!("`{of}` has no value"),
        |value| format!("`{of}` is {} {unit}", figures::number(value)),
    );
    match (change.change, &change.by) {
        (Became::Raised, _) => format!("alarm {alarm} raised{text} ({value})"),
        (Became::Acknowledged, by) => {
            let by = by.as_deref().unwrap_or("somebody");
            format!("{by}: alarm {alarm} acknowledged")
        }
        (Became::Gone, _) => format!("alarm {alarm} gone ({value})"),
    }
}
