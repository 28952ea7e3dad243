//! Stamps of the future, and a last tick that was.

use super::*;

/// So many sources with a channel each.
fn rules_of(sources: usize) -> Rules {
    let mut rules = plain(sources);
    rules.sources = vec![SourceRules::default(); sources];
    for (source, channel) in rules.channels.iter_mut().enumerate() {
        channel.source = source;
    }
    rules
}

/// What becomes of samples, as they come and later.
struct World {
    sequencer: Sequencer,
    decided: Vec<Decided>,
}

impl World {
    fn of(sources: usize) -> Self {
        Self {
            sequencer: connected(rules_of(sources)),
            decided: Vec::new(),
        }
    }

    /// The host says this at a moment.
    fn trusted(mut self, host: i64, now: i64) -> Self {
        self.sequencer.synchronise(stamp(host), at(now));
        self
    }

    fn guess(mut self, host: i64) -> Self {
        self.sequencer.guess(stamp(host), at(0));
        self
    }

    /// A sample comes, and time passes up to it.
    fn comes(&mut self, channel: u32, stamp_ms: i64, now: i64) -> Admission {
        self.until(now);
        let admission = self
            .sequencer
            .arrive(sample(channel, stamp_ms, 1.0), at(now));
        self.decided.push(Decided::Sample(admission));
        self.until(now);
        admission
    }

    fn until(&mut self, now: i64) {
        self.decided.extend(decided(&mut self.sequencer, at(now)));
    }

    /// Stamps of all samples of a channel that came to something in the end.
    fn all(&self, of: impl Fn(&Admission) -> Option<Sample>, channel: u32) -> Vec<i64> {
        let sample = |decided: &Decided| match decided {
            Decided::Sample(admission) => of(admission).filter(|of| of.channel == channel),
            _ => None,
        };
        let all = self.decided.iter().filter_map(sample);
        all.map(|of| of.stamp.as_ns() / 1_000_000).collect()
    }

    fn accepted(&self, channel: u32) -> Vec<i64> {
        let accepted = |of: &Admission| match of {
            Admission::Accepted(sample) => Some(*sample),
            _ => None,
        };
        self.all(accepted, channel)
    }

    fn refused(&self, channel: u32) -> Vec<i64> {
        let refused = |of: &Admission| match of {
            Admission::Refused(sample, Refusal::Future { .. }) => Some(*sample),
            _ => None,
        };
        self.all(refused, channel)
    }

    fn ticks(&self) -> Vec<i64> {
        let tick = |decided: &Decided| match decided {
            Decided::Tick(at, _) => Some(at.as_ns() / 1_000_000),
            _ => None,
        };
        self.decided.iter().filter_map(tick).collect()
    }

    fn went_back(&self) -> usize {
        let is_back = |of: &&Decided| matches!(of, Decided::Back(..));
        self.decided.iter().filter(is_back).count()
    }
}

const HOUR: i64 = 3_600_000;

#[test]
fn a_backlog_with_holes_is_accepted_whole_with_a_trusted_host_and_without() {
    for is_trusted in [true, false] {
        let mut world = World::of(1);
        if is_trusted {
            world = world.trusted(100 * HOUR, 0);
        }
        let mut expected = Vec::new();
        // Three stretches of a minute, hours apart; then what is measured now.
        for stretch in 0..3 {
            for second in 0..60 {
                let stamp = stretch * 10 * HOUR + 1_000 * second;
                expected.push(stamp);
                world.comes(0, stamp, 60 * stretch + second);
            }
        }
        for second in 1..10 {
            let stamp = 100 * HOUR + 1_000 * second;
            expected.push(stamp);
            world.comes(0, stamp, 1_000 * second);
        }
        world.until(20_000);
        let mut accepted = world.accepted(0);
        // What waited comes behind the one that showed what it was.
        accepted.sort_unstable();
        assert_eq!(accepted, expected, "trusted: {is_trusted}");
        assert_eq!(world.ticks(), expected);
        assert!(world.sequencer.timeline().waiting().is_empty());
    }
}

#[test]
fn three_stamps_with_the_clock_show_a_gap_and_two_do_not() {
    let mut world = World::of(1);
    world.comes(0, 0, 0);
    world.comes(0, HOUR, 1_000);
    world.comes(0, HOUR + 1_000, 2_000);
    assert_eq!(world.accepted(0), [0]);
    assert_eq!(world.ticks(), [0], "nothing waits for what is open");
    world.comes(0, HOUR + 2_000, 3_000);
    world.until(3_500);
    assert_eq!(world.ticks(), [0, HOUR, HOUR + 1_000, HOUR + 2_000]);
}

