//! Decides which samples made-up measurements consist of.

use std::collections::BTreeMap;

use crate::compile::Plan;
use crate::prng::Prng;
use crate::recording::{Event, Recording, Samples, Source, SourceError, Table};
use crate::time::{Duration, Instant};

/// Made-up measurements of one channel, in its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// The time between two samples; the first is at 0.
    pub every: Duration,
    /// What the samples are.
    pub shape: Shape,
    /// The standard deviation of the noise that is added.
    pub noise: f64,
    /// The seed of the noise.
    pub seed: u64,
}

/// The values of a series without noise.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// One by one; NaN where there is none.
    Samples(Vec<f64>),
    /// As a function of time.
    Curve(Curve),
}

/// A function of time: `start`, and from `delay` on a step, a ramp and a sine on top.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Curve {
    /// From the first sample to the last.
    pub length: Duration,
    /// The value before `delay`.
    pub start: f64,
    /// When it begins to change.
    pub delay: Duration,
    /// The change at `delay`.
    pub step: f64,
    /// The change per second.
    pub ramp: f64,
    /// The amplitude of a sine.
    pub amplitude: f64,
    /// The period of the sine, above 0.
    pub period: Duration,
}

impl Curve {
    fn at(&self, time: Duration) -> f64 {
        if time < self.delay {
            return self.start;
        }
        let since = (time - self.delay).secs();
        let phase = if self.amplitude == 0.0 {
            0.0
        } else {
            since / self.period.secs()
        };
        let sine = self.amplitude * (std::f64::consts::TAU * phase).sin();
        self.start + self.step + self.ramp * since + sine
    }
}

impl Series {
    fn samples(&self, name: &str) -> Vec<f64> {
        let mut values = match &self.shape {
            Shape::Samples(values) => values.clone(),
            Shape::Curve(curve) => (0..=curve.length.as_ns() / self.every.as_ns().max(1))
                .map(|nth| curve.at(Duration::from_ns(nth * self.every.as_ns())))
                .collect(),
        };
        if self.noise > 0.0 {
            let mut random = Prng::stream(self.seed, name);
            for value in &mut values {
                *value += self.noise * random.normal();
            }
        }
        values
    }
}

/// Made-up measurements of some of a graph's channels; all others are absent.
#[derive(Debug, Clone, PartialEq)]
pub struct Synthetic {
    /// Which measured channel, as a position among [`Plan::sources`], and its samples.
    pub channels: Vec<(usize, Series)>,
}

impl Synthetic {
    /// The rows: one for each instant at which any channel has a sample.
    #[must_use]
    pub fn table(&self, plan: &Plan) -> Table {
        let width = plan.sources.len();
        let mut rows: BTreeMap<Instant, Vec<f64>> = BTreeMap::new();
        for (channel, series) in &self.channels {
            for (nth, value) in (0..).zip(series.samples(&plan.sources[*channel].name)) {
                let time = Instant::from_ns(series.every.as_ns() * nth);
                rows.entry(time).or_insert_with(|| vec![f64::NAN; width])[*channel] = value;
            }
        }
        let mut table = Table::default();
        for (time, values) in rows {
            table.push(time, &values);
        }
        table
    }
}

impl Recording for Synthetic {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        let table = self.table(plan);
        Ok(Box::new(Replay { table, next: 0 }))
    }
}

struct Replay {
    table: Table,
    next: usize,
}

impl Source for Replay {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let event = Source::next(&mut self.table.events()[self.next..].iter(), samples)?;
        self.next += usize::from(event.is_some());
        Ok(event)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(secs: i64) -> Duration {
        Duration::from_ns(secs * 1_000_000_000)
    }

    fn series(shape: Shape) -> Series {
        Series {
            every: seconds(10),
            shape,
            noise: 0.0,
            seed: 1,
        }
    }

    #[test]
    fn a_curve_stays_at_its_start_until_the_delay_and_then_moves() {
        let curve = Curve {
            length: seconds(40),
            start: 20.0,
            delay: seconds(20),
            step: 1.0,
            ramp: 0.5,
            ..Curve::default()
        };
        // 20, then 20 + 1 + 0.5 K/s × 0, 10 and 20 s.
        assert_eq!(
            series(Shape::Curve(curve)).samples("x"),
            [20.0, 20.0, 21.0, 26.0, 31.0]
        );
    }

    #[test]
    fn a_sine_is_zero_at_half_its_period_and_full_at_a_quarter() {
        let curve = Curve {
            length: seconds(40),
            amplitude: 2.0,
            period: seconds(40),
            ..Curve::default()
        };
        let values = series(Shape::Curve(curve)).samples("x");
        assert_eq!((values[0], values[1]), (0.0, 2.0));
        assert!(values[2].abs() < 1e-15, "{}", values[2]);
    }

    #[test]
    fn noise_has_its_standard_deviation_and_repeats_with_its_seed() {
        let noisy = |seed| Series {
            noise: 3.0,
            seed,
            ..series(Shape::Samples(vec![0.0; 10_000]))
        };
        let values = noisy(1).samples("x");
        let variance = values.iter().map(|value| value * value).sum::<f64>() / 10_000.0;
        // The standard error of a standard deviation from n values is σ / √(2n).
        assert!((variance.sqrt() - 3.0).abs() < 4.0 * 3.0 / 20_000_f64.sqrt());
        assert_eq!(values, noisy(1).samples("x"));
        assert_ne!(values, noisy(2).samples("x"));
        assert_ne!(values, noisy(1).samples("y"), "channels are independent");
    }
}
