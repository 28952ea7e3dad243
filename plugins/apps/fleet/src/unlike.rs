//! Machines that are unlike the others of their fleet: by their coefficients, by their errors, and by what their sensors showed.

use std::collections::BTreeMap;

use athermal_analysis::chart::{Chart, Layer, Mark};
use athermal_analysis::figures::number;
use athermal_core::engine::SampleRange;
use athermal_core::node::Figure;
use athermal_estimators::input_of;
use athermal_run::model::Model;
use serde::{Serialize, Serializer};

use crate::spread::{Fleet, Measured, moderated, student_quantile, usual_error};

/// Of fewer machines no spread is known.
pub const FEWEST: usize = 5;

/// The share of machines that would be named although they are as they should be, were their values normal.
const CHANCE: f64 = 0.01;
/// The same as simulated fleets have it, whose values have heavier tails.
pub const RATE: f64 = 0.02;

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

/// What a machine is compared by, each with its value.
pub type Traits = BTreeMap<Trait, Measured>;

/// Those of a model: of its coefficients and its card. A response is as sure as the jackknife of the fit says, else as theory says of its
/// coefficients as if they knew nothing of each other.
#[must_use]
pub fn traits_of(model: &Model) -> Traits {
    let mut all = Traits::new();
    let cards = || model.card.iter().flat_map(|card| &card.estimators);
    let figure =
        |node: &str, name: &str| cards().find(|of| of.node == node)?.report.figures.get(name);
    for estimator in model.estimators() {
        let errors = match figure(&estimator.node, "input_errors") {
            Some(Figure::Named(errors)) => Some(errors),
            _ => None,
        };
        let coefficients = estimator.parts.iter().flat_map(|of| &of.coefficients);
        for of in coefficients {
            // Products and polynomials have no part that is one input's alone.
            let ([factor], None) = (&*of.factors, of.polynomial) else {
                continue;
            };
            let per = of.per.as_deref().unwrap_or("1");
            let to = input_of(&factor.regressor);
            let key = Trait::Response {
                of: estimator.node.clone(),
                to: to.to_owned(),
                unit: format!("{} per {per}", estimator.unit),
            };
            let sum = all.entry(key).or_insert(Measured::exactly(0.0));
            sum.value += of.value;
            sum.error = match errors.and_then(|errors| errors.get(to)) {
                Some(error) => error.0,
                None => sum.error.hypot(of.standard_error.unwrap_or(0.0)),
            };
        }
    }
    for of in cards() {
        if let Some(rmse) = of.report.in_sample_rmse.filter(|rmse| *rmse > 0.0) {
            let error = match of.report.figures.get("log_rmse_error") {
                Some(Figure::Number(error)) => error.0,
                _ => 0.0,
            };
            let (node, unit) = (of.node.clone(), of.unit.clone());
            let value = libm::log(rmse);
            all.insert(Trait::Error { of: node, unit }, Measured { value, error });
        }
    }
    for range in model.card.iter().flat_map(|card| &card.ranges) {
        let (low, high) = (range.lowest, range.highest);
        let middle = Measured::exactly(0.5 * (low + high));
        all.insert(Trait::Middle(range.channel.clone()), middle);
        if high > low {
            let width = Measured::exactly(libm::log(high - low));
            all.insert(Trait::Width(range.channel.clone()), width);
        }
    }
    all
}

/// By so many times as much or as little a channel varies that is in another unit; machines of one type hardly do.
const OTHER_UNIT: f64 = 8.0;
/// And by so many standard deviations.
const FAR: f64 = 6.0;

/// Machines of which a channel varies so much more or less than in the others that it must be in another unit, and which.
#[must_use]
pub fn other_units(fleet: &BTreeMap<String, Vec<SampleRange>>) -> BTreeMap<String, String> {
    let mut channels: BTreeMap<&str, Vec<(&String, Measured)>> = BTreeMap::new();
    for (machine, range) in fleet
        .iter()
        .flat_map(|(of, ranges)| ranges.iter().map(move |range| (of, range)))
    {
        if range.highest > range.lowest {
            let width = Measured::exactly(libm::log(range.highest - range.lowest));
            channels
                .entry(&range.channel)
                .or_default()
                .push((machine, width));
        }
    }
    let mut found = BTreeMap::new();
    for (channel, all) in channels {
        let widths: Vec<Measured> = all.iter().map(|(_, width)| *width).collect();
        let Some(usual) = Fleet::of(&widths, FEWEST) else {
            continue;
        };
        for (machine, width) in all {
            let times = libm::exp(width.value - usual.centre);
            if times.max(1.0 / times) > OTHER_UNIT && usual.score(width).abs() > FAR {
                let why = format!(
                    "{channel} varies {} times as much as in the other machines: is it in another unit? The machine is left out",
                    number(times)
                );
                found.entry(machine.clone()).or_insert(why);
            }
        }
    }
    found
}

