//! Channels computed from channels at the same instant: sums, products, scalings, differences in time.

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::node::{
    Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs, PortSummary,
    Reach, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The weighted sum of its inputs: `Σ w_i x_i`, such as the mean of two sensors or what one has more than another.
///
/// It exists while all inputs do; each is held up to its maximum age. Of temperatures in Cel or `[degF]` the weights
/// must add up to 1 or to 0. A sum of 1 gives a temperature, 0 a difference, in K of Cel and in `[degR]` of `[degF]`.
/// Other sums would depend on where the scale has its zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sum {
    /// The weight of each input, in order; without it, 1 for all.
    #[serde(default)]
    pub weights: Option<Vec<f64>>,
}

/// The product of its inputs, such as an interaction of two temperatures.
///
/// `y = Π x_i`. It exists while all inputs do; each is held up to its maximum age.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Product {
    /// The unit of the product; its inputs are taken as plain numbers in their own units.
    pub unit: Unit,
}

/// Each channel times a factor plus an offset: `y = factor · x + offset`.
///
/// Where `unit` measures the same as the input, `x` is first converted to it: a factor of 1 makes micrometres of nanometres. To
/// and from temperature scales points are converted: 20 Cel are 68 `[degF]` and 293.15 K. A unit that measures something else is
/// that of the result, and `x` a plain number in its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scale {
    /// The factor.
    #[serde(default = "one")]
    pub factor: f64,
    /// The offset, in the unit of the result: `"0.2 K"`.
    #[serde(default)]
    pub offset: Option<Quantity>,
    /// The unit of the result; without it, that of the input.
    #[serde(default)]
    pub unit: Option<Unit>,
}

fn one() -> f64 {
    1.0
}

const TERMS: InputPort = InputPort::held("signal", "the channels that are put together");

fn same_units(inputs: &Inputs) -> Result<&Channel, Vec<Mistake>> {
    let channels = inputs.port("signal");
    let Some(first) = channels.first() else {
        return Err(vec![Mistake::at(
            "inputs.signal",
            "there is nothing to put together",
        )]);
    };
    match channels
        .iter()
        .position(|channel| channel.unit != first.unit)
    {
        Some(other) => {
            let message = format!(
                "`{}` is in {} and `{}` in {}",
                inputs.reference("signal", 0),
                first.unit,
                inputs.reference("signal", other),
                channels[other].unit
            );
            let help = "give all in the same unit, with a `scale` node where it is another";
            Err(vec![Mistake::at("inputs.signal", message).help(help)])
        }
        None => Ok(first),
    }
}

/// A channel that summarises as much of the past as the longest of several, under one name.
fn together(inputs: &Inputs, name: &str, unit: Unit) -> Channel {
    let channels = inputs.port("signal");
    let spans = channels.iter().map(|channel| channel.span);
    Channel {
        name: inputs.member.clone().unwrap_or_else(|| name.to_owned()),
        unit,
        span: spans.max().unwrap_or_default(),
        ahead: channels
            .iter()
            .map(|channel| channel.ahead)
            .max()
            .unwrap_or_default(),
        max_age: channels.iter().filter_map(|channel| channel.max_age).min(),
    }
}

impl Feature for Sum {
    fn inputs() -> &'static [InputPort] {
        const { &[TERMS] }
    }

    fn ports() -> &'static [PortSummary] {
        const { &[PortSummary::new("sum", "the sum")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal");
        let weights = self.weights.as_deref();
        let miscounted = weights.filter(|weights| weights.len() != channels.len());
        let miscounted = miscounted.map(|weights| {
            let message = format!(
                "`weights` has {} numbers for {} channels",
                weights.len(),
                channels.len()
            );
            Mistake::at("weights", message)
        });
        let first = match (same_units(inputs), miscounted) {
            (Ok(first), None) => first,
            (units, miscounted) => {
                let mistakes = units.err().into_iter().flatten().chain(miscounted);
                return Err(mistakes.collect());
            }
        };
        let total = weights.map_or(channels.len() as f64, |weights| weights.iter().sum());
        let adds_up_to = |sum: f64| (total - sum).abs() < 1e-9;
        let is_scale = first.unit.is_temperature_point();
        if is_scale && !adds_up_to(0.0) && !adds_up_to(1.0) {
            // What it would be hangs on where the scale has its zero.
            let message = format!(
                "weights of temperatures in {} add up to {total}, which makes neither a temperature nor a difference",
                first.unit
            );
            let help = "let `weights` add up to 1, as those of a mean do, or to 0, as those of a difference do; or take temperatures \
                        in K, by a `scale` with `unit = \"K\"`";
            let place = self.weights.as_ref().map_or("inputs.signal", |_| "weights");
            return Err(vec![Mistake::at(place, message).help(help)]);
        }
        let unit = if is_scale && adds_up_to(0.0) {
            first.unit.difference()
        } else {
            first.unit.clone()
        };
        Ok(vec![OutputPort {
            name: "sum",
            channels: vec![together(inputs, "sum", unit)],
        }])
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let ones = || vec![1.0; inputs.port("signal").len()];
        Box::new(Adding {
            weights: self.weights.clone().unwrap_or_else(ones),
        })
    }
}

