use proptest::prelude::*;

use super::*;

const SECOND: i64 = 1_000_000_000;

fn ns(text: &str) -> i64 {
    text.parse::<Duration>()
        .expect("the test's durations are valid")
        .as_ns()
}

fn error(text: &str) -> DurationError {
    text.parse::<Duration>()
        .expect_err("the test's text is no duration")
}

#[test]
fn durations_are_read_exactly() {
    assert_eq!(ns("150s"), 150 * SECOND);
    assert_eq!(ns("5min"), 300 * SECOND);
    assert_eq!(ns("1h30m"), 5_400 * SECOND);
    assert_eq!(ns("1h30min"), 5_400 * SECOND);
    assert_eq!(ns("1h 30m"), 5_400 * SECOND);
    assert_eq!(ns("250ms"), 250_000_000);
    assert_eq!(ns("1.5h"), 5_400 * SECOND);
    assert_eq!(ns("2d"), 172_800 * SECOND);
    assert_eq!(ns("7us"), 7_000);
    assert_eq!(ns("7\u{b5}s"), 7_000);
    assert_eq!(ns("7\u{3bc}s"), 7_000);
    assert_eq!(ns(" 3 ns "), 3);
    assert_eq!(ns("0s"), 0);
    // 429.089 has no exact double; the decimal is carried in integers.
    assert_eq!(ns("429.089s"), 429_089_000_000);
    assert_eq!(ns("0.000000001s"), 1);
    assert_eq!(ns(".5s"), SECOND / 2);
    assert_eq!(ns("9223372036.854775807s"), i64::MAX);
}

#[test]
fn a_decimal_comma_is_told_with_the_duration_that_was_meant() {
    for (text, instead) in [
        ("2,5min", "2.5min"),
        ("1h2,5min", "1h2.5min"),
        ("0,5", "0.5"),
    ] {
        let expected =
            format!("\"{text}\" has a decimal comma; a number has a decimal point: \"{instead}\"");
        assert_eq!(error(text).to_string(), expected);
    }
    assert_eq!(
        error("5min,10min"),
        DurationError::NoNumber {
            found: ",10min".to_owned()
        }
    );
}

#[test]
fn what_is_no_duration_is_refused_with_its_reason() {
    assert_eq!(error(""), DurationError::Empty);
    assert_eq!(error("  "), DurationError::Empty);
    assert_eq!(
        error("5"),
        DurationError::NoUnit {
            number: "5".to_owned()
        }
    );
    assert_eq!(error("-5s"), DurationError::Negative);
    assert_eq!(error("\u{2212}5s"), DurationError::Negative);
    assert_eq!(
        error("NaN"),
        DurationError::NoNumber {
            found: "NaN".to_owned()
        }
    );
    assert_eq!(
        error("inf s"),
        DurationError::NoNumber {
            found: "inf s".to_owned()
        }
    );
    assert_eq!(
        error("5mn"),
        DurationError::UnknownUnit {
            unit: "mn".to_owned()
        }
    );
    assert_eq!(
        error("5Min"),
        DurationError::UnknownUnit {
            unit: "Min".to_owned()
        }
    );
    assert_eq!(
        error("1.2.3s"),
        DurationError::NoNumber {
            found: "1.2.3".to_owned()
        }
    );
    assert_eq!(
        error("5s1h"),
        DurationError::Order {
            unit: "h".to_owned()
        }
    );
    assert_eq!(
        error("5min3m"),
        DurationError::Order {
            unit: "m".to_owned()
        }
    );
    assert_eq!(error("0.1ns"), DurationError::TooFine);
    assert_eq!(error("9223372036.854775808s"), DurationError::TooLong);
    assert_eq!(error("106752d"), DurationError::TooLong);
    assert_eq!(
        error(&format!("{}s", "9".repeat(400))),
        DurationError::TooLong
    );
    assert_eq!(
        error("1e3s"),
        DurationError::UnknownUnit {
            unit: "e".to_owned()
        }
    );
}

#[test]
fn errors_say_what_is_allowed() {
    assert_eq!(
        error("5").to_string(),
        "the number 5 needs a unit of time, e.g. \"5s\"; the units are ns, us, ms, s, min (or m), h and d"
    );
    assert_eq!(
        error("5mn").to_string(),
        "\"mn\" is not a unit of time; the units are ns, us, ms, s, min (or m), h and d"
    );
    assert_eq!(
        error("-1s").to_string(),
        "a duration here is 0 or more, found a negative one"
    );
    assert_eq!(
        error("").to_string(),
        "a duration is a number and a unit, e.g. \"5min\", found an empty text"
    );
    assert_eq!(
        error("x").to_string(),
        "a duration is a number and a unit, e.g. \"5min\", found \"x\""
    );
    assert_eq!(
        error("106752d").to_string(),
        "a duration is at most 106751 d (292 years)"
    );
    assert_eq!(
        error("0.1ns").to_string(),
        "a duration is a whole number of nanoseconds"
    );
    assert_eq!(
        error("1s1h").to_string(),
        "units go from large to small, each once, as in \"1h30m\"; \"h\" is out of order"
    );
}