#[test]
fn a_wrong_stamp_is_refused_once_its_channel_returns_and_others_go_on_meanwhile() {
    let mut world = World::of(2);
    for second in 0..10 {
        let wrong = if second == 5 { HOUR } else { 0 };
        world.comes(0, 1_000 * second + wrong, 1_000 * second);
        world.comes(1, 1_000 * second + 10, 1_000 * second + 20);
    }
    world.until(20_000);
    assert_eq!(world.refused(0), [HOUR + 5_000]);
    assert_eq!(world.accepted(0).len(), 9);
    assert_eq!(world.accepted(1).len(), 10);
    assert_eq!(world.sequencer.counts()[0].future, 1);
}

#[test]
fn a_clock_that_jumps_ahead_beside_a_live_source_is_refused_and_named_with_its_offset() {
    let mut world = World::of(2);
    let mut named = None;
    for second in 0..30 {
        let wrong = if second >= 10 { HOUR } else { 0 };
        let came = world.comes(0, 1_000 * second + wrong, 1_000 * second);
        named = world.sequencer.leader(came, at(1_000 * second));
        world.comes(1, 1_000 * second, 1_000 * second + 20);
    }
    assert_eq!(world.accepted(0).len(), 10);
    assert_eq!(world.refused(0).len(), 20);
    assert_eq!(world.accepted(1).len(), 30);
    let named = named.unwrap();
    assert_eq!((named.source, named.channel), (0, 0));
    assert!((named.ahead - ms(HOUR)) < ms(1_100) && named.ahead > ms(HOUR - 1_100));
}

#[test]
fn the_majority_of_sources_decides_then_the_hosts_unsure_clock_else_the_old_time_stays() {
    // One that is two minutes slow speaks first; so many others are right.
    let slow_first = |others: u32, guess: Option<i64>| {
        let mut world = World::of(1 + others as usize);
        if let Some(guess) = guess {
            world = world.guess(guess);
        }
        for second in 0..30 {
            world.comes(0, HOUR - 120_000 + 1_000 * second, 1_000 * second);
            for other in 1..=others {
                let ms = 1_000 * second + 10 * i64::from(other);
                world.comes(other, HOUR + ms, ms);
            }
        }
        world
    };
    let majority = slow_first(2, None);
    for other in 1..=2 {
        assert_eq!(majority.accepted(other).len(), 30);
    }
    // The host is off by 20 s, and knows better all the same.
    let guessed = slow_first(1, Some(HOUR + 20_000));
    assert_eq!(guessed.accepted(1).len(), 30);
    let slow = slow_first(1, Some(HOUR - 130_000));
    assert_eq!((slow.accepted(1).len(), slow.accepted(0).len()), (0, 30));
    // One that has just booted in 1970, or says nothing, decides nothing.
    for guess in [Some(-1_000 * 24 * HOUR), None] {
        let open = slow_first(1, guess);
        assert_eq!((open.accepted(1).len(), open.accepted(0).len()), (0, 30));
        assert_eq!(open.refused(1).len(), 30);
    }
}

#[test]
fn a_device_that_begins_in_2000_and_is_set_right_loses_nothing_of_itself_or_others() {
    for is_trusted in [true, false] {
        let mut world = World::of(3);
        if is_trusted {
            world = world.trusted(1_000 * HOUR, 0);
        }
        for second in 0..60 {
            let wrong = if second < 3 { -900 * HOUR } else { 0 };
            for source in 0..3 {
                let ms = 1_000 * second + 10 * i64::from(source);
                let wrong = if source == 0 { wrong } else { 0 };
                world.comes(source, 1_000 * HOUR + wrong + ms, ms);
            }
        }
        for source in 0..3 {
            // The wrong stamps of the device behind those of the others are late, unless it was alone.
            let accepted = world.accepted(source).len();
            let least = if source == 0 { 57 } else { 60 };
            assert!(accepted >= least, "{source} {is_trusted}: {accepted}");
        }
    }
}

#[test]
fn a_backlog_judges_nobody() {
    let mut world = World::of(2);
    // A hundred times faster than time, an hour ago.
    for nth in 0..500 {
        world.comes(0, 1_000 * nth, 10 * nth);
        if nth % 100 == 99 {
            world.comes(1, HOUR + 10 * nth, 10 * nth + 5);
        }
    }
    assert_eq!(world.accepted(1).len(), 5);
}

