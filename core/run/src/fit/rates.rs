//! How often samples come, as room is made for them elsewhere: from the steps between samples, of which gaps are none.

use std::collections::BTreeMap;

use crate::compile::Plan;
use crate::engine::Engine;
use crate::recording::Event;

/// Steps of about one size: how many, and their sum in ns.
type Bucket = (u64, u64);

/// So many sizes there are.
const SIZES: usize = 256;

/// The steps between two samples of each measured channel, by their size: four sizes to each power of two.
#[derive(Debug, Clone, Default)]
pub(super) struct Spacing {
    last: Vec<Option<i64>>,
    sizes: Vec<Vec<Bucket>>,
}

/// The same as it is kept: of each channel sizes, counts and sums.
pub(super) type Kept = Vec<Vec<(usize, u64, u64)>>;

fn size_of(step: u64) -> usize {
    let power = step.max(4).ilog2();
    4 * power as usize + ((step.max(4) >> (power - 2)) & 3) as usize
}

impl Spacing {
    pub(super) fn new(plan: &Plan) -> Self {
        let channels = plan.sources.len();
        Self {
            last: vec![None; channels],
            sizes: vec![vec![(0, 0); SIZES]; channels],
        }
    }

    /// Takes the samples of a tick; whether their steps count, or only when they came.
    pub(super) fn look(&mut self, engine: &Engine, event: Event, counts: bool) {
        let Event::Row(now) = event else {
            return self.last.fill(None);
        };
        for (nth, last) in self.last.iter_mut().enumerate() {
            if engine.value(nth).is_nan() {
                continue;
            }
            if let Some(last) = last.replace(now.as_ns()).filter(|_| counts) {
                let step = u64::try_from(now.as_ns().saturating_sub(last)).unwrap_or(0);
                let (count, sum) = &mut self.sizes[nth][size_of(step)];
                (*count, *sum) = (*count + 1, sum.saturating_add(step));
            }
        }
    }

    pub(super) fn kept(&self) -> Kept {
        let all = self.sizes.iter().map(|of| {
            let sizes = of.iter().enumerate().filter(|(_, (count, _))| *count > 0);
            sizes
                .map(|(size, &(count, sum))| (size, count, sum))
                .collect()
        });
        all.collect()
    }

    /// And those of another part of the data.
    pub(super) fn add(&mut self, kept: &Kept) {
        for (sizes, kept) in self.sizes.iter_mut().zip(kept) {
            for &(size, more, of) in kept {
                // A block that was not written by this program may have any.
                if let Some((count, sum)) = sizes.get_mut(size) {
                    (*count, *sum) = (*count + more, sum.saturating_add(of));
                }
            }
        }
    }

    /// The usual time between two samples of each signal, in seconds: of its channel with the least.
    pub(super) fn usual(&self, plan: &Plan) -> BTreeMap<String, f64> {
        let mut usual: BTreeMap<String, f64> = BTreeMap::new();
        for (source, sizes) in plan.sources.iter().zip(&self.sizes) {
            let Some(step) = usual_of(sizes) else {
                continue;
            };
            let signal = source.name.split('.').next().unwrap_or(&source.name);
            usual
                .entry(signal.to_owned())
                .and_modify(|known| *known = known.min(step))
                .or_insert(step);
        }
        usual
    }
}

/// The usual step, in seconds: but for jitter a quarter of all steps are shorter, since samples that come now fast, now slowly need the
/// room of the fast ones.
fn usual_of(sizes: &[Bucket]) -> Option<f64> {
    let all: u64 = sizes.iter().map(|(count, _)| count).sum();
    let mut before = 0;
    let size = sizes.iter().position(|(count, _)| {
        before += count;
        *count > 0 && 4 * before >= all
    })?;
    let near = &sizes[size.saturating_sub(1)..(size + 2).min(sizes.len())];
    let (count, sum) = near.iter().fold((0, 0_u64), |(count, sum), of| {
        (count + of.0, sum.saturating_add(of.1))
    });
    // With three digits, and rather too short.
    let step = sum / count;
    let digit = 10_u64.pow(step.max(100).ilog10() - 2);
    Some(((step + step / 10_000) / digit * digit) as f64 / 1e9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usual(steps_ms: &[(u64, usize)]) -> Option<f64> {
        let mut sizes = vec![(0, 0); SIZES];
        for &(ms, times) in steps_ms {
            let bucket: &mut Bucket = &mut sizes[size_of(1_000_000 * ms)];
            bucket.0 += times as u64;
            bucket.1 += 1_000_000 * ms * times as u64;
        }
        usual_of(&sizes)
    }

    #[test]
    fn the_usual_step_is_that_of_regular_samples_whatever_gaps_and_jitter_there_are() {
        for (steps, expected) in [
            (&[][..], None),
            (&[(10_000, 1)], Some(10.0)),
            (&[(10_000, 900), (86_400_000, 5), (600_000, 40)], Some(10.0)),
            (&[(9_990, 50), (10_000, 100), (10_010, 50)], Some(10.0)),
            (&[(9_999, 9), (10_000, 1)], Some(10.0)),
            (&[(76_621, 9), (76_629, 1)], Some(76.6)),
            // On both sides of a power of two.
            (&[(8_580, 50), (8_590, 100), (8_600, 50)], Some(8.59)),
            // Now fast, now slowly.
            (&[(1_000, 100), (9_000, 100)], Some(1.0)),
            (&[(1_000, 10), (9_000, 100)], Some(9.0)),
        ] {
            assert_eq!(usual(steps), expected, "{steps:?}");
        }
    }
}