/// One value of one machine beside those of the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Departure {
    /// What is compared.
    #[serde(rename = "trait")]
    pub of: Trait,
    /// The value, as words.
    pub value: String,
    /// What the fleet has in common, as words.
    pub fleet: String,
    /// How many standard deviations these are apart.
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
    /// So many machines would be named if all were as they should be.
    pub expected: f64,
    /// How many traits were compared.
    pub traits: usize,
    /// The machines, the one that is most unlike the others first.
    pub machines: Vec<Member>,
}

/// Compares machines trait by trait.
///
/// The score of a value is its distance from what the fleet has in common, over the root of three variances: of a machine's true value about
/// that, of the machine's own value by its standard error, and of what the fleet has in common. The first is found beside the second, and
/// from machines that are not far off. Responses that have the same sign in all machines, by twice their standard errors, are compared by
/// their logarithms, since parameters of machines differ by factors. An input that an estimator did not choose has no response.
///
/// A machine is named by its largest score. The limit is one that a machine exceeds by chance in one of a hundred cases: by Student's t and
/// Bonferroni's share for so many traits, or by the largest scores of the machines of this very fleet, where these are larger: their
/// logarithms have a mean and a spread too.
#[must_use]
pub fn compare(fleet: &BTreeMap<String, Traits>) -> Comparison {
    let mut keys: Vec<&Trait> = fleet.values().flat_map(BTreeMap::keys).collect();
    keys.sort();
    keys.dedup();
    let of_all = keys.iter().map(|key| Some((*key, Beside::of(key, fleet)?)));
    let found: Vec<(&Trait, Beside)> = of_all.flatten().collect();
    let chance = CHANCE / (2 * found.len()).max(1) as f64;
    let usual = student_quantile(chance, (fleet.len() as f64 - 1.0).max(1.0));
    let mut members: Vec<Member> = fleet
        .iter()
        .map(|(machine, traits)| {
            let departures = found.iter().filter_map(|(key, beside)| {
                let value = *traits.get(key)?;
                // A spread that fewer machines tell is less sure.
                let surety = usual / student_quantile(chance, beside.fleet.freedom);
                Some(Departure {
                    of: (*key).clone(),
                    value: key.shown(value.value),
                    fleet: key.shown(beside.centre()),
                    score: surety * beside.score(value),
                })
            });
            let mut departures: Vec<Departure> = departures.collect();
            departures.sort_by(|one, other| other.score.abs().total_cmp(&one.score.abs()));
            Member {
                machine: machine.clone(),
                unlike: false,
                departures,
            }
        })
        .collect();
    members.sort_by(|one, other| other.largest().total_cmp(&one.largest()));
    let largest: Vec<Measured> = members
        .iter()
        .filter(|of| of.largest() > 0.0)
        .map(|of| Measured {
            value: libm::log(of.largest()),
            error: 0.0,
        })
        .collect();
    let of_fleet = Fleet::of(&largest, FEWEST).map_or(0.0, |of| libm::exp(of.exceeded(CHANCE)));
    let limit = usual.max(of_fleet);
    for member in &mut members {
        member.unlike = member.largest() > limit;
    }
    Comparison {
        limit,
        expected: RATE * fleet.len() as f64,
        traits: found.len(),
        machines: members,
    }
}

/// One trait of all machines.
struct Beside {
    fleet: Fleet,
    /// The sign of values that are compared by the logarithms of their sizes.
    by_size: Option<f64>,
    /// By how much the variance of its errors is the fleet's.
    usual: Option<f64>,
}

