//! What holds for any graph, any edit of it and any instant.
//!
//! - No tick is lost, repeated or reordered.
//! - What an edit does not touch goes on with the same bits; a cosmetic one changes no bit and carries everything.
//! - A failed stage changes nothing.
//! - The report tells the truth.
//! - Going back is as if nothing had happened.
//!
//! That faults of each kind would be found is shown in `planted`.
//!
//! `ATHERMAL_LONG=1` looks at a hundred thousand cases, `ATHERMAL_SEED=7` at those of one pair of graphs.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use athermal::Model;
use athermal::core::engine::{Carry, NodeCarry};
use athermal::core::prng::Prng;
use athermal::run::live::{Control, Feed, LiveOptions, Notice, StageError, Stepper, pair};

use super::model::{Happening, bits, columns, d, model, run};
use super::random_graph::{Graph, chance, feed, happenings, pick};

/// Rows of each case.
const ROWS: usize = 100;
/// Instants of a swap for each pair of graphs.
const INSTANTS: usize = 8;

fn cases() -> u64 {
    if std::env::var_os("ATHERMAL_LONG").is_some() {
        100_000
    } else {
        1_200
    }
}

fn channels() -> Vec<Feed> {
    let column = |name: &String| name.split('.').nth(1).unwrap().to_owned();
    let feed = feed();
    let all = feed.iter().map(|name| Feed {
        column: column(name),
        name: name.clone(),
    });
    all.collect()
}

/// The fits of a graph follow from its salts.
fn model_of(graph: &Graph, cosmetic: Option<&mut Prng>) -> Model {
    let mut built = model(&graph.text(cosmetic), "0");
    for (name, salt) in graph.salt.iter().filter(|(_, salt)| **salt > 0) {
        let other = model(&graph.text(None), &salt.to_string());
        for (instance, fit) in other.fitted {
            if instance.split('.').next() == Some(name) {
                built.fitted.insert(instance, fit);
            }
        }
    }
    built
}

/// A running graph with the outputs of each of its ticks.
struct Live {
    stepper: Stepper,
    control: Control,
    order: Vec<usize>,
    rows: Vec<BTreeMap<String, u64>>,
    revisions: Vec<String>,
    notices: Vec<Notice>,
}

impl Live {
    fn new(model: &Model, retain: i64) -> Self {
        let options = LiveOptions {
            retain: d(retain),
            channels: channels(),
            ..LiveOptions::default()
        };
        let (stepper, control) = pair(model, options).unwrap();
        let feed = feed();
        let place = |fed: &Feed| feed.iter().position(|name| *name == fed.name).unwrap();
        Self {
            order: stepper.feed().iter().map(place).collect(),
            stepper,
            control,
            rows: Vec::new(),
            revisions: Vec::new(),
            notices: Vec::new(),
        }
    }

    fn take(&mut self, happening: &Happening) {
        let Happening::Row(time, samples) = happening else {
            self.stepper.segment();
            return;
        };
        let samples: Vec<_> = self.order.iter().map(|&place| samples[place]).collect();
        let stepped = self.stepper.step(*time, &samples).unwrap();
        self.rows
            .push(bits(&columns(stepped.plan), stepped.outputs));
        self.revisions.push(stepped.revision.to_owned());
    }

    fn pump(&mut self) {
        self.notices.extend(self.control.pump());
        let replica = self.control.replica().unwrap();
        let names = columns(replica.plan());
        if let Some(row) = self.rows.last() {
            assert_eq!(
                bits(&names, replica.outputs()),
                *row,
                "the replica does what runs"
            );
        }
    }
}

/// The instance that an output column shows.
fn instance(graph: &Graph, column: &str) -> String {
    let column = column.strip_prefix("slow_").unwrap_or(column);
    let (node, channel) = column.split_once('.').unwrap_or((column, ""));
    if graph.nodes[node].each {
        format!("{node}.{channel}")
    } else {
        node.to_owned()
    }
}

fn rows_before(happenings: &[Happening], at: usize) -> usize {
    let rows = |h: &&Happening| matches!(h, Happening::Row(..));
    happenings[..at].iter().filter(rows).count()
}

pub(super) struct Case<'a> {
    name: String,
    old: (&'a Graph, &'a Model),
    new: (&'a Graph, &'a Model),
    revisions: [String; 2],
    unheard: Option<&'a Model>,
    happenings: &'a [Happening],
    unswapped: &'a [BTreeMap<String, u64>],
    from_the_start: &'a [BTreeMap<String, u64>],
    at: usize,
    back: Option<usize>,
    retain: i64,
}

/// What came of a case.
pub(super) struct Observed {
    pub(super) rows: Vec<BTreeMap<String, u64>>,
    pub(super) revisions: Vec<String>,
    pub(super) notices: Vec<Notice>,
    pub(super) carry: Vec<NodeCarry>,
    /// The first happening of what was retained of the past.
    retained: usize,
}

