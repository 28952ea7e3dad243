//! One of everything that a source is to give, for whoever commissions it.

use std::collections::BTreeMap;
use std::time::Duration as Wait;

use athermal_serve::connector::{Seen, WiredChannel};

use crate::client::Settings;
use crate::listen::{Heard, listen};
use crate::session::shown;
use crate::source::Route;
use athermal_messages::payload::Values;

/// What came of each channel.
///
/// # Errors
/// Why there is no connection.
pub fn look(
    settings: &Settings,
    routes: &[Route],
    channels: &[WiredChannel],
    patience: Wait,
) -> Result<Vec<Seen>, String> {
    let nothing = |channel: usize| Seen {
        channel,
        value: None,
        quality: format!("nothing came in {} s", patience.as_secs()),
        stamp: None,
        offset: None,
        granted: "no answer".to_owned(),
    };
    let mut all: Vec<_> = (0..channels.len()).map(nothing).collect();
    let filters: BTreeMap<_, ()> = routes
        .iter()
        .map(|of| (of.topic.filter().to_owned(), ()))
        .collect();
    let filters: Vec<_> = filters.into_keys().collect();
    listen(settings.clone(), &filters, patience, |heard| {
        match heard {
            Heard::Answer(topic, answer) => {
                let granted = match answer {
                    Ok(qos) => format!("QoS {qos}"),
                    Err(why) => format!("refused: {why}"),
                };
                for route in routes.iter().filter(|of| of.topic.filter() == topic) {
                    for channel in channels_of(&route.form.values) {
                        all[channel].granted.clone_from(&granted);
                    }
                }
            }
            Heard::Message(message) => {
                let now = athermal_serve::host::time_of_day();
                for route in routes.iter().filter(|of| of.topic.matches(&message.topic)) {
                    let read = route.form.read(&message.payload, now);
                    for of in read.given {
                        let seen = &mut all[of.channel];
                        // A fresh one says more than one that was kept.
                        if seen.value.is_none() || seen.quality != "good" {
                            seen.value = Some(of.value);
                            seen.stamp = Some(shown(of.stamp));
                            seen.offset = Some(now - of.stamp);
                            seen.quality = match message.is_retained {
                                true => "retained".to_owned(),
                                false => "good".to_owned(),
                            };
                        }
                    }
                    let Some(left_out) = read.left_out.first() else {
                        continue;
                    };
                    for channel in channels_of(&route.form.values) {
                        if all[channel].value.is_none() {
                            all[channel].quality =
                                format!("{}: {}", left_out.reason, left_out.what);
                        }
                    }
                }
            }
        }
        all.iter().all(|of| of.quality == "good")
    })?;
    Ok(all)
}

fn channels_of(values: &Values) -> Vec<usize> {
    match values {
        Values::Plain(channel) | Values::One(_, channel) => vec![*channel],
        Values::Fields(fields) => fields.iter().map(|(_, channel)| *channel).collect(),
        Values::Each { channels, .. } => channels.values().copied().collect(),
    }
}
