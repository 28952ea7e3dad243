//! Which truth a channel predicts, and how far off it was once that truth is measured.

use crate::compile::{Plan, TruthLink};
use crate::engine::Pairing;
use crate::live::Slots;
use crate::time::Instant;

/// The truth that a channel predicts; none where it predicts none, or where nothing says how old a prediction of it may be.
#[must_use]
pub fn link(plan: &Plan, slot: usize) -> Option<TruthLink> {
    let channel = &plan.channels[slot];
    let truth = &plan.channels[channel.predicts?].channel;
    // As the node itself is given truths; a combiner may be given none.
    let own = plan.nodes[channel.node?].role.truth();
    Some(TruthLink {
        slot: channel.predicts?,
        ahead: channel.channel.ahead,
        span: truth.span,
        limit: own.map(|link| link.limit).or(truth.default_max_age())?,
    })
}

/// A channel that predicts, each value of which is paired with the truth that it is of.
#[derive(Debug, Clone)]
pub struct PairedPrediction {
    slot: usize,
    pairing: Pairing,
}

impl PairedPrediction {
    /// Pairs what a channel predicts with the truths of a link.
    #[must_use]
    pub fn new(slot: usize, link: &TruthLink) -> Self {
        let pairing = Pairing::new(link, 1);
        Self { slot, pairing }
    }

    /// Looks at a tick: by how much what had been predicted for this truth is off; NaN where there is no truth, or nothing was predicted.
    pub fn error(&mut self, at: &impl Slots, now: Instant, truth: f64) -> f64 {
        if at.ran(self.slot) {
            self.pairing.run(now, [&[at.value(self.slot)][..]]);
        }
        let pair = (!truth.is_nan()).then(|| self.pairing.truth(now)).flatten();
        pair.map_or(f64::NAN, |pair| pair.row[0] - truth)
    }

    /// What follows belongs to another segment.
    pub fn clear(&mut self) {
        self.pairing.clear();
    }
}