impl Case<'_> {
    pub(super) fn observed(&self) -> Observed {
        let mut live = Live::new(self.old.1, self.retain);
        let mut carry = Vec::new();
        let mut retained = 0;
        for (index, happening) in self.happenings.iter().enumerate() {
            if index == self.at {
                live.pump();
                retained = self.past_of(live.control.retained());
                self.fail_to_stage(&mut live);
                let staged = live.control.stage(self.new.1, false).unwrap();
                carry = staged.carry().to_vec();
                live.control.commit().unwrap();
            }
            if Some(index) == self.back {
                live.pump();
                live.control.rollback().unwrap();
            }
            live.take(happening);
            if index % 16 == 3 {
                live.pump();
            }
        }
        live.pump();
        assert_eq!(live.stepper.engine().state().tick(), self.rows() as u64);
        assert_eq!(live.stepper.missed(), 0);
        Observed {
            rows: live.rows,
            revisions: live.revisions,
            notices: live.notices,
            carry,
            retained,
        }
    }

    pub(super) fn judge(&self, observed: &Observed) {
        assert_eq!(observed.rows.len(), self.rows(), "{}", self.name);
        self.check_revisions(observed);
        self.check_untouched(observed);
        self.check_report(observed);
    }

    /// How many rows there are, and between which the new graph runs.
    fn rows(&self) -> usize {
        rows_before(self.happenings, self.happenings.len())
    }

    pub(super) fn swapped(&self) -> Range<usize> {
        rows_before(self.happenings, self.at)..self.until()
    }

    pub(super) fn untouched(&self) -> BTreeSet<String> {
        self.old.0.untouched(self.new.0)
    }

    /// The instance of the new graph that an output column shows.
    pub(super) fn shown(&self, column: &str) -> String {
        instance(self.new.0, column)
    }

    /// The first happening of the retained past, of a whole number of seconds, before the swap.
    fn past_of(&self, span: athermal::Duration) -> usize {
        let mut left = span;
        let mut first = self.at;
        let mut later = None;
        for (index, happening) in self.happenings[..self.at].iter().enumerate().rev() {
            match happening {
                Happening::Row(time, _) => {
                    if let Some(later) = later {
                        left -= later - *time;
                    }
                    if left < athermal::Duration::ZERO {
                        break;
                    }
                    later = Some(*time);
                    first = index;
                }
                Happening::Break => {
                    // A segment may begin where another, of which nothing is kept, ended.
                    if left == athermal::Duration::ZERO {
                        break;
                    }
                    later = None;
                }
            }
        }
        first
    }

    fn fail_to_stage(&self, live: &mut Live) {
        if let Some(unheard) = self.unheard {
            let error = live.control.stage(unheard, false).unwrap_err();
            let channels = vec!["temperature.unheard".to_owned()];
            assert_eq!(error, StageError::MissingChannels { channels });
            assert_eq!(live.control.commit(), Err(StageError::NothingStaged));
        }
    }

    fn until(&self) -> usize {
        rows_before(self.happenings, self.back.unwrap_or(self.happenings.len()))
    }

    fn check_revisions(&self, observed: &Observed) {
        let [old, new] = &self.revisions;
        let (at, until) = (rows_before(self.happenings, self.at), self.until());
        for (row, found) in observed.revisions.iter().enumerate() {
            let swapped = row >= at && row < until;
            assert_eq!(
                found,
                if swapped { new } else { old },
                "{} row {row}",
                self.name
            );
        }
        let took_over = observed.notices.iter().map(|notice| match notice {
            Notice::TookOver { tick, .. } => *tick,
            other => panic!("{other:?}"),
        });
        let mut expected: Vec<_> = vec![at as u64 + 1];
        expected.extend(self.back.map(|_| until as u64 + 1));
        expected.retain(|&tick| tick <= observed.rows.len() as u64);
        assert_eq!(took_over.collect::<Vec<_>>(), expected, "{}", self.name);
    }

    fn check_untouched(&self, observed: &Observed) {
        let untouched = self.untouched();
        let (at, until) = (rows_before(self.happenings, self.at), self.until());
        for (row, (found, expected)) in observed.rows.iter().zip(self.unswapped).enumerate() {
            let swapped = row >= at && row < until;
            for (column, value) in found {
                let graph = if swapped { self.new.0 } else { self.old.0 };
                let of = instance(graph, column);
                // After going back, what is blended passes over from the new graph.
                let passes = row >= until && column.starts_with("slow_");
                if if swapped {
                    untouched.contains(&of)
                } else {
                    !passes || untouched.contains(&of)
                } {
                    assert_eq!(
                        Some(value),
                        expected.get(column),
                        "{}: {column} in row {row}, swapped at {at}, back at {until}",
                        self.name
                    );
                }
            }
        }
    }

    fn check_report(&self, observed: &Observed) {
        let Observed {
            carry, retained, ..
        } = observed;
        let untouched = self.untouched();
        let instances = self.new.1.plan.nodes.iter().map(|node| node.instance());
        let reported: Vec<_> = carry.iter().map(|node| node.node.clone()).collect();
        assert_eq!(reported, instances.collect::<Vec<_>>(), "{}", self.name);
        for node in carry {
            assert_eq!(
                node.outcome == Carry::Carried,
                untouched.contains(&node.node),
                "{}: {node:?}",
                self.name
            );
            if self.at == 0 {
                assert!(!matches!(node.outcome, Carry::Warmed { .. }));
            }
        }
        let afresh: BTreeSet<String> = carry
            .iter()
            .filter(|node| matches!(node.outcome, Carry::Warmed { .. } | Carry::Cold { .. }))
            .map(|node| node.node.clone())
            .collect();
        // Where nothing was forgotten, all but what was offered an old state is as if the new graph had always run.
        let adopted: BTreeSet<String> = carry
            .iter()
            .filter(|node| !matches!(node.outcome, Carry::Adopted { .. }))
            .map(|node| node.node.clone())
            .collect();
        let always = self.new.0.hangs_on_others(&adopted);
        // What is warmed, with all before it, is a new graph that began with the retained past.
        let warmed = self.new.0.hangs_on_others(&afresh);
        let begun = run(self.new.1, &feed(), &self.happenings[*retained..]);
        let skipped = rows_before(self.happenings, *retained);
        for row in self.swapped() {
            for (column, value) in &observed.rows[row] {
                if column.starts_with("slow_") {
                    continue;
                }
                let of = instance(self.new.0, column);
                if *retained == 0 && !always.contains(&of) {
                    assert_eq!(
                        *value, self.from_the_start[row][column],
                        "{}: {column} in row {row} as from the start",
                        self.name
                    );
                }
                if !warmed.contains(&of) {
                    assert_eq!(
                        *value,
                        begun[row - skipped][column],
                        "{}: {column} in row {row} as warmed",
                        self.name
                    );
                }
            }
        }
    }
}