#[test]
fn what_may_wait_is_bounded_and_a_source_that_is_alone_is_believed_then() {
    let mut rules = rules_of(1);
    rules.most = 100;
    let mut sequencer = connected(rules);
    sequencer.arrive(sample(0, 0, 1.0), at(0));
    let mut accepted = 0;
    for nth in 0..200 {
        sequencer.arrive(sample(0, HOUR + 1_000 * nth, 1.0), at(1 + nth));
        assert!(sequencer.timeline().waiting().len() <= 25);
        let made = decided(&mut sequencer, at(1 + nth));
        let is_accepted = |of: &&Decided| matches!(of, Decided::Sample(Admission::Accepted(_)));
        accepted += made.iter().filter(is_accepted).count();
    }
    assert_eq!(accepted, 25, "what waited, behind the one that had no room");
    assert_eq!(sequencer.counts()[0].accepted, 201);
}

#[test]
fn beside_a_live_source_what_has_no_room_to_wait_is_refused() {
    let mut rules = rules_of(2);
    rules.most = 100;
    let mut sequencer = connected(rules);
    for nth in 0..20 {
        sequencer.arrive(sample(0, 500 * nth, 1.0), at(500 * nth));
        // Forth and back: never with the clock.
        for more in 0..20 {
            let wrong = HOUR + 100_000 * nth + 1_000 * more;
            sequencer.arrive(sample(1, wrong, 1.0), at(500 * nth + more));
        }
        assert!(sequencer.timeline().waiting().len() <= 25);
        decided(&mut sequencer, at(500 * nth + 400));
    }
    assert_eq!(sequencer.counts()[0].accepted, 20);
    assert_eq!(sequencer.counts()[1].accepted, 0);
    assert!(sequencer.counts()[1].future > 300);
}

