//! Decides when a sample that does not count, or lies far outside of what the fit saw, is told of while rows still come: the first, and
//! again the first after some time in order; which samples count is decided by the graph.

use athermal::core::compile::{Plan, SourceChannel};
use athermal::core::engine::SampleRange;
use athermal::run::live::Feed;
use athermal::run::recording::{Event, Samples, Source, SourceError};

use athermal::{Duration, Instant};
use serde_json::json;

use crate::command::beyond;
use crate::command::data::REJECTED;
use crate::message::Message;
use crate::terminal::Terminal;
use athermal_analysis::figures::number;

/// A channel that has been in order for so long is told of when it is not again.
const IN_ORDER: Duration = Duration::from_ns(3600 * 1_000_000_000);

/// Rows as they are read. Where they may never end, the first sample of each channel that does not count, and the first far outside
/// of what the fit saw, are told at once.
pub struct Ranged<'a> {
    source: &'a mut dyn Source,
    terminal: Terminal,
    /// The channels in the order of a row's values; none of what the graph does not read.
    channels: Vec<Option<Channel>>,
}

/// A channel of which is told.
struct Channel {
    source: SourceChannel,
    /// Where samples lay in the fit, if that is known.
    usual: Option<SampleRange>,
    /// When the last sample came that does not count.
    rejected: Option<Instant>,
    /// When the last came that counts and is far outside.
    beyond: Option<Instant>,
}

impl<'a> Ranged<'a> {
    /// Watches these channels, in the order of a row's values; none where all is told at the end. `usual` is where samples lay in the
    /// fit.
    pub fn new(
        terminal: &Terminal,
        source: &'a mut dyn Source,
        channels: &[SourceChannel],
        usual: &[SampleRange],
    ) -> Self {
        let channels = channels.iter();
        Self {
            source,
            terminal: *terminal,
            channels: channels
                .map(|channel| Some(Channel::new(channel, usual)))
                .collect(),
        }
    }

    /// Goes on with the graph that has taken over, which reads its channels among those of a feed; where all is told at the end,
    /// that is no matter.
    pub fn follow(&mut self, plan: &Plan, feed: &[Feed], usual: &[SampleRange]) {
        if self.channels.is_empty() {
            return;
        }
        let mut before = std::mem::take(&mut self.channels);
        before.resize_with(feed.len(), || None);
        let followed = before.into_iter().zip(feed).map(|(before, fed)| {
            let source = fed.source(plan)?;
            let mut now = Channel::new(source, usual);
            if let Some(before) = before {
                (now.rejected, now.beyond) = (before.rejected, before.beyond);
                // A graph goes by the fits of what ran before.
                now.usual = now.usual.or(before.usual);
            }
            Some(now)
        });
        self.channels = followed.collect();
    }
}

impl Channel {
    fn new(source: &SourceChannel, usual: &[SampleRange]) -> Self {
        Self {
            source: source.clone(),
            usual: beyond::usual(usual, &source.name).cloned(),
            rejected: None,
            beyond: None,
        }
    }

    fn sample(&mut self, terminal: &Terminal, now: Instant, time: &str, value: f64) {
        if value.is_nan() {
            return;
        }
        let Self { source, usual, .. } = self;
        if !source.admits(value) {
            if is_news(&mut self.rejected, now) {
                let words = format!(
                    "{} at {time}: {}, taken as missing; others like it are counted",
                    source.name,
                    why(value, source.range)
                );
                let facts = json!({ "channel": source.name, "time": time, "value": value });
                terminal.warning(Message::new(REJECTED, facts, words));
            }
        } else if let Some(usual) = usual
            && beyond::is_beyond(usual, value)
            && is_news(&mut self.beyond, now)
        {
            beyond::warn_first(terminal, usual, time, value);
        }
    }
}

/// Whether none came in a while before; this one is the last then.
fn is_news(last: &mut Option<Instant>, now: Instant) -> bool {
    let before = last.replace(now);
    before.is_none_or(|before| now - before >= IN_ORDER)
}

impl Source for Ranged<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let event = self.source.next(samples)?;
        if let Some(Event::Row(now)) = event {
            for (channel, &value) in self.channels.iter_mut().zip(&samples.values) {
                if let Some(channel) = channel {
                    channel.sample(&self.terminal, now, &samples.time_text, value);
                }
            }
        }
        Ok(event)
    }
}

/// What is wrong with a sample.
fn why(value: f64, (lowest, highest): (f64, f64)) -> String {
    if value.is_infinite() {
        "an infinite sample".to_owned()
    } else if value < lowest {
        format!(
            "{} is below the lowest of its range, {}",
            number(value),
            number(lowest)
        )
    } else {
        format!(
            "{} is above the highest of its range, {}",
            number(value),
            number(highest)
        )
    }
}
