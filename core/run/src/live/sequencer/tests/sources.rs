//! Sources of any clocks: whoever is right is heard.
//!
//! Where the host is trusted, or most sources are right, every right sample that is live is accepted from a minute after that; none is
//! ever refused as of the future; and who is late behind a clock that is ahead by less than `future` learns whose it is.
//! `ATHERMAL_LONG=1` looks at a hundred thousand cases.

use std::collections::BTreeMap;

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use super::*;

/// 2027, in ms.
const TODAY: i64 = 1_800_000_000_000;
const SECOND: i64 = 1_000;
const MINUTE: i64 = 60_000;
/// How long a case goes on.
const END: i64 = 3 * MINUTE;

/// What is the matter with a clock.
#[derive(Debug, Clone, Copy)]
enum Clock {
    Right,
    /// By so many ms, all the time.
    Off(i64),
    /// Ahead by so many ms, now and then, for so many samples.
    Jumping(i64, i64),
    /// At this time when it starts, until it is set right.
    Begins(i64, i64),
}

impl Clock {
    /// What it shows at a moment, as the nth sample.
    fn shows(self, now: i64, nth: i64) -> i64 {
        let right = TODAY + now;
        match self {
            Self::Off(by) => right + by,
            Self::Jumping(by, samples) if nth / samples % 2 == 1 => right + by,
            Self::Begins(at, until) if now < until => at + now,
            _ => right,
        }
    }

    /// Since when it is right.
    fn right_since(self) -> Option<i64> {
        match self {
            Self::Right => Some(0),
            Self::Begins(_, until) => Some(until),
            Self::Off(_) | Self::Jumping(..) => None,
        }
    }
}

#[derive(Debug, Clone)]
struct Feeding {
    clock: Clock,
    /// Between two samples, and their delay at most.
    every: i64,
    delay: i64,
    /// It is connected from here on; what it measured for so long before it gives at once then.
    connected: i64,
    backlog: i64,
    /// Of the backlog these parts are missing, in hundredths.
    hole: (i64, i64),
    phase: i64,
}

fn feeding(clock: impl Strategy<Value = Clock>) -> impl Strategy<Value = Feeding> {
    let every = prop::sample::select(vec![500, 1_000, 2_000, 5_000]);
    let backlog = prop_oneof![Just(0), 0..120 * SECOND, Just(600 * SECOND)];
    let hole = (0..100_i64, 0..100_i64);
    let more = (every, 0..150_i64, 0..20 * SECOND, backlog, hole, 0..500_i64);
    (clock, more).prop_map(
        |(clock, (every, delay, connected, backlog, hole, phase))| Feeding {
            clock,
            every,
            delay,
            connected,
            backlog,
            hole,
            phase,
        },
    )
}

fn right() -> impl Strategy<Value = Clock> {
    Just(Clock::Right)
}

fn wrong() -> impl Strategy<Value = Clock> {
    let far = prop_oneof![
        30 * SECOND..3_600 * SECOND,
        Just(86_400 * SECOND),
        Just(73 * 31_536_000_000)
    ];
    let begins = prop::sample::select(vec![0, 946_684_800_000, 4_102_444_800_000]);
    prop_oneof![
        far.clone().prop_map(Clock::Off),
        far.clone().prop_map(|by| Clock::Off(-by)),
        (SECOND..4_500_i64).prop_map(Clock::Off),
        (SECOND..4_500_i64).prop_map(|by| Clock::Off(-by)),
        (far, 1..20_i64).prop_map(|(by, samples)| Clock::Jumping(by, samples)),
        (begins, 0..60 * SECOND).prop_map(|(at, until)| Clock::Begins(at, until)),
    ]
}

#[derive(Debug, Clone)]
struct Case {
    feeding: Vec<Feeding>,
    /// Since when the host is trusted, and what it is off by as long as it is not.
    trusted: Option<i64>,
    guess: Option<i64>,
}

