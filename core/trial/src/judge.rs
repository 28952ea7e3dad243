//! Decides whether an expectation holds of what was observed, and the figures that say so.

use std::collections::BTreeMap;
use std::fmt;

use super::expect::rival_of;
use super::expectation::{Check, Expectation, Rival, Tolerance};
use super::observed::Observed;
use crate::compile::Plan;
use crate::diagnostic::counted;
use crate::quantity::Quantity;
use crate::time::Duration;

/// What was found of one thing that a test checks of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The channel: `vote.Z1`.
    pub of: String,
    /// The key of the check: `rmse_below`.
    pub check: &'static str,
    /// The other prediction, where the check is a comparison.
    pub rival: Option<String>,
    /// What was found; none where there was nothing to look at.
    pub found: Option<f64>,
    /// What was wanted.
    pub wanted: Wanted,
    /// The unit of both; `1` for shares and R².
    pub unit: String,
    /// How many instants were looked at.
    pub instants: usize,
    /// When a value was off for the first time, and that value.
    pub first: Option<(Duration, f64)>,
}

/// What is wanted of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wanted {
    /// Less than this.
    Below(f64),
    /// More than this.
    Above(f64),
    /// This, give or take.
    Equal {
        /// The value.
        value: f64,
        /// How far it may be off.
        within: f64,
    },
    /// From one to the other, both included.
    Between(f64, f64),
    /// No value at all.
    Nothing,
}

impl Wanted {
    /// Whether a figure is as wanted; NaN never is.
    #[must_use]
    pub fn admits(&self, found: f64) -> bool {
        match *self {
            Self::Below(limit) => found < limit,
            Self::Above(limit) => found > limit,
            Self::Equal { value, within } => (found - value).abs() <= within,
            Self::Between(low, high) => low <= found && found <= high,
            Self::Nothing => false,
        }
    }
}

impl Finding {
    /// Whether the expectation holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        match self.wanted {
            // Where no tick was looked at, nothing has been shown.
            Wanted::Nothing => self.found.is_none() && self.instants > 0,
            wanted => self.first.is_none() && self.found.is_some_and(|found| wanted.admits(found)),
        }
    }
}

/// All findings of an expectation, in the order of the channels and then of the file's keys.
pub(super) fn judge(plan: &Plan, expectation: &Expectation, observed: &Observed) -> Vec<Finding> {
    let judging = |&slot: &usize| {
        let judge = Judge {
            plan,
            expectation,
            observed,
            slot,
        };
        expectation
            .checks
            .iter()
            .flat_map(|check| judge.check(check))
            .collect::<Vec<_>>()
    };
    expectation.slots.iter().flat_map(judging).collect()
}

struct Judge<'a> {
    plan: &'a Plan,
    expectation: &'a Expectation,
    observed: &'a Observed,
    slot: usize,
}

/// A prediction beside its truth, at the instants that count.
struct Pairs {
    truths: Vec<f64>,
    predictions: Vec<f64>,
}

impl Pairs {
    fn rmse(&self) -> Option<f64> {
        let squares = self.truths.iter().zip(&self.predictions);
        let sum: f64 = squares.map(|(y, p)| (p - y) * (p - y)).sum();
        (!self.truths.is_empty()).then(|| (sum / self.truths.len() as f64).sqrt())
    }

    /// 1 − Σ(ŷ − y)² / Σ(y − ȳ)²; none where the truth does not vary.
    fn r2(&self) -> Option<f64> {
        let n = self.truths.len() as f64;
        let mean = self.truths.iter().sum::<f64>() / n;
        let about: f64 = self.truths.iter().map(|y| (y - mean) * (y - mean)).sum();
        let squared = n * self.rmse()?.powi(2);
        (about > 0.0).then(|| 1.0 - squared / about)
    }
}

