//! Sources whose clocks are wrong.

use super::*;

/// A source whose clock may be off by 5 s, at the host's 1,000 s.
fn source(otherwise: ClockRemedy) -> Sequencer {
    let mut rules = plain(1);
    rules.sources[0].clock = Some(ClockRule {
        within: ms(5_000),
        otherwise,
    });
    rules.settle = ms(5_000);
    let mut sequencer = connected(rules);
    sequencer.synchronise(stamp(1_000_000), at(0));
    sequencer
}

/// Samples each 100 ms from a moment on, whose stamps are behind by some ms.
fn feed(sequencer: &mut Sequencer, from_ms: i64, samples: i64, behind_ms: i64) -> Vec<Decided> {
    let mut made = Vec::new();
    for nth in 0..samples {
        let ms = from_ms + 100 * nth;
        sequencer.arrive(sample(0, 1_000_000 + ms - behind_ms, nth as f64), at(ms));
        made.extend(decided(sequencer, at(ms + 50)));
    }
    made
}

fn ticks(made: &[Decided]) -> Vec<i64> {
    let tick = |decided: &Decided| match decided {
        Decided::Tick(at, _) => Some(at.as_ns() / 1_000_000 - 1_000_000),
        _ => None,
    };
    made.iter().filter_map(tick).collect()
}

#[test]
fn a_clock_within_its_limit_is_left_alone() {
    for otherwise in [
        ClockRemedy::Refuse,
        ClockRemedy::Shift,
        ClockRemedy::Arrival,
    ] {
        let mut sequencer = source(otherwise);
        let mut made = feed(&mut sequencer, 0, 30, 4_900);
        made.extend(decided(&mut sequencer, at(60_000)));
        let expected: Vec<_> = (0..30).map(|nth| 100 * nth - 4_900).collect();
        assert_eq!(ticks(&made), expected, "{otherwise:?}");
        assert_eq!(made.len(), 30);
    }
}

#[test]
fn a_wrong_clock_is_refused_where_the_file_says_so() {
    let mut sequencer = source(ClockRemedy::Refuse);
    let wrong = sample(0, 0, 1.0);
    let refusal = Refusal::Clock {
        off: ms(1_000_000 + 10),
    };
    assert_eq!(
        sequencer.arrive(wrong, at(10)),
        Admission::Refused(wrong, refusal)
    );
    assert_eq!(sequencer.counts()[0].clock, 1);
}

#[test]
fn a_wrong_clock_is_replaced_by_arrival_where_the_file_says_so() {
    let mut sequencer = source(ClockRemedy::Arrival);
    let admission = sequencer.arrive(sample(0, 0, 1.0), at(10));
    assert_eq!(admission, Admission::Accepted(sample(0, 1_000_010, 1.0)));
}

#[test]
fn a_wrong_clock_is_shifted_by_the_median_of_its_first_samples() {
    let mut sequencer = source(ClockRemedy::Shift);
    let mut made = Vec::new();
    for nth in 0..40_i64 {
        let ms = 100 * nth;
        // Delays of 0, 10 and 20 ms; a clock that began an hour late.
        let stamp = 1_000_000 + ms - 3_600_000;
        sequencer.arrive(sample(0, stamp, nth as f64), at(ms + 10 * (nth % 3)));
        made.extend(decided(&mut sequencer, at(ms + 50)));
    }
    made.extend(decided(&mut sequencer, at(60_000)));
    assert_eq!(made[0], Decided::Shift(ms(3_600_010)));
    let expected: Vec<_> = (0..40).map(|nth| 100 * nth + 10).collect();
    assert_eq!(ticks(&made), expected, "no sample is lost, distances stay");
    assert!(!made.contains(&Decided::Break));
}

#[test]
fn a_slow_source_is_not_held_longer_than_it_takes_to_settle() {
    let mut sequencer = source(ClockRemedy::Shift);
    sequencer.arrive(sample(0, 0, 1.0), at(1_000));
    let made = pass(&mut sequencer, at(20_000));
    assert_eq!(made[0], (at(6_000), Decided::Shift(ms(1_001_000))));
}

