//! Each rule by itself.

use super::*;

#[test]
fn an_instant_is_stepped_so_long_after_its_first_sample_came() {
    let mut sequencer = connected(plain(2));
    sequencer.arrive(sample(0, 1_000, 1.0), at(50));
    sequencer.arrive(sample(1, 1_000, 2.0), at(249));
    assert_eq!(sequencer.due(), Some(at(250)));
    assert_eq!(pass(&mut sequencer, at(249)), []);
    let made = pass(&mut sequencer, at(10_000));
    assert_eq!(made, [(at(250), tick(1_000, &[Some(1.0), Some(2.0)]))]);
}

#[test]
fn older_instants_are_stepped_before_the_one_that_is_due() {
    let mut sequencer = connected(plain(2));
    sequencer.arrive(sample(0, 1_000, 1.0), at(0));
    sequencer.arrive(sample(1, 990, 2.0), at(150));
    sequencer.arrive(sample(1, 1_010, 3.0), at(150));
    let made = pass(&mut sequencer, at(200));
    let older = tick(990, &[None, Some(2.0)]);
    let due = tick(1_000, &[Some(1.0), None]);
    assert_eq!(made, [(at(200), older), (at(200), due)]);
    // What is newer waits for its own time.
    assert_eq!(sequencer.due(), Some(at(350)));
}

#[test]
fn a_repeated_sample_is_known_whether_it_waits_or_has_been_stepped() {
    let mut sequencer = connected(plain(1));
    let first = sample(0, 1_000, 1.0);
    assert_eq!(sequencer.arrive(first, at(0)), Admission::Accepted(first));
    assert_eq!(sequencer.arrive(first, at(10)), Admission::Twice(first));
    pass(&mut sequencer, at(500));
    assert_eq!(sequencer.arrive(first, at(500)), Admission::Twice(first));
    let older = sample(0, 900, 1.0);
    assert_eq!(sequencer.arrive(older, at(500)), Admission::Twice(older));
    assert_eq!(sequencer.counts()[0].twice, 3);
    assert_eq!(sequencer.counts()[0].accepted, 1);
}

#[test]
fn a_sample_that_is_not_after_the_last_tick_is_late() {
    let mut sequencer = connected(plain(2));
    sequencer.arrive(sample(0, 1_000, 1.0), at(0));
    pass(&mut sequencer, at(200));
    let late = sample(1, 1_000, 2.0);
    assert_eq!(sequencer.arrive(late, at(201)), Admission::Late(late));
    assert_eq!(sequencer.counts()[1].late, 1);
    assert_eq!(sequencer.due(), None);
}

#[test]
fn a_late_sample_of_a_channel_that_allows_it_goes_into_the_next_tick() {
    let mut rules = plain(2);
    rules.channels[1].late = ms(2_000);
    let mut sequencer = connected(rules);
    sequencer.arrive(sample(0, 10_000, 1.0), at(0));
    pass(&mut sequencer, at(200));
    let dear = sample(1, 8_000, 2.0);
    assert_eq!(sequencer.arrive(dear, at(300)), Admission::Accepted(dear));
    let too_late = sample(1, 7_999, 2.0);
    assert_eq!(
        sequencer.arrive(too_late, at(300)),
        Admission::Late(too_late)
    );
    // It makes no tick of its own.
    assert_eq!(sequencer.due(), None);
    sequencer.arrive(sample(0, 10_100, 3.0), at(400));
    let made = decided(&mut sequencer, at(1_000));
    assert_eq!(made, [tick(10_100, &[Some(3.0), Some(2.0)])]);
    assert_eq!(sequencer.arrive(dear, at(1_000)), Admission::Twice(dear));
}

#[test]
fn a_stamp_from_the_future_is_refused_and_does_not_poison_the_rest() {
    let mut sequencer = connected(plain(1));
    sequencer.arrive(sample(0, 1_000, 1.0), at(0));
    // A second later, 1,000 + 1,000 + 5,000 ms is the limit.
    let allowed = sample(0, 7_000, 1.0);
    assert_eq!(
        sequencer.arrive(allowed, at(1_000)),
        Admission::Accepted(allowed)
    );
    let beyond = sample(0, 12_001, 1.0);
    assert_eq!(
        sequencer.arrive(beyond, at(1_000)),
        Admission::Waits(beyond)
    );
    let next = sample(0, 7_100, 2.0);
    assert_eq!(sequencer.arrive(next, at(1_100)), Admission::Accepted(next));
    let refusal = Refusal::Future { ahead: ms(4_901) };
    let made = decided(&mut sequencer, at(1_100));
    let refused = Decided::Sample(Admission::Refused(beyond, refusal));
    assert_eq!(made[0], refused, "its channel has returned to the old time");
    assert_eq!(sequencer.counts()[0].future, 1);
}

