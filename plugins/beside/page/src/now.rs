//! What is said of each axis now, and when nothing may be said any more.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant as Clock;

use athermal_core::compile::Plan;
use athermal_core::figures;
use athermal_core::time::Instant;
use athermal_http::{Asked, Refused, Reply};
use athermal_run::live::TickView;
use athermal_serve::host;
use athermal_serve::service::{Observer, Service};
use athermal_serve::shown::{HeldValue, Shown};
use schemars::JsonSchema;
use serde::Serialize;

use crate::axes::{Axis, axes};
use crate::settings::Page;

/// How many intervals between ticks say what is usual.
const INTERVALS: usize = 16;
/// After so many usual intervals without a tick nothing is said any more.
const STALE: f64 = 3.0;
/// Ticks that come faster are waited for so long, in s: the control thread looks ten times a second.
const LEAST_S: f64 = 0.5;

/// The axes now.
#[derive(Debug, Serialize, JsonSchema)]
pub struct AxesNow {
    /// The axes.
    pub axes: Vec<AxisNow>,
    /// The instant of the last tick, in s.
    pub last_s: Option<f64>,
    /// How far apart ticks usually are, in s.
    pub tick_s: Option<f64>,
    /// Why nothing can be said now; `null` where it can.
    pub stale: Option<StaleNow>,
    /// The host's time, in s since 1970.
    pub host_s: f64,
}

/// Why nothing can be said.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct StaleNow {
    /// The reason, for people.
    pub why: String,
    /// Since when, by the host's clock, in s since 1970.
    pub since_s: f64,
}

/// An axis now.
#[derive(Debug, Serialize, JsonSchema)]
pub struct AxisNow {
    /// Its name.
    pub axis: String,
    /// All of it in a sentence.
    pub sentence: String,
    /// How it drifts.
    pub drift: Option<f64>,
    /// In which unit.
    pub unit: Option<String>,
    /// What is left of that after the correction.
    pub left: Option<f64>,
    /// In which unit.
    pub left_unit: Option<String>,
    /// Whether it is stable; `null` where that is not known.
    pub stable: Option<bool>,
    /// For how long it has been, in s.
    pub stable_s: Option<f64>,
    /// Whether it may be measured; `null` where that is not known.
    pub may_measure: Option<bool>,
    /// What holds its correction back.
    pub why: Option<String>,
    /// What a picture of it shows, by what it is: names of outputs and channels.
    pub channels: BTreeMap<&'static str, Vec<String>>,
}

/// What is known of the axes of what runs.
#[derive(Debug)]
pub(crate) struct Now {
    settings: Page,
    plan: Option<Arc<Plan>>,
    axes: Vec<Known>,
    last: Option<Instant>,
    /// When the last tick was seen, by a clock that nobody sets and by the host's.
    seen: (Clock, f64),
    /// The last differences between instants, in s.
    intervals: VecDeque<f64>,
    /// Whether something that is shown takes a copy of what runs.
    looks_inside: bool,
}

#[derive(Debug)]
struct Known {
    axis: Axis,
    /// What it drifts by, what is left, whether it is stable, whether it may be measured, what holds it back: as far as it counts.
    values: [f64; 5],
    last: [HeldValue; 5],
    stable_since: Option<Instant>,
}

fn host_s() -> f64 {
    host::now().map_or(0.0, |of| of.as_ns() as f64 / 1e9)
}

/// Looks on at a service.
pub(crate) struct Looker(Arc<Mutex<Now>>);

impl Looker {
    pub(crate) fn new(now: Arc<Mutex<Now>>) -> Self {
        Self(now)
    }
}

impl Observer for Looker {
    fn tick(&mut self, tick: &TickView<'_>) {
        let mut now = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        now.tick(tick);
    }

    fn looks_inside(&self) -> bool {
        let now = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        now.looks_inside
    }
}

impl Now {
    pub(crate) fn new(settings: Page) -> Self {
        Self {
            settings,
            plan: None,
            axes: Vec::new(),
            last: None,
            seen: (Clock::now(), host_s()),
            intervals: VecDeque::new(),
            looks_inside: false,
        }
    }

    fn tick(&mut self, tick: &TickView<'_>) {
        if !self
            .plan
            .as_ref()
            .is_some_and(|of| Arc::ptr_eq(of, tick.plan))
        {
            self.follow(tick);
        }
        let before = self.last.replace(tick.at);
        let passed = before.map(|last| (tick.at - last).as_ns() as f64 / 1e9);
        let is_break = passed.is_none_or(|passed| passed <= 0.0);
        if let Some(passed) = passed.filter(|_| !is_break) {
            if self.intervals.len() == INTERVALS {
                self.intervals.pop_front();
            }
            self.intervals.push_back(passed);
        }
        self.seen = (Clock::now(), host_s());
        for known in &mut self.axes {
            known.tick(tick, is_break);
        }
    }

