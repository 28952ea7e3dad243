//! What steps: an engine alone, or both ends of one that can be replaced.

use std::path::PathBuf;

use super::super::monitor::{Finding, Monitor};
use super::super::{Control, Feed, LiveOptions, RunError, Stepper, pair_from};
use super::swap_schedule::SwapSchedule;
use super::{Replacement, Reporter};
use crate::engine::{Engine, EngineError};
use crate::model::Model;
use crate::time::Instant;

/// What a session steps.
pub(super) enum Runner {
    Fixed(Box<(Engine, Model)>),
    Replaceable(Box<Replaceable>),
}

/// A graph that can be replaced, with its control on the same thread.
pub(super) struct Replaceable {
    stepper: Stepper,
    control: Control,
    schedule: SwapSchedule,
    feed: Vec<Feed>,
    /// The outputs in the order of the columns, and where they stand among those of the graph.
    shown: Vec<f64>,
    places: Vec<Option<usize>>,
    /// How many graphs had taken over when the places were found.
    generation: Option<u64>,
}

/// The monitors, and what they have found.
type Watching<'a, 'm> = (&'a mut [&'m mut dyn Monitor], &'a mut Vec<Finding>);

impl Runner {
    pub(super) fn fixed(mut engine: Engine, model: Model, frozen: bool) -> Self {
        engine.freeze(frozen);
        Self::Fixed(Box::new((engine, model)))
    }

    pub(super) fn replaceable(
        engine: Engine,
        model: Model,
        replacement: Replacement,
        (feed, columns): (Vec<Feed>, Vec<String>),
        frozen: bool,
    ) -> Result<Self, RunError> {
        let live = LiveOptions {
            channels: feed.clone(),
            ..LiveOptions::default()
        };
        let (mut stepper, control) = pair_from(engine, live)?;
        stepper.freeze(frozen);
        let mut runner = Self::Replaceable(Box::new(Replaceable {
            stepper,
            control,
            schedule: SwapSchedule::new(model, replacement),
            feed,
            shown: Vec::new(),
            places: Vec::new(),
            generation: None,
        }));
        runner.set_columns(columns);
        Ok(runner)
    }

    /// How many samples a row has.
    pub(super) fn width(&self) -> usize {
        match self {
            Self::Fixed(of) => of.1.plan.sources.len(),
            Self::Replaceable(of) => of.feed.len(),
        }
    }

    pub(super) fn set_columns(&mut self, columns: Vec<String>) {
        if let Self::Replaceable(of) = self {
            of.shown = vec![f64::NAN; columns.len()];
            of.schedule.set_columns(columns);
            of.generation = None;
        }
    }

    pub(super) fn engine(&self) -> &Engine {
        match self {
            Self::Fixed(of) => &of.0,
            Self::Replaceable(of) => of.stepper.engine(),
        }
    }

    pub(super) fn model(&self) -> &Model {
        match self {
            Self::Fixed(of) => &of.1,
            Self::Replaceable(of) => of.schedule.running(),
        }
    }

    pub(super) fn segment(&mut self) {
        match self {
            Self::Fixed(of) => of.0.segment(),
            Self::Replaceable(of) => of.stepper.segment(),
        }
    }

    pub(super) fn freeze(&mut self, frozen: bool) {
        match self {
            Self::Fixed(of) => of.0.freeze(frozen),
            Self::Replaceable(of) => of.stepper.freeze(frozen),
        }
    }

    pub(super) fn swap(&mut self, path: PathBuf, model: Model) -> Result<(), Box<Model>> {
        let Self::Replaceable(of) = self else {
            return Err(Box::new(model));
        };
        of.schedule.add(path, model);
        Ok(())
    }

    /// Steps a row; false where its time is not after the last one.
    pub(super) fn step(
        &mut self,
        time: Instant,
        samples: &[f64],
        watching: Watching<'_, '_>,
        reporter: &dyn Reporter,
    ) -> Result<bool, RunError> {
        match self {
            Self::Fixed(of) => match of.0.step(time, samples) {
                Ok(_) => Ok(true),
                Err(EngineError::NotAfter { .. }) => Ok(false),
                Err(error) => Err(error.into()),
            },
            Self::Replaceable(of) => of.step(time, samples, watching, reporter),
        }
    }

    /// The revision of the graph that stepped last, and its outputs.
    pub(super) fn made(&self) -> (&str, &[f64]) {
        match self {
            Self::Fixed(of) => (of.0.revision(), of.0.outputs()),
            Self::Replaceable(of) => (of.stepper.engine().revision(), &of.shown),
        }
    }

    pub(super) fn end(&mut self, reporter: &dyn Reporter) {
        if let Self::Replaceable(of) = self {
            of.schedule.end(&mut of.control, reporter);
        }
    }
}

impl Replaceable {
    fn step(
        &mut self,
        time: Instant,
        samples: &[f64],
        (monitors, found): Watching<'_, '_>,
        reporter: &dyn Reporter,
    ) -> Result<bool, RunError> {
        self.schedule.before(&mut self.control, time, reporter)?;
        let stepped = match self.stepper.step(time, samples) {
            Ok(stepped) => stepped,
            Err(EngineError::NotAfter { .. }) => return Ok(false),
            Err(error) => return Err(error.into()),
        };
        // Two graphs of one revision may give their outputs in another order.
        if self.generation != Some(stepped.generation) {
            self.generation = Some(stepped.generation);
            let place = |name: &String| {
                let mut outputs = stepped.plan.outputs.iter();
                outputs.position(|output| output.name == *name)
            };
            self.places.clear();
            self.places
                .extend(self.schedule.columns().iter().map(place));
            let usual = self.schedule.running().sample_ranges();
            for monitor in monitors {
                monitor.follow(stepped.plan, &self.feed, usual, found);
            }
        }
        for (shown, place) in self.shown.iter_mut().zip(&self.places) {
            *shown = place.map_or(f64::NAN, |place| stepped.outputs[place]);
        }
        self.schedule.count(&self.shown);
        Ok(true)
    }
}
