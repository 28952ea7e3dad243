//! The first sample of each channel that does not count, or lies far outside of what the fit saw; and the first again after an hour in
//! order. Which samples count, the graph decides.

use super::super::{Feed, Report, Reporter};
use super::Monitor;
use crate::compile::{Plan, SourceChannel};
use crate::engine::SampleRange;
use crate::recording::Samples;
use crate::time::{Duration, Instant};

/// A channel that has been in order for so long is reported when it is not again.
const IN_ORDER: Duration = Duration::from_ns(3600 * 1_000_000_000);

/// Watches the ranges of channels.
#[derive(Debug)]
pub struct RangeMonitor {
    /// The channels in the order of a row's values; none of what the graph does not read.
    channels: Vec<Option<Channel>>,
}

#[derive(Debug)]
struct Channel {
    source: SourceChannel,
    /// Where samples lay in the fit, if that is known.
    usual: Option<SampleRange>,
    /// When the last sample came that does not count.
    rejected: Option<Instant>,
    /// When the last came that counts and is far outside.
    outside: Option<Instant>,
}

impl RangeMonitor {
    /// Watches these channels, in the order of a row's values. `usual` is where samples lay in the fit.
    #[must_use]
    pub fn new(channels: &[SourceChannel], usual: &[SampleRange]) -> Self {
        let channels = channels.iter();
        Self {
            channels: channels
                .map(|channel| Some(Channel::new(channel, usual)))
                .collect(),
        }
    }
}

impl Monitor for RangeMonitor {
    fn row(&mut self, now: Instant, samples: &Samples, reporter: &dyn Reporter) {
        for (channel, &value) in self.channels.iter_mut().zip(&samples.values) {
            if let Some(channel) = channel {
                channel.sample(now, &samples.time_text, value, reporter);
            }
        }
    }

    fn follow(&mut self, plan: &Plan, feed: &[Feed], usual: &[SampleRange]) {
        let mut before = std::mem::take(&mut self.channels);
        before.resize_with(feed.len(), || None);
        let followed = before.into_iter().zip(feed).map(|(before, fed)| {
            let source = fed.source(plan)?;
            let mut now = Channel::new(source, usual);
            if let Some(before) = before {
                (now.rejected, now.outside) = (before.rejected, before.outside);
                // A graph goes by the fits of what ran before.
                now.usual = now.usual.or(before.usual);
            }
            Some(now)
        });
        self.channels = followed.collect();
    }
}

impl Channel {
    fn new(source: &SourceChannel, usual_of_all: &[SampleRange]) -> Self {
        Self {
            source: source.clone(),
            usual: usual(usual_of_all, &source.name)
                .filter(|_| !source.is_instant)
                .cloned(),
            rejected: None,
            outside: None,
        }
    }

    fn sample(&mut self, now: Instant, time: &str, value: f64, reporter: &dyn Reporter) {
        if value.is_nan() {
            return;
        }
        let Self { source, usual, .. } = self;
        if !source.admits(value) {
            if is_news(&mut self.rejected, now) {
                reporter.report(Report::Rejected {
                    channel: source,
                    time,
                    value,
                });
            }
        } else if let Some(usual) = usual
            && usual.is_far_from(value, value)
            && is_news(&mut self.outside, now)
        {
            reporter.report(Report::OutsideFit { usual, time, value });
        }
    }
}

/// Where the samples of a channel lay in a fit.
#[must_use]
pub fn usual<'a>(fit: &'a [SampleRange], channel: &str) -> Option<&'a SampleRange> {
    fit.iter().find(|usual| usual.channel == channel)
}

/// Whether none came in a while before; this one is the last then.
fn is_news(last: &mut Option<Instant>, now: Instant) -> bool {
    let before = last.replace(now);
    before.is_none_or(|before| now - before >= IN_ORDER)
}