impl Judge<'_> {
    fn check(&self, check: &Check) -> Vec<Finding> {
        let of = &self.plan.channels[self.slot].channel.unit;
        let size = |quantity: &Quantity| quantity.as_difference(of).unwrap_or(f64::NAN);
        let value = |quantity: &Quantity| quantity.in_unit(of).unwrap_or(f64::NAN);
        let finding = match check {
            Check::RmseBelow(limit) => {
                let pairs = self.pairs(&[]);
                let wanted = Wanted::Below(size(limit));
                self.finding(check, pairs.rmse(), wanted, pairs.truths.len())
            }
            Check::R2Above(limit) => {
                let pairs = self.pairs(&[]);
                let wanted = Wanted::Above(*limit);
                self.finding(check, pairs.r2(), wanted, pairs.truths.len())
            }
            Check::Beats(rivals) => return self.beats(check, rivals),
            Check::ValidAbove(share) => {
                let (valid, of) = self.valid();
                self.share(check, *share, valid, of)
            }
            Check::GivenAbove(share) => {
                let ticks = self.ticks();
                let given = self.values().filter(|value| !value.2.is_nan()).count();
                self.share(check, *share, given, ticks)
            }
            Check::Equals(wanted, tolerance) => {
                let within = match tolerance {
                    Tolerance::Number(number) => {
                        let quantity = Quantity {
                            value: *number,
                            unit: wanted.unit.clone(),
                        };
                        size(&quantity)
                    }
                    Tolerance::Quantity(quantity) => size(quantity),
                };
                let wanted = Wanted::Equal {
                    value: value(wanted),
                    within,
                };
                self.each_value(check, wanted)
            }
            Check::Between(low, high) => {
                self.each_value(check, Wanted::Between(value(low), value(high)))
            }
            Check::Absent => self.nothing(check),
            Check::MaxStepBelow(limit) => self.largest_step(check, Wanted::Below(size(limit))),
        };
        vec![finding]
    }

    fn finding(
        &self,
        check: &Check,
        found: Option<f64>,
        wanted: Wanted,
        instants: usize,
    ) -> Finding {
        let planned = &self.plan.channels[self.slot];
        let unit = match check {
            Check::R2Above(_) | Check::ValidAbove(_) | Check::GivenAbove(_) => "1".to_owned(),
            Check::RmseBelow(_) | Check::Beats(_) | Check::MaxStepBelow(_) => {
                planned.channel.unit.difference().to_string()
            }
            Check::Equals(..) | Check::Between(..) | Check::Absent => {
                planned.channel.unit.to_string()
            }
        };
        Finding {
            of: planned.name.clone(),
            check: check.key(),
            rival: None,
            found,
            wanted,
            unit,
            instants,
            first: None,
        }
    }

    fn share(&self, check: &Check, share: f64, have: usize, of: usize) -> Finding {
        let found = (of > 0).then(|| have as f64 / of as f64);
        self.finding(check, found, Wanted::Above(share), of)
    }

    fn beats(&self, check: &Check, rivals: &[Rival]) -> Vec<Finding> {
        let pairs = self.pairs(rivals);
        let against = |rival: &Rival| {
            let other = self.paired_with(rival, rivals);
            let limit = other.rmse().unwrap_or(f64::NAN);
            let wanted = Wanted::Below(limit);
            let name = match rival {
                Rival::Zero => "zero".to_owned(),
                Rival::Persistence => "persistence".to_owned(),
                Rival::Channels(name, slots) => rival_of(self.plan, self.slot, slots).map_or_else(
                    || name.clone(),
                    |slot| self.plan.channels[slot].name.clone(),
                ),
            };
            Finding {
                rival: Some(name),
                ..self.finding(check, pairs.rmse(), wanted, pairs.truths.len())
            }
        };
        rivals.iter().map(against).collect()
    }

    /// The prediction beside its truth, where it and all of `rivals` have a value.
    fn pairs(&self, rivals: &[Rival]) -> Pairs {
        self.paired(rivals, |column| column)
    }

    /// A rival beside the truth, on the instants of [`Self::pairs`].
    fn paired_with(&self, rival: &Rival, rivals: &[Rival]) -> Pairs {
        self.paired(rivals, |_| self.column(rival))
    }

    fn paired<'b>(
        &'b self,
        rivals: &[Rival],
        of: impl FnOnce(Option<&'b [f64]>) -> Option<&'b [f64]>,
    ) -> Pairs {
        let mut pairs = Pairs {
            truths: Vec::new(),
            predictions: Vec::new(),
        };
        let Some((truth, prediction)) = self.observed.prediction(self.slot) else {
            return pairs;
        };
        let others: Vec<Option<&[f64]>> = rivals.iter().map(|rival| self.column(rival)).collect();
        let of = of(Some(prediction));
        for nth in self.counted() {
            let has = |column: &Option<&[f64]>| column.is_none_or(|values| !values[nth].is_nan());
            if !prediction[nth].is_nan() && others.iter().all(has) {
                pairs.truths.push(truth[nth]);
                pairs.predictions.push(of.map_or(0.0, |values| values[nth]));
            }
        }
        pairs
    }

    /// What a rival predicts at each truth; none for zero.
    fn column(&self, rival: &Rival) -> Option<&[f64]> {
        match rival {
            Rival::Zero => None,
            Rival::Persistence => self.observed.persistence(self.slot),
            Rival::Channels(_, slots) => {
                let slot = rival_of(self.plan, self.slot, slots)?;
                self.observed.prediction(slot).map(|(_, values)| values)
            }
        }
    }

    /// The truths that count, by number.
    fn counted(&self) -> impl Iterator<Item = usize> {
        let truth = self.plan.channels[self.slot].predicts;
        let limit = self.expectation.abs_truth_below.as_ref().zip(truth);
        let limit = limit.and_then(|(limit, truth)| {
            limit.as_difference(&self.plan.channels[truth].channel.unit)
        });
        let truths = self.observed.truths(self.slot).unwrap_or_default();
        let times = self.observed.truth_times(self.slot).unwrap_or_default();
        let counts = move |nth: &usize| {
            self.expectation.period.contains(times[*nth])
                && limit.is_none_or(|limit| truths[*nth].abs() < limit)
        };
        (0..truths.len().min(times.len())).filter(counts)
    }

    /// How many instants have a value, and of how many.
    fn valid(&self) -> (usize, usize) {
        if let Some((_, prediction)) = self.observed.prediction(self.slot) {
            let valid = |nth: &usize| !prediction[*nth].is_nan();
            return (self.counted().filter(valid).count(), self.counted().count());
        }
        let valid = self.values().filter(|value| !value.2.is_nan()).count();
        (valid, self.values().count())
    }

    /// What was given in the period: segment, time and value.
    fn values(&self) -> impl DoubleEndedIterator<Item = &(u32, Duration, f64)> {
        let values = self.observed.values(self.slot);
        values
            .iter()
            .filter(|(_, time, _)| self.expectation.period.contains(*time))
    }

    /// How many ticks there are in the period.
    fn ticks(&self) -> usize {
        let within = |tick: &&(u32, Duration)| self.expectation.period.contains(tick.1);
        self.observed.ticks.iter().filter(within).count()
    }

    /// The last tick of each segment at or before a time.
    fn last_ticks(&self, at: Duration) -> BTreeMap<u32, Duration> {
        let by_then = self.observed.ticks.iter().filter(|tick| tick.1 <= at);
        by_then.copied().collect()
    }

    /// The first value where there should be none, or at the last tick of any segment at or before a time.
    fn nothing(&self, check: &Check) -> Finding {
        let ticks = self.expectation.at.map(|at| self.last_ticks(at));
        let mut given = self.values().filter(|value| !value.2.is_nan());
        let (value, instants) = match &ticks {
            Some(ticks) => (
                given.find(|value| ticks.get(&value.0) == Some(&value.1)),
                ticks.len(),
            ),
            None => (given.next(), self.ticks()),
        };
        Finding {
            first: value.map(|value| (value.1, value.2)),
            ..self.finding(check, value.map(|value| value.2), Wanted::Nothing, instants)
        }
    }

    /// Every value, or the one of each segment at a time.
    fn each_value(&self, check: &Check, wanted: Wanted) -> Finding {
        if let Some(at) = self.expectation.at {
            let by_then = self.values().filter(|value| value.1 <= at);
            let last: BTreeMap<u32, _> = by_then.map(|value| (value.0, value)).collect();
            let of_segments = self.last_ticks(at).into_keys();
            let found = of_segments.map(|segment| {
                let value = last.get(&segment).filter(|value| !value.2.is_nan())?;
                Some((value.1, value.2))
            });
            let found: Vec<_> = found.collect();
            let off = found.iter().flatten().find(|value| !wanted.admits(value.1));
            // A segment without a value is reported before one with a wrong one.
            let lacks = found.contains(&None);
            let shown = off.or_else(|| found.last()?.as_ref()).filter(|_| !lacks);
            return Finding {
                first: off.filter(|_| !lacks).copied(),
                ..self.finding(
                    check,
                    shown.map(|value| value.1),
                    wanted,
                    found.iter().flatten().count(),
                )
            };
        }
        let given = || self.values().filter(|value| !value.2.is_nan());
        let off = given().find(|value| !wanted.admits(value.2));
        let shown = off.or_else(|| given().next_back());
        Finding {
            first: off.map(|value| (value.1, value.2)),
            ..self.finding(check, shown.map(|value| value.2), wanted, given().count())
        }
    }

    fn largest_step(&self, check: &Check, wanted: Wanted) -> Finding {
        let given: Vec<_> = self.values().filter(|value| !value.2.is_nan()).collect();
        let steps = given.windows(2).filter(|pair| pair[0].0 == pair[1].0);
        let steps = steps.map(|pair| (pair[1].1, (pair[1].2 - pair[0].2).abs()));
        let largest = steps.clone().map(|(_, step)| step).reduce(f64::max);
        let count = steps.clone().count();
        let first = steps.clone().find(|(_, step)| !wanted.admits(*step));
        Finding {
            first,
            ..self.finding(check, largest, wanted, count)
        }
    }
}

