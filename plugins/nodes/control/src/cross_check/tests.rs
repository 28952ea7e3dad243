//! What a cross_check takes for a sensor that came off, and what for heat.

#![allow(clippy::unwrap_used)]

use super::*;

const PERIOD_S: i64 = 10;

/// What four sensors read after so many samples: two bodies that follow the air, one a mean of both, and the air.
fn reads(nth: i64) -> [f64; 4] {
    let t = nth as f64;
    let air = (0.013 * t).sin() + 0.4 * (0.0021 * t).cos();
    let body = |slow: f64| 0.6 * (0.013 * t - slow).sin() + 0.4 * (0.0021 * t - slow).cos();
    let noise = |of: f64| 0.002 * (t * (7.1 + of)).sin();
    [
        body(0.5) + noise(0.0),
        body(0.9) + noise(1.0),
        0.5 * (body(0.5) + body(0.9)) + noise(2.0),
        air + noise(3.0),
    ]
}

fn with_past(now: [f64; 4], past: [f64; 4]) -> Vec<f64> {
    now.into_iter().chain(past).collect()
}

/// Sensors that a node compares, with what each reads besides.
struct Bench {
    node: Checking,
    nth: i64,
    past: Vec<[f64; 4]>,
}

impl Bench {
    fn new(spec: &str) -> Self {
        let spec: CrossCheck = serde_json::from_str(spec).unwrap();
        let lag = (spec.lag.secs() as i64 / PERIOD_S) as usize;
        let mut blocks = GramBlocks::new(8);
        for nth in 0..6000 {
            let row = with_past(reads(nth), reads(nth - lag as i64));
            blocks.push(&row, 0.0);
        }
        let agreement = Agreement::of(&blocks.total(), blocks.rows().unwrap()).unwrap();
        let learned = Known::new(agreement, &[], &[0, 1, 2, 3, 4, 5, 6, 7], 4);
        let past = (6000 - lag as i64..6000).map(reads).collect();
        Self {
            node: Checking {
                spec,
                is_fitted: true,
                learned: Some(learned),
                hindsight: None,
                sensors: vec![Sensor::default(); 4],
                verdict: Verdict::default(),
            },
            nth: 6000,
            past,
        }
    }

    /// So many minutes; gives how many samples each sensor was out.
    fn run(&mut self, minutes: i64, off: impl Fn(f64) -> [f64; 4]) -> [usize; 4] {
        let mut out = [0; 4];
        for step in 0..minutes * 60 / PERIOD_S {
            let off = off((step * PERIOD_S) as f64 / 60.0);
            let now: [f64; 4] = std::array::from_fn(|of| reads(self.nth)[of] + off[of]);
            let past = self.past.remove(0);
            self.past.push(now);
            let values = with_past(now, past);
            let at = Instant::from_ns(self.nth * PERIOD_S * 1_000_000_000);
            for (value, sensor) in values.iter().zip(&mut self.node.sensors) {
                sensor.read(*value, at, self.node.spec.lag);
            }
            self.node.judge(&values, at);
            for (out, sensor) in out.iter_mut().zip(&self.node.sensors) {
                *out += usize::from(sensor.out.is_some());
            }
            let left = self.node.sensors.iter().filter(|of| of.out.is_none());
            assert!(left.count() >= 3, "more than one is out");
            self.nth += 1;
        }
        out
    }
}

const ONE: fn(usize, f64) -> [f64; 4] =
    |of, by| std::array::from_fn(|nth| if nth == of { by } else { 0.0 });

#[test]
fn a_sensor_that_leaps_is_out_within_minutes_and_until_it_agrees() {
    let mut bench = Bench::new("{}");
    assert_eq!(bench.run(120, |_| [0.0; 4]), [0; 4]);
    for sensor in 0..3 {
        let out = bench.run(120, |_| ONE(sensor, 0.5));
        assert!(out[sensor] >= 118 * 6, "{out:?}");
        assert_eq!(out.iter().sum::<usize>(), out[sensor], "{out:?}");
        // A lag until its past agrees too, and `recover`.
        let out = bench.run(120, |_| [0.0; 4]);
        assert!(out[sensor] > 0 && out[sensor] <= 25 * 6, "{out:?}");
    }
}

