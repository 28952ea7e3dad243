//! Machines that are unlike the others of their fleet: by their coefficients, by their errors, and by what their sensors showed.

use std::collections::BTreeMap;

use athermal_analysis::chart::{Chart, Layer, Mark};
use athermal_analysis::figures::number;
use athermal_numerics::{median, robust_deviation};
use athermal_run::model::Model;
use serde::{Serialize, Serializer};

/// Of fewer machines no spread is known.
pub const FEWEST: usize = 5;

/// The chance that a fleet of machines that are all alike has one that is named.
const CHANCE: f64 = 0.05;

/// How well the median absolute deviation knows the spread of normal values, beside the standard deviation: 0.368 (Rousseeuw & Croux
/// 1993, "Alternatives to the Median Absolute Deviation", JASA 88, table 2).
const EFFICIENCY: f64 = 0.368;

/// Below so many medians a spread is one of rounding alone.
const ROUNDING: f64 = 1e-9;

/// What machines are compared by.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Trait {
    /// The logarithm of the error of an estimator on the rows of its fit.
    Error {
        /// The estimator.
        of: String,
        /// The unit of the error.
        unit: String,
    },
    /// How an estimator answers an input that lasts: the sum of its coefficients over all windows and lags.
    Response {
        /// The estimator.
        of: String,
        /// The input.
        to: String,
        /// The unit of the sum.
        unit: String,
    },
    /// The middle between the lowest sample of a channel and the highest.
    Middle(String),
    /// The logarithm of how far these are apart.
    Width(String),
}

impl Trait {
    /// What it is, in words.
    #[must_use]
    pub fn words(&self) -> String {
        match self {
            Self::Error { of, .. } => format!("error of {of}"),
            Self::Response { of, to, .. } => format!("response of {of} to {to}"),
            Self::Middle(channel) => format!("middle of {channel}"),
            Self::Width(channel) => format!("range of {channel}"),
        }
    }

    /// A value of it, in words, with its unit where it is known.
    #[must_use]
    pub fn shown(&self, value: f64) -> String {
        match self {
            Self::Error { unit, .. } => format!("{} {unit}", number(libm::exp(value))),
            Self::Response { unit, .. } => format!("{} {unit}", number(value)),
            Self::Middle(_) => number(value),
            Self::Width(_) => number(libm::exp(value)),
        }
    }

    /// What may have come about where it departs so.
    #[must_use]
    pub fn hint(&self, is_more: bool) -> &'static str {
        match (self, is_more) {
            (Self::Error { .. }, true) => "is a part worn, or a sensor noisy?",
            (Self::Error { .. }, false) => "did it stand still while it was recorded?",
            (Self::Response { .. }, _) => "is the sensor loose, or a part worn?",
            (Self::Middle(_), _) => "is the sensor off, or the machine elsewhere?",
            (Self::Width(_), true) => "is the sensor noisy, or was the machine somewhere else?",
            (Self::Width(_), false) => "is the sensor loose or stuck?",
        }
    }
}

impl Serialize for Trait {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.words())
    }
}

/// What a machine is compared by, with its values.
pub type Traits = BTreeMap<Trait, f64>;

/// Those of a model: of its coefficients and its card.
#[must_use]
pub fn traits_of(model: &Model) -> Traits {
    let mut all = Traits::new();
    for estimator in model.estimators() {
        let coefficients = estimator.parts.iter().flat_map(|of| &of.coefficients);
        for of in coefficients {
            // Products and polynomials have no part that is one input's alone.
            let ([factor], None) = (&*of.factors, of.polynomial) else {
                continue;
            };
            let per = of.per.as_deref().unwrap_or("1");
            let to = without_span(&factor.regressor);
            let key = Trait::Response {
                of: estimator.node.clone(),
                to: to.to_owned(),
                unit: format!("{} per {per}", estimator.unit),
            };
            *all.entry(key).or_default() += of.value;
        }
    }
    let Some(card) = &model.card else {
        return all;
    };
    for of in &card.estimators {
        if let Some(rmse) = of.report.in_sample_rmse.filter(|rmse| *rmse > 0.0) {
            let (of, unit) = (of.node.clone(), of.unit.clone());
            all.insert(Trait::Error { of, unit }, libm::log(rmse));
        }
    }
    for range in &card.ranges {
        let (low, high) = (range.lowest, range.highest);
        all.insert(Trait::Middle(range.channel.clone()), 0.5 * (low + high));
        if high > low {
            all.insert(Trait::Width(range.channel.clone()), libm::log(high - low));
        }
    }
    all
}

