//! Whatever the order of arrival, and whatever the delays.

use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;

use super::*;

const CHANNELS: usize = 4;

/// Samples of four channels of two sources: stamp and delay in ms.
fn samples(longest: i64) -> impl Strategy<Value = Vec<(u32, i64, i64)>> {
    let sample = (0..CHANNELS as u32, 0..20_000_i64, 0..longest);
    prop::collection::vec(sample, 1..200)
}

fn rules(join: i64) -> Rules {
    let mut rules = plain(CHANNELS);
    rules.join = ms(join);
    rules.future = ms(1_000_000);
    rules.sources.push(SourceRules::default());
    rules.channels[3].source = 1;
    rules
}

/// What arrives, in its order: of a channel and stamp the first alone.
fn arrivals(samples: &[(u32, i64, i64)]) -> Vec<(i64, Sample)> {
    let mut known = BTreeSet::new();
    let first = samples
        .iter()
        .filter(|(channel, stamp, _)| known.insert((*channel, *stamp)));
    let mut arriving: Vec<_> = first
        .enumerate()
        .map(|(nth, &(channel, stamp, delay))| (stamp + delay, sample(channel, stamp, nth as f64)))
        .collect();
    arriving.sort_by_key(|(when, _)| *when);
    arriving
}

/// All ticks and what was decided of samples, as it happens.
fn run(rules: Rules, arriving: &[(i64, Sample)]) -> (Vec<Decided>, Vec<Decided>) {
    let mut sequencer = connected(rules);
    let mut log = Vec::new();
    for &(when, sample) in arriving {
        // What is due at this very moment is cut before or after the arrival; before is the harder case.
        log.extend(decided(&mut sequencer, at(when)));
        log.push(Decided::Sample(sequencer.arrive(sample, at(when))));
    }
    log.extend(decided(&mut sequencer, at(1_000_000)));
    let is_tick = |decided: &&Decided| matches!(decided, Decided::Tick(..) | Decided::Beat(..));
    (log.iter().filter(is_tick).cloned().collect(), log)
}

/// The ticks by the stamps alone, worked out without a clock.
fn expected(arriving: &[(i64, Sample)], join: i64) -> Vec<Decided> {
    let mut by_stamp: BTreeMap<Instant, Vec<Sample>> = BTreeMap::new();
    for (_, sample) in arriving {
        by_stamp.entry(sample.stamp).or_default().push(*sample);
    }
    let mut ticks: Vec<(Instant, Instant, Vec<Option<f64>>)> = Vec::new();
    for (stamp, samples) in by_stamp {
        match ticks.last_mut() {
            Some((first, last, _)) if stamp - *first <= ms(join) => *last = stamp,
            _ => ticks.push((stamp, stamp, vec![None; CHANNELS])),
        }
        let (_, _, row) = ticks.last_mut().expect("one has been pushed");
        for sample in samples {
            row[sample.channel as usize] = Some(sample.value);
        }
    }
    let tick = |(_, at, row)| Decided::Tick(at, row);
    ticks.into_iter().map(tick).collect()
}

proptest! {
    #[test]
    fn any_order_of_arrival_with_delays_below_wait_gives_the_same_ticks(
        samples in samples(200), join in 0..50_i64,
    ) {
        let arriving = arrivals(&samples);
        let (ticks, _) = run(rules(join), &arriving);
        prop_assert_eq!(ticks, expected(&arriving, join));
    }

    #[test]
    fn a_repeated_message_changes_no_tick(samples in samples(200), again in 0..5_000_i64) {
        let arriving = arrivals(&samples);
        let mut twice = arriving.clone();
        twice.extend(arriving.iter().map(|(when, sample)| (when + again, *sample)));
        twice.sort_by_key(|(when, _)| *when);
        let (ticks, log) = run(rules(0), &twice);
        prop_assert_eq!(ticks, expected(&arriving, 0));
        let is_repeat = |of: &&Decided| matches!(of, Decided::Sample(Admission::Twice(_)));
        // Another sample of its channel may be the newest by then; it is repeated all the same.
        prop_assert_eq!(log.iter().filter(is_repeat).count(), arriving.len());
    }

    #[test]
    fn a_log_of_any_arrivals_is_applied_to_the_same_ticks(
        samples in samples(3_000), join in 0..50_i64, late in 0..2_000_i64, beat in 50..2_000_i64,
        most in 4..200_usize,
    ) {
        let mut rules = rules(join);
        rules.channels[3].late = ms(late);
        (rules.heartbeat, rules.most) = (Some(ms(beat)), most);
        let (ticks, log) = run(rules, &arrivals(&samples));
        let mut timeline = Timeline::new(CHANNELS, 2);
        let mut again = Vec::new();
        let mut last = Instant::MIN;
        for decided in log {
            match decided {
                Decided::Sample(Admission::Accepted(sample)) => {
                    prop_assert!(timeline.accept(sample));
                }
                Decided::Tick(at, _) => {
                    prop_assert!(at > last, "instants rise");
                    last = at;
                    let row = timeline.tick(at);
                    again.push(Decided::of(Decision::Tick { at, row }));
                }
                Decided::Beat(at, _) => {
                    prop_assert!(at > last, "instants rise");
                    last = at;
                    let row = timeline.tick(at);
                    again.push(Decided::of(Decision::Beat { at, row }));
                }
                _ => {}
            }
        }
        prop_assert_eq!(again, ticks);
    }

    #[test]
    fn every_accepted_sample_is_stepped_once_unless_a_newer_one_of_its_channel_is_in_its_tick(
        samples in samples(3_000),
    ) {
        let (ticks, log) = run(rules(0), &arrivals(&samples));
        let value = |decided: &Decided| match decided {
            Decided::Sample(Admission::Accepted(sample)) => Some(sample.value.to_bits()),
            _ => None,
        };
        let accepted: BTreeSet<_> = log.iter().filter_map(value).collect();
        let mut stepped = BTreeSet::new();
        for tick in &ticks {
            if let Decided::Tick(_, row) = tick {
                for value in row.iter().flatten() {
                    prop_assert!(stepped.insert(value.to_bits()), "stepped twice");
                }
            }
        }
        prop_assert_eq!(stepped, accepted);
    }
}