/// A number with six significant digits, or with all that it takes to tell it from what was wanted.
fn figure(value: f64, beside: f64) -> String {
    let rounded = format!("{value:.5e}").parse().unwrap_or(value);
    let shown: f64 = if rounded == beside || (rounded - beside).abs() < 1e-4 * beside.abs() {
        value
    } else {
        rounded
    };
    if shown != 0.0 && !(1e-5..1e15).contains(&shown.abs()) {
        format!("{shown:e}")
    } else {
        shown.to_string()
    }
}

impl fmt::Display for Wanted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Below(limit) => write!(f, "below {limit}"),
            Self::Above(limit) => write!(f, "above {limit}"),
            Self::Equal { value, within: 0.0 } => write!(f, "exactly {value}"),
            Self::Equal { value, within } => write!(f, "{value} ± {within}"),
            Self::Between(low, high) => write!(f, "between {low} and {high}"),
            Self::Nothing => f.write_str("none"),
        }
    }
}

impl fmt::Display for Finding {
    /// `vote.Z1: rmse_below: found 41.3 nm/min over 2,310 instants, wanted below 40 nm/min`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = match self.unit.as_str() {
            "1" => String::new(),
            unit => format!(" {unit}"),
        };
        let beside = match self.wanted {
            Wanted::Below(limit) | Wanted::Above(limit) => limit,
            Wanted::Equal { value, .. } => value,
            Wanted::Between(low, _) => low,
            Wanted::Nothing => f64::NAN,
        };
        write!(f, "{}: {}: ", self.of, self.check)?;
        match self.found {
            Some(found) => write!(f, "found {}{unit}", figure(found, beside))?,
            None => f.write_str("found no value")?,
        }
        let instants = counted(self.instants, "instant");
        match self.first {
            Some((time, value)) if Some(value) == self.found => write!(f, " at {time}")?,
            Some((time, value)) => write!(
                f,
                " over {instants}, first {}{unit} at {time}",
                figure(value, beside)
            )?,
            None => write!(f, " over {instants}")?,
        }
        match (&self.rival, self.wanted) {
            (Some(rival), Wanted::Below(limit)) if limit.is_nan() => {
                write!(f, ", and `{rival}` has none")
            }
            (Some(rival), Wanted::Below(limit)) => {
                write!(
                    f,
                    ", wanted below the {}{unit} of `{rival}`",
                    figure(limit, f64::NAN)
                )
            }
            (_, Wanted::Nothing) => f.write_str(", wanted none"),
            (_, wanted) => write!(f, ", wanted {wanted}{unit}"),
        }
    }
}