/// The name of a regressor without its window or lag.
fn without_span(name: &str) -> &str {
    let name = name.split(" lag ").next().unwrap_or(name);
    name.split('@').next().unwrap_or(name)
}

/// One value of one machine beside those of the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Departure {
    /// What is compared.
    #[serde(rename = "trait")]
    pub of: Trait,
    /// The value, as words.
    pub value: String,
    /// The median of the fleet, as words.
    pub fleet: String,
    /// The modified z-score.
    pub score: f64,
}

impl Departure {
    /// A sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        let Self {
            of,
            value,
            fleet,
            score,
        } = self;
        let hint = of.hint(*score > 0.0);
        format!(
            "{} is {value}, that of the fleet {fleet} (score {score:+.1}): {hint}",
            of.words()
        )
    }
}

/// A machine with all of its departures, the largest first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Member {
    /// The machine.
    pub machine: String,
    /// Whether its largest score is beyond the limit.
    pub unlike: bool,
    /// Its departures.
    pub departures: Vec<Departure>,
}

impl Member {
    /// Those beyond a limit.
    pub fn beyond(&self, limit: f64) -> impl Iterator<Item = &Departure> {
        self.departures
            .iter()
            .take_while(move |of| of.score.abs() > limit)
    }

    fn largest(&self) -> f64 {
        self.departures.first().map_or(0.0, |of| of.score.abs())
    }
}

/// The machines of a fleet beside each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Scores beyond this are named.
    pub limit: f64,
    /// How many traits were compared.
    pub traits: usize,
    /// The machines, the one that is most unlike the others first.
    pub machines: Vec<Member>,
}

/// Compares machines trait by trait.
///
/// The score is the modified z-score of Iglewicz & Hoaglin (1993, "How to Detect and Handle Outliers", section 3): the distance from the
/// median over `1.4826 · MAD`, the median absolute deviation as that of normal values (Hampel 1974). It is beyond the [`limit`] by chance
/// in one of twenty fleets. What half of the machines or more have in common has no spread, and is not compared. An input that an
/// estimator did not choose has a response of 0.
#[must_use]
pub fn compare(fleet: &BTreeMap<String, Traits>) -> Comparison {
    let mut keys: Vec<&Trait> = fleet.values().flat_map(BTreeMap::keys).collect();
    keys.sort();
    keys.dedup();
    let mut members: Vec<Member> = fleet
        .keys()
        .map(|machine| Member {
            machine: machine.clone(),
            unlike: false,
            departures: Vec::new(),
        })
        .collect();
    let mut judged = 0;
    for key in keys {
        let value = |traits: &Traits| match (traits.get(key), key) {
            (None, Trait::Response { .. }) => Some(0.0),
            (found, _) => found.copied(),
        };
        let values: Vec<Option<f64>> = fleet.values().map(value).collect();
        let Some((centre, deviation)) = middle(values.iter().flatten().copied()) else {
            continue;
        };
        judged += 1;
        for (member, value) in members.iter_mut().zip(values) {
            if let Some(value) = value {
                member.departures.push(Departure {
                    of: key.clone(),
                    value: key.shown(value),
                    fleet: key.shown(centre),
                    score: (value - centre) / deviation,
                });
            }
        }
    }
    let limit = limit(fleet.len(), judged);
    for member in &mut members {
        let by = |one: &Departure, other: &Departure| other.score.abs().total_cmp(&one.score.abs());
        member.departures.sort_by(by);
        member.unlike = member.largest() > limit;
    }
    members.sort_by(|one, other| other.largest().total_cmp(&one.largest()));
    Comparison {
        limit,
        traits: judged,
        machines: members,
    }
}

