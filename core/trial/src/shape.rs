//! Decides how made-up measurements are written: which keys go together, and quantities in the unit of the channel.

use super::problem;
use super::series::{Curve, Series, Shape};
use super::table::{InputTable, Sample};
use crate::diagnostic::Diagnostics;
use crate::document::problem::MissingKey;
use crate::document::{Value, decode};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

/// The most samples of one channel.
const MOST_SAMPLES: i64 = 10_000_000;

/// The series of a channel; `None` after a mistake.
pub(super) fn read(
    value: &Value,
    channel: &str,
    unit: &Unit,
    diagnostics: &mut Diagnostics,
) -> Option<Series> {
    let before = diagnostics.error_count();
    let table = decode::<InputTable>(value, "the input", diagnostics)?;
    let mut shaping = Shaping {
        value,
        channel,
        unit,
        diagnostics,
    };
    let noise = shaping.difference("noise", table.noise.as_ref(), &unit.difference());
    let shape = shaping.shape(&table);
    if noise < 0.0 || noise.is_nan() {
        shaping.range("noise", noise.to_string(), "0 or more");
    }
    if table.every <= Duration::ZERO {
        shaping.range("every", table.every.to_string(), "greater than 0");
    }
    (diagnostics.error_count() == before).then_some(Series {
        every: table.every,
        shape,
        noise,
        seed: table.seed,
    })
}

struct Shaping<'a> {
    value: &'a Value,
    channel: &'a str,
    unit: &'a Unit,
    diagnostics: &'a mut Diagnostics,
}