impl Beside {
    /// None of a trait that few machines have, or in which they do not differ.
    fn of(key: &Trait, fleet: &BTreeMap<String, Traits>) -> Option<Self> {
        let all = fleet.values().filter_map(|traits| traits.get(key));
        let mut all: Vec<Measured> = all.copied().collect();
        let usual = usual_error(&all);
        let sign = all.first()?.value.signum();
        let is_sure = |of: &Measured| sign * of.value > 2.0 * of.error;
        let is_response = matches!(key, Trait::Response { .. });
        let by_size = (is_response && all.iter().all(is_sure)).then_some(sign);
        for of in &mut all {
            *of = scaled(moderated(*of, usual), by_size);
        }
        let fleet = Fleet::of(&all, FEWEST)?;
        Some(Self {
            fleet,
            by_size,
            usual,
        })
    }

    fn score(&self, of: Measured) -> f64 {
        self.fleet
            .score(scaled(moderated(of, self.usual), self.by_size))
    }

    /// What the fleet has in common, as a value is.
    fn centre(&self) -> f64 {
        let centre = self.fleet.centre;
        self.by_size.map_or(centre, |sign| sign * libm::exp(centre))
    }
}

fn scaled(of: Measured, by_size: Option<f64>) -> Measured {
    by_size.map_or(of, |sign| Measured {
        value: libm::log(sign * of.value),
        error: of.error / of.value.abs(),
    })
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

    /// Machines whose traits differ by a factor `exp(spread · n)`, or by the errors of their values alone.
    fn alike(machines: usize, traits: usize, seed: u64, spread: f64) -> BTreeMap<String, Traits> {
        let mut random = Prng::stream(seed, "machines that are alike");
        let mut measured = |nth: usize| {
            let error = 0.02 * (1.0 + nth as f64 % 3.0);
            let value = libm::exp(spread * random.normal()) + error * random.normal();
            Measured { value, error }
        };
        let fleet = (0..machines).map(|nth| {
            let traits = (0..traits).map(|nth| (response(&nth.to_string()), measured(nth)));
            (format!("m{nth:03}"), traits.collect())
        });
        fleet.collect()
    }

    fn response(to: &str) -> Trait {
        let (of, to, unit) = ("e".to_owned(), to.to_owned(), String::new());
        Trait::Response { of, to, unit }
    }

    #[test]
    fn healthy_machines_are_seldom_named_in_fleets_of_any_size_and_spread() {
        for spread in [0.0, 0.3] {
            for machines in [5, 12, 60] {
                let fleets = 600 / machines;
                let named = (0..fleets).map(|seed| {
                    let comparison = compare(&alike(machines, 12, seed as u64, spread));
                    comparison.machines.iter().filter(|of| of.unlike).count()
                });
                let share = named.sum::<usize>() as f64 / (fleets * machines) as f64;
                assert!(share < 0.02, "{machines} machines of {spread}: {share}");
            }
        }
    }

    #[test]
    fn a_machine_that_is_unlike_the_others_is_named_with_what_differs() {
        let mut fleet = alike(20, 10, 1, 0.1);
        let mut set = |to: &str, value: f64, error: f64| {
            let machine = fleet.get_mut("m007").unwrap();
            machine.insert(response(to), Measured { value, error });
        };
        // The one is sure, the other is nothing that its rows know.
        set("3", 2.0, 0.02);
        set("4", 2.0, 5.0);
        let comparison = compare(&fleet);
        let unlike: Vec<_> = comparison.machines.iter().filter(|of| of.unlike).collect();
        assert_eq!(unlike.len(), 1);
        assert_eq!(unlike[0].machine, "m007");
        let beyond: Vec<_> = unlike[0].beyond(comparison.limit).collect();
        assert_eq!((beyond.len(), &beyond[0].of), (1, &response("3")));
        assert!((comparison.expected - 0.4).abs() < 1e-12);
    }

    #[test]
    fn what_few_machines_have_is_not_compared_and_what_a_selection_left_out_is_no_response() {
        let mut fleet = BTreeMap::new();
        for nth in 0..20 {
            let value = Measured::exactly(1.0 + f64::from(nth));
            let mut traits = Traits::from([
                (response("all"), value),
                (response("same"), Measured::exactly(2.0)),
            ]);
            if nth == 4 {
                traits.insert(response("one"), Measured::exactly(5.0));
            }
            // Half of the machines were fitted without it.
            if nth % 2 == 0 {
                traits.insert(
                    response("half"),
                    Measured::exactly(9.0 + 0.1 * f64::from(nth)),
                );
            }
            fleet.insert(format!("m{nth}"), traits);
        }
        let comparison = compare(&fleet);
        assert_eq!(comparison.traits, 2);
        assert!(!comparison.machines[0].unlike, "{comparison:?}");
    }
}