#[test]
fn the_hosts_time_limits_the_first_stamp_where_it_is_known() {
    let mut sequencer = connected(plain(1));
    sequencer.synchronise(stamp(100_000), at(0));
    assert!(sequencer.is_synchronised());
    let beyond = sample(0, 105_001, 1.0);
    let refusal = Refusal::Future { ahead: ms(5_001) };
    assert_eq!(
        sequencer.arrive(beyond, at(0)),
        Admission::Refused(beyond, refusal)
    );
    let mut unknown = connected(plain(1));
    assert_eq!(unknown.arrive(beyond, at(0)), Admission::Accepted(beyond));
    // One that is ten minutes slow is no backlog for ever: what follows is compared with its own stamps.
    let slow = sample(0, -500_000, 1.0);
    assert_eq!(sequencer.arrive(slow, at(1)), Admission::Accepted(slow));
    assert_eq!(sequencer.newest(at(11)), Some(stamp(-499_990)));
}

#[test]
fn after_a_backlog_what_is_live_is_not_from_the_future() {
    let mut sequencer = connected(plain(2));
    sequencer.arrive(sample(0, 1_000, 1.0), at(0));
    // Ten minutes without anything; then what was kept meanwhile, and what is measured now.
    let now = at(600_000);
    for nth in 1..100 {
        let kept = sample(0, 1_000 + 1_000 * nth, 1.0);
        assert_eq!(sequencer.arrive(kept, now), Admission::Accepted(kept));
    }
    let live = sample(1, 601_000, 1.0);
    assert_eq!(sequencer.arrive(live, now), Admission::Accepted(live));
}

#[test]
fn a_source_whose_clock_is_slow_is_followed() {
    let mut sequencer = connected(plain(1));
    // 50 ppm slow: after 30 days it is 130 s behind, and a stamp 6 s ahead of it is still refused.
    let mut stamp_ms = 0;
    for minute in 0..30 * 1_440_i64 {
        stamp_ms = minute * 60_000 - minute * 3;
        let now = at(minute * 60_000);
        sequencer.arrive(sample(0, stamp_ms, 1.0), now);
        while sequencer.pass(now).is_some() {}
    }
    let now = at((30 * 1_440 - 1) * 60_000);
    let ahead = sample(0, stamp_ms + 6_000, 1.0);
    assert_eq!(sequencer.arrive(ahead, now), Admission::Waits(ahead));
}

#[test]
fn instants_within_join_are_one_tick_at_the_last_of_them() {
    let mut rules = plain(3);
    rules.join = ms(20);
    let mut sequencer = connected(rules);
    sequencer.arrive(sample(0, 1_000, 1.0), at(0));
    sequencer.arrive(sample(1, 1_012, 2.0), at(5));
    sequencer.arrive(sample(2, 1_020, 3.0), at(5));
    // Further from the first than `join`, though not from the last.
    sequencer.arrive(sample(0, 1_021, 4.0), at(5));
    let made = pass(&mut sequencer, at(1_000));
    let joined = tick(1_020, &[Some(1.0), Some(2.0), Some(3.0)]);
    let next = tick(1_021, &[Some(4.0), None, None]);
    // `join` longer than `wait`, so that all of an instant can be there.
    assert_eq!(made, [(at(220), joined), (at(225), next)]);
}

#[test]
fn of_two_samples_of_a_channel_in_a_tick_the_newer_counts() {
    let mut rules = plain(1);
    rules.join = ms(20);
    let mut sequencer = connected(rules);
    sequencer.arrive(sample(0, 1_010, 2.0), at(0));
    sequencer.arrive(sample(0, 1_000, 1.0), at(5));
    assert_eq!(
        decided(&mut sequencer, at(1_000)),
        [tick(1_010, &[Some(2.0)])]
    );
}

