//! Combiners: which rule a vote follows, and how many runs, truths and errors it remembers.

use athermal_combiners::share::trust;
use athermal_combiners::{AutoWeighted, Best, Guard, Hedge, Memory, StateGate, Trimmed, Weighting};
use athermal_core::compile::{PlannedNode, PlannedRole, TruthLink};
use athermal_core::node::Combiner;
use athermal_core::time::Duration;

use super::features::parameters;
use super::{Lowering, Refused, SPARE, first, refuse, samples, ways};
use crate::form::{BY_COUNT, BY_TIME, FADING, Field, GUARD, HEDGE, Record, STATE_GATE};

/// What a vote follows, beside what it reads.
#[derive(Default)]
struct Rule {
    number: i64,
    memory: Option<Memory>,
    /// How long errors count.
    longest: Duration,
    form: usize,
    power: f64,
    rate: Option<f64>,
    /// Of a hedge; what the memory of other votes has is its own.
    half_life: Duration,
    shrinkage: f64,
    floor: f64,
    share: f64,
    min_truths: f64,
    least_trust: f64,
    dwell: Duration,
}

fn rule_of(node: &PlannedNode) -> Result<Rule, Refused> {
    let plain = |number| Rule {
        number,
        ..Rule::default()
    };
    match (node.kind.package, node.kind.name) {
        ("athermal-combiners", "auto_weighted") => {
            let spec: AutoWeighted = parameters(node)?;
            Ok(Rule {
                memory: Some(spec.memory),
                longest: Combiner::memory(&spec),
                // Of mean squares.
                power: 0.5 * spec.power.unwrap_or(2.0),
                form: match spec.weights {
                    Weighting::InversePower => 0,
                    Weighting::AsPrinted => 1,
                    Weighting::AsPrintedRaw => 2,
                },
                shrinkage: spec.shrinkage,
                floor: spec.floor,
                ..plain(0)
            })
        }
        ("athermal-combiners", "mean") => Ok(plain(1)),
        ("athermal-combiners", "median") => Ok(Rule {
            share: 0.5,
            ..plain(2)
        }),
        ("athermal-combiners", "trimmed") => Ok(Rule {
            share: parameters::<Trimmed>(node)?.share,
            ..plain(2)
        }),
        ("athermal-combiners", "best") => {
            let spec: Best = parameters(node)?;
            Ok(Rule {
                memory: Some(spec.memory),
                longest: Combiner::memory(&spec),
                ..plain(3)
            })
        }
        ("athermal-combiners", "fallback") => Ok(plain(4)),
        ("athermal-combiners", "guard") => {
            let spec: Guard = parameters(node)?;
            Ok(Rule {
                memory: Some(spec.memory),
                longest: Combiner::memory(&spec),
                min_truths: spec.min_truths as f64,
                // As a vote at the most novelty counts.
                least_trust: trust(spec.most_novel),
                ..plain(GUARD)
            })
        }
        ("athermal-combiners", "state_gate") => Ok(Rule {
            dwell: parameters::<StateGate>(node)?.dwell,
            ..plain(STATE_GATE)
        }),
        ("athermal-combiners", "hedge") => {
            let spec: Hedge = parameters(node)?;
            Ok(Rule {
                rate: spec.rate,
                half_life: spec.half_life.unwrap_or_default(),
                floor: spec.floor,
                ..plain(HEDGE)
            })
        }
        (package, kind) => refuse(
            format!("the kind `{kind}` of {package} cannot be exported"),
            ways::around(kind).unwrap_or(
                "use `auto_weighted`, `hedge`, `mean`, `median`, `trimmed`, `best`, `fallback`, `guard` or `state_gate`",
            ),
        ),
    }
}

/// How much a vote remembers.
struct Rooms {
    runs: usize,
    waiting: usize,
    errors: usize,
    memory: i64,
    longest: i64,
    half_life: Duration,
}

