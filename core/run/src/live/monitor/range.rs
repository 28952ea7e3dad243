//! The first sample of each channel that does not count, or lies far outside of what the fit saw; and the first again after an hour in
//! order. Which samples count, the graph decides.

use super::super::Feed;
use super::{Finding, Monitor};
use crate::compile::{Plan, SourceChannel};
use crate::engine::SampleRange;
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
    /// What is known of those.
    all_outside: Option<OutsideFit>,
}

/// The samples of a channel that lay far outside of those of the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct OutsideFit {
    /// The channel, and where its samples lay in the fit.
    pub usual: SampleRange,
    /// How many there were.
    pub samples: u64,
    /// The lowest of them.
    pub lowest: f64,
    /// The highest of them.
    pub highest: f64,
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

impl RangeMonitor {
    /// The channels of which samples lay far outside of those of the fit.
    pub fn outside_fit(&self) -> impl Iterator<Item = &OutsideFit> {
        let channels = self.channels.iter().flatten();
        channels.filter_map(|of| of.all_outside.as_ref())
    }
}

impl Monitor for RangeMonitor {
    fn row(&mut self, now: Instant, values: &[f64], found: &mut Vec<Finding>) {
        for (channel, &value) in self.channels.iter_mut().zip(values) {
            if let Some(channel) = channel {
                found.extend(channel.sample(now, value));
            }
        }
    }

    fn follow(&mut self, plan: &Plan, feed: &[Feed], usual: &[SampleRange], _: &mut Vec<Finding>) {
        let mut before = std::mem::take(&mut self.channels);
        before.resize_with(feed.len(), || None);
        let followed = before.into_iter().zip(feed).map(|(before, fed)| {
            let source = fed.source(plan)?;
            let mut now = Channel::new(source, usual);
            if let Some(before) = before {
                (now.rejected, now.outside) = (before.rejected, before.outside);
                now.all_outside = before.all_outside;
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
            all_outside: None,
        }
    }

    fn sample(&mut self, now: Instant, value: f64) -> Option<Finding> {
        if value.is_nan() {
            return None;
        }
        if !self.source.admits(value) {
            return is_news(&mut self.rejected, now).then(|| Finding::Rejected {
                channel: self.source.name.clone(),
                range: self.source.range,
                value,
            });
        }
        let usual = self.usual.as_ref();
        let usual = usual.filter(|usual| usual.is_far_from(value, value))?;
        let all = self.all_outside.get_or_insert_with(|| OutsideFit {
            usual: usual.clone(),
            samples: 0,
            lowest: value,
            highest: value,
        });
        all.samples += 1;
        (all.lowest, all.highest) = (all.lowest.min(value), all.highest.max(value));
        is_news(&mut self.outside, now).then(|| Finding::OutsideFit {
            usual: usual.clone(),
            value,
        })
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