struct Adding {
    weights: Vec<f64>,
}

impl Operator for Adding {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        // An absent term is a NaN and makes the sum one.
        let terms = tick.port(0).iter().zip(&self.weights);
        outputs.set(0, terms.map(|(value, weight)| weight * value).sum());
    }

    fn segment(&mut self) {}
}

impl Feature for Product {
    fn facts() -> KindFacts {
        KindFacts::default().change()
    }

    fn inputs() -> &'static [InputPort] {
        const { &[TERMS] }
    }

    fn ports() -> &'static [PortSummary] {
        const { &[PortSummary::new("product", "the product")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        if inputs.port("signal").is_empty() {
            return Err(vec![Mistake::at(
                "inputs.signal",
                "there is nothing to multiply",
            )]);
        }
        let channel = together(inputs, "product", self.unit.clone());
        Ok(vec![OutputPort {
            name: "product",
            channels: vec![channel],
        }])
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Multiplying)
    }
}

struct Multiplying;

impl Operator for Multiplying {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        outputs.set(0, tick.port(0).iter().product());
    }

    fn segment(&mut self) {}
}

impl Scale {
    fn unit_of(&self, from: &Channel) -> Unit {
        self.unit.clone().unwrap_or_else(|| from.unit.clone())
    }
}

impl Scale {
    /// The slope and offset of a channel's line, in the unit of the result.
    fn line(&self, from: &Channel) -> (f64, f64) {
        let unit = self.unit_of(from);
        let shift = from.unit.convert(0.0, &unit);
        let gain = from.unit.factor_to(&unit);
        let (gain, shift) = gain.zip(shift).unwrap_or((1.0, 0.0));
        let offset = self.offset.as_ref();
        let offset = offset.and_then(|offset| offset.as_difference(&unit));
        (
            self.factor * gain,
            self.factor * shift + offset.unwrap_or(0.0),
        )
    }
}

impl Feature for Scale {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is scaled")] }
    }

    fn ports() -> &'static [PortSummary] {
        const { &[PortSummary::new("scaled", "each channel, scaled")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mut mistakes = Vec::new();
        let mut channels = inputs.port("signal").to_vec();
        for channel in &mut channels {
            let unit = self.unit_of(channel);
            if let Some(offset) = &self.offset
                && offset.as_difference(&unit).is_none()
                && mistakes.is_empty()
            {
                let message = format!("`offset` is in {} and the result in {unit}", offset.unit);
                mistakes.push(Mistake::at("offset", message));
            }
            channel.unit = unit;
        }
        if mistakes.is_empty() {
            Ok(vec![OutputPort {
                name: "scaled",
                channels,
            }])
        } else {
            Err(mistakes)
        }
    }

    fn every_tick(&self) -> bool {
        // A run of the producer that gave nothing is no new value, and still ends the hold of the one before.
        true
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let lines = inputs.port("signal").iter();
        Box::new(Scaling {
            lines: lines.map(|channel| self.line(channel)).collect(),
        })
    }
}

struct Scaling {
    /// The slope and offset of each channel's line.
    lines: Vec<(f64, f64)>,
}

impl Operator for Scaling {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let inputs = tick.port(0).iter().zip(tick.stamps(0)).zip(&self.lines);
        for (i, ((&value, &stamp), (gain, offset))) in inputs.enumerate() {
            if is_unchanged(value) {
                continue;
            }
            let scaled = if value.is_nan() {
                ABSENT
            } else {
                gain * value + offset
            };
            outputs.set_stamped(i, scaled, stamp);
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Sum, Feature, "sum");
athermal_core::register!(Product, Feature, "product");
athermal_core::register!(Scale, Feature, "scale");

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn line(text: &str, from: &str) -> (f64, f64) {
        let scale: Scale = serde_json::from_str(text).unwrap();
        let channel = Channel {
            name: "x".to_owned(),
            unit: from.parse().unwrap(),
            span: Default::default(),
            ahead: Default::default(),
            max_age: None,
        };
        scale.line(&channel)
    }

    fn near(found: (f64, f64), expected: (f64, f64)) {
        let within = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs().max(1.0);
        assert!(
            within(found.0, expected.0) && within(found.1, expected.1),
            "{found:?}"
        );
    }

    #[test]
    fn a_unit_of_the_same_kind_is_converted_to() {
        near(line(r#"{ "unit": "um" }"#, "nm"), (1e-3, 0.0));
        near(
            line(r#"{ "unit": "um", "factor": 2, "offset": "5 nm" }"#, "nm"),
            (2e-3, 5e-3),
        );
        near(line(r#"{ "unit": "[degF]" }"#, "Cel"), (1.8, 32.0));
        near(line(r#"{ "unit": "K" }"#, "Cel"), (1.0, 273.15));
    }

    #[test]
    fn a_unit_of_another_kind_is_that_of_the_result() {
        near(line(r#"{ "unit": "um", "factor": 3 }"#, "V"), (3.0, 0.0));
        near(
            line(r#"{ "factor": 3, "offset": "1 mV" }"#, "V"),
            (3.0, 1e-3),
        );
    }
}
