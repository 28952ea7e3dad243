//! Combiners: which rule a vote follows, and how many runs, truths and errors it remembers.

use athermal_combiners::{AutoWeighted, Best, Guard, Memory, StateGate, Trimmed, Weighting};
use athermal_core::compile::{PlannedNode, PlannedRole, TruthLink};
use athermal_core::time::Duration;

use super::features::parameters;
use super::{Lowering, Refused, SPARE, first, refuse, samples, unread};
use crate::form::{Field, Record};

/// What a vote follows, beside what it reads.
#[derive(Default)]
struct Rule {
    number: usize,
    memory: Option<Memory>,
    form: usize,
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
            let power = spec.power.unwrap_or(2.0);
            if power != 2.0 && power != 4.0 {
                return refuse(
                    "a `power` other than 2 and 4 cannot be exported",
                    "leave `power` out: 2 is what inverse variances have",
                );
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
            let most = spec.most_novel;
            Ok(Rule {
                memory: Some(spec.memory),
                min_truths: spec.min_truths as f64,
                // As a vote at the most novelty counts.
                least_trust: if most > 1.0 { 1.0 / (most * most) } else { 1.0 },
                ..plain(5)
            })
        }
        ("athermal-combiners", "state_gate") => Ok(Rule {
            dwell: parameters::<StateGate>(node)?.dwell,
            ..plain(6)
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
        let judged = if rule.number == 5 { 2 * count } else { count };
        let ints =
            self.ints(7 + rooms.runs + 2 * rooms.waiting + 2 * judged + judged * rooms.errors);
        let reals = self
            .reals(rooms.runs * count + rooms.waiting + judged * rooms.errors + 2 * judged + count);
        self.scratch(4 * count);
        let heeded = beside.novelties.and(novelties.as_ref());
        let which = heeded.map_or(&[][..], |(_, which)| which);
        let which = which.iter().map(|&nth| nth as i64).collect();
        let time = |of: fn(&TruthLink) -> Duration| {
            Field::Int(truth.as_ref().map_or(0, |link| of(link).as_ns()))
        };
        Ok(Record::new("vote", node.instance())
            .int("rule", rule.number)
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
            Some(Memory::Time(time)) => (samples(time, of_truth) + SPARE, false, time.as_ns()),
            Some(Memory::Truths(last)) => (last.truths, true, last.truths as i64),
            Some(Memory::HalfLife(_)) => {
                return refuse(
                    "a memory with a `half_life` cannot be exported",
                    "use a time, such as `memory = \"15min\"`, or `{ truths = 12 }`",
                );
            }
        };
        Ok(Rooms {
            runs: samples(link.ahead + link.embargo(), period) + SPARE,
            waiting: samples(link.embargo(), of_truth) + SPARE,
            errors,
            by_count,
            longest,
        })
    }
}