#[test]
fn durations_are_written_short() {
    let written = |ns: i64| Duration::from_ns(ns).to_string();
    assert_eq!(written(0), "0s");
    assert_eq!(written(300 * SECOND), "5min");
    assert_eq!(written(9_000 * SECOND), "2h30min");
    assert_eq!(written(429_089_000_000), "429.089s");
    assert_eq!(written(150 * SECOND), "150s");
    assert_eq!(written(3_600 * SECOND), "1h");
    assert_eq!(written(172_800 * SECOND), "2d");
    assert_eq!(written(250_000_000), "250ms");
    assert_eq!(written(1_500_000), "1.5ms");
    assert_eq!(written(12_000), "12us");
    assert_eq!(written(1), "1ns");
    assert_eq!(written(-300 * SECOND), "-5min");
    assert_eq!(written(i64::MAX), "9223372036.854775807s");
}

#[test]
fn instants_are_written_as_exact_seconds() {
    let written = |ns: i64| Instant::from_ns(ns).to_string();
    assert_eq!(written(0), "0");
    assert_eq!(written(20 * SECOND), "20");
    assert_eq!(written(-300_000_000), "-0.3");
    assert_eq!(written(1_700_000_000_000_000_001), "1700000000.000000001");
    assert_eq!(written(i64::MIN), "-9223372036.854775808");
}

#[test]
fn arithmetic_saturates() {
    let long = Duration::from_ns(i64::MAX);
    assert_eq!(Instant::MAX + long, Instant::MAX);
    assert_eq!(Instant::MIN - long, Instant::MIN);
    assert_eq!(Instant::MAX - Instant::MIN, long);
    assert_eq!(long + Duration::from_ns(1), long);
    assert_eq!(-Duration::from_ns(i64::MIN), long);
    assert_eq!(
        Instant::from_ns(7) - Instant::from_ns(9),
        Duration::from_ns(-2)
    );
    let mut sum = Duration::ZERO;
    sum += Duration::from_ns(5);
    sum -= Duration::from_ns(2);
    assert_eq!(sum, Duration::from_ns(3));
}

#[test]
fn seconds_become_durations_only_where_they_fit() {
    assert_eq!(
        Duration::from_secs_f64(429.089),
        Some(Duration::from_ns(429_089_000_000))
    );
    assert_eq!(
        Duration::from_secs_f64(-1.5),
        Some(Duration::from_ns(-1_500_000_000))
    );
    assert_eq!(Duration::from_secs_f64(f64::NAN), None);
    assert_eq!(Duration::from_secs_f64(f64::INFINITY), None);
    assert_eq!(Duration::from_secs_f64(9.3e9), None);
    assert_eq!(Duration::from_ns(429_089_000_000).secs(), 429.089);
}

#[test]
fn json_holds_instants_as_integers_and_durations_as_texts() {
    assert_eq!(
        serde_json::json!(Instant::from_ns(-5)),
        serde_json::json!(-5)
    );
    assert_eq!(
        serde_json::json!(Duration::from_ns(300 * SECOND)),
        serde_json::json!("5min")
    );
    assert_eq!(
        serde_json::from_str::<Instant>("-5").ok(),
        Some(Instant::from_ns(-5))
    );
    assert_eq!(
        serde_json::from_str::<Duration>("\"5min\"").ok(),
        Some(Duration::from_ns(300 * SECOND))
    );
    for number in ["5", "-5", "5.5"] {
        let error = serde_json::from_str::<Duration>(number)
            .expect_err("a number is no duration")
            .to_string();
        assert!(
            error.contains("expected a duration like \"5min\""),
            "{error}"
        );
    }
}

proptest! {
    #[test]
    fn what_is_written_reads_back_exactly(ns in prop_oneof![0..=i64::MAX, 0..=10_000i64, (0..=200_000i64).prop_map(|s| s * SECOND)]) {
        let duration = Duration::from_ns(ns);
        prop_assert_eq!(duration.to_string().parse::<Duration>(), Ok(duration));
    }

    #[test]
    fn no_text_makes_the_parser_panic(text in "\\PC{0,12}|[0-9.]{0,25}[a-z\u{b5}]{0,3}[0-9.]{0,4}(s|h|m)?") {
        if let Err(error) = text.parse::<Duration>() {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}