impl Shaping<'_> {
    fn shape(&mut self, table: &InputTable) -> Shape {
        let curved = [
            ("constant", table.constant.is_some()),
            ("start", table.start.is_some()),
            ("ramp", table.ramp.is_some()),
            ("step", table.step.is_some()),
            ("sine", table.sine.is_some()),
        ];
        let given: Vec<&'static str> = curved
            .into_iter()
            .filter(|(_, given)| *given)
            .map(|(key, _)| key)
            .collect();
        if let Some(samples) = &table.samples {
            let last = i64::try_from(samples.len()).unwrap_or(i64::MAX);
            if table.every.as_ns().checked_mul(last).is_none() {
                let found = format!("{} for {} samples", table.every, samples.len());
                self.range("every", found, "at most 292 years for all of them");
            }
            let others = [
                ("period", table.period.is_some()),
                ("delay", table.delay.is_some()),
                ("for", table.length.is_some()),
            ];
            let others = others.into_iter().filter(|(_, given)| *given);
            for key in given.into_iter().chain(others.map(|(key, _)| key)) {
                self.keys(key, "samples", true);
            }
            let samples = samples.iter().enumerate();
            return Shape::Samples(
                samples
                    .map(|(nth, sample)| self.sample(nth, sample))
                    .collect(),
            );
        }
        let shapeless = given.is_empty() && table.noise.is_none();
        if shapeless {
            self.diagnostics
                .report(self.value.place, problem::NoShape {});
        }
        if table.constant.is_some() {
            for key in given.into_iter().filter(|key| *key != "constant") {
                self.keys(key, "constant", true);
            }
        }
        if table.delay.is_some() {
            let changes = table.step.is_some() || table.ramp.is_some() || table.sine.is_some();
            if table.constant.is_some() {
                self.keys("delay", "constant", true);
            } else if !changes && !shapeless {
                self.keys("delay", "step", false);
            }
        }
        if table.period.is_some() && table.sine.is_none() {
            self.keys("period", "sine", false);
        }
        if table.sine.is_some() && table.period.is_none() {
            self.keys("sine", "period", false);
        }
        let curve = self.curve(table);
        self.lengths(table, &curve);
        Shape::Curve(curve)
    }

    fn curve(&mut self, table: &InputTable) -> Curve {
        let difference = self.unit.difference();
        let rate = difference.per(&Unit::second());
        let (start, key) = match &table.constant {
            Some(constant) => (Some(constant), "constant"),
            None => (table.start.as_ref(), "start"),
        };
        Curve {
            length: table.length.unwrap_or_default(),
            start: self.point(key, start),
            delay: table.delay.unwrap_or_default(),
            step: self.difference("step", table.step.as_ref(), &difference),
            ramp: self.difference("ramp", table.ramp.as_ref(), &rate),
            amplitude: self.difference("sine", table.sine.as_ref(), &difference),
            period: table.period.unwrap_or(Duration::MAX),
        }
    }

    fn lengths(&mut self, table: &InputTable, curve: &Curve) {
        match table.length {
            None => self.diagnostics.report(
                self.value.place,
                MissingKey {
                    key: "for".to_owned(),
                    what: "the input".to_owned(),
                    advice: Some("say how long it lasts, e.g. for = \"20min\"".to_owned()),
                },
            ),
            Some(length) if length < Duration::ZERO => {
                self.range("for", length.to_string(), "0 or longer");
            }
            Some(length)
                if table.every > Duration::ZERO
                    && length.as_ns() / table.every.as_ns() >= MOST_SAMPLES =>
            {
                let found = format!("{length} with a sample every {}", table.every);
                self.range("for", found, "at most 10,000,000 samples long");
            }
            Some(_) => {}
        }
        if let Some(delay) = table.delay.filter(|delay| *delay < Duration::ZERO) {
            self.range("delay", delay.to_string(), "0 or longer");
        }
        if curve.period <= Duration::ZERO {
            self.range("period", curve.period.to_string(), "greater than 0");
        }
    }

    fn sample(&mut self, nth: usize, sample: &Sample) -> f64 {
        match sample {
            Sample::Absent(number) if number.is_nan() => f64::NAN,
            Sample::Absent(number) => {
                let samples = self
                    .value
                    .as_table()
                    .and_then(|keys| keys.get("samples")?.as_list());
                let place = samples
                    .and_then(|samples| samples.get(nth))
                    .map_or(self.value.place, |value| value.place);
                let problem = problem::BareSample {
                    number: *number,
                    unit: self.unit.clone(),
                };
                self.diagnostics.report(place, problem);
                f64::NAN
            }
            Sample::Value(quantity) => self.point("samples", Some(quantity)),
        }
    }

    /// A value as a number in the unit of the channel; 0 for none, and after a mistake.
    fn point(&mut self, key: &'static str, quantity: Option<&Quantity>) -> f64 {
        let unit = self.unit;
        self.converted(key, quantity, unit, |quantity| quantity.in_unit(unit))
    }

    /// A change as a number in `unit`; 0 for none, and after a mistake.
    fn difference(&mut self, key: &'static str, quantity: Option<&Quantity>, unit: &Unit) -> f64 {
        self.converted(key, quantity, unit, |quantity| quantity.as_difference(unit))
    }

    fn converted(
        &mut self,
        key: &'static str,
        quantity: Option<&Quantity>,
        unit: &Unit,
        convert: impl Fn(&Quantity) -> Option<f64>,
    ) -> f64 {
        let Some(quantity) = quantity else {
            return 0.0;
        };
        convert(quantity).unwrap_or_else(|| {
            let problem = problem::Units {
                key,
                found: quantity.unit.clone(),
                channel: self.channel.to_owned(),
                expected: unit.clone(),
            };
            self.diagnostics.report(self.value.place_of(key), problem);
            0.0
        })
    }

    fn keys(&mut self, key: &'static str, with: &'static str, excluded: bool) {
        let problem = problem::keys(key, with, excluded);
        self.diagnostics.report(self.value.place_of(key), problem);
    }

    fn range(&mut self, key: &'static str, found: String, allowed: &'static str) {
        let problem = problem::Range {
            key,
            found,
            allowed,
        };
        self.diagnostics.report(self.value.place_of(key), problem);
    }
}
