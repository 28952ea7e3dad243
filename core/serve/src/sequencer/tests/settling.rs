//! After a start or a reconnect.

use super::*;

/// Two sources with a channel each, which settle for 5 s and are given up after 30 s.
fn two() -> Sequencer {
    let mut rules = plain(2);
    rules.settle = ms(5_000);
    rules.sources.push(SourceRules::default());
    rules.channels[1].source = 1;
    Sequencer::new(rules, at(0))
}

fn instants(made: &[(Moment, Decided)]) -> Vec<(Moment, Instant)> {
    let tick = |(now, decided): &(Moment, Decided)| match decided {
        Decided::Tick(instant, _) => Some((*now, *instant)),
        _ => None,
    };
    made.iter().filter_map(tick).collect()
}

#[test]
fn no_tick_is_cut_until_every_source_has_settled() {
    let mut sequencer = two();
    sequencer.connected(0, at(0));
    sequencer.connected(1, at(2_000));
    sequencer.arrive(sample(0, 1_000, 1.0), at(10));
    // An older one of the other source, seconds later, is not late.
    sequencer.arrive(sample(1, 500, 2.0), at(6_500));
    let made = pass(&mut sequencer, at(10_000));
    let expected = [(at(7_000), stamp(500)), (at(7_000), stamp(1_000))];
    assert_eq!(instants(&made), expected);
}

#[test]
fn a_source_that_is_away_is_not_waited_for_for_ever() {
    let mut sequencer = two();
    sequencer.connected(0, at(0));
    sequencer.arrive(sample(0, 1_000, 1.0), at(10));
    let made = pass(&mut sequencer, at(100_000));
    assert_eq!(instants(&made), [(at(30_000), stamp(1_000))]);
}

#[test]
fn a_source_that_has_ended_is_not_waited_for() {
    let mut sequencer = two();
    sequencer.connected(0, at(0));
    sequencer.ended(1);
    sequencer.arrive(sample(0, 1_000, 1.0), at(10));
    let made = pass(&mut sequencer, at(100_000));
    assert_eq!(instants(&made), [(at(5_000), stamp(1_000))]);
}

#[test]
fn ticks_go_on_while_a_source_is_away_and_wait_when_it_is_back() {
    let mut sequencer = two();
    (0..2).for_each(|source| sequencer.connected(source, at(0)));
    pass(&mut sequencer, at(10_000));
    sequencer.away(1, at(10_000));
    sequencer.arrive(sample(0, 10_000, 1.0), at(10_000));
    let made = pass(&mut sequencer, at(11_000));
    assert_eq!(instants(&made), [(at(10_200), stamp(10_000))]);
    sequencer.connected(1, at(20_000));
    sequencer.arrive(sample(0, 20_000, 1.0), at(20_000));
    sequencer.arrive(sample(1, 12_000, 1.0), at(24_000));
    let made = pass(&mut sequencer, at(30_000));
    let expected = [(at(25_000), stamp(12_000)), (at(25_000), stamp(20_000))];
    assert_eq!(instants(&made), expected);
}

#[test]
fn a_source_that_comes_and_goes_does_not_stop_the_others() {
    let mut sequencer = two();
    (0..2).for_each(|source| sequencer.connected(source, at(0)));
    let mut ticks = Vec::new();
    for second in 0..300 {
        let now = at(1_000 * second);
        match second % 4 {
            1 if second > 20 => sequencer.connected(1, now),
            3 if second > 20 => sequencer.away(1, now),
            _ => {}
        }
        sequencer.arrive(sample(0, 1_000 * second, 1.0), now);
        ticks.extend(instants(&pass(&mut sequencer, at(1_000 * second + 999))));
    }
    assert_eq!(ticks.len(), 300);
    let delayed = |(cut, stamp): &&(Moment, Instant)| cut.as_ns() - stamp.as_ns() > 1_000_000_000;
    let late: Vec<_> = ticks.iter().filter(delayed).collect();
    // Once for `settle` and `silent` at the most.
    assert!((1..=40).contains(&late.len()), "{late:?}");
}

#[test]
fn no_beat_is_cut_while_sources_settle() {
    let mut rules = plain(1);
    (rules.settle, rules.heartbeat) = (ms(5_000), Some(ms(1_000)));
    let timeline = Timeline::resume(stamp(1_000), vec![stamp(1_000)], vec![None], &[]);
    let mut sequencer = Sequencer::resume(rules, timeline, at(0));
    sequencer.connected(0, at(0));
    let made = pass(&mut sequencer, at(5_500));
    assert_eq!(made, [(at(5_000), Decided::Beat(stamp(5_800), vec![None]))]);
}