#[test]
fn a_beat_comes_once_nothing_was_measured_for_so_long_and_stays_behind_by_wait() {
    let mut rules = plain(1);
    rules.heartbeat = Some(ms(1_000));
    let mut sequencer = connected(rules);
    // Nothing to go by before the first sample.
    assert_eq!(sequencer.due(), None);
    sequencer.arrive(sample(0, 50_000, 1.0), at(0));
    let made = pass(&mut sequencer, at(2_500));
    let beat = |ms| Decided::Beat(stamp(ms), vec![None]);
    let expected = [
        (at(200), tick(50_000, &[Some(1.0)])),
        (at(1_200), beat(50_800)),
        (at(2_200), beat(51_800)),
    ];
    assert_eq!(made, expected);
    // A sample that was on its way for less than `wait` is not late.
    let on_its_way = sample(0, 52_301, 2.0);
    assert_eq!(
        sequencer.arrive(on_its_way, at(2_500)),
        Admission::Accepted(on_its_way)
    );
    assert_eq!(sequencer.due(), Some(at(2_700)));
}

#[test]
fn a_caller_that_comes_late_gets_one_beat() {
    let mut rules = plain(1);
    rules.heartbeat = Some(ms(1_000));
    let mut sequencer = connected(rules);
    sequencer.arrive(sample(0, 50_000, 1.0), at(0));
    pass(&mut sequencer, at(200));
    let late = at(60_200);
    assert!(matches!(
        sequencer.pass(late),
        Some(Decision::Beat { at, .. }) if at == stamp(109_800)
    ));
    assert_eq!(sequencer.pass(late), None);
}

#[test]
fn too_many_samples_are_stepped_at_once_and_counted() {
    let mut rules = plain(1);
    rules.most = 10;
    let mut sequencer = connected(rules);
    for nth in 0..10 {
        sequencer.arrive(sample(0, nth, 1.0), at(0));
    }
    assert_eq!(
        decided(&mut sequencer, at(0)),
        [tick(0, &[Some(1.0)])],
        "no more than needed"
    );
    assert_eq!(sequencer.hurried(), 1);
}

#[test]
fn a_flood_of_late_samples_is_bounded_too() {
    let mut rules = plain(2);
    (rules.most, rules.channels[1].late) = (10, ms(2_000));
    let mut sequencer = connected(rules);
    sequencer.arrive(sample(0, 10_000, 1.0), at(0));
    pass(&mut sequencer, at(200));
    for nth in 0..20 {
        sequencer.arrive(sample(1, 9_000 + nth, 1.0), at(200));
    }
    assert_eq!(sequencer.counts()[1].late, 10);
    assert_eq!(sequencer.timeline().pending().len(), 10);
    assert_eq!(sequencer.due(), None);
}

#[test]
fn an_unknown_channel_is_refused() {
    let mut sequencer = connected(plain(1));
    let foreign = sample(1, 0, 1.0);
    let refused = Admission::Refused(foreign, Refusal::NoChannel);
    assert_eq!(sequencer.arrive(foreign, at(0)), refused);
}

#[test]
fn at_the_end_nothing_is_left_waiting() {
    let mut sequencer = connected(plain(1));
    for nth in 0..3 {
        sequencer.arrive(sample(0, nth, 1.0), at(0));
    }
    let mut ticks = 0;
    while sequencer.finish(at(1)).is_some() {
        ticks += 1;
    }
    assert_eq!((ticks, sequencer.due()), (3, None));
    // Another file, whose times start again.
    sequencer.segment();
    let first = sample(0, 0, 1.0);
    assert_eq!(sequencer.arrive(first, at(2)), Admission::Accepted(first));
}

#[test]
fn one_that_goes_on_knows_what_waited_and_what_was_stepped() {
    let mut sequencer = connected(plain(2));
    sequencer.arrive(sample(0, 1_000, 1.0), at(0));
    pass(&mut sequencer, at(200));
    let waiting = sample(1, 1_100, 2.0);
    sequencer.arrive(waiting, at(250));
    let timeline = sequencer.timeline().clone();
    let mut next = Sequencer::resume(plain(2), timeline, at(0));
    next.connected(0, at(0));
    let stepped = sample(0, 1_000, 1.0);
    assert_eq!(next.arrive(stepped, at(10)), Admission::Twice(stepped));
    assert_eq!(next.arrive(waiting, at(10)), Admission::Twice(waiting));
    assert_eq!(
        pass(&mut next, at(1_000)),
        [(at(200), tick(1_100, &[None, Some(2.0)]))]
    );
}