#[test]
fn what_comes_as_slowly_as_heat_takes_no_sensor_out() {
    let mut bench = Bench::new("{}");
    bench.run(60, |_| [0.0; 4]);
    // Two kelvins in ten minutes, where half of one was enough, kept for four hours.
    let warm = |minutes: f64| ONE(1, 2.0 * (1.0 - (-minutes / 10.0).exp()));
    assert_eq!(bench.run(240, warm), [0; 4]);
}

#[test]
fn of_two_that_leap_one_after_the_other_the_second_stays() {
    let mut bench = Bench::new("{}");
    bench.run(60, |_| [0.0; 4]);
    let out = bench.run(60, |minutes| {
        [0.5, if minutes < 30.0 { 0.0 } else { 0.7 }, 0.0, 0.0]
    });
    assert_eq!(out[1..], [0, 0, 0], "{out:?}");
    assert!(out[0] > 0, "{out:?}");
}

#[test]
fn where_a_sensor_is_dead_others_go_out_only_while_half_of_all_stay() {
    let leap = |dead: [f64; 4]| move |_: f64| [0.5 + dead[0], dead[1], dead[2], dead[3]];
    let mut bench = Bench::new("{}");
    bench.run(60, |_| [0.0, 0.0, 0.0, f64::NAN]);
    assert!(bench.run(30, leap([0.0, 0.0, 0.0, f64::NAN]))[0] > 0);
    let mut bench = Bench::new("{}");
    bench.run(60, |_| [0.0, 0.0, f64::NAN, f64::NAN]);
    assert_eq!(bench.run(30, leap([0.0, 0.0, f64::NAN, f64::NAN])), [0; 4]);
}