    fn follow(&mut self, tick: &TickView<'_>) {
        let axes = axes(tick.plan, &self.settings);
        let shown = || axes.iter().flat_map(Axis::all);
        self.looks_inside = shown().any(|of| !of.is_mirrored(tick));
        self.axes = axes
            .into_iter()
            .map(|of| Known::new(of, tick.plan))
            .collect();
        self.plan = Some(Arc::clone(tick.plan));
    }

    fn tick_s(&self) -> Option<f64> {
        let mut sorted: Vec<_> = self.intervals.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied()
    }

    /// Why nothing can be said of what the last tick gave.
    fn stale(&self, service: &Service) -> Option<StaleNow> {
        let (seen, seen_s) = self.seen;
        let silent_s = seen.elapsed().as_secs_f64();
        let usual = self.tick_s();
        let since = |why: String, since_s| Some(StaleNow { why, since_s });
        let Some(last) = self.last else {
            return since("no tick since the start".to_owned(), seen_s);
        };
        let Some(usual_s) = usual else {
            return since("one tick so far".to_owned(), seen_s);
        };
        let patience_s = (STALE * usual_s).max(LEAST_S);
        if silent_s > patience_s {
            let why = format!(
                "no tick for {}; one comes each {}",
                figures::time(silent_s),
                figures::time(usual_s)
            );
            return since(why, seen_s);
        }
        let behind = service.snapshot().newest;
        let behind_s = behind.map_or(0.0, |newest| (newest - last).as_ns() as f64 / 1e9);
        if behind_s > patience_s {
            let why = format!("ticks are {} behind the sources", figures::time(behind_s));
            return since(why, seen_s - behind_s);
        }
        let why = degraded(service)?;
        let events = service.watcher().seen();
        let fault = events.recent.iter().rev().find(|(is_fault, ..)| *is_fault);
        since(why, fault.map_or(seen_s, |(.., at_s)| *at_s))
    }
}

/// What of a service is not as it should be.
fn degraded(service: &Service) -> Option<String> {
    let lacking = service.lacking();
    if let Some(source) = lacking.first() {
        return Some(format!("the source `{source}` has not been connected"));
    }
    if let Some(node) = service.given_up().first() {
        return Some(format!("a node was given up: {node}"));
    }
    if service.running().is_none() {
        return Some("ticks were missed; it is not known what runs".to_owned());
    }
    let is_degraded = service.journal().is_degraded;
    is_degraded.then(|| "the journal cannot be written".to_owned())
}

impl Known {
    fn new(axis: Axis, plan: &Plan) -> Self {
        let ages = axis.all().filter_map(|of| of.max_age(plan));
        let longest = ages.max().unwrap_or_default();
        let age = |of: Option<Shown>| of.and_then(|of| of.max_age(plan)).unwrap_or(longest);
        Self {
            values: [f64::NAN; 5],
            last: axis.parts().map(|of| HeldValue::new(age(of))),
            stable_since: None,
            axis,
        }
    }

    fn tick(&mut self, tick: &TickView<'_>, is_break: bool) {
        let parts = self.axis.parts();
        for ((last, of), value) in self.last.iter_mut().zip(parts).zip(&mut self.values) {
            *value = last.take(of.map_or(f64::NAN, |of| of.value(tick)), tick.at);
        }
        self.stable_since = match (self.stable(), self.stable_since) {
            (Some(true), Some(since)) if !is_break => Some(since),
            (Some(true), _) => Some(tick.at),
            _ => None,
        };
    }

    fn stable(&self) -> Option<bool> {
        let (_, is_truth) = self.axis.stable?;
        let value = self.values[2];
        (!value.is_nan()).then_some((value != 0.0) == is_truth)
    }

