//! When data lie so far from those of a fit that predictions of them mean little.

use athermal_core::engine::SampleRange;
use athermal_core::watch::Watch;
use athermal_run::live::monitor::usual;
use serde::Serialize;
use serde_json::json;

use athermal_analysis::figures::apart;
use athermal_core::message::Message;
use athermal_run::live::monitor::words::{OUTSIDE_FIT, doubt};

/// A channel whose samples lie far outside of what a fit saw.
#[derive(Debug, Serialize)]
pub struct Beyond<'a> {
    channel: &'a str,
    lowest: f64,
    highest: f64,
    lowest_in_fit: f64,
    highest_in_fit: f64,
    #[serde(skip)]
    doubt: &'static str,
}

/// The channels whose samples lie far outside of what a fit saw.
pub fn beyond<'a>(fit: &[SampleRange], seen: &'a [SampleRange]) -> Vec<Beyond<'a>> {
    let of = |seen: &'a SampleRange| {
        let usual = usual(fit, &seen.channel)?;
        Some(Beyond {
            channel: &seen.channel,
            lowest: seen.lowest,
            highest: seen.highest,
            lowest_in_fit: usual.lowest,
            highest_in_fit: usual.highest,
            doubt: doubt(usual, seen.lowest, seen.highest)?,
        })
    };
    seen.iter().filter_map(of).collect()
}

/// The warnings, one for each.
pub fn messages(all: &[Beyond<'_>]) -> Vec<Message> {
    let message = |of: &Beyond<'_>| {
        let all = [of.lowest, of.highest, of.lowest_in_fit, of.highest_in_fit];
        let [lowest, highest, lowest_in_fit, highest_in_fit] = apart(all);
        let words = format!(
            "{} is between {lowest} and {highest}, and was between {lowest_in_fit} and {highest_in_fit} in the data of the fit: {}",
            of.channel, of.doubt
        );
        Message::new(OUTSIDE_FIT, json!(of), words)
    };
    all.iter().map(message).collect()
}

/// Warns of them.
pub fn warn(host: &dyn Watch, all: &[Beyond<'_>]) {
    messages(all).into_iter().for_each(|of| host.warning(of));
}