#[test]
fn a_clock_that_is_set_back_is_shifted_anew_and_ends_the_segment() {
    let mut sequencer = source(ClockRemedy::Shift);
    let mut made = feed(&mut sequencer, 0, 100, 0);
    made.extend(feed(&mut sequencer, 10_000, 100, 900_000));
    made.extend(decided(&mut sequencer, at(60_000)));
    let expected: Vec<_> = (0..200).map(|nth| 100 * nth).collect();
    assert_eq!(ticks(&made), expected);
    let place = |of: &Decided| made.iter().position(|decided| decided == of);
    let ended = place(&Decided::Break).expect("a break");
    assert_eq!(ticks(&made[..ended]).len(), 100);
    assert!(place(&Decided::Shift(ms(900_000))).is_some_and(|shift| shift < ended));
}

#[test]
fn a_clock_that_is_set_forward_is_shifted_anew_within_the_segment() {
    let mut sequencer = source(ClockRemedy::Shift);
    let mut made = feed(&mut sequencer, 0, 100, 0);
    made.extend(feed(&mut sequencer, 10_000, 100, -900_000));
    made.extend(decided(&mut sequencer, at(60_000)));
    let expected: Vec<_> = (0..200).map(|nth| 100 * nth).collect();
    assert_eq!(ticks(&made), expected);
    assert!(made.contains(&Decided::Shift(ms(-900_000))));
    assert!(!made.contains(&Decided::Break));
}

#[test]
fn a_backlog_is_no_wrong_clock() {
    let mut sequencer = source(ClockRemedy::Shift);
    let mut made = feed(&mut sequencer, 0, 100, 0);
    // A minute of old samples at once, after a minute without any.
    for nth in 0..600 {
        sequencer.arrive(sample(0, 1_010_000 + 100 * nth, 1.0), at(70_000));
    }
    made.extend(decided(&mut sequencer, at(75_000)));
    let expected: Vec<_> = (0..700).map(|nth| 100 * nth).collect();
    assert_eq!(ticks(&made), expected);
    assert_eq!(made.len(), 700);
}

#[test]
fn a_repeated_sample_is_known_after_a_reconnect_of_a_shifted_source() {
    let mut sequencer = source(ClockRemedy::Shift);
    feed(&mut sequencer, 0, 100, 3_600_000);
    decided(&mut sequencer, at(11_000));
    sequencer.away(0, at(11_000));
    sequencer.connected(0, at(12_000));
    // Later by other milliseconds than the first time.
    let again = sample(0, 1_000_000 + 9_900 - 3_600_000, 99.0);
    let admission = sequencer.arrive(again, at(12_345));
    assert!(matches!(admission, Admission::Twice(_)), "{admission:?}");
}

#[test]
fn an_offset_goes_on_after_a_restart() {
    let mut sequencer = source(ClockRemedy::Shift);
    feed(&mut sequencer, 0, 100, 3_600_000);
    decided(&mut sequencer, at(60_000));
    let timeline = sequencer.timeline().clone();
    let mut next = Sequencer::resume(sequencer.rules.clone(), timeline, at(0));
    next.synchronise(stamp(1_020_000), at(0));
    let made = next.arrive(sample(0, 1_020_000 - 3_600_000, 1.0), at(0));
    assert_eq!(made, Admission::Accepted(sample(0, 1_020_000, 1.0)));
}

#[test]
fn clocks_are_not_judged_before_the_hosts_time_is_known() {
    let mut rules = plain(1);
    rules.sources[0].clock = Some(ClockRule {
        within: ms(5_000),
        otherwise: ClockRemedy::Refuse,
    });
    let mut sequencer = connected(rules);
    let early = sample(0, 10, 1.0);
    assert_eq!(sequencer.arrive(early, at(0)), Admission::Accepted(early));
}
