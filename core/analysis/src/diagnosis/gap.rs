//! The usual time between two samples: a quantile of the gaps, which neither a pause nor a few missing samples move.

use std::collections::BTreeMap;

use athermal_core::time::Duration;

/// Gaps within such a part of each other are one, given by their mean: a regular series has its exact interval, and an irregular one
/// costs no more memory than a regular one.
const SHARES_OF_OCTAVE: i64 = 64;

/// The times between the samples of a series.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Gaps {
    count: i64,
    /// Of gaps of about the same length, how many and their sum in ns.
    alike: BTreeMap<i64, (i64, i128)>,
}

impl Gaps {
    pub(super) fn push(&mut self, gap: Duration) {
        let ns = gap.as_ns();
        let (count, sum) = self.alike.entry(class(ns)).or_default();
        *count += 1;
        *sum += i128::from(ns);
        self.count += 1;
    }

    /// How many there are.
    pub(super) fn count(&self) -> i64 {
        self.count
    }

    /// The median; none without a gap.
    pub(super) fn median(&self) -> Option<Duration> {
        self.quantile(1, 2)
    }

    /// How long all of them are, pauses counted as no longer than `longest`.
    pub(super) fn length(&self, longest: Duration) -> Duration {
        let longest = i128::from(longest.as_ns());
        let each = self.alike.values();
        let sum: i128 = each
            .map(|&(count, sum)| sum.min(i128::from(count) * longest))
            .sum();
        Duration::from_ns(i64::try_from(sum).unwrap_or(i64::MAX))
    }

    /// The length that `share` in `of` gaps do not reach.
    pub(super) fn quantile(&self, share: i64, of: i64) -> Option<Duration> {
        let mut left = (self.count - 1) * share / of;
        for (count, sum) in self.alike.values() {
            if left < *count {
                let mean = i64::try_from(sum / i128::from(*count)).ok()?;
                return Some(Duration::from_ns(mean));
            }
            left -= count;
        }
        None
    }
}

/// Exact up to 63 ns; above, 64 classes from each power of two to the next.
fn class(ns: i64) -> i64 {
    if ns < SHARES_OF_OCTAVE {
        return ns;
    }
    let octave = i64::from(ns.ilog2() - SHARES_OF_OCTAVE.ilog2());
    octave * SHARES_OF_OCTAVE + (ns >> octave)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn median(gaps: impl IntoIterator<Item = i64>) -> Option<i64> {
        let mut all = Gaps::default();
        gaps.into_iter()
            .for_each(|ns| all.push(Duration::from_ns(ns)));
        all.median().map(Duration::as_ns)
    }

    #[test]
    fn the_usual_gap_is_the_median_which_a_pause_does_not_move() {
        assert_eq!(median([]), None);
        assert_eq!(median([7]), Some(7));
        let second = 1_000_000_000;
        let regular = std::iter::repeat_n(second, 1000);
        assert_eq!(
            median(regular.clone().chain([36_000 * second])),
            Some(second)
        );
        assert_eq!(median([i64::MAX, i64::MAX]), Some(i64::MAX));
    }

    #[test]
    fn gaps_that_differ_a_little_are_told_by_their_mean() {
        // Classes at a thousand are eight wide: 1000 to 1007 are one, and 1008 the next.
        assert_eq!(median([1000, 1002, 1007]), Some(1003));
        assert_eq!(median([1000, 1008, 1008]), Some(1008));
        let longer = (1..5000).map(|ns| (class(ns), class(ns + 1)));
        assert!(
            longer
                .into_iter()
                .all(|(one, next)| next == one || next == one + 1)
        );
    }
}
