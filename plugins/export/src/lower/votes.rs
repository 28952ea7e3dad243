//! Combiners: which rule a vote follows, and how many runs, truths and errors it remembers.

use athermal_combiners::share::trust;
use athermal_combiners::{AutoWeighted, Best, Guard, Memory, StateGate, Trimmed, Weighting};
use athermal_core::compile::{PlannedNode, PlannedRole, TruthLink};
use athermal_core::time::Duration;

use super::features::parameters;
use super::{Lowering, Refused, SPARE, first, refuse, samples, unread};
use crate::form::{Field, GUARD, Record, STATE_GATE};

/// What a vote follows, beside what it reads.
#[derive(Default)]
struct Rule {
    number: i64,
    memory: Option<Memory>,
    form: usize,
    shrinkage: f64,
    floor: f64,
    share: f64,
    min_truths: f64,
    least_trust: f64,
    dwell: Duration,
}

/// What no vote of the runtime does, and what to write instead.
const POWER: (&str, &str) = (
    "a `power` other than 2 and 4",
    "use 2, which is the default, or 4",
);
const HALF_LIFE: (&str, &str) = (
    "a memory with a `half_life`",
    "use a time, such as `memory = \"15min\"`, or `{ truths = 12 }`",
);

fn cannot<T>(reasons: &[(&str, &str)]) -> Result<T, Refused> {
    let (what, ways): (Vec<&str>, Vec<&str>) = reasons.iter().copied().unzip();
    let what = what.join(" and ");
    refuse(format!("{what} cannot be exported"), ways.join("; "))
}

fn rule_of(node: &PlannedNode) -> Result<Rule, Refused> {
    let plain = |number| Rule {
        number,
        ..Rule::default()
    };
    match (node.kind.package, node.kind.name) {
        ("athermal-combiners", "auto_weighted") => {
            let spec: AutoWeighted = parameters(node)?;
            let power = spec.power.unwrap_or(2.0);
            let fades = matches!(spec.memory, Memory::HalfLife(_));
            if power != 2.0 && power != 4.0 {
                return cannot(&[POWER, HALF_LIFE][..1 + usize::from(fades)]);
            }
            Ok(Rule {
                memory: Some(spec.memory),
                form: match spec.weights {
                    Weighting::InversePower if power == 4.0 => 3,
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
        ("athermal-combiners", "best") => Ok(Rule {
            memory: Some(parameters::<Best>(node)?.memory),
            ..plain(3)
        }),
        ("athermal-combiners", "fallback") => Ok(plain(4)),
        ("athermal-combiners", "guard") => {
            let spec: Guard = parameters(node)?;
            Ok(Rule {
                memory: Some(spec.memory),
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
        (package, kind) => refuse(
            format!("the kind `{kind}` of {package} cannot be exported"),
            "use `auto_weighted`, `mean`, `median`, `trimmed`, `best`, `fallback`, `guard` or `state_gate`",
        ),
    }
}

/// How much a vote remembers.
struct Rooms {
    runs: usize,
    waiting: usize,
    errors: usize,
    by_count: bool,
    longest: i64,
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
        if beside.std_dev.is_some() {
            unread(node, "std_dev")?;
        }
        let period = self.periods.of_votes(self.plan, *voters, *state);
        let rooms = self.rooms(&rule, truth.as_ref(), period)?;
        let count = self.gathers[*voters].entries.len();
        let judged = if rule.number == GUARD {
            2 * count
        } else {
            count
        };
        let errors = judged.saturating_mul(rooms.errors);
        let (runs, waiting) = (rooms.runs, rooms.waiting);
        let sum = |of: &[usize]| of.iter().fold(0, |sum: usize, of| sum.saturating_add(*of));
        let ints = self.ints(sum(&[7, runs, waiting, waiting, 2 * judged, errors]));
        let rows = runs.saturating_mul(count);
        let reals = self.reals(sum(&[rows, waiting, errors, 2 * judged, count]));
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
            .maybe("truth", truth.as_ref().map(|link| link.slot))
            .with("ahead", time(|link| link.ahead))
            .with("limit", time(|link| link.limit))
            .with("embargo", time(TruthLink::embargo))
            .int("runs", rooms.runs)
            .int("waiting", rooms.waiting)
            .int("errors", rooms.errors)
            .int("memory", usize::from(rooms.by_count))
            .with("longest", Field::Int(rooms.longest))
            .int("form", rule.form)
            .real("shrinkage", rule.shrinkage)
            .real("floor", rule.floor)
            .real("share", rule.share)
            .real("min_truths", rule.min_truths)
            .real("least_trust", rule.least_trust)
            .with("dwell", Field::Int(rule.dwell.as_ns()))
            .int("ints", ints)
            .int("reals", reals))
    }

    fn rooms(&self, rule: &Rule, truth: Option<&TruthLink>, period: i64) -> Result<Rooms, Refused> {
        let none = Rooms {
            runs: 1,
            waiting: 1,
            errors: 1,
            by_count: false,
            longest: 0,
        };
        let Some(link) = truth else {
            return Ok(none);
        };
        let of_truth = self.periods.slots[link.slot];
        let (errors, by_count, longest) = match rule.memory {
            None => (1, false, 0),
            Some(Memory::Time(time)) => (samples(time, of_truth, SPARE), false, time.as_ns()),
            Some(Memory::Truths(last)) => (last.truths, true, last.truths as i64),
            Some(Memory::HalfLife(_)) => return cannot(&[HALF_LIFE]),
        };
        Ok(Rooms {
            runs: samples(link.ahead + link.embargo(), period, SPARE),
            waiting: samples(link.embargo(), of_truth, SPARE),
            errors,
            by_count,
            longest,
        })
    }
}