/// Most sources are right; or the host is trusted.
fn case() -> impl Strategy<Value = Case> {
    let guess = prop::option::of(prop_oneof![-30 * SECOND..30 * SECOND, Just(-TODAY)]);
    let majority = (1..3_usize).prop_flat_map(|wrongs| {
        let rights = prop::collection::vec(feeding(right()), wrongs + 1..wrongs + 3);
        (
            rights,
            prop::collection::vec(feeding(wrong()), wrongs),
            Just(None),
        )
    });
    let any = prop_oneof![right().boxed(), wrong().boxed()];
    let trusted = (
        prop::collection::vec(feeding(right()), 0..2),
        prop::collection::vec(feeding(any), 1..4),
        prop_oneof![Just(Some(0)), (0..MINUTE).prop_map(Some)],
    );
    let sources = prop_oneof![majority.boxed(), trusted.boxed()];
    (sources, guess).prop_map(|((mut feeding, others, trusted), guess)| {
        feeding.extend(others);
        Case {
            feeding,
            trusted,
            guess,
        }
    })
}

/// What comes: when, the sample, and whether it is live and right.
fn arrivals(case: &Case) -> Vec<(i64, Sample, Option<i64>)> {
    let mut all = Vec::new();
    for (nth, of) in case.feeding.iter().enumerate() {
        let first = of.connected - of.backlog;
        let mut behind = 0;
        for count in 0.. {
            let measured = first + of.phase + count * of.every;
            if measured >= END {
                break;
            }
            let part = (measured - first) * 100 / of.backlog.max(1);
            let is_backlog = measured < of.connected;
            if is_backlog && part >= of.hole.0 && part < of.hole.0 + of.hole.1 {
                continue;
            }
            behind += i64::from(is_backlog);
            let delay = (count * 7_919) % (of.delay + 1);
            let came = match is_backlog {
                true => of.connected + behind,
                // What was queued comes first.
                false => (measured + delay).max(of.connected + behind + 1),
            };
            let stamp = of.clock.shows(measured, count);
            let is_right = stamp == TODAY + measured;
            let since = of.clock.right_since().unwrap_or(0).max(of.connected);
            let live = (is_right && !is_backlog).then_some(since);
            all.push((came, sample(nth as u32, stamp, count as f64), live));
        }
    }
    all.sort_by_key(|(came, sample, _)| (*came, sample.channel, sample.stamp));
    all
}

/// What became of each sample in the end, whose clock was named, and how often a segment began.
struct Ran {
    became: BTreeMap<(u32, Instant), Admission>,
    named: BTreeMap<(u32, Instant), Option<Leader>>,
    back: Vec<i64>,
}

fn run(case: &Case, arriving: &[(i64, Sample, Option<i64>)]) -> Ran {
    let sources = case.feeding.len();
    let mut rules = plain(sources);
    rules.sources = vec![SourceRules::default(); sources];
    for (source, channel) in rules.channels.iter_mut().enumerate() {
        channel.source = source;
    }
    let mut sequencer = Sequencer::new(rules, at(0));
    if let Some(off) = case.guess {
        sequencer.guess(stamp(TODAY + off), at(0));
    }
    let mut calls: Vec<(i64, Option<usize>)> = case
        .feeding
        .iter()
        .enumerate()
        .map(|(nth, of)| (of.connected, Some(nth)))
        .collect();
    calls.extend(case.trusted.map(|when| (when, None)));
    calls.sort_unstable();
    let mut calls = calls.into_iter().peekable();
    let mut ran = Ran {
        became: BTreeMap::new(),
        named: BTreeMap::new(),
        back: Vec::new(),
    };
    let take = |ran: &mut Ran, sequencer: &mut Sequencer, now: i64| {
        for (when, decided) in pass(sequencer, at(now)) {
            match decided {
                Decided::Sample(admission) => became(ran, admission),
                Decided::Back(..) => ran.back.push(when.as_ns() / 1_000_000),
                _ => {}
            }
        }
    };
    for (came, sample, _) in arriving {
        while let Some((when, source)) = calls.next_if(|(when, _)| when <= came) {
            take(&mut ran, &mut sequencer, when);
            match source {
                Some(source) => sequencer.connected(source, at(when)),
                None => sequencer.synchronise(stamp(TODAY + when), at(when)),
            }
        }
        take(&mut ran, &mut sequencer, *came);
        let admission = sequencer.arrive(*sample, at(*came));
        became(&mut ran, admission);
        let key = (sample.channel, sample.stamp);
        ran.named
            .insert(key, sequencer.leader(admission, at(*came)));
        assert!(sequencer.timeline().waiting().len() <= 1 << 14);
    }
    take(&mut ran, &mut sequencer, END + MINUTE);
    ran
}

