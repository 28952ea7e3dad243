//! A feature that is sound, and the same with one fault at a time.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

use athermal_core::channel::ABSENT;

use super::*;

faulty! {
    /// The mean of each channel since the beginning of the segment.
    struct Averages;
    /// Gives nothing at all.
    Silent,
    /// No two instances give the same.
    CountsInstances,
    /// Believes that what was computed at an instant is true of all instances.
    Caches,
    /// Leaves the counts out of its state.
    ForgetsCounts,
    /// Has no state to give.
    ForgetsAll,
    /// A snapshot changes it.
    ClearedBySnapshot,
    /// Takes any state for its own.
    TakesAnyState,
    /// Takes a state of another number of channels.
    TakesAnyShape,
    /// Its state has no version.
    Unversioned,
    /// Takes nothing for zero.
    ZeroForAbsent,
    /// Never gets rid of what is not finite.
    Poisoned,
    /// Writes infinity past the framework.
    Infinite,
    /// Goes on over a break.
    IgnoresBreaks,
    /// Has a threshold in nobody's unit.
    BareThreshold,
    /// States the wrong unit.
    WrongUnit,
    /// Keeps a list of all it has seen.
    Hoards,
    /// Allocates at a gap.
    HoardsGaps,
    /// Panics at a gap.
    Panics,
    /// Says to have no past.
    ForgetsSpan,
    /// Says that each channel goes its own way, which does not.
    Mixes,
    /// Bears a time that is yet to come.
    Early,
    /// Writes NaN in a way of its own.
    OwnNan,
    /// Asks for a port that it does not declare.
    AsksElsewhere,
    /// Points at a parameter that it does not have.
    PointsElsewhere,
}

impl Feature for Averages {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is averaged")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mut channels = inputs.port("signal").to_vec();
        if self.fault == Fault::WrongUnit {
            for channel in &mut channels {
                channel.unit = Unit::kelvin();
            }
        }
        if self.fault == Fault::AsksElsewhere {
            channels.extend_from_slice(inputs.port("sginal"));
        }
        if self.fault == Fault::PointsElsewhere {
            return Err(vec![Mistake::at("no.such.parameter", "it is too long")]);
        }
        Ok(vec![OutputPort {
            name: "mean",
            channels,
        }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn is_endless(&self) -> bool {
        self.fault != Fault::ForgetsSpan
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        static INSTANCES: AtomicU64 = AtomicU64::new(0);
        let channels = inputs.port("signal").len();
        Box::new(Averaging {
            fault: self.fault,
            instance: INSTANCES.fetch_add(1, Ordering::Relaxed),
            sums: vec![0.0; channels],
            counts: vec![0.0; channels],
            seen: Vec::new(),
            cleared: false.into(),
        })
    }
}

struct Averaging {
    fault: Fault,
    instance: u64,
    sums: Vec<f64>,
    counts: Vec<f64>,
    seen: Vec<f64>,
    cleared: std::cell::Cell<bool>,
}

thread_local! {
    static KNOWN: RefCell<BTreeMap<(Instant, usize), f64>> = const { RefCell::new(BTreeMap::new()) };
}

impl Averaging {
    fn mean(&mut self, i: usize, value: f64) -> f64 {
        self.sums[i] += value;
        self.counts[i] += 1.0;
        let mean = self.sums[i] / self.counts[i];
        if !mean.is_finite() && self.fault != Fault::Poisoned {
            (self.sums[i], self.counts[i]) = (0.0, 0.0);
        }
        mean
    }
}

impl Operator for Averaging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        if self.cleared.replace(false) {
            self.segment();
        }
        let gap = tick.port(0).iter().any(|value| value.is_nan());
        assert!(
            !(gap && self.fault == Fault::Panics),
            "there is nothing to average"
        );
        if gap && self.fault == Fault::HoardsGaps {
            self.seen.push(0.0);
        }
        for (i, &value) in tick.port(0).iter().enumerate() {
            let value = match self.fault {
                Fault::ZeroForAbsent if value.is_nan() => 0.0,
                Fault::BareThreshold if value.abs() < 10.0 => ABSENT,
                _ => value,
            };
            if value.is_nan() && self.fault != Fault::ZeroForAbsent {
                if self.fault == Fault::OwnNan {
                    let own = f64::NAN.to_bits() + self.instance + 1;
                    outputs.set(i, f64::from_bits(own));
                }
                continue;
            }
            let mut mean = self.mean(i, value);
            match self.fault {
                Fault::Silent => mean = ABSENT,
                Fault::CountsInstances => mean += self.instance as f64 * 1e-9,
                Fault::Caches => {
                    mean =
                        KNOWN.with_borrow_mut(|known| *known.entry((tick.now, i)).or_insert(mean));
                }
                Fault::Hoards => self.seen.push(value),
                Fault::Mixes => mean += 0.1 * tick.port(0).iter().copied().fold(value, f64::max),
                _ => {}
            }
            if self.fault == Fault::Early {
                let early = tick.now + Duration::from_ns(1_000_000_000);
                outputs.set_stamped(i, mean, early);
            } else if self.fault == Fault::Infinite && value > 1e200 {
                outputs.fill_stamped(i..i + 1, tick.now)[0] = f64::INFINITY;
            } else {
                outputs.set(i, mean);
            }
        }
    }

