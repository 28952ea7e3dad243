//! From which measured channels, and how much delayed, a value is made; the leak check stands on it.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::time::Duration;

/// The measured channels behind a value, each with the smallest delay on any path: through data inputs, and through the truth of
/// what learns while it runs. And the longest span on any of them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    delays: Arc<BTreeMap<usize, Duration>>,
    span: Duration,
}

impl Provenance {
    /// A measured channel itself.
    #[must_use]
    pub fn source(slot: usize) -> Self {
        Self {
            delays: Arc::new(BTreeMap::from([(slot, Duration::ZERO)])),
            span: Duration::ZERO,
        }
    }

    /// What is made of several values, `delay` later.
    #[must_use]
    pub fn of<'a>(parts: impl IntoIterator<Item = (&'a Provenance, Duration)>) -> Self {
        let mut parts = parts.into_iter();
        let Some((first, delay)) = parts.next() else {
            return Self::default();
        };
        let mut all = first.clone();
        if delay != Duration::ZERO {
            Arc::make_mut(&mut all.delays)
                .values_mut()
                .for_each(|d| *d += delay);
        }
        for (part, delay) in parts {
            all.span = all.span.max(part.span);
            if delay == Duration::ZERO && Arc::ptr_eq(&part.delays, &all.delays) {
                continue;
            }
            for (&slot, &gathered) in part.delays.iter() {
                let gathered = gathered + delay;
                if all.delays.get(&slot).is_none_or(|&known| gathered < known) {
                    Arc::make_mut(&mut all.delays).insert(slot, gathered);
                }
            }
        }
        all
    }

    /// The same of a value that summarises so much of the past, as its node says.
    #[must_use]
    pub(crate) fn spanning(self, span: Duration) -> Self {
        let span = self.span.max(span);
        Self { span, ..self }
    }

    /// The longest span of the value and of all that it is made of: no node gives an instant of what is a mean of minutes.
    #[must_use]
    pub(crate) fn span(&self) -> Duration {
        self.span
    }

    /// The smallest delay of a measured channel, where it is behind the value.
    #[must_use]
    pub(crate) fn delay_of(&self, source: usize) -> Option<Duration> {
        self.delays.get(&source).copied()
    }

    /// The measured channels and their smallest delays.
    pub(crate) fn sources(&self) -> impl Iterator<Item = (usize, Duration)> + '_ {
        self.delays.iter().map(|(&slot, &delay)| (slot, delay))
    }
}

/// The smallest lag at which a truth of this span may be a regressor for this horizon, where `Duration::ZERO` stands for
/// "one sample" when both are zero.
#[must_use]
pub(crate) fn smallest_lag(span: Duration, ahead: Duration) -> Duration {
    (span - ahead).max(Duration::ZERO)
}

/// The lag of "the sample before" where a truth is a plain sample: the last value before the present instant.
pub(crate) const ONE_SAMPLE: Duration = Duration::from_ns(1);

/// The lag of persistence: the smallest at which the truth sees nothing of the answer.
#[must_use]
pub fn persistence_lag(span: Duration, ahead: Duration) -> Duration {
    let lag = smallest_lag(span, ahead);
    if leaks(lag, span, ahead) {
        ONE_SAMPLE
    } else {
        lag
    }
}

/// Whether a value of the truth's signal, this much delayed, shares something with the predicted value.
#[must_use]
pub fn leaks(lag: Duration, span: Duration, ahead: Duration) -> bool {
    lag < span - ahead || (span == Duration::ZERO && lag + ahead <= Duration::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn minutes(count: i64) -> Duration {
        Duration::from_ns(count * 60_000_000_000)
    }

    #[test]
    fn a_lag_leaks_while_its_window_overlaps_the_predicted_one() {
        assert!(leaks(minutes(4), minutes(5), minutes(0)));
        assert!(!leaks(minutes(5), minutes(5), minutes(0)));
        assert!(!leaks(minutes(0), minutes(5), minutes(5)));
        assert_eq!(smallest_lag(minutes(5), minutes(2)), minutes(3));
        assert_eq!(smallest_lag(minutes(5), minutes(9)), minutes(0));
    }

    #[test]
    fn a_sample_leaks_into_itself_only() {
        assert!(leaks(minutes(0), minutes(0), minutes(0)));
        assert!(!leaks(minutes(1), minutes(0), minutes(0)));
        assert!(!leaks(minutes(0), minutes(0), minutes(1)));
    }

    #[test]
    fn the_shortest_path_counts() {
        let position = Provenance::source(3);
        let late = Provenance::of([(&position, minutes(7))]);
        let both = Provenance::of([(&late, minutes(0)), (&position, minutes(2))]);
        assert_eq!(both.sources().collect::<Vec<_>>(), [(3, minutes(2))]);
    }
}
