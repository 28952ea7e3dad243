//! How old a tick is as a command.

use super::*;

/// What is known of ticks as they are cut: instant, age, and whether a newer one is due.
fn ages(sequencer: &mut Sequencer, now: Moment) -> Vec<(i64, i64, bool)> {
    let mut ages = Vec::new();
    while let Some(decision) = sequencer.pass(now) {
        if let Decision::Tick { at, .. } = decision {
            let age = sequencer.age(now).as_ns() / 1_000_000;
            ages.push((at.as_ns() / 1_000_000, age, sequencer.is_superseded()));
        }
    }
    ages
}

fn quick() -> Rules {
    Rules {
        wait: Duration::ZERO,
        ..plain(1)
    }
}

const HOUR: i64 = 3_600_000;

#[test]
fn the_first_tick_of_a_backlog_is_no_fresh_command_after_a_restart() {
    // A clock may be slow by hours, or fast; what counts is what its source has shown.
    for off in [0, -5 * HOUR, 2 * HOUR] {
        let mut sequencer = connected(quick());
        sequencer.synchronise(stamp(100 * HOUR), at(0));
        for second in 0..5 {
            let came = at(1_000 * second + 50);
            sequencer.arrive(sample(0, 90 * HOUR + off + 1_000 * second, 1.0), came);
            let made = ages(&mut sequencer, came);
            assert_eq!(made, [(90 * HOUR + off + 1_000 * second, 0, false)]);
        }
        let timeline = sequencer.timeline().clone();
        assert_eq!(timeline.lags(), [Some(ms(10 * HOUR - off + 50))]);
        // 40 s later, by a clock that begins anew; the host is not trusted at first.
        let mut rules = quick();
        rules.future = ms(HOUR);
        let mut next = Sequencer::resume(rules, timeline, at(0));
        next.connected(0, at(0));
        next.guess(stamp(100 * HOUR + 45_000), at(0));
        for (second, age) in [(5, 40_000), (25, 20_000), (45, 0)] {
            let late = sample(0, 90 * HOUR + off + 1_000 * second, 1.0);
            next.arrive(late, at(50));
            let made = ages(&mut next, at(50));
            assert_eq!(made, [(90 * HOUR + off + 1_000 * second, age, false)]);
        }
    }
}

#[test]
fn a_simulation_from_1970_that_runs_a_thousand_times_as_fast_commands() {
    for is_in_order in [true, false] {
        let mut rules = quick();
        rules.sources[0].is_in_order = is_in_order;
        rules.future = ms(24 * HOUR);
        let mut sequencer = connected(rules);
        sequencer.synchronise(stamp(500_000 * HOUR), at(0));
        for nth in 0..1_000 {
            sequencer.arrive(sample(0, 10_000 * nth, 1.0), at(10 * nth));
            assert_eq!(
                ages(&mut sequencer, at(10 * nth)),
                [(10_000 * nth, 0, false)]
            );
        }
    }
}

#[test]
fn of_ticks_due_in_one_pass_only_the_newest_is_a_command_unless_they_are_of_a_recording() {
    for is_in_order in [true, false] {
        let mut rules = quick();
        rules.sources[0].is_in_order = is_in_order;
        let mut sequencer = connected(rules);
        for nth in 0..4 {
            sequencer.arrive(sample(0, 100 * nth, 1.0), at(1_000));
        }
        let superseded: Vec<_> = ages(&mut sequencer, at(1_000))
            .iter()
            .map(|of| of.2)
            .collect();
        let each = !is_in_order;
        assert_eq!(superseded, [each, each, each, false]);
    }
}

#[test]
fn a_clock_that_becomes_slow_commands_again_after_a_minute_and_a_slow_backlog_does_not() {
    let mut sequencer = connected(quick());
    sequencer.synchronise(stamp(100 * HOUR), at(0));
    let mut age_after = |from: i64, seconds: i64, behind: i64, pace: i64| {
        let mut age = 0;
        for second in 0..seconds {
            let now = at(1_000 * (from + second));
            let stamp = 100 * HOUR + 1_000 * (from + second) - behind + pace * second;
            sequencer.arrive(sample(0, stamp, 1.0), now);
            if let Some((_, of, _)) = ages(&mut sequencer, now).last() {
                age = *of;
            }
        }
        age
    };
    assert_eq!(age_after(0, 100, 0, 0), 0);
    // An hour off, and its clock stood meanwhile.
    assert_eq!(age_after(3_700, 30, HOUR, 0), HOUR);
    assert_eq!(age_after(3_730, 60, HOUR, 0), 0);
    // A backlog that is given a twentieth faster than it came: half a minute is left of two.
    let left = age_after(7_400, 1_800, HOUR + 120_000, 50);
    assert!((30_000..31_000).contains(&left), "{left}");
}

#[test]
fn a_beat_is_as_old_as_its_source_lags() {
    let mut rules = quick();
    rules.heartbeat = Some(ms(1_000));
    let mut sequencer = connected(rules);
    sequencer.synchronise(stamp(HOUR), at(0));
    sequencer.arrive(sample(0, HOUR, 1.0), at(0));
    ages(&mut sequencer, at(0));
    assert!(matches!(
        sequencer.pass(at(1_000)),
        Some(Decision::Beat { .. })
    ));
    assert!(sequencer.age(at(1_000)) <= ms(1));
}

#[test]
fn a_least_lag_is_kept_seldom() {
    let mut sequencer = connected(quick());
    sequencer.guess(stamp(HOUR), at(0));
    let mut kept = 0;
    for nth in 0..10_000 {
        // Shorter by 0.1 ms each time.
        sequencer.arrive(sample(0, 10 * nth + nth / 10, 1.0), at(10 * nth));
        let made = pass_all(&mut sequencer, at(10 * nth));
        kept += made
            .iter()
            .filter(|(_, of)| matches!(of, Decided::Lag(_)))
            .count();
    }
    assert!((2..=25).contains(&kept), "{kept}");
}
