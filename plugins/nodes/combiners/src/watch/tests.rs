use super::*;
use athermal_core::prng::Prng;

fn s(seconds: i64) -> Instant {
    Instant::from_ns(seconds * 1_000_000_000)
}

/// Tells errors of size 1 and changing sign, then of another mean from a truth on; what was said after each.
fn watched(mut node: Box<dyn Combine>, change: i64, gone: f64, truths: i64) -> Vec<f64> {
    let vote = Votes(&[7.0]);
    let mut said = Vec::new();
    for nth in 0..truths {
        let sign = if nth % 2 == 0 { 1.0 } else { -1.0 };
        let error = if nth < change { sign } else { sign + gone };
        node.observe(vote, 7.0 + 5.0 * error, s(60 * nth));
        node.advance(s(60 * nth));
        assert_eq!(node.combine(vote), 7.0);
        said.push(node.reason(vote));
    }
    said
}

/// At which of so many errors, one a minute, it was first said that they have gone up.
fn first_alarm(mut node: Box<dyn Combine>, errors: i64, error: impl Fn(i64) -> f64) -> Option<i64> {
    let vote = Votes(&[0.0]);
    (0..errors).find(|&nth| {
        node.observe(vote, error(nth), s(60 * nth));
        node.advance(s(60 * nth));
        node.reason(vote) == reason::UP
    })
}

