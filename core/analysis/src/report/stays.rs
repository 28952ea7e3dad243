//! How near a position stays that is not measured again for a while: what is left of a drift, added up.

use serde::Serialize;

use super::{Axis, Voter, figure};
use crate::figures::time;

/// Over so long a time, or where truths are rarer, over a few of them.
const OVER_S: f64 = 1800.0;
const FEWEST_TRUTHS: f64 = 6.0;
/// The limit is the first round one that holds so often.
const OFTEN: f64 = 0.95;
/// Fewer stretches say nothing.
const FEWEST: usize = 20;

/// How near positions stay with a prediction and without.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stays {
    /// Over how long a time a drift is added up, in s; none where the truth is itself a position or another level.
    pub over_s: Option<f64>,
    /// A round limit.
    pub limit: f64,
    /// The unit of the limit.
    pub unit: String,
    /// How often it holds of what is left by the prediction.
    pub predicted: f64,
    /// How often it holds of all of it.
    pub without: f64,
}

impl Stays {
    /// By what is left of a truth at the instants at which it was predicted. `no_model` is what no model predicts.
    pub(super) fn of(axis: &Axis, voter: &Voter, no_model: f64) -> Option<Self> {
        let (time_s, truths) = (&axis.truth.time_s, &axis.truth.value);
        let both = time_s.iter().zip(truths).zip(&voter.value);
        let both = both.map(|((at, y), p)| (*at, y - no_model, y - p));
        let both: Vec<_> = both.filter(|(_, y, left)| (y + left).is_finite()).collect();
        let (over_s, unit, pairs) = match per_time(&axis.unit) {
            Some((unit, per_s)) => {
                let mut gaps: Vec<f64> = both.windows(2).map(|two| two[1].0 - two[0].0).collect();
                gaps.sort_by(f64::total_cmp);
                let usual = gaps.get(gaps.len() / 2).copied()?;
                let over_s = OVER_S.max(FEWEST_TRUTHS * usual);
                let longest = (5.0 * usual).min(over_s / 2.0);
                (Some(over_s), unit, added_up(&both, per_s, over_s, longest))
            }
            None => {
                let all = both.iter().map(|(_, y, left)| (y.abs(), left.abs()));
                (None, axis.error_unit.as_str(), all.collect())
            }
        };
        if pairs.len() < FEWEST {
            return None;
        }
        let share = |within: &dyn Fn(&(f64, f64)) -> bool| {
            pairs.iter().filter(|pair| within(pair)).count() as f64 / pairs.len() as f64
        };
        let largest = pairs.iter().map(|pair| pair.1).fold(0.0, f64::max);
        let holds = |limit: &f64| share(&|pair| pair.1 <= *limit) >= OFTEN;
        let limit = round_numbers(largest).find(holds)?;
        Some(Self {
            over_s,
            limit,
            unit: unit.to_owned(),
            predicted: share(&|pair| pair.1 <= limit),
            without: share(&|pair| pair.0 <= limit),
        })
    }

    /// The sentence, for people.
    #[must_use]
    pub fn sentence(&self) -> String {
        let percent = |share: f64| format!("{:.0} %", (100.0 * share).floor());
        let (limit, unit) = (figure(Some(self.limit)), super::spelled(&self.unit));
        let limit = match limit.contains('.') {
            true => limit.trim_end_matches('0').trim_end_matches('.'),
            false => &limit,
        };
        let (predicted, without) = (percent(self.predicted), percent(self.without));
        match self.over_s {
            Some(over_s) => format!(
                "From each measured position on, {} without another stay within {limit} {unit} in {predicted} of cases, uncorrected {without}.",
                time(over_s)
            ),
            None => {
                format!(
                    "It stays within {limit} {unit} in {predicted} of cases, without a model {without}."
                )
            }
        }
    }
}

/// The unit and the length in s of what a rate is per.
fn per_time(unit: &str) -> Option<(&str, f64)> {
    let (unit, per) = unit.rsplit_once('/')?;
    let per_s = match per {
        "s" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        "d" => 86_400.0,
        _ => return None,
    };
    Some((unit, per_s))
}

/// Rates added up over each stretch of a length in which none is missing for longer than `longest`: all of them, and what is left.
fn added_up(rates: &[(f64, f64, f64)], per_s: f64, over_s: f64, longest: f64) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0)];
    for two in rates.windows(2) {
        let (whole, left) = sums[sums.len() - 1];
        let span = (two[1].0 - two[0].0) / per_s;
        let gap = if two[1].0 - two[0].0 > longest {
            f64::NAN
        } else {
            0.5 * span
        };
        sums.push((
            whole + gap * (two[0].1 + two[1].1),
            left + gap * (two[0].2 + two[1].2),
        ));
        if gap.is_nan() {
            let last = sums.len() - 1;
            sums[last] = (0.0, 0.0);
        }
    }
    let mut begins = 0;
    let mut until = 0;
    let mut pairs = Vec::new();
    for (at, of) in rates.iter().enumerate() {
        // A stretch begins anew behind a gap.
        if at > 0 && of.0 - rates[at - 1].0 > longest {
            begins = at;
        }
        until = until.max(begins);
        while until < at && rates[until + 1].0 <= of.0 - over_s {
            until += 1;
        }
        if rates[until].0 <= of.0 - over_s {
            let (now, then) = (sums[at], sums[until]);
            pairs.push(((now.0 - then.0).abs(), (now.1 - then.1).abs()));
        }
    }
    pairs
}

/// 1, 1.5, 2, 3 … from well below a number to the first above it.
fn round_numbers(up_to: f64) -> impl Iterator<Item = f64> {
    let first = (up_to.max(f64::MIN_POSITIVE).log10().floor() as i32).saturating_sub(4);
    let decades = (first..).take(6);
    let all = decades.flat_map(|decade| {
        [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0].map(|of| of * 10.0_f64.powi(decade))
    });
    all.chain(std::iter::once(up_to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_added_up_over_stretches_without_a_gap() {
        // 60 nm/min for an hour, of which 6 are left, a gap of two hours, and the same again.
        let minute = |nth: i32| (60.0 * f64::from(nth), 60.0, 6.0);
        let rates: Vec<_> = (0..=60).chain(180..=240).map(minute).collect();
        let pairs = added_up(&rates, 60.0, 1800.0, 300.0);
        assert_eq!(pairs.len(), 62, "31 of each hour");
        for (whole, left) in pairs {
            assert!((whole - 1800.0).abs() < 1e-9 && (left - 180.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_limit_is_round_and_its_sentence_says_when_it_holds() {
        let round: Vec<f64> = round_numbers(37.0)
            .filter(|of| *of >= 7.0)
            .take(6)
            .collect();
        let expected = [8.0, 10.0, 15.0, 20.0, 30.0, 40.0];
        let is_near = |(a, b): (&f64, f64)| (a - b).abs() < 1e-9;
        assert!(round.iter().zip(expected).all(is_near), "{round:?}");
        let mut stays = Stays {
            over_s: Some(1800.0),
            limit: 50.0,
            unit: "nm".into(),
            predicted: 0.974,
            without: 0.61,
        };
        assert_eq!(
            stays.sentence(),
            "From each measured position on, 30 min without another stay within 50 nm in 97 % of cases, uncorrected 61 %."
        );
        (stays.over_s, stays.limit, stays.unit) = (None, 500.0, "Cel".into());
        assert_eq!(
            stays.sentence(),
            "It stays within 500 °C in 97 % of cases, without a model 61 %."
        );
    }
}