#[test]
fn what_waits_is_in_the_log_and_is_decided_on_after_a_restart() {
    let mut world = World::of(1);
    world.comes(0, 0, 0);
    world.comes(0, HOUR, 1_000);
    world.comes(0, HOUR + 1_000, 2_000);
    // As a log has it.
    let mut timeline = Timeline::new(1, 1);
    for decided in &world.decided {
        match decided {
            Decided::Sample(Admission::Accepted(sample)) => drop(timeline.accept(*sample)),
            Decided::Sample(Admission::Waits(sample)) => timeline.wait(*sample),
            Decided::Tick(at, _) => drop(timeline.tick(*at).len()),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(timeline.waiting(), world.sequencer.timeline().waiting());
    let mut sequencer = Sequencer::resume(rules_of(1), timeline, at(0));
    sequencer.connected(0, at(0));
    let mut next = World {
        sequencer,
        decided: Vec::new(),
    };
    for second in 2..5 {
        next.comes(0, HOUR + 1_000 * second, 1_000 * second);
    }
    next.until(10_000);
    let expected: Vec<_> = (0..5).map(|second| HOUR + 1_000 * second).collect();
    assert_eq!(next.ticks(), expected);
}

#[test]
fn with_a_trusted_host_what_waited_is_decided_on_at_once() {
    let mut world = World::of(2);
    world.comes(0, 0, 0);
    world.comes(0, HOUR, 1_000);
    world.comes(1, 5 * HOUR, 1_500);
    let mut world = world.trusted(HOUR, 2_000);
    world.until(3_000);
    assert_eq!(world.accepted(0), [0, HOUR]);
    assert_eq!(world.refused(1), [5 * HOUR]);
}

#[test]
fn where_the_last_tick_is_ahead_of_the_trusted_host_a_segment_begins() {
    let mut world = World::of(2);
    // Nobody knows better: the device that speaks first is in 2100.
    for second in 0..5 {
        world.comes(0, 9_000 * HOUR + 1_000 * second, 1_000 * second);
    }
    world.comes(1, 100 * HOUR + 5_000, 5_000);
    let mut world = world.trusted(100 * HOUR + 6_000, 6_000);
    for second in 6..20 {
        world.comes(1, 100 * HOUR + 1_000 * second, 1_000 * second);
        world.comes(0, 9_000 * HOUR + 1_000 * second, 1_000 * second);
    }
    world.until(30_000);
    assert_eq!(world.went_back(), 1);
    assert_eq!(world.accepted(1).len(), 14, "all since the host is trusted");
    assert_eq!(world.accepted(0).len(), 5);
    let ticks = world.ticks();
    assert_eq!(ticks[ticks.len() - 1], 100 * HOUR + 19_000);
}

#[test]
fn where_all_have_gone_on_before_the_last_tick_for_a_minute_a_segment_begins() {
    let mut world = World::of(1);
    for second in 0..10 {
        world.comes(0, 9_000 * HOUR + 1_000 * second, 1_000 * second);
    }
    // It is set right.
    for second in 10..100 {
        world.comes(0, 100 * HOUR + 1_000 * second, 1_000 * second);
    }
    world.until(200_000);
    assert_eq!(world.went_back(), 1);
    assert_eq!(world.accepted(0).len(), 10 + 30);
    assert_eq!(
        world.sequencer.counts()[0].late + world.sequencer.counts()[0].twice,
        60
    );
}

#[test]
fn a_redelivery_or_a_recording_at_its_own_pace_beside_a_live_source_begins_no_segment() {
    for is_trusted in [true, false] {
        let mut world = World::of(2);
        if is_trusted {
            world = world.trusted(100 * HOUR, 0);
        }
        for second in 0..300 {
            world.comes(0, 100 * HOUR + 1_000 * second, 1_000 * second);
            world.comes(1, 90 * HOUR + 1_000 * second, 1_000 * second + 100);
        }
        // All of it at once, again.
        for second in 0..300 {
            world.comes(0, 100 * HOUR + 1_000 * second, 300_000 + second);
        }
        assert_eq!(world.went_back(), 0);
        assert_eq!(world.accepted(0).len(), 300);
    }
}

#[test]
fn beside_a_source_with_times_of_its_own_no_segment_begins() {
    let mut rules = rules_of(2);
    rules.sources[0].is_in_order = true;
    let mut sequencer = connected(rules);
    sequencer.synchronise(stamp(0), at(0));
    for second in 0..200 {
        sequencer.arrive(
            sample(0, 100 * HOUR + 1_000 * second, 1.0),
            at(1_000 * second),
        );
        sequencer.arrive(sample(1, 1_000 * second, 1.0), at(1_000 * second));
        let made = decided(&mut sequencer, at(1_000 * second + 900));
        assert!(made.iter().all(|of| !matches!(of, Decided::Back(..))));
    }
}

#[test]
fn beside_a_logger_that_is_right_a_device_from_2100_that_is_set_right_begins_a_segment() {
    for is_trusted in [false, true] {
        let mut rules = rules_of(2);
        rules.sources[0].is_in_order = true;
        let mut world = World {
            sequencer: connected(rules),
            decided: Vec::new(),
        };
        for second in 0..3 {
            world.comes(1, 9_000 * HOUR + 1_000 * second, 1_000 * second);
        }
        if is_trusted {
            world = world.trusted(100 * HOUR + 3_000, 3_000);
        }
        for second in 3..100 {
            world.comes(0, 100 * HOUR + 1_000 * second, 1_000 * second);
            world.comes(1, 100 * HOUR + 1_000 * second + 500, 1_000 * second + 500);
        }
        world.until(200_000);
        assert_eq!(world.went_back(), 1, "trusted: {is_trusted}");
        let least = if is_trusted { 90 } else { 30 };
        for channel in [0, 1] {
            let accepted = world.accepted(channel).len();
            assert!(
                accepted >= least,
                "{channel}: {accepted}, trusted: {is_trusted}"
            );
        }
    }
}

#[test]
fn who_is_late_behind_a_clock_that_is_ahead_by_less_than_future_is_counted_and_the_clock_named() {
    let mut world = World::of(2).trusted(HOUR, 0);
    let mut late = 0;
    for second in 0..20 {
        world.comes(0, HOUR + 1_000 * second + 3_000, 1_000 * second);
        let came = world.comes(1, HOUR + 1_000 * second + 500, 1_000 * second + 500);
        if let Admission::Late(_) = came {
            late += 1;
            if second > 5 {
                let named = world
                    .sequencer
                    .leader(came, at(1_000 * second + 500))
                    .unwrap();
                assert_eq!((named.source, named.ahead), (0, ms(3_000)));
            }
        }
    }
    assert!(late > 10);
    assert_eq!(world.sequencer.counts()[1].late, late);
}