    fn now(&self, plan: &Plan, last: Option<Instant>, stale: Option<&StaleNow>) -> AxisNow {
        let axis = &self.axis;
        let is_known = stale.is_none();
        let some = |value: f64| Some(value).filter(|of| is_known && !of.is_nan());
        let unit = |of: Option<Shown>| of.map(|of| of.unit(plan));
        let [drift, left, _, may_measure, held] = self.values.map(some);
        let stable = self.stable().filter(|_| is_known);
        let since = self.stable_since.zip(last).filter(|_| is_known);
        let stable_s = since.map(|(since, last)| (last - since).as_ns() as f64 / 1e9);
        let reason = axis.held.zip(held);
        let reason = reason.and_then(|((_, kind), held)| (kind.facts)().reason(held));
        // Without a valid prediction, or at the end of its range, a correction does not do what it is for.
        let is_off = held == Some(1.0) || held == Some(5.0);
        let may_measure = match axis.may_measure {
            Some(_) => may_measure.map(|of| of != 0.0),
            None => stable.filter(|_| !is_off),
        };
        let names = |all: &Vec<Shown>| all.iter().map(|of| of.name(plan).to_owned()).collect();
        let mut now = AxisNow {
            axis: axis.name.clone(),
            sentence: String::new(),
            unit: unit(axis.drift),
            left_unit: unit(axis.left),
            drift,
            left,
            stable,
            stable_s,
            may_measure,
            why: reason.map(str::to_owned),
            channels: axis
                .shown
                .iter()
                .map(|(what, of)| (*what, names(of)))
                .collect(),
        };
        now.sentence = match stale {
            Some(stale) => format!("{}: not known, {}", now.axis, stale.why),
            None => now.words(axis),
        };
        now
    }
}

impl AxisNow {
    /// "Z1 drifts 12 nm/min, corrected to 1.8; stable for 4 min; may measure: yes"
    fn words(&self, axis: &Axis) -> String {
        let unit = |of: &Option<String>| of.clone().unwrap_or_default();
        let drift = match self.drift {
            Some(drift) => format!("drifts {} {}", two(drift), unit(&self.unit)),
            None => "drift not known".to_owned(),
        };
        let left = axis.left.map(|_| match self.left {
            Some(left) if self.left_unit == self.unit => format!(", corrected to {}", two(left)),
            Some(left) => format!(", corrected to {} {}", two(left), unit(&self.left_unit)),
            None => ", what the correction leaves is not known".to_owned(),
        });
        let held = self.why.as_ref().map(|why| format!("; correction: {why}"));
        let stable = axis.stable.map(|_| match (self.stable, self.stable_s) {
            (Some(true), Some(s)) if s > 0.0 => format!("; stable for {}", figures::time(s)),
            (Some(true), _) => "; stable".to_owned(),
            (Some(false), _) => "; not stable".to_owned(),
            (None, _) => "; whether it is stable is not known".to_owned(),
        });
        let asked = axis.may_measure.is_some() || axis.stable.is_some();
        let may = asked.then_some(match self.may_measure {
            Some(true) => "; may measure: yes",
            Some(false) => "; may measure: no",
            None => "; may measure: unknown",
        });
        let parts = [left, held, stable];
        let parts = parts.into_iter().flatten().collect::<String>();
        format!("{} {drift}{parts}{}", self.axis, may.unwrap_or_default())
    }
}

/// A number to two significant digits.
fn two(value: f64) -> String {
    let rounded = format!("{value:.1e}");
    let size = rounded
        .split_once('e')
        .and_then(|(_, size)| size.parse().ok());
    let size: i32 = size.filter(|_| value != 0.0).unwrap_or(1);
    if size < -4 {
        return rounded;
    }
    let decimals = (1 - size).max(0).unsigned_abs() as usize;
    let digit = 10_f64.powi(size - 1);
    format!("{:.decimals$}", (value / digit).round() * digit)
}

pub(crate) fn answer(service: &mut Service, _: &Asked) -> Result<Reply, Refused> {
    let lacks = || Refused::not_now("nothing is known of axes");
    let now = service.shared().find::<Mutex<Now>>().ok_or_else(lacks)?;
    let now = now.lock().unwrap_or_else(PoisonError::into_inner);
    let stale = now.stale(service);
    let plan = now.plan.as_deref();
    let axis = |of: &Known| Some(of.now(plan?, now.last, stale.as_ref()));
    Ok(Reply::json(&AxesNow {
        axes: now.axes.iter().filter_map(axis).collect(),
        last_s: now.last.map(|of| of.as_ns() as f64 / 1e9),
        tick_s: now.tick_s(),
        stale,
        host_s: host_s(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_have_numbers_of_two_digits() {
        for (value, text) in [
            (12.34, "12"),
            (1.849, "1.8"),
            (-0.0123, "-0.012"),
            (987.0, "990"),
            (0.0, "0"),
        ] {
            assert_eq!(two(value), text, "{value}");
        }
    }
}
