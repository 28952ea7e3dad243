//! When data lie so far from those of a fit that predictions of them mean little.

use athermal::core::engine::SampleRange;
use athermal::run::live::monitor::usual;
use serde::Serialize;
use serde_json::json;

use crate::message::Message;
use crate::terminal::Terminal;
use athermal_analysis::figures::apart;

/// So many widths beyond, another unit is more likely than another day.
const ANOTHER_UNIT: f64 = 10.0;

/// The event for samples outside of those of the fit.
const OUTSIDE: &str = "outside_fit";

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

/// Warns of them.
/// Warns of them.
pub fn warn(terminal: &Terminal, all: &[Beyond<'_>]) {
    for of in all {
        let all = [of.lowest, of.highest, of.lowest_in_fit, of.highest_in_fit];
        let [lowest, highest, lowest_in_fit, highest_in_fit] = apart(all);
        let words = format!(
            "{} is between {lowest} and {highest}, and was between {lowest_in_fit} and {highest_in_fit} in the data of the fit: {}",
            of.channel, of.doubt
        );
        terminal.warning(Message::new(OUTSIDE, json!(of), words));
    }
}

/// Warns of the first such sample of a channel.
pub fn warn_first(terminal: &Terminal, usual: &SampleRange, time: &str, sample: f64) {
    if let Some(doubt) = doubt(usual, sample, sample) {
        let [found, lowest, highest] = apart([sample, usual.lowest, usual.highest]);
        let words = format!(
            "{} at {time}: {found}, and was between {lowest} and {highest} in the data of the fit: {doubt}",
            usual.channel
        );
        let facts = json!({
            "channel": usual.channel,
            "time": time,
            "value": sample,
            "lowest_in_fit": usual.lowest,
            "highest_in_fit": usual.highest,
        });
        terminal.warning(Message::new(OUTSIDE, facts, words));
    }
}

/// What to think of samples that lie far outside; none where they do not.
fn doubt(usual: &SampleRange, lowest: f64, highest: f64) -> Option<&'static str> {
    if usual.exceeded_by(lowest, highest) > ANOTHER_UNIT {
        Some("is it in the unit of the fit? The fit learned nothing of values so far outside")
    } else {
        let far = usual.is_far_from(lowest, highest);
        far.then_some("the fit learned nothing of values so far outside")
    }
}
