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
    // Once, for `settle` at the most.
    assert!((1..=5).contains(&late.len()), "{late:?}");
}

#[test]
fn an_instant_that_holds_a_sample_of_a_lost_source_waits_until_that_is_back_and_settled() {
    let mut rules = plain(2);
    rules.settle = ms(5_000);
    let mut sequencer = connected(rules);
    pass(&mut sequencer, at(10_000));
    sequencer.arrive(sample(0, 10_000, 1.0), at(10_000));
    sequencer.away(0, at(10_100));
    // It fails to come back again and again.
    (11..20).for_each(|second| sequencer.away(0, at(1_000 * second)));
    assert_eq!(pass(&mut sequencer, at(20_000)), []);
    sequencer.connected(0, at(20_000));
    let rest = sample(1, 10_000, 2.0);
    assert_eq!(
        sequencer.arrive(rest, at(22_000)),
        Admission::Accepted(rest)
    );
    let made = pass(&mut sequencer, at(60_000));
    assert_eq!(made, [(at(25_000), tick(10_000, &[Some(1.0), Some(2.0)]))]);
}

#[test]
fn a_lost_source_is_waited_for_up_to_silent_where_no_other_gives_anything() {
    let mut rules = plain(2);
    rules.settle = ms(5_000);
    let mut sequencer = connected(rules);
    pass(&mut sequencer, at(10_000));
    sequencer.arrive(sample(0, 10_000, 1.0), at(10_000));
    sequencer.away(0, at(10_100));
    let made = pass(&mut sequencer, at(60_000));
    assert_eq!(made, [(at(40_100), tick(10_000, &[Some(1.0), None]))]);
}

#[test]
fn one_of_two_sources_dies_then_flaps_and_the_other_pauses_once_for_settle_at_most() {
    let mut pauses = 0;
    // In the middle of an instant, or between two; and it may stay connected longer than it takes to settle.
    for (death, up) in [
        (20_050, 500),
        (20_700, 500),
        (20_050, 7_000),
        (20_700, 7_000),
    ] {
        let mut sequencer = two();
        (0..2).for_each(|source| sequencer.connected(source, at(0)));
        let mut ticks = Vec::new();
        for second in 0..300 {
            let now = 1_000 * second;
            for source in 0..2 {
                if source == 0 || now < death {
                    sequencer.arrive(sample(source, now, 1.0), at(now));
                }
            }
            for ms in (now..now + 1_000).step_by(50) {
                match ms - death {
                    0 => sequencer.away(1, at(ms)),
                    since if since > 0 && since % (up + 500) == 0 => sequencer.connected(1, at(ms)),
                    since if since > up && since % (up + 500) == up => sequencer.away(1, at(ms)),
                    _ => {}
                }
                // Where one is no longer waited for, what was due is cut now.
                let made = instants(&pass(&mut sequencer, at(ms + 49)));
                ticks.extend(
                    made.into_iter()
                        .map(|(cut, stamp)| (cut.max(at(ms)), stamp)),
                );
            }
        }
        assert_eq!(ticks.len(), 300);
        // After the start, of which the first tick is delayed too.
        let late = ticks
            .iter()
            .skip(10)
            .filter(|(cut, stamp)| cut.as_ns() - stamp.as_ns() > 250_000_000);
        let late: Vec<_> = late.collect();
        assert!(late.len() <= 6, "{death} {up}: {late:?}");
        let delay = |(cut, stamp): &&(Moment, Instant)| cut.as_ns() - stamp.as_ns();
        let longest = late.iter().map(delay).max();
        assert!(longest <= Some(5_250_000_000), "{death} {up}: {late:?}");
        if let [first, .., last] = late[..] {
            let pause = ms(1_000 * (late.len() as i64 - 1));
            assert_eq!(last.1 - first.1, pause, "it pauses once");
        }
        pauses += late.len();
    }
    assert!(pauses > 10, "it is waited for: {pauses}");
}

#[test]
fn two_sources_of_a_broker_that_is_lost_amid_an_instant_are_both_waited_for() {
    let mut sequencer = two();
    (0..2).for_each(|source| sequencer.connected(source, at(0)));
    pass(&mut sequencer, at(10_000));
    for source in 0..2 {
        sequencer.arrive(sample(source, 10_000, 1.0), at(10_000));
    }
    sequencer.away(0, at(10_100));
    sequencer.away(1, at(10_110));
    assert_eq!(pass(&mut sequencer, at(20_000)), []);
    sequencer.connected(0, at(20_000));
    sequencer.connected(1, at(21_000));
    let made = pass(&mut sequencer, at(60_000));
    assert_eq!(instants(&made), [(at(26_000), stamp(10_000))]);
}

#[test]
fn no_beat_is_cut_while_sources_settle() {
    let mut rules = plain(1);
    (rules.settle, rules.heartbeat) = (ms(5_000), Some(ms(1_000)));
    let timeline = Timeline::resume(
        stamp(1_000),
        vec![stamp(1_000)],
        (vec![None], vec![None]),
        &[],
        Vec::new(),
    );
    let mut sequencer = Sequencer::resume(rules, timeline, at(0));
    sequencer.connected(0, at(0));
    let made = pass(&mut sequencer, at(5_500));
    assert_eq!(made, [(at(5_000), Decided::Beat(stamp(5_800), vec![None]))]);
}
