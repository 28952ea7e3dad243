//! Decides when a sample that does not count is told of while rows still come; which samples count is decided by the graph.

use athermal::core::compile::SourceChannel;
use athermal::core::live::{Samples, Source, SourceError};
use athermal::core::recording::Event;

use crate::figures::number;
use crate::terminal::Terminal;

/// Rows as they are read. Where they may never end, the first sample of each channel that does not count is told at once.
pub struct Ranged<'a> {
    source: &'a mut dyn Source,
    terminal: Terminal,
    /// The channels of which none has been told yet, with their places in a row.
    untold: Vec<(usize, SourceChannel)>,
}

impl<'a> Ranged<'a> {
    /// Watches these channels, in the order of a row's values; none where all is told at the end.
    pub fn new(
        terminal: &Terminal,
        source: &'a mut dyn Source,
        channels: &[SourceChannel],
    ) -> Self {
        Self {
            source,
            terminal: *terminal,
            untold: channels.iter().cloned().enumerate().collect(),
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
