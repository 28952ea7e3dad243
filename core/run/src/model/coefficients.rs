//! The fitted estimators of a model: the name and unit of each coefficient.

use athermal_numerics::Fading;
use serde::Serialize;

use super::Model;
use crate::compile::{Plan, PlannedNode, PlannedRole};
use crate::node::{Coefficients, Factor, Mode, Noise, Of, Predictor, Regressor, Term};
use crate::unit::Unit;

/// The longest difference equation of which modes are shown, in steps.
const LONGEST: i64 = 100;

/// A fitted estimator.
#[derive(Debug, Serialize)]
pub struct FittedEstimator {
    /// Its node or instance: `thermal.Z1`.
    pub node: String,
    /// The type of its node.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// The channel that it predicts.
    pub truth: String,
    /// The unit of a difference of the truth.
    pub unit: String,
    /// None of a kind without coefficients.
    #[serde(flatten)]
    pub parts: Option<EstimatorParts>,
}

/// What it consists of.
#[derive(Debug, Serialize)]
pub struct EstimatorParts {
    /// The coefficients, each with its name.
    pub coefficients: Vec<Coefficient>,
    /// The standard deviations of its noises.
    pub noises: Vec<Noise>,
    /// How it comes to rest.
    pub modes: Vec<Mode>,
    /// The step of its difference equation, in s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_s: Option<f64>,
    /// How often its noise is integrated.
    #[serde(skip_serializing_if = "is_zero")]
    pub differences: usize,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_zero(value: &usize) -> bool {
    *value == 0
}

/// A coefficient.
#[derive(Debug, Serialize)]
pub struct Coefficient {
    /// Of what: `constant`, or what it is multiplied by.
    pub name: String,
    /// The letter of its polynomial.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polynomial: Option<char>,
    /// Its power of the shift in the polynomial.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// The factors of the product that it multiplies.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub factors: Vec<ProductFactor>,
    /// Its value.
    pub value: f64,
    /// Its standard error, where theory has one.
    pub standard_error: Option<f64>,
    /// Its unit is that of the truth per this one; none where it has no unit, and of a constant.
    pub per: Option<String>,
}

/// A regressor in a product, as the difference from a value.
#[derive(Debug, Serialize)]
pub struct ProductFactor {
    /// The regressor.
    pub regressor: String,
    /// The unit of a difference of its values.
    pub unit: String,
    /// The value from which it counts; none for 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub about: Option<f64>,
    /// The least and the largest value that counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held: Option<(f64, f64)>,
}

impl Model {
    /// Every fitted estimator, in the order of the plan.
    #[must_use]
    pub fn estimators(&self) -> Vec<FittedEstimator> {
        let nodes = self.plan.nodes.iter();
        let estimators = nodes.filter_map(|node| {
            let predictor = self.fitted.get(&node.instance())?;
            estimator_of(&self.plan, node, &**predictor)
        });
        estimators.collect()
    }