/// With its defaults, but for truths that come every minute and do not overlap.
fn page_hinkley() -> PageHinkley {
    serde_json::from_str(r#"{ "every": "0s" }"#).unwrap()
}

fn adwin() -> Adwin {
    serde_json::from_str(r#"{ "every": "0s" }"#).unwrap()
}

#[test]
fn a_mean_that_goes_up_or_down_is_told_for_an_hour() {
    for (gone, reason) in [(2.0, reason::UP), (-2.0, reason::DOWN)] {
        for node in [page_hinkley().build(1), adwin().build(1)] {
            let said = watched(node, 200, gone, 500);
            assert!(said[..29].iter().all(|&said| said == reason::UNKNOWN));
            assert!(said[30..200].iter().all(|&said| said == reason::NONE));
            let alarm = said.iter().position(|&said| said == reason).unwrap();
            assert!((200..260).contains(&alarm), "{alarm}");
            assert!(said[alarm..alarm + 60].iter().all(|&said| said == reason));
        }
    }
}

#[test]
fn an_alarm_is_told_at_the_tick_at_which_it_becomes_known_however_short_its_hold() {
    for hold in [0, 60] {
        let hold = Duration::from_ns(hold * 1_000_000_000);
        let test = PageHinkley {
            hold,
            ..page_hinkley()
        };
        let window = Adwin { hold, ..adwin() };
        for mut node in [test.build(1), window.build(1)] {
            let mut said = Vec::new();
            for nth in 0..400_i64 {
                let sign = if nth % 2 == 0 { 1.0 } else { -1.0 };
                let gone = if nth < 200 { 0.0 } else { 4.0 };
                node.observe(Votes(&[7.0]), 7.0 + sign + gone, s(60 * nth));
                node.advance(s(60 * (nth + 1)));
                said.push(node.reason(Votes(&[7.0])));
            }
            let alarm = said.iter().position(|&said| said == reason::UP);
            let alarm = alarm.expect("the alarm shows");
            assert!((200..260).contains(&alarm), "{alarm}");
            assert_eq!(said[alarm + 1], reason::NONE);
        }
    }
}

#[test]
fn a_bias_as_large_as_the_usual_error_is_told_from_a_day_of_truths_on() {
    for (before, told) in [(100, false), (288, true)] {
        let alarm = first_alarm(page_hinkley().build(1), before + 576, |nth| {
            let sign = if nth % 2 == 0 { 1.0 } else { -1.0 };
            if nth < before { sign } else { sign + 1.0 }
        });
        assert_eq!(alarm.is_some(), told, "{before}");
    }
}

#[test]
fn a_model_that_gets_worse_without_bias_is_told_by_the_size_of_its_errors() {
    let size = PageHinkley {
        watch: Watched::Size,
        ..page_hinkley()
    };
    let alarm = first_alarm(size.build(1), 600, |nth| {
        let size = if nth < 300 { 1.0 } else { 3.0 };
        if nth % 2 == 0 { size } else { -size }
    });
    assert!(
        alarm.is_some_and(|alarm| (300..350).contains(&alarm)),
        "{alarm:?}"
    );
}

#[test]
fn what_was_seen_of_errors_is_of_no_use_for_their_sizes() {
    let size = PageHinkley {
        watch: Watched::Size,
        ..page_hinkley()
    };
    let mut errors = page_hinkley().build(1);
    for nth in 0..40 {
        errors.observe(Votes(&[0.0]), 1.0, s(nth));
    }
    let seen = || errors.snapshot().unwrap();
    assert_eq!(page_hinkley().build(1).restore(seen()), Restored::Accepted);
    assert!(matches!(
        size.build(1).restore(seen()),
        Restored::Cold { .. }
    ));
}

#[test]
fn a_glitch_is_no_alarm_and_leaves_the_test_as_sensitive_as_it_was() {
    let alarm = first_alarm(page_hinkley().build(1), 400, |nth| {
        let sign = if nth % 2 == 0 { 1.0 } else { -1.0 };
        match nth {
            150 => 1e9,
            0..300 => sign,
            _ => sign + 2.0,
        }
    });
    assert!(
        alarm.is_some_and(|alarm| (300..350).contains(&alarm)),
        "{alarm:?}"
    );
}

#[test]
fn a_glitch_among_the_first_errors_leaves_the_tests_as_sensitive_as_they_are_without_it() {
    for glitch in [1.0, 1e6, -1e200] {
        for node in [page_hinkley().build(1), adwin().build(1)] {
            let alarm = first_alarm(node, 400, |nth| {
                let sign = if nth % 2 == 0 { 1.0 } else { -1.0 };
                match nth {
                    6 => glitch,
                    0..200 => sign,
                    _ => sign + 3.0,
                }
            });
            assert!(
                alarm.is_some_and(|alarm| (200..250).contains(&alarm)),
                "{glitch}: {alarm:?}"
            );
        }
    }
}

/// How often it is said anew of so many errors, one a minute, that they have gone up or down.
fn alarms(mut node: Box<dyn Combine>, errors: i64, error: impl Fn(i64) -> f64) -> Vec<i64> {
    let vote = Votes(&[0.0]);
    let mut alarms = Vec::new();
    let mut before = reason::UNKNOWN;
    for nth in 0..errors {
        node.observe(vote, error(nth), s(60 * nth));
        node.advance(s(60 * nth));
        let said = node.reason(vote);
        if said != before && (said == reason::UP || said == reason::DOWN) {
            alarms.push(nth);
        }
        before = said;
    }
    alarms
}

/// The series that are watched in these tests, of errors without a mean.
fn noise(seed: u64, errors: usize) -> Vec<f64> {
    let mut draw = Prng::stream(seed, "errors");
    (0..errors).map(|_| draw.normal()).collect()
}

#[test]
fn a_start_without_any_error_says_nothing_of_those_that_follow() {
    for seed in 0..5 {
        let noise = noise(seed, 3000);
        // A machine that stands still, by persistence: exactly, and but for rounding.
        for quiet in [0.0, 1e-15] {
            let error = |nth: i64| match nth {
                0..60 => quiet * noise[nth as usize],
                2000.. => noise[nth as usize] + 3.0,
                _ => noise[nth as usize],
            };
            for node in [page_hinkley().build(1), adwin().build(1)] {
                let found = alarms(node, 3000, error);
                let (early, late): (Vec<i64>, Vec<i64>) =
                    found.iter().partition(|&&nth| nth < 2000);
                assert!(early.len() <= 1, "{seed}, {quiet}: {found:?}");
                assert!(
                    late.first().is_some_and(|&nth| nth < 2050),
                    "{seed}, {quiet}: {found:?}"
                );
            }
        }
    }
}

#[test]
fn noise_that_grows_for_good_is_no_bias_and_told_by_its_size() {
    let size = PageHinkley {
        watch: Watched::Size,
        ..page_hinkley()
    };
    let size_by_window = Adwin {
        watch: Watched::Size,
        ..adwin()
    };
    for (quiet, of_later) in [(1000, 0.01), (300, 0.001)] {
        for seed in 0..5 {
            let noise = noise(seed, 3000);
            let error = |nth: i64| match nth {
                _ if nth < quiet => of_later * noise[nth as usize],
                _ => noise[nth as usize],
            };
            for node in [page_hinkley().build(1), adwin().build(1)] {
                let found = alarms(node, 3000, error);
                assert!(found.len() <= 1, "{quiet}, {seed}: {found:?}");
            }
            for node in [size.build(1), size_by_window.build(1)] {
                let found = alarms(node, 3000, error);
                let told = matches!(found[..], [only] if (quiet..quiet + 30).contains(&only));
                assert!(told, "{quiet}, {seed}: {found:?}");
            }
        }
    }
}

#[test]
fn with_every_only_some_truths_are_taken() {
    let seldom = PageHinkley {
        every: Duration::from_ns(300_000_000_000),
        ..page_hinkley()
    };
    let said = watched(seldom.build(1), 200, 2.0, 200);
    assert_eq!(
        said.iter().position(|&said| said == reason::NONE),
        Some(29 * 5)
    );
}