/// The median of values and their robust deviation; none where they are too few, or have no spread.
fn middle(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    if values.len() < FEWEST {
        return None;
    }
    let centre = median(&mut values)?;
    let mut sizes: Vec<f64> = values.iter().map(|value| (value - centre).abs()).collect();
    let deviation = robust_deviation(&mut sizes)?;
    (deviation > ROUNDING * centre.abs()).then_some((centre, deviation))
}

/// The score that all of so many machines and traits stay within, but for one fleet in twenty: the quantile of Student's t by
/// Bonferroni's share of that chance, and at least the 3.5 of Iglewicz & Hoaglin. It has as many degrees of freedom as a standard
/// deviation would need to know the spread as well as the MAD of so many machines does.
#[must_use]
pub fn limit(machines: usize, traits: usize) -> f64 {
    let looks = (machines * traits).max(1) as f64;
    let freedom = (EFFICIENCY * (machines as f64 - 1.0)).max(1.0);
    student_quantile(CHANCE / (2.0 * looks), freedom).max(3.5)
}

/// The value that Student's t exceeds with this chance, by halving an interval.
fn student_quantile(chance: f64, freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while student_tail(high, freedom) > chance && high < 1e9 {
        high *= 2.0;
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        match student_tail(middle, freedom) > chance {
            true => low = middle,
            false => high = middle,
        }
    }
    high
}

/// The chance that Student's t is larger than t > 0: half the regularised incomplete beta function of ν / (ν + t²) with ν/2 and 1/2
/// (Abramowitz & Stegun 26.7.1, 26.5.27).
fn student_tail(t: f64, freedom: f64) -> f64 {
    let x = freedom / (freedom + t * t);
    let (a, b) = (0.5 * freedom, 0.5);
    // The continued fraction converges fast below this; above it stands for the rest.
    match x < (a + 1.0) / (a + b + 2.0) {
        true => 0.5 * incomplete_beta(x, a, b),
        false => 0.5 * (1.0 - incomplete_beta(1.0 - x, b, a)),
    }
}

/// The regularised incomplete beta function by its continued fraction (Abramowitz & Stegun 26.5.8), from the front as Lentz does
/// (Press et al. 2007, "Numerical Recipes", section 6.4).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let kept = |value: f64| if value.abs() < TINY { TINY } else { value };
    let front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    let front = libm::exp(front + a * libm::log(x) + b * libm::log1p(-x)) / a;
    let mut c = 1.0;
    let mut d = 1.0 / kept(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let before = fraction;
        for term in [even, odd] {
            d = 1.0 / kept(1.0 + term * d);
            c = kept(1.0 + term / c);
            fraction *= c * d;
        }
        if (fraction / before - 1.0).abs() < 1e-14 {
            break;
        }
    }
    front * fraction
}

