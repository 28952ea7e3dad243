//! Decides what of a run is compared, and how a difference is worded.

use super::fixture::Fixture;
use crate::channel::is_cold;
use crate::engine::Engine;
use crate::recording::Event;
use crate::time::Instant;

/// What a node gave over a run: for each tick its instant and, for each slot of the node, value and stamp.
#[derive(Debug, Clone, Default)]
pub(super) struct Course {
    ticks: Vec<(Instant, Vec<Given>)>,
}

/// What a slot was given at a tick; none where the node did not run.
pub type Given = Option<(f64, Instant)>;

impl Course {
    /// Writes down what the engine's last tick gave.
    pub(super) fn note(&mut self, fixture: &Fixture, engine: &Engine, now: Instant) {
        let slots = fixture.slots().map(|slot| {
            let ran = engine.ran(slot);
            ran.then(|| (engine.value(slot), engine.stamp(slot)))
        });
        self.ticks.push((now, slots.collect()));
    }

    /// The values of a slot of the node, tick by tick; NaN where there is none.
    pub(super) fn values(&self, number: usize) -> impl Iterator<Item = f64> + '_ {
        self.ticks
            .iter()
            .map(move |(_, slots)| slots[number].map_or(f64::NAN, |(value, _)| value))
    }

    /// What a slot of the node was given, tick by tick.
    pub(super) fn given(&self, number: usize) -> impl Iterator<Item = (Instant, Given)> + '_ {
        self.ticks
            .iter()
            .map(move |(now, slots)| (*now, slots[number]))
    }

    /// The first value of a channel of which something is so, and when.
    pub(super) fn find(&self, number: usize, is: impl Fn(f64) -> bool) -> Option<(Instant, f64)> {
        let mut all = self.instants().zip(self.values(number));
        all.find(|(_, value)| is(*value))
    }

    /// The size of the largest finite value of a channel.
    pub(super) fn largest(&self, number: usize) -> f64 {
        let finite = self.values(number).filter(|value| value.is_finite());
        finite.fold(0.0, |largest, value| largest.max(value.abs()))
    }

    /// The instants of the ticks.
    pub(super) fn instants(&self) -> impl Iterator<Item = Instant> + '_ {
        self.ticks.iter().map(|(now, _)| *now)
    }

    /// The part from a tick on.
    pub(super) fn from(&self, tick: usize) -> Self {
        Self {
            ticks: self.ticks[tick..].to_vec(),
        }
    }

    /// The first difference in bits or stamps to another course, in words.
    pub(super) fn difference(&self, other: &Self, fixture: &Fixture) -> Option<String> {
        self.difference_where(other, fixture, |_| true)
    }

    /// The same of some slots.
    pub(super) fn difference_where(
        &self,
        other: &Self,
        fixture: &Fixture,
        counts: impl Fn(usize) -> bool,
    ) -> Option<String> {
        if self.ticks.len() != other.ticks.len() {
            return Some(format!(
                "one run has {} ticks and the other {}",
                self.ticks.len(),
                other.ticks.len()
            ));
        }
        let ticks = self.ticks.iter().zip(&other.ticks).enumerate();
        for (nth, ((now, one), (_, two))) in ticks {
            for (number, (one, two)) in one.iter().zip(two).enumerate() {
                let slot = fixture.slots().start + number;
                if !alike(*one, *two) && counts(slot) {
                    return Some(format!(
                        "at tick {nth} ({now} s) `{}` is {} in one run and {} in the other",
                        fixture.plan.channels[slot].name,
                        worded(*one),
                        worded(*two)
                    ));
                }
            }
        }
        None
    }
}

fn alike(one: Given, two: Given) -> bool {
    match (one, two) {
        (None, None) => true,
        (Some((one, at_one)), Some((two, at_two))) => {
            if one.is_nan() {
                // Of what is said by the payload of a NaN, this alone counts.
                two.is_nan() && is_cold(one) == is_cold(two)
            } else {
                one.to_bits() == two.to_bits() && at_one == at_two
            }
        }
        _ => false,
    }
}

fn worded(given: Given) -> String {
    match given {
        None => "not given".to_owned(),
        Some((value, _)) if is_cold(value) => "absent (`COLD`)".to_owned(),
        Some((value, _)) if value.is_nan() => "absent".to_owned(),
        Some((value, stamp)) => format!("{value:?} (of {stamp} s)"),
    }
}

/// Steps an engine through events, writing down what the node gives.
pub(super) fn course(
    fixture: &Fixture,
    engine: &mut Engine,
    events: &[(Event, Vec<f64>)],
) -> Course {
    let mut course = Course::default();
    for (event, values) in events {
        match event {
            Event::Segment => engine.segment(),
            Event::Row(now) => {
                engine
                    .step(*now, values)
                    .expect("the instants of a test are in order");
                course.note(fixture, engine, *now);
            }
        }
    }
    course
}

/// Whether two values have the same bits, or are both absent.
pub(super) fn same_bits(one: f64, two: f64) -> bool {
    one.to_bits() == two.to_bits() || (one.is_nan() && two.is_nan())
}

/// Nothing, or all that was found.
pub(super) fn none_of(found: Vec<String>) -> Result<(), String> {
    if found.is_empty() {
        Ok(())
    } else {
        Err(found.join("\n"))
    }
}