    /// The instances of both that have other fitted parameters in another model; none where one of the two was not fitted.
    #[must_use]
    pub fn refitted(&self, other: &Self) -> Vec<String> {
        if self.card.is_none() || other.card.is_none() {
            return Vec::new();
        }
        let parameters = |model: &Self, instance: &str| {
            let predictor = model.fitted.get(instance)?;
            serde_json::to_value(&**predictor).ok()
        };
        let nodes = self.plan.nodes.iter();
        let mut instances: Vec<String> = nodes.map(PlannedNode::instance).collect();
        instances.retain(|instance| {
            let mut there = other.plan.nodes.iter();
            there.any(|node| node.instance() == *instance)
                && parameters(self, instance) != parameters(other, instance)
        });
        instances.sort_unstable();
        instances
    }
}

fn estimator_of(
    plan: &Plan,
    node: &PlannedNode,
    predictor: &dyn Predictor,
) -> Option<FittedEstimator> {
    let PlannedRole::Estimator { fit, .. } = &node.role else {
        return None;
    };
    let channel = &plan.channels[fit.truth.slot];
    let used = predictor.uses().iter();
    let used: Option<Vec<&Regressor>> = used
        .map(|name| fit.regressors.iter().find(|of| of.name == *name))
        .collect();
    let parts = used.zip(predictor.coefficients()).map(|(used, mut found)| {
        recur(&mut found, &used, fit.truth.ahead.as_ns());
        Names(&used).parts(found)
    });
    Some(FittedEstimator {
        node: node.instance(),
        kind: node.kind.name,
        truth: channel.name.clone(),
        unit: channel.channel.unit.difference().to_string(),
        parts,
    })
}

/// Adds the modes of a sum that has past truths among its regressors: fed with its own predictions, it is a difference
/// equation, whose step is the shortest time from such a truth to the one that is predicted.
fn recur(found: &mut Coefficients, used: &[&Regressor], ahead_ns: i64) {
    let mut lagged: Vec<(i64, f64)> = Vec::new();
    for term in &found.terms {
        match &term.of {
            Of::Constant => {}
            Of::Product(factors) => match factors[..] {
                [factor] if factor == Factor::of(factor.regressor) => {
                    let of = used[factor.regressor];
                    if of.of_truth {
                        lagged.push((of.lag.as_ns() + ahead_ns, term.value));
                    }
                }
                _ => return,
            },
            Of::Power { .. } => return,
        }
    }
    let step_ns = lagged.iter().map(|&(back, _)| back).min().unwrap_or(0);
    let even = |&(back, _): &(i64, f64)| back % step_ns == 0 && back / step_ns <= LONGEST;
    if step_ns <= 0 || !lagged.iter().all(even) {
        return;
    }
    let longest = lagged.iter().map(|&(back, _)| back / step_ns).max();
    let mut polynomial = vec![0.0; longest.map_or(0, |longest| longest as usize)];
    for (back, value) in lagged {
        polynomial[(back / step_ns) as usize - 1] -= value;
    }
    let step_s = step_ns as f64 / 1e9;
    let modes = Fading::of(&polynomial).into_iter();
    found.modes.extend(modes.map(|fading| Mode {
        of: "past truths".to_owned(),
        time_constant_s: fading.time_constant * step_s,
        period_s: fading.period.map(|period| period * step_s),
    }));
}

/// The regressors that are used.
struct Names<'a>(&'a [&'a Regressor]);

impl Names<'_> {
    fn parts(&self, of: Coefficients) -> EstimatorParts {
        EstimatorParts {
            coefficients: of.terms.iter().map(|term| self.coefficient(term)).collect(),
            noises: of.noises,
            modes: of.modes,
            step_s: of.step.map(crate::time::Duration::secs),
            differences: of.differences,
        }
    }

    fn coefficient(&self, term: &Term) -> Coefficient {
        let plain = Coefficient {
            name: "constant".to_owned(),
            polynomial: None,
            steps: None,
            factors: Vec::new(),
            value: term.value,
            standard_error: term.error,
            per: None,
        };
        match &term.of {
            Of::Constant => plain,
            Of::Product(factors) => {
                let factors: Vec<_> = factors.iter().map(|factor| self.factor(factor)).collect();
                let names: Vec<String> = powers(factors.iter().map(|of| &*of.regressor));
                let units: Vec<String> = powers(factors.iter().map(|of| &*of.unit));
                Coefficient {
                    name: names.join(" × "),
                    per: Some(units.join("·")),
                    factors,
                    ..plain
                }
            }
            &Of::Power {
                polynomial,
                steps,
                input,
            } => {
                let input = input.map(|input| self.0[input]);
                let parts = [
                    polynomial.to_string(),
                    input.map_or_else(String::new, |of| of.name.clone()),
                    back(steps),
                ];
                let parts: Vec<String> = parts.into_iter().filter(|of| !of.is_empty()).collect();
                let has_unit = polynomial == 'B';
                Coefficient {
                    name: parts.join(" "),
                    polynomial: Some(polynomial),
                    steps: Some(steps),
                    per: input.filter(|_| has_unit).map(unit),
                    ..plain
                }
            }
        }
    }

    fn factor(&self, factor: &Factor) -> ProductFactor {
        let of = self.0[factor.regressor];
        let (least, largest) = factor.held;
        ProductFactor {
            regressor: of.name.clone(),
            unit: unit(of),
            about: Some(factor.about).filter(|about| *about != 0.0),
            held: (least.is_finite() || largest.is_finite()).then_some(factor.held),
        }
    }
}

/// The unit of a difference of its values.
fn unit(of: &Regressor) -> String {
    let unit = Unit::parse(&of.unit).map(|unit| unit.difference().to_string());
    unit.unwrap_or_else(|_| of.unit.clone())
}

/// What comes several times in a row as a power.
fn powers<'a>(all: impl Iterator<Item = &'a str>) -> Vec<String> {
    let all: Vec<&str> = all.collect();
    let power = |of: &[&str]| match of.len() {
        1 => of[0].to_owned(),
        times if of[0].contains(['/', ' ']) => format!("({}){}", of[0], superscript(times)),
        times => format!("{}{}", of[0], superscript(times)),
    };
    all.chunk_by(|a, b| a == b).map(power).collect()
}

/// So many steps back.
fn back(steps: usize) -> String {
    match steps {
        0 => String::new(),
        steps => format!("q⁻{}", superscript(steps)),
    }
}

fn superscript(number: usize) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digits = number.to_string();
    digits
        .bytes()
        .map(|digit| DIGITS[usize::from(digit - b'0')])
        .collect()
}
