//! Decides when a sample that does not count, or lies far outside of what the fit saw, is told of while rows still come; which
//! samples count is decided by the graph.

use athermal::core::compile::SourceChannel;
use athermal::core::engine::SampleRange;
use athermal::core::live::{Samples, Source, SourceError};
use athermal::core::recording::Event;

use super::beyond;
use crate::figures::number;
use crate::terminal::Terminal;

/// Rows as they are read. Where they may never end, the first sample of each channel that does not count, and the first far outside
/// of what the fit saw, are told at once.
pub struct Ranged<'a> {
    source: &'a mut dyn Source,
    terminal: Terminal,
    /// The channels of which none has been told yet, with their places in a row.
    untold: Vec<(usize, SourceChannel)>,
    /// The same for samples that count and are far outside of what the fit saw, with where they lay there.
    untold_beyond: Vec<(usize, SourceChannel, SampleRange)>,
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
        let beyond = channels.iter().enumerate().filter_map(|(place, channel)| {
            let usual = beyond::usual(usual, &channel.name)?;
            Some((place, channel.clone(), usual.clone()))
        });
        Self {
            source,
            terminal: *terminal,
            untold: channels.iter().cloned().enumerate().collect(),
            untold_beyond: beyond.collect(),
        }
    }
}

impl Source for Ranged<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let event = self.source.next(samples)?;
        if let Some(Event::Row(_)) = event {
            let (time, values, terminal) = (&samples.time_text, &samples.values, self.terminal);
            self.untold.retain(|(place, channel)| {
                let value = values[*place];
                let counts = value.is_nan() || channel.admits(value);
                if !counts {
                    terminal.warning(format_args!(
                        "{} at {time}: {}, taken as missing; others like it are counted",
                        channel.name,
                        why(value, channel.range)
                    ));
                }
                counts
            });
            self.untold_beyond.retain(|(place, channel, usual)| {
                let value = values[*place];
                !(channel.admits(value) && beyond::tell_first(&terminal, usual, time, value))
            });
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