/// The cases of a pair of graphs.
pub(super) fn cases_of(seed: u64, mut each: impl FnMut(&Case<'_>)) {
    let mut random = Prng::stream(seed, "swaps");
    let old = Graph::random(&mut random);
    let cosmetic = seed.is_multiple_of(5);
    let mut new = old.clone();
    if !cosmetic {
        for _ in 0..1 + random.bits() % 3 {
            new.edit(&mut random);
        }
    }
    let before = model_of(&old, None);
    let after = model_of(&new, cosmetic.then_some(&mut random));
    let data = happenings(&mut random, ROWS);
    let unswapped = run(&before, &feed(), &data);
    let from_the_start = run(&after, &feed(), &data);
    let revision = |model: &Model| model.engine().unwrap().revision().to_owned();
    let revisions = [revision(&before), revision(&after)];
    if cosmetic {
        assert_eq!(old.untouched(&new).len(), before.plan.nodes.len());
        assert_eq!(revisions[0], revisions[1], "seed {seed}");
    }
    let unheard = chance(&mut random, 0.2).then(|| {
        let text = new.text(None);
        model(&text.replace("\"c\"]", "\"c\", \"unheard\"]"), "0")
    });
    for _ in 0..INSTANTS {
        let at = (random.bits() % ROWS as u64) as usize;
        let back = (chance(&mut random, 0.4) && at + 1 < ROWS)
            .then(|| at + 1 + (random.bits() % (ROWS - at - 1) as u64) as usize);
        // A rollback needs a tick of the new graph, which a break alone is not.
        let back = back.filter(|&back| rows_before(&data, back) > rows_before(&data, at));
        let case = Case {
            name: format!("seed {seed}"),
            old: (&old, &before),
            new: (&new, &after),
            revisions: revisions.clone(),
            unheard: unheard.as_ref(),
            happenings: &data,
            unswapped: &unswapped,
            from_the_start: &from_the_start,
            at,
            back,
            retain: pick(&mut random, &[0, 100, 100_000]),
        };
        each(&case);
    }
}

fn check_seed(seed: u64) {
    cases_of(seed, |case| case.judge(&case.observed()));
}

#[test]
fn any_graph_is_swapped_for_any_other_at_any_instant() {
    if let Ok(seed) = std::env::var("ATHERMAL_SEED") {
        check_seed(seed.parse().unwrap());
        return;
    }
    let seeds = cases() / INSTANTS as u64;
    std::thread::scope(|scope| {
        for half in 0..2 {
            scope.spawn(move || (half..seeds).step_by(2).for_each(check_seed));
        }
    });
}