impl Lowering<'_> {
    pub(super) fn combiner(&mut self, node: &PlannedNode) -> Result<Record, Refused> {
        let PlannedRole::Combiner {
            voters,
            novelties,
            state,
            truth,
            beside,
            ..
        } = &node.role
        else {
            return refuse("it is no combiner", "report this");
        };
        let rule = rule_of(node)?;
        let period = self.periods.of_votes(self.plan, *voters, *state);
        let rooms = self.rooms(&rule, truth.as_ref(), period);
        let count = self.gathers[*voters].entries.len();
        let judged = if rule.number == GUARD {
            2 * count
        } else {
            count
        };
        // Errors that count for a time come and go for all voters at once.
        let rings = if rooms.memory == BY_TIME { 1 } else { judged };
        let times = rings.saturating_mul(rooms.errors);
        let errors = judged.saturating_mul(rooms.errors);
        let (runs, waiting) = (rooms.runs, rooms.waiting);
        let sum = |of: &[usize]| of.iter().fold(0, |sum: usize, of| sum.saturating_add(*of));
        let ints = self.ints(sum(&[7, runs, waiting, waiting, 2 * rings, times]));
        let rows = runs.saturating_mul(count);
        let reals = self.reals(sum(&[rows, waiting, errors, 3 * judged, count]));
        self.scratch(4 * count);
        let heeded = beside.novelties.and(novelties.as_ref());
        let which = heeded.map_or(&[][..], |(_, which)| which);
        let which = which.iter().map(|&nth| nth as i64).collect();
        let time = |of: fn(&TruthLink) -> Duration| {
            Field::Int(truth.as_ref().map_or(0, |link| of(link).as_ns()))
        };
        Ok(Record::new("vote", node.instance())
            .with("rule", Field::Int(rule.number))
            .int("voters", *voters)
            .maybe("state", *state)
            .maybe("novelties", heeded.map(|(gather, _)| *gather))
            .with("which", Field::Ints(which))
            .int("slot", first(&node.slots))
            .maybe("weights_slot", beside.weights)
            .maybe("reason_slot", beside.reason)
            .maybe("novelty_slot", beside.novelty)
            .maybe("std_dev_slot", beside.std_dev.map(|(slot, _)| slot))
            .maybe("std_devs", beside.std_dev.map(|(_, of_votes)| of_votes))
            .maybe("truth", truth.as_ref().map(|link| link.slot))
            .with("ahead", time(|link| link.ahead))
            .with("limit", time(|link| link.limit))
            .with("embargo", time(TruthLink::embargo))
            .int("runs", rooms.runs)
            .int("waiting", rooms.waiting)
            .int("errors", rooms.errors)
            .int("rings", rings)
            .with("memory", Field::Int(rooms.memory))
            .with("longest", Field::Int(rooms.longest))
            .real("half_life", rooms.half_life.secs())
            .int("form", rule.form)
            .real("power", rule.power)
            .real("rate", rule.rate.unwrap_or_else(|| libm::log(count as f64)))
            .int("adaptive", usize::from(rule.rate.is_none()))
            .real("shrinkage", rule.shrinkage)
            .real("floor", rule.floor)
            .real("share", rule.share)
            .real("min_truths", rule.min_truths)
            .real("least_trust", rule.least_trust)
            .with("dwell", Field::Int(rule.dwell.as_ns()))
            .int("ints", ints)
            .int("reals", reals))
    }

    fn rooms(&self, rule: &Rule, truth: Option<&TruthLink>, period: i64) -> Rooms {
        let mut rooms = Rooms {
            runs: 1,
            waiting: 1,
            errors: 1,
            memory: BY_TIME,
            longest: 0,
            half_life: rule.half_life,
        };
        if rule.number == HEDGE {
            // Of two sums.
            (rooms.errors, rooms.memory) = (2, BY_COUNT);
        }
        let Some(link) = truth else {
            return rooms;
        };
        let of_truth = self.periods.slots[link.slot];
        rooms.runs = samples(link.ahead + link.embargo(), period, SPARE);
        rooms.waiting = samples(link.embargo(), of_truth, SPARE);
        if let Some(memory) = rule.memory {
            rooms.longest = rule.longest.as_ns();
            (rooms.errors, rooms.memory) = match memory {
                Memory::Time(time) => (samples(time, of_truth, SPARE), BY_TIME),
                Memory::Truths(last) => (last.truths, BY_COUNT),
                Memory::HalfLife(_) => (1, FADING),
            };
            if let Memory::HalfLife(fading) = memory {
                rooms.half_life = fading.half_life;
            }
        }
        rooms
    }
}