#[test]
fn a_sensor_is_given_back_after_the_longest_while_unless_it_goes_on_leaping() {
    let mut bench = Bench::new(r#"{ "longest": "1h" }"#);
    bench.run(60, |_| [0.0; 4]);
    let out = bench.run(240, |_| ONE(1, 0.5));
    assert_eq!(out, [0, 60 * 6, 0, 0]);
    let restless = |minutes: f64| ONE(1, 0.5 + 0.2 * (minutes * 6.0 * 2.1).sin());
    let out = bench.run(240, restless);
    assert!(out[1] > 200 * 6, "{out:?}");
}

#[test]
fn over_a_hole_in_its_samples_nothing_is_sudden() {
    let (at, lag) = (|s: i64| Instant::from_ns(s * 1_000_000_000), ten_minutes());
    let mut sensor = Sensor::default();
    for nth in 0..10 {
        sensor.read(20.0 + 0.1 * nth as f64, at(10 * nth), lag);
    }
    // What it began with, once, is a change from standing still.
    assert!(sensor.sudden < 0.011, "{}", sensor.sudden);
    sensor.read(25.0, at(100), lag);
    assert!(sensor.sudden > 16.0);
    sensor.read(29.0, at(701), lag);
    assert_eq!(sensor.sudden, 0.0);
    assert!(sensor.is_new);
    sensor.read(29.0, at(701), lag);
    assert!(!sensor.is_new);
}

/// Predictions of a truth by the first of two columns, and without its sensor, by nothing.
fn answers() -> Answers {
    let answer = |without, coefficient| Answer {
        without,
        constant: 0.0,
        coefficients: vec![coefficient, 0.0],
    };
    let all = [answer(None, 2.0), answer(Some(0), 0.0)];
    Answers::of(&all, &[Some(0), None]).unwrap()
}

/// What a truth that came to be known then says, of a window of 5 min that it ends, where the sensor read something.
fn look(verdict: &mut Verdict, minute: i64, reads: f64, truth: f64) {
    let at = |minute: i64| Instant::from_ns(minute * 60_000_000_000);
    let seen = Seen {
        truth,
        known: at(minute),
        hindsight: Hindsight {
            port: 1,
            delay: Duration::from_ns(300_000_000_000),
            span: Duration::from_ns(300_000_000_000),
        },
        column: &|_| reads,
    };
    verdict.look(&answers(), 0, at(100), &seen);
}

#[test]
fn a_sensor_is_believed_after_three_windows_with_which_predictions_were_better_and_while_they_are()
{
    let (mut verdict, start) = (Verdict::default(), Instant::from_ns(0));
    verdict.begin(0, start, day());
    // Truths of runs before it contradicted the others, of windows that overlap, and none, say nothing.
    for (minute, truth) in [
        (104, 2.0),
        (105, 2.0),
        (107, 2.0),
        (109, 2.0),
        (112, f64::NAN),
    ] {
        look(&mut verdict, minute, 1.0, truth);
    }
    look(&mut verdict, 113, 1.0, 2.1);
    assert!(!verdict.believes());
    look(&mut verdict, 118, f64::NAN, 2.0);
    assert!(!verdict.believes());
    look(&mut verdict, 118, 1.0, 2.2);
    assert!(verdict.believes());
    // It contradicts them again, and what is known counts; not of another, nor for ever.
    verdict.begin(0, start, day());
    assert!(verdict.believes());
    let mut other = verdict.clone();
    other.begin(1, start, day());
    assert!(!other.believes());
    let mut late = verdict.clone();
    late.begin(0, Instant::from_ns(118 * 60_000_000_000) + day(), day());
    assert!(!late.believes());
    // Then it comes loose.
    for minute in [123, 128, 133] {
        look(&mut verdict, minute, -1.0, 2.0);
    }
    assert!(!verdict.believes());
}

#[test]
fn a_sensor_no_better_than_none_is_not_believed() {
    let mut verdict = Verdict::default();
    for nth in 0..10 {
        // Errors of 1 with it, and without.
        look(&mut verdict, 105 + 5 * nth, 1.0, 1.0);
    }
    assert!(!verdict.believes());
}

#[test]
fn a_state_of_before_leaps_and_truths_is_read() {
    let old =
        r#"{"sensors":[{"last":5,"since":null,"is_out":true,"passes":false,"agrees_since":7}]}"#;
    let read: Checked = serde_json::from_str(old).unwrap();
    assert_eq!(read.verdict, Verdict::default());
    let sensor = &read.sensors[0];
    assert_eq!((sensor.last, sensor.out), (Some(Instant::from_ns(5)), None));
}

#[test]
fn a_fit_with_answers_that_do_not_fit_is_refused_and_one_without_an_answer_judges_nothing() {
    let fit = |answers: &str| -> Learned {
        let text = format!(
            r#"{{"uses":["a","b"],"agreement":{{"means":[0.0,0.0],"scales":[1.0,1.0],"matrix":[1.0,0.0,1.0],"usual":1.0}},"answers":{answers}}}"#
        );
        serde_json::from_str(&text).unwrap()
    };
    let short = fit(r#"[{"constant":0.0,"coefficients":[1.0]}]"#);
    assert_eq!(short.mistakes()[0].at, "answers.0.coefficients");
    let beyond = fit(r#"[{"without":2,"constant":0.0,"coefficients":[1.0,1.0]}]"#);
    assert_eq!(beyond.mistakes()[0].at, "answers.0.without");
    let lacking = fit(r#"[{"constant":0.0,"coefficients":[1.0,1.0]}]"#);
    assert!(lacking.mistakes().is_empty());
    assert!(Answers::of(&lacking.answers, &[Some(0), Some(1)]).is_none());
}
