//! Where parts of files could not be read, so that anything may be missing there; what follows from that is decided elsewhere.

use std::collections::BTreeMap;

use super::{Place, SourceId};

/// Parts of files, by their starts. None reaches into the next, so that a place is looked up by the one before it.
#[derive(Debug, Clone, Default)]
pub(super) struct Gaps(BTreeMap<(SourceId, u32), u32>);

impl Gaps {
    pub(super) fn add(&mut self, gap: Place) {
        let (mut start, mut end) = (gap.start, gap.end);
        let touched = self.0.range(..=(gap.source, end)).rev();
        let touched =
            touched.take_while(|((source, _), last)| *source == gap.source && **last >= start);
        let touched: Vec<_> = touched.map(|((_, first), last)| (*first, *last)).collect();
        for (first, last) in touched {
            self.0.remove(&(gap.source, first));
            (start, end) = (start.min(first), end.max(last));
        }
        self.0.insert((gap.source, start), end);
    }

    /// Whether a place starts within one of them.
    pub(super) fn hold(&self, place: Place) -> bool {
        let mut before = self.0.range(..=(place.source, place.start)).rev();
        before
            .next()
            .is_some_and(|((source, _), end)| *source == place.source && place.start < *end)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn place() -> impl Strategy<Value = Place> {
        (0..2u32, 0..30u32, 0..12u32)
            .prop_map(|(source, start, length)| Place::new(SourceId(source), start, start + length))
    }

    proptest! {
        #[test]
        fn a_place_is_held_where_one_of_the_parts_holds_it(
            parts in proptest::collection::vec(place(), 0..8),
            asked in place(),
        ) {
            let mut gaps = Gaps::default();
            parts.iter().for_each(|part| gaps.add(*part));
            let around = |part: &Place| {
                part.source == asked.source && (part.start..part.end).contains(&asked.start)
            };
            prop_assert_eq!(gaps.hold(asked), parts.iter().any(around));
        }
    }
}