/// Scores of all machines as a picture: a column of dots for each, the one that is most unlike the others first.
#[must_use]
pub fn picture(comparison: &Comparison, wrap: impl Fn(&Chart<'_>) -> String) -> String {
    /// So many machines have a colour and a name.
    const CLASSES: [&str; 5] = ["c3", "c2", "c4", "c5", "c6"];
    let machines = &comparison.machines;
    let named = machines
        .iter()
        .take(CLASSES.len())
        .take_while(|of| of.unlike)
        .count();
    let points = |range: std::ops::Range<usize>| -> (Vec<f64>, Vec<f64>) {
        let columns = range.flat_map(|nth| {
            machines[nth]
                .departures
                .iter()
                .map(move |of| ((nth + 1) as f64, of.score))
        });
        columns.unzip()
    };
    let groups: Vec<_> = (0..named).map(|nth| points(nth..nth + 1)).collect();
    let others = points(named..machines.len());
    let mut layers = vec![layer(&others, "c1", String::new())];
    for (nth, group) in groups.iter().enumerate() {
        layers.push(layer(group, CLASSES[nth], machines[nth].machine.clone()));
    }
    wrap(&Chart {
        title: "How far each machine departs from the fleet".to_owned(),
        x_label: "machine, the one that is most unlike the others first".to_owned(),
        y_label: "score".to_owned(),
        height: 300.0,
        layers,
        limits: vec![-comparison.limit, comparison.limit],
        ..Chart::default()
    })
}

fn layer<'a>((x, y): &'a (Vec<f64>, Vec<f64>), class: &'static str, label: String) -> Layer<'a> {
    Layer {
        x,
        y,
        class,
        label,
        mark: Mark::Dots,
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::prng::Prng;

    use super::*;

    #[test]
    fn the_tail_of_students_t_is_that_of_published_tables() {
        // Abramowitz & Stegun, table 26.10: t of one-sided chances 0.05, 0.005 and 0.0005.
        let table = [
            (1.0, [6.314, 63.657, 636.619]),
            (5.0, [2.015, 4.032, 6.869]),
            (30.0, [1.697, 2.750, 3.646]),
        ];
        for (freedom, quantiles) in table {
            for (chance, expected) in [0.05, 0.005, 0.0005].into_iter().zip(quantiles) {
                let found = student_quantile(chance, freedom);
                assert!(
                    (found - expected).abs() < 6e-4,
                    "{freedom} {chance}: {found}"
                );
            }
        }
    }

    fn alike(machines: usize, traits: usize, seed: u64) -> BTreeMap<String, Traits> {
        let mut random = Prng::stream(seed, "machines that are alike");
        let fleet = (0..machines).map(|nth| {
            let traits = (0..traits).map(|nth| (Trait::Middle(nth.to_string()), random.normal()));
            (format!("m{nth:03}"), traits.collect())
        });
        fleet.collect()
    }

    #[test]
    fn machines_that_are_alike_are_seldom_named_in_fleets_of_any_size() {
        for machines in [5, 8, 12, 40, 200] {
            let fleets = 60;
            let named = (0..fleets).filter(|seed| {
                let comparison = compare(&alike(machines, 20, *seed));
                comparison.machines[0].unlike
            });
            let share = named.count() as f64 / fleets as f64;
            assert!(share < 0.15, "{machines} machines: {share}");
        }
    }

    #[test]
    fn a_machine_that_is_unlike_the_others_is_named_with_what_differs() {
        let mut fleet = alike(20, 10, 1);
        let key = Trait::Middle("3".to_owned());
        fleet.get_mut("m007").unwrap().insert(key.clone(), -25.0);
        let comparison = compare(&fleet);
        let unlike: Vec<_> = comparison.machines.iter().filter(|of| of.unlike).collect();
        assert_eq!(unlike.len(), 1);
        assert_eq!(unlike[0].machine, "m007");
        let beyond: Vec<_> = unlike[0].beyond(comparison.limit).collect();
        assert_eq!((beyond.len(), &beyond[0].of), (1, &key));
        assert!(beyond[0].score < -15.0);
    }

    #[test]
    fn what_most_machines_have_in_common_is_not_compared() {
        let mut fleet = BTreeMap::new();
        for nth in 0..20 {
            let key = |to: &str| Trait::Response {
                of: "e".to_owned(),
                to: to.to_owned(),
                unit: String::new(),
            };
            // The first was chosen by one machine alone, the second by all.
            let mut traits = Traits::from([(key("all"), 1.0 + f64::from(nth))]);
            if nth == 4 {
                traits.insert(key("one"), 5.0);
            }
            fleet.insert(format!("m{nth}"), traits);
        }
        let comparison = compare(&fleet);
        assert_eq!(comparison.traits, 1);
        assert!(!comparison.machines[0].unlike);
    }

    #[test]
    fn windows_and_lags_are_no_part_of_the_name_of_an_input() {
        let names = ["gradients.room@150s", "drift.Z1 lag 5min", "room"];
        assert_eq!(
            names.map(without_span),
            ["gradients.room", "drift.Z1", "room"]
        );
    }
}
