//! Decides what a node sees of the slots that it reads: fresh or held, how old, how far back; not what it does with it.

use super::Slots;
use super::history::{Cursor, History};
use crate::channel::{ABSENT, UNCHANGED};
use crate::compile::Gather;
use crate::node::Read;
use crate::time::{Duration, Instant};

/// A bundle of slots as read at the present tick, side by side.
#[derive(Debug, Clone)]
pub(crate) struct Gathered {
    /// The values; NaN where there is none.
    pub(crate) values: Vec<f64>,
    /// Their stamps; of no meaning where there is no value.
    pub(crate) stamps: Vec<Instant>,
    /// Whether any of the slots, read without a lag, has a new value at this tick.
    pub(crate) fresh: bool,
    cursors: Vec<Cursor>,
}

impl Gathered {
    pub(crate) fn new(gather: &Gather) -> Self {
        let width = gather.entries.len();
        Self {
            values: vec![ABSENT; width],
            stamps: vec![Instant::MIN; width],
            fresh: false,
            cursors: vec![0; width],
        }
    }

    /// Reads the slots as they stand now.
    pub(crate) fn read(
        &mut self,
        gather: &Gather,
        slots: &Slots,
        histories: &[Option<History>],
        now: Instant,
    ) {
        self.fresh = false;
        for (i, entry) in gather.entries.iter().enumerate() {
            let (value, stamp) = if entry.lag > Duration::ZERO {
                let history = histories[entry.slot]
                    .as_ref()
                    .expect("a slot that is read with a lag has a history");
                let (value, stamp) =
                    history.at(now - entry.lag, entry.max_age, &mut self.cursors[i]);
                (value, stamp + entry.lag)
            } else {
                let (value, stamp) = (slots.values[entry.slot], slots.stamps[entry.slot]);
                let new = slots.written[entry.slot] == slots.tick && !value.is_nan();
                self.fresh |= new;
                match gather.read {
                    Read::Fresh if slots.written[entry.slot] != slots.tick => (UNCHANGED, stamp),
                    Read::Held | Read::Truth if !value.is_nan() && now - stamp > entry.max_age => {
                        (ABSENT, stamp)
                    }
                    _ => (value, stamp),
                }
            };
            self.values[i] = value;
            self.stamps[i] = stamp;
        }
        for conversion in &gather.conversions {
            let value = &mut self.values[conversion.entry];
            // A NaN says why there is no value, and must stay as it is.
            if !value.is_nan() {
                *value *= conversion.factor();
            }
        }
    }

    /// The oldest stamp among the values that are there.
    pub(crate) fn oldest(&self) -> Option<Instant> {
        let present = self
            .values
            .iter()
            .zip(&self.stamps)
            .filter(|(value, _)| !value.is_nan());
        present.map(|(_, &stamp)| stamp).min()
    }

    /// Looks its places in histories up anew: they are not those that it read from before.
    pub(crate) fn forget_places(&mut self) {
        self.cursors.fill(0);
    }

    /// Starts afresh for another segment.
    pub(crate) fn clear(&mut self) {
        self.values.fill(ABSENT);
        self.cursors.fill(0);
        self.fresh = false;
    }
}