    fn segment(&mut self) {
        if self.fault != Fault::IgnoresBreaks {
            self.sums.fill(0.0);
            self.counts.fill(0.0);
        }
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        if self.fault == Fault::Unversioned {
            return Some(Box::new(Nameless {}));
        }
        self.cleared.set(self.fault == Fault::ClearedBySnapshot);
        (self.fault != Fault::ForgetsAll).then(|| {
            Box::new(Known {
                sums: self.sums.clone(),
                counts: self.counts.clone(),
            }) as Box<dyn State>
        })
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        match state.into_any().downcast::<Known>() {
            Ok(known)
                if known.sums.len() == self.sums.len() || self.fault == Fault::TakesAnyShape =>
            {
                self.sums = known.sums;
                if self.fault != Fault::ForgetsCounts {
                    self.counts = known.counts;
                }
                Restored::Accepted
            }
            Ok(_) => Restored::cold("the number of channels differs"),
            Err(_) if self.fault == Fault::TakesAnyState => Restored::Accepted,
            Err(_) => Restored::cold("the state belongs to another kind of node"),
        }
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct Known {
    sums: Vec<f64>,
    counts: Vec<f64>,
}

athermal_core::state!(Known, "sabotaged_feature/1");

#[derive(Debug, Serialize, Deserialize)]
struct Nameless {}

athermal_core::state!(Nameless, "sabotaged_feature");

athermal_core::register!(Averages, Feature, "sabotaged_feature");

#[test]
fn a_sound_feature_breaks_no_rule() {
    breaks_only::<Averages>(Case::new(""), &[]);
    breaks_only::<Averages>(Case::new("").input("signal", 5, "Cel"), &[]);
}

#[test]
fn a_case_in_which_nothing_comes_out_proves_nothing() {
    breaks::<Averages>(with("silent"), Rule::Answers, "nothing comes out");
    breaks::<Averages>(
        Case::new("").input("signals", 1, "K"),
        Rule::Answers,
        "`signal`",
    );
    breaks::<Averages>(Case::new("fault ="), Rule::Answers, "no TOML");
}

#[test]
fn instances_that_differ_are_not_deterministic() {
    breaks::<Averages>(with("counts_instances"), Rule::Deterministic, "run again");
}

#[test]
fn what_instances_share_shows_when_another_runs_beside() {
    breaks::<Averages>(with("caches"), Rule::LongRun, "beside another instance");
}

#[test]
fn a_state_without_all_that_counts_does_not_go_on() {
    for fault in ["forgets_counts", "forgets_all"] {
        breaks_one::<Averages>(with(fault), Rule::Restores, "restored after");
    }
    breaks::<Averages>(
        with("cleared_by_snapshot"),
        Rule::Restores,
        "asked for a snapshot",
    );
}

#[test]
fn a_state_of_another_version_kind_or_shape_is_not_taken() {
    breaks_one::<Averages>(with("takes_any_state"), Rule::Versions, "another kind");
    breaks::<Averages>(with("unversioned"), Rule::Versions, "without a version");
    finds::<Averages>(
        with("takes_any_shape"),
        Rule::Versions,
        "it panics: index out of bounds: the len is 1 but the index is 1",
    );
}

#[test]
fn nothing_is_not_zero() {
    breaks::<Averages>(
        with("zero_for_absent"),
        Rule::Absence,
        "although `signal.a` has never been measured",
    );
    breaks::<Averages>(
        with("panics"),
        Rule::Answers,
        "it panics: there is nothing to average",
    );
}

#[test]
fn what_is_not_finite_is_neither_kept_nor_given() {
    breaks_one::<Averages>(with("poisoned"), Rule::Infinity, "does not come back");
    breaks_one::<Averages>(with("infinite"), Rule::Infinity, "is inf at");
}

#[test]
fn a_break_in_the_data_is_a_new_beginning() {
    breaks_one::<Averages>(with("ignores_breaks"), Rule::Segments, "than a new node");
}

#[test]
fn other_units_of_the_inputs_change_nothing() {
    breaks_one::<Averages>(with("bare_threshold"), Rule::Units, "signal in um");
    breaks::<Averages>(with("wrong_unit"), Rule::Units, "rather than");
}

#[test]
fn room_is_made_before_the_steady_state() {
    breaks_one::<Averages>(with("hoards"), Rule::Allocation, "allocations");
    breaks_one::<Averages>(with("hoards_gaps"), Rule::Allocation, "allocations");
}

#[test]
fn a_value_is_made_of_what_its_kind_says() {
    breaks_only::<Averages>(with("forgets_span"), &[Rule::Past, Rule::Memory]);
    for fault in ["mixes", "early"] {
        breaks_only::<Averages>(with(fault), &[Rule::Past]);
    }
    finds::<Averages>(
        with("forgets_span"),
        Rule::Past,
        "`node.a` is 1.9301235261335568 rather than -1.2125982615786046 at 2988.678 s with other values up to 2982.012 s, further \
         back than the span of the channel",
    );
    finds::<Averages>(
        with("mixes"),
        Rule::Past,
        "`node.b` is -49.53336295739379 rather than -38.97996201957864 at 13.428 s with other values of `signal.a`, of which \
         `reach` says that it is not made",
    );
    finds::<Averages>(
        with("early"),
        Rule::Past,
        "`node.a` bears the time 14.428 s at 13.428 s already",
    );
}

#[test]
fn a_nan_is_a_nan_however_it_is_written() {
    breaks_only::<Averages>(with("own_nan"), &[]);
}

#[test]
fn a_name_that_the_kind_does_not_declare_is_told() {
    finds::<Averages>(
        with("asks_elsewhere"),
        Rule::Answers,
        "it panics: it asks for the input port `sginal`, and declares [\"signal\"]",
    );
    finds::<Averages>(
        with("points_elsewhere"),
        Rule::Answers,
        "it panics: it finds a mistake at `no.such.parameter`, which is none of its parameters and ports: it is too long",
    );
}

#[test]
fn what_panics_is_told_how_to_find_where() {
    let broken = broken::<Averages>(&[with("panics")]);
    assert_eq!(
        broken[0].to_string(),
        "answers: it panics: there is nothing to average\n  in the case: fault = \"panics\"\n  to do: a node answers with absence or \
         a `Mistake` where it cannot go on, and never panics; `RUST_BACKTRACE=1` shows where it does"
    );
}

#[test]
#[should_panic(expected = "NaN is no time: a row begins with one in seconds, less than 9.2e9")]
fn a_bench_takes_no_time_that_is_none() {
    Bench::of(&Averages { fault: Fault::None }).feed([(f64::NAN, [1.0, 2.0])]);
}

#[test]
fn a_rule_that_a_case_excepts_is_not_tried() {
    let case = with("bare_threshold").except(Rule::Units, "the threshold is in nm by design");
    breaks_only::<Averages>(case, &[]);
}

#[test]
#[should_panic(expected = "`sabotaged_feature` breaks 1 of the rules that every node keeps")]
fn an_assertion_fails_with_what_is_broken() {
    athermal_testkit::assert_conforms::<Averages>(&[with("ignores_breaks")]);
}