fn became(ran: &mut Ran, admission: Admission) {
    let (Admission::Accepted(sample)
    | Admission::Waits(sample)
    | Admission::Late(sample)
    | Admission::Twice(sample)
    | Admission::Refused(sample, _)) = admission
    else {
        return;
    };
    ran.became.insert((sample.channel, sample.stamp), admission);
}

fn holds(case: &Case) -> Result<(), TestCaseError> {
    let arriving = arrivals(case);
    let ran = run(case, &arriving);
    // Until all that are right are there, nobody knows who is.
    let rights = case
        .feeding
        .iter()
        .filter(|of| matches!(of.clock, Clock::Right));
    let there = rights
        .map(|of| of.connected + 4 * of.every + SECOND)
        .max()
        .unwrap_or(0);
    let known = case.trusted.unwrap_or(there);
    for (came, sample, live) in &arriving {
        let Some(admission) = ran.became.get(&(sample.channel, sample.stamp)) else {
            panic!("nothing became of {sample:?}");
        };
        let of = &case.feeding[sample.channel as usize];
        let is_right = live.is_some() || matches!(of.clock, Clock::Right);
        let is_future = matches!(admission, Admission::Refused(_, Refusal::Future { .. }));
        let is_known = *came >= known;
        prop_assert!(
            !(is_right && is_future && is_known),
            "right, and refused at {came}: {sample:?} of {of:?}: {admission:?}, back {:?}",
            ran.back
        );
        let Some(since) = live else { continue };
        // A minute, from the first sample on that comes then, and to the next that shows it.
        let settled = known.max(*since) + MINUTE + 3 * of.every + SECOND;
        if *came < settled.max(there + MINUTE + 10 * SECOND) {
            continue;
        }
        match admission {
            Admission::Accepted(_) => {}
            Admission::Late(_) => {
                let named = ran
                    .named
                    .get(&(sample.channel, sample.stamp))
                    .copied()
                    .flatten();
                let Some(named) = named else {
                    panic!(
                        "late at {came}, behind nobody: {sample:?} of {of:?}, back {:?}",
                        ran.back
                    );
                };
                let leader = case.feeding[named.source].clock;
                let Clock::Off(by) = leader else {
                    panic!("late at {came} behind {leader:?}: {sample:?} of {of:?}");
                };
                let off = named.ahead - ms(by);
                prop_assert!(
                    by < 5 * SECOND && off < ms(400) && -off < ms(400),
                    "{named:?}, {by}"
                );
            }
            other => panic!("at {came}: {other:?} of {of:?}, back {:?}", ran.back),
        }
    }
    prop_assert!(ran.back.len() <= 2, "segments at {:?}", ran.back);
    Ok(())
}

#[test]
fn whoever_is_right_is_heard_where_the_host_is_trusted_or_most_are_right() {
    let cases = match std::env::var_os("ATHERMAL_LONG") {
        Some(_) => 100_000,
        None => 300,
    };
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let held = TestRunner::new(config).run(&case(), |case| holds(&case));
    if let Err(error) = held {
        panic!("{error}");
    }
}

#[test]
fn a_right_majority_is_heard_beside_one_that_is_ahead_and_one_that_began_in_2100() {
    let feeding = |clock, every, connected, backlog, phase| Feeding {
        clock,
        every,
        delay: 0,
        connected,
        backlog,
        hole: (0, 0),
        phase,
    };
    let case = Case {
        feeding: vec![
            feeding(Clock::Right, 500, 9_108, 0, 390),
            feeding(Clock::Right, 500, 9_467, 0, 31),
            feeding(Clock::Right, 500, 9_489, 0, 9),
            feeding(
                Clock::Begins(4_102_444_800_000, 5_657),
                2_000,
                3_289,
                600_000,
                192,
            ),
            feeding(Clock::Off(30_000), 500, 2_935, 0, 355),
        ],
        trusted: None,
        guess: None,
    };
    holds(&case).unwrap();
}
