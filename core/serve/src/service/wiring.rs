//! What a graph and a machine file say of a service, as its parts need it.

use athermal_run::live::Feed;

use super::wait;
use crate::compile::Plan;
use crate::connector::Stamps;
use crate::deployment::{DeclaredSource, Runtime};
use crate::journal::Keep;
use crate::sequencer::{ChannelRules, Rules, SourceRules};

/// The channels that samples are given for: those of what runs, then those of what is to run.
pub(super) fn fed(plan: &Plan, given: &[Feed]) -> Vec<Feed> {
    let mut feed = Feed::of(plan);
    for channel in given {
        if !feed.contains(channel) {
            feed.push(channel.clone());
        }
    }
    feed
}

pub(super) fn rules(runtime: &Runtime, sources: &[DeclaredSource], feed: &[Feed]) -> Rules {
    let channel = |of: &Feed| {
        let mut wired = sources.iter().enumerate().flat_map(|(nth, source)| {
            let channels = source.channels.iter();
            channels.map(move |channel| (nth, channel))
        });
        let found = wired.find(|(_, channel)| channel.channel.name == of.name);
        found.map_or_else(ChannelRules::default, |(source, channel)| ChannelRules {
            source,
            late: channel.late,
        })
    };
    Rules {
        wait: runtime.wait,
        join: runtime.join,
        settle: runtime.settle,
        future: runtime.future,
        heartbeat: runtime.heartbeat,
        sources: sources
            .iter()
            .map(|of| SourceRules {
                silent: of.silent,
                clock: of.clock,
                is_in_order: of.parameters.stamps() == Stamps::Order,
            })
            .collect(),
        channels: feed.iter().map(channel).collect(),
        ..Rules::default()
    }
}

pub(super) fn keep(runtime: &Runtime) -> Keep {
    Keep {
        age: wait(runtime.keep.journal),
        at_most: runtime.keep.at_most.0,
    }
}
