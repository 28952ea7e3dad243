//! Decides what an entry of `expect` means: keys that need or exclude each other, channels looked up, units checked.

use super::declare::Declaring;
use super::expectation::{Check, Expectation, Period, Rival, Tolerance};
use super::problem;
use super::table::{ExpectTable, Within};
use crate::compile::Plan;
use crate::diagnostic::Place;
use crate::document::{Value, decode};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

impl Declaring<'_> {
    pub(super) fn expectation(&mut self, value: &Value) -> Option<Expectation> {
        let table = decode::<ExpectTable>(value, "the expectation", self.diagnostics)?;
        self.check_keys(value, &table);
        self.check_ranges(value, &table);
        let slots = self.channels(&table.of, value.place_of("of"));
        let checks = self.checks(value, &table);
        let (plan, slots) = (self.plan, slots?);
        for &slot in &slots {
            self.check_channel(value, &table, &checks, (plan, slot));
        }
        Some(Expectation {
            slots,
            abs_truth_below: table.abs_truth_below,
            period: Period {
                from: table.from.unwrap_or(Duration::ZERO),
                to: table.to.unwrap_or(Duration::MAX),
            },
            at: table.at,
            checks,
        })
    }

    fn checks(&mut self, value: &Value, table: &ExpectTable) -> Vec<Check> {
        let mut checks = Vec::new();
        checks.extend(table.rmse_below.clone().map(Check::RmseBelow));
        checks.extend(table.r2_above.map(Check::R2Above));
        if let Some(beats) = &table.beats {
            let places = place_list(value, "beats");
            let rivals = beats.iter().zip(places).filter_map(|(name, place)| {
                Some(match name.as_str() {
                    "zero" => Rival::Zero,
                    "persistence" => Rival::Persistence,
                    _ => Rival::Channels(name.clone(), self.rival(name, place)?),
                })
            });
            let rivals: Vec<Rival> = rivals.collect();
            if !rivals.is_empty() {
                checks.push(Check::Beats(rivals));
            }
        }
        checks.extend(table.valid_above.map(Check::ValidAbove));
        checks.extend(table.given_above.map(Check::GivenAbove));
        let tolerance = match &table.within {
            None => Tolerance::Number(0.0),
            Some(Within::Number(number)) => Tolerance::Number(*number),
            Some(Within::Quantity(quantity)) => Tolerance::Quantity(quantity.clone()),
        };
        let equals = table.equals.clone();
        checks.extend(equals.map(|equals| Check::Equals(equals, tolerance)));
        let between = table.between.clone();
        checks.extend(between.map(|(low, high)| Check::Between(low, high)));
        checks.extend(table.absent.map(|_| Check::Absent));
        checks.extend(table.max_step_below.clone().map(Check::MaxStepBelow));
        checks
    }

    /// Keys that need or exclude each other.
    fn check_keys(&mut self, value: &Value, table: &ExpectTable) {
        let at = table.at.is_some();
        let of_values = [
            ("equals", table.equals.is_some()),
            ("between", table.between.is_some()),
            ("max_step_below", table.max_step_below.is_some()),
            ("valid_above", table.valid_above.is_some()),
            ("given_above", table.given_above.is_some()),
            ("rmse_below", table.rmse_below.is_some()),
            ("r2_above", table.r2_above.is_some()),
            (
                "beats",
                table.beats.as_ref().is_some_and(|by| !by.is_empty()),
            ),
        ];
        let absent = table.absent.is_some();
        let value_beside = of_values.iter().find(|(_, stated)| *stated);
        let nothing = value_beside.is_none() && !absent;
        let one_value = table.equals.is_some() || table.between.is_some() || absent;
        let period = table.from.is_some() || table.to.is_some();
        let of_truths = table.rmse_below.is_some()
            || table.r2_above.is_some()
            || table.beats.is_some()
            || table.valid_above.is_some();
        let wrong = [
            (
                table.within.is_some() && table.equals.is_none(),
                "within",
                "equals",
                false,
            ),
            (at && !one_value, "at", "equals", false),
            (
                at && period,
                "at",
                if table.from.is_some() { "from" } else { "to" },
                true,
            ),
            (
                table.abs_truth_below.is_some() && !of_truths,
                "abs_truth_below",
                "rmse_below",
                false,
            ),
            (
                absent && value_beside.is_some(),
                "absent",
                value_beside.map_or("", |(key, _)| key),
                true,
            ),
        ];
        // A key that needs one that checks something says so itself.
        if nothing && !wrong.iter().any(|(wrong, ..)| *wrong) {
            let what = "the expectation";
            let problem = problem::NothingExpected { what };
            self.diagnostics.report(value.place, problem);
        }
        for (_, key, with, excluded) in wrong.into_iter().filter(|(wrong, ..)| *wrong) {
            let problem = problem::keys(key, with, excluded);
            self.diagnostics.report(value.place_of(key), problem);
        }
    }

    /// Numbers out of their range.
    fn check_ranges(&mut self, value: &Value, table: &ExpectTable) {
        if table.absent == Some(false) {
            let found = "false".to_owned();
            self.range(value, "absent", found, "true, or left out");
        }
        for (key, share) in [
            ("valid_above", table.valid_above),
            ("given_above", table.given_above),
        ] {
            if let Some(share) = share.filter(|share| !(0.0..1.0).contains(share)) {
                self.range(value, key, share.to_string(), "0 or more and below 1");
            }
        }
        if let Some(r2) = table.r2_above.filter(|r2| *r2 >= 1.0 || r2.is_nan()) {
            self.range(value, "r2_above", r2.to_string(), "below 1");
        }
        if let (Some(from), Some(to)) = (table.from, table.to)
            && from > to
        {
            self.range(value, "from", from.to_string(), "not after `to`");
        }
        let sizes = [
            ("rmse_below", &table.rmse_below),
            ("abs_truth_below", &table.abs_truth_below),
            ("max_step_below", &table.max_step_below),
        ];
        for (key, size) in sizes {
            if let Some(size) = size
                .as_ref()
                .filter(|size| size.value <= 0.0 || size.value.is_nan())
            {
                self.range(value, key, size.to_string(), "above 0");
            }
        }
        let off = match &table.within {
            Some(Within::Number(number)) => Some((*number, number.to_string())),
            Some(Within::Quantity(quantity)) => Some((quantity.value, quantity.to_string())),
            None => None,
        };
        if let Some((_, found)) = off.filter(|(off, _)| !(*off >= 0.0 && off.is_finite())) {
            self.range(value, "within", found, "0 or more");
        }
        if let Some((low, high)) = &table.between
            && low.unit.measures_same(&high.unit)
            && !high
                .in_unit(&low.unit)
                .is_some_and(|high| low.value <= high)
        {
            let found = format!("from {low} to {high}");
            self.range(value, "between", found, "given with the lower end first");
        }
    }

    /// What a channel must be for the checks to make sense.
    fn check_channel(
        &mut self,
        value: &Value,
        table: &ExpectTable,
        checks: &[Check],
        (plan, slot): (&Plan, usize),
    ) {
        let planned = &plan.channels[slot];
        let (unit, name) = (&planned.channel.unit, &planned.name);
        let truth = planned.predicts;
        let prediction_keys = checks.iter().filter(|check| check.is_of_predictions());
        let limit = table.abs_truth_below.as_ref().map(|_| "abs_truth_below");
        let first = prediction_keys.map(Check::key).chain(limit).next();
        if let Some(key) = first.filter(|_| truth.is_none()) {
            let channel = name.clone();
            let problem = problem::NotAPrediction { key, channel };
            self.diagnostics.report(value.place_of(key), problem);
        }
        let mut quantities: Vec<(&'static str, &Quantity, Unit)> = Vec::new();
        for check in checks {
            match check {
                Check::RmseBelow(size) | Check::MaxStepBelow(size) => {
                    quantities.push((check.key(), size, unit.difference()));
                }
                Check::Equals(wanted, tolerance) => {
                    quantities.push(("equals", wanted, unit.clone()));
                    if let Tolerance::Quantity(within) = tolerance {
                        quantities.push(("within", within, unit.difference()));
                    }
                }
                Check::Between(low, high) => {
                    quantities.push(("between", low, unit.clone()));
                    quantities.push(("between", high, unit.clone()));
                }
                Check::Beats(rivals) => self.check_rivals(value, rivals, plan, slot),
                Check::R2Above(_) | Check::ValidAbove(_) | Check::GivenAbove(_) | Check::Absent => {
                }
            }
        }
        if let (Some(limit), Some(truth)) = (&table.abs_truth_below, truth) {
            let unit = plan.channels[truth].channel.unit.clone();
            quantities.push(("abs_truth_below", limit, unit));
        }
        for (key, quantity, unit) in quantities {
            if !quantity.unit.measures_same(&unit) {
                let problem = problem::Units {
                    key,
                    found: quantity.unit.clone(),
                    channel: name.clone(),
                    expected: unit,
                };
                self.diagnostics.report(value.place_of(key), problem);
            }
        }
    }

    fn check_rivals(&mut self, value: &Value, rivals: &[Rival], plan: &Plan, slot: usize) {
        let Some(truth) = plan.channels[slot].predicts else {
            return;
        };
        for rival in rivals {
            if let Rival::Channels(name, slots) = rival
                && rival_of(plan, slot, slots).is_none()
            {
                let problem = problem::NoRival {
                    rival: name.clone(),
                    channel: plan.channels[slot].name.clone(),
                    truth: plan.channels[truth].name.clone(),
                };
                self.diagnostics.report(value.place_of("beats"), problem);
            }
        }
    }
}

/// The one of `slots` that predicts what `slot` does, as far ahead.
pub(super) fn rival_of(plan: &Plan, slot: usize, slots: &[usize]) -> Option<usize> {
    let of = &plan.channels[slot];
    slots.iter().copied().find(|&rival| {
        let rival = &plan.channels[rival];
        rival.predicts.is_some()
            && rival.predicts == of.predicts
            && rival.channel.ahead == of.channel.ahead
    })
}

fn place_list(table: &Value, key: &str) -> Vec<Place> {
    let list = table.as_table().and_then(|keys| keys.get(key)?.as_list());
    list.unwrap_or_default()
        .iter()
        .map(|value| value.place)
        .collect()
}
