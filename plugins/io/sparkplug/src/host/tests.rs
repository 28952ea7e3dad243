//! Births, deaths, gaps and histories, as an edge node sends them.

use super::*;

struct Bench {
    host: Host,
    began: Clock,
    ms: u64,
}

impl Bench {
    fn new() -> Self {
        let channels = ["edge:T", "edge/d:A/B", "other:T"].map(|of| address(of).unwrap());
        Self {
            host: Host::new("plant", true, channels.into_iter()),
            began: Clock::now(),
            ms: 0,
        }
    }

    fn pass(&mut self, ms: u64) -> Vec<Out> {
        let mut out = Vec::new();
        let now = self.began + Wait::from_millis(ms);
        self.host.pass(now, Instant::from_ns(9), &mut out);
        out.retain(|of| !matches!(of, Out::State(..)));
        out
    }

    fn take(&mut self, topic: &str, seq: Option<u64>, metrics: Vec<Metric>) -> Vec<Out> {
        let payload = Payload {
            timestamp: Some(1000),
            metrics,
            seq,
            uuid: None,
            body: None,
        };
        let (now, at) = (self.began + Wait::from_millis(self.ms), Instant::from_ns(9));
        let mut out = Vec::new();
        let topic = format!("spBv1.0/plant/{topic}");
        self.host
            .take(&topic, &payload.encode_to_vec(), now, at, &mut out);
        out.retain(|of| !matches!(of, Out::State(..)));
        out
    }
}

fn metric(name: Option<&str>, alias: Option<u64>, value: metric::Value) -> Metric {
    Metric {
        name: name.map(str::to_owned),
        alias,
        timestamp: Some(2000),
        value: Some(value),
        ..Metric::new()
    }
}

fn double(name: Option<&str>, alias: Option<u64>, value: f64) -> Metric {
    metric(name, alias, metric::Value::DoubleValue(value))
}

fn birth_of(number: u64) -> Vec<Metric> {
    let number = metric(Some("bdSeq"), None, metric::Value::LongValue(number));
    vec![number, double(Some("T"), Some(7), 20.0)]
}

fn sample(channel: usize, value: f64) -> Out {
    Out::Sample(channel, Instant::from_ns(2_000_000_000), value)
}

/// Another one within the millisecond of the one before.
fn later(channel: usize, value: f64) -> Out {
    Out::Sample(channel, Instant::from_ns(2_000_000_001), value)
}

fn rebirth() -> Out {
    Out::Rebirth("edge".to_owned())
}

#[test]
fn births_say_what_aliases_mean_and_deaths_that_nothing_is_known() {
    let mut bench = Bench::new();
    assert_eq!(
        bench.take("NBIRTH/edge", Some(0), birth_of(3)),
        [sample(0, 20.0)]
    );
    assert_eq!(
        bench.take("NDATA/edge", Some(1), vec![double(None, Some(7), 21.0)]),
        [later(0, 21.0)]
    );
    let device = vec![double(Some("A/B"), Some(8), 1.0)];
    assert_eq!(
        bench.take("DBIRTH/edge/d", Some(2), device),
        [sample(1, 1.0)]
    );
    assert_eq!(
        bench.take("DDATA/edge/d", Some(3), vec![double(None, Some(8), 2.0)]),
        [later(1, 2.0)]
    );
    let absent = |of: &[Out]| -> Vec<usize> {
        let nan = |of: &Out| match of {
            Out::Sample(channel, _, value) if value.is_nan() => Some(*channel),
            _ => None,
        };
        of.iter().filter_map(nan).collect()
    };
    assert_eq!(absent(&bench.take("DDEATH/edge/d", Some(4), vec![])), [1]);
    // The death of a connection before this one says nothing.
    let old = vec![metric(Some("bdSeq"), None, metric::Value::LongValue(2))];
    assert_eq!(bench.take("NDEATH/edge", None, old.clone()), [rebirth()]);
    bench.take("NDATA/edge", Some(5), vec![]);
    assert_eq!(bench.pass(6000), [], "it lives");
    bench.take("NDEATH/edge", None, old);
    assert_eq!(absent(&bench.pass(6000)), [0, 1], "nothing came");
    bench.take("NBIRTH/edge", Some(0), birth_of(3));
    let own = vec![metric(Some("bdSeq"), None, metric::Value::LongValue(3))];
    assert_eq!(absent(&bench.take("NDEATH/edge", None, own)), [0, 1]);
}

#[test]
fn a_number_that_is_missing_and_an_alias_that_is_unknown_ask_for_a_rebirth_and_not_in_a_storm() {
    let mut bench = Bench::new();
    bench.take("NBIRTH/edge", Some(254), birth_of(0));
    assert_eq!(bench.take("NDATA/edge", Some(255), vec![]), []);
    assert_eq!(
        bench.take("NDATA/edge", Some(0), vec![]),
        [],
        "255 is followed by 0"
    );
    let out = bench.take("NDATA/edge", Some(3), vec![double(None, Some(7), 22.0)]);
    let gap = "gap: 2 messages of edge node `edge` are missing by their numbers; it is asked for a rebirth";
    assert_eq!(
        out,
        [Out::Remark(gap.to_owned()), rebirth(), later(0, 22.0)]
    );
    let unknown = || vec![double(None, Some(99), 1.0)];
    let left_out = Out::Dropped(None, LeftOut::NoSuchName);
    assert_eq!(
        bench.take("NDATA/edge", Some(4), unknown()),
        std::slice::from_ref(&left_out),
        "it was asked"
    );
    bench.ms = 6000;
    assert_eq!(
        bench.take("NDATA/edge", Some(5), unknown()),
        [left_out.clone(), rebirth()]
    );
    assert_eq!(bench.take("NDATA/edge", Some(6), unknown()), [left_out]);
}

#[test]
fn data_before_a_birth_are_held_for_a_while() {
    let mut bench = Bench::new();
    let data = |value| vec![double(None, Some(7), value)];
    assert_eq!(bench.take("NDATA/edge", Some(5), data(1.0)), [rebirth()]);
    bench.ms = 3000;
    assert_eq!(bench.take("NDATA/edge", Some(6), data(2.0)), []);
    bench.ms = 7000;
    let out = bench.take("NBIRTH/edge", Some(7), birth_of(0));
    assert_eq!(
        out,
        [sample(0, 2.0), later(0, 20.0)],
        "the first one is too old"
    );
    // A device that is not born is held by itself.
    assert_eq!(
        bench.take("DDATA/edge/d", Some(8), vec![double(None, Some(8), 3.0)]),
        [rebirth()]
    );
    let device = vec![double(Some("A/B"), Some(8), 1.0)];
    assert_eq!(
        bench.take("DBIRTH/edge/d", Some(8), device),
        [sample(1, 3.0), later(1, 1.0)]
    );
    bench.take("DDATA/edge/x", Some(9), vec![]);
    assert_eq!(
        bench.pass(20_000),
        [rebirth(), Out::Dropped(None, LeftOut::NoSuchName)],
        "it is asked again"
    );
}

#[test]
fn what_an_edge_had_stored_comes_before_what_is_live_and_live_values_wait_no_longer_than_that() {
    let mut bench = Bench::new();
    let stamped = |value: f64, is_stored| {
        let mut metric = double(Some("T"), None, value);
        metric.timestamp = Some(value as u64);
        metric.is_historical = Some(is_stored);
        vec![metric]
    };
    bench.host.connected(bench.began, &mut Vec::new());
    let given = |value: f64| Out::Sample(0, Instant::from_ns(value as i64 * 1_000_000), value);
    let mut of = |ms, topic: &str, metrics| {
        bench.ms = ms;
        let mut out = bench.take(topic, None, metrics);
        out.extend(bench.pass(ms));
        out
    };
    assert_eq!(of(0, "NBIRTH/edge", stamped(9000.0, false)), []);
    assert_eq!(of(100, "NDATA/edge", stamped(1.0, true)), [given(1.0)]);
    assert_eq!(of(900, "NDATA/edge", stamped(9500.0, false)), []);
    // Some that are stored do not say so: their stamps do.
    assert_eq!(of(950, "NDATA/edge", stamped(3.0, false)), []);
    assert_eq!(of(1000, "NDATA/edge", stamped(2.0, true)), [given(2.0)]);
    assert_eq!(of(1900, "NDATA/edge", vec![]), []);
    let live = [given(3.0), given(9000.0), given(9500.0)];
    assert_eq!(of(2000, "NDATA/edge", vec![]), live);
    assert_eq!(
        of(2100, "NDATA/edge", stamped(9600.0, false)),
        [given(9600.0)]
    );
    // Behind no later birth, until the connection was away again; and what waits is not lost.
    assert_eq!(
        of(2200, "NBIRTH/edge", stamped(9700.0, false)),
        [given(9700.0)]
    );
    bench.host.connected(bench.began, &mut Vec::new());
    assert_eq!(bench.take("NBIRTH/edge", None, stamped(9800.0, false)), []);
    let out = bench.take("NDEATH/edge", None, vec![]);
    assert_eq!(out[0], given(9800.0));
    assert!(
        matches!(out[1], Out::Sample(0, _, value) if value.is_nan()),
        "{out:?}"
    );
}

#[test]
fn an_edge_whose_numbers_are_never_right_is_asked_for_a_birth_each_five_seconds_and_no_more() {
    let mut bench = Bench::new();
    let mut asked = Vec::new();
    let mut look = |ms, out: Vec<Out>| {
        let is = out.contains(&rebirth());
        asked.extend(is.then_some(ms));
        is
    };
    for ms in (0..12_000).step_by(100) {
        bench.ms = ms;
        let out = bench.take("NDATA/edge", Some(ms / 50 % 256), vec![]);
        if look(ms, out) {
            bench.take("NBIRTH/edge", Some(0), birth_of(0));
        }
    }
    // What it was not asked for at once it is asked for later.
    bench.take("NDATA/edge", Some(99), vec![]);
    look(14_900, bench.pass(14_900));
    look(15_000, bench.pass(15_000));
    look(30_000, bench.pass(30_000));
    assert_eq!(asked, [0, 5000, 10_000, 15_000]);
}

#[test]
fn a_value_is_what_its_type_and_its_quality_say() {
    use metric::Value::{BooleanValue, IntValue, LongValue, StringValue};
    for (of, datatype, expected) in [
        (IntValue(0xff), Some(1), Ok(-1.0)),
        (IntValue(0xfffe), Some(2), Ok(-2.0)),
        (IntValue(u32::MAX), Some(3), Ok(-1.0)),
        (IntValue(u32::MAX), Some(7), Ok(f64::from(u32::MAX))),
        (LongValue(u64::MAX), Some(4), Ok(-1.0)),
        (BooleanValue(true), Some(11), Ok(1.0)),
        (
            StringValue("a".to_owned()),
            Some(12),
            Err(LeftOut::NoNumber),
        ),
        (
            metric::Value::DoubleValue(f64::NAN),
            Some(10),
            Err(LeftOut::NoNumber),
        ),
    ] {
        assert_eq!(
            value(&metric(None, None, of.clone()), datatype),
            expected,
            "{of:?}"
        );
    }
    let mut null = double(None, None, 1.0);
    null.is_null = Some(true);
    assert_eq!(value(&null, None), Err(LeftOut::NoNumber));
    for (text, is_right) in [
        ("a:b", true),
        ("a/b:c/d:e", true),
        ("a", false),
        (":b", false),
        ("a:", false),
        ("a/b/c:d", false),
        ("+:b", false),
    ] {
        assert_eq!(address(text).is_ok(), is_right, "{text}");
    }
}

#[test]
fn a_new_connection_asks_all_anew_and_says_what_may_be_lost() {
    let mut bench = Bench::new();
    let mut out = Vec::new();
    bench.host.connected(bench.began, &mut out);
    assert_eq!(out, [rebirth(), Out::Rebirth("other".to_owned())]);
    bench.take("NBIRTH/edge", Some(0), birth_of(0));
    out.clear();
    bench
        .host
        .connected(bench.began + Wait::from_secs(1), &mut out);
    assert_eq!(out[0], sample(0, 20.0), "what waits is not lost");
    assert!(
        matches!(&out[2], Out::Remark(of) if of.contains("`edge` published while")),
        "{out:?}"
    );
}

#[test]
fn a_death_is_of_the_clock_of_its_edge_so_that_the_next_life_is_later() {
    let mut bench = Bench::new();
    let died = |out: Vec<Out>| match out.iter().find(|of| matches!(of, Out::Sample(..))) {
        Some(Out::Sample(0, at, value)) if value.is_nan() => at.as_ns() / 1_000_000,
        _ => panic!("{out:?}"),
    };
    let will = || vec![metric(Some("bdSeq"), None, metric::Value::LongValue(3))];
    // A will has the time of the connection: what was said last, and the time since, is later.
    bench.take("NBIRTH/edge", Some(0), birth_of(3));
    bench.ms = 70;
    assert_eq!(died(bench.take("NDEATH/edge", None, will())), 1070);
    bench.take("NBIRTH/edge", Some(0), birth_of(3));
    let said = Payload {
        timestamp: Some(1500),
        metrics: will(),
        seq: None,
        uuid: None,
        body: None,
    };
    let mut out = Vec::new();
    let (topic, said) = ("spBv1.0/plant/NDEATH/edge", said.encode_to_vec());
    let (now, at) = (bench.began + Wait::from_secs(9), Instant::from_ns(9));
    bench.host.take(topic, &said, now, at, &mut out);
    assert_eq!(died(out), 1500);
}

#[test]
fn another_value_within_a_millisecond_comes_after_the_first_and_what_was_held_before_a_birth() {
    let mut bench = Bench::new();
    let given = |value: f64, ns: i64| Out::Sample(0, Instant::from_ns(2_000_000_000 + ns), value);
    let data = |value| vec![double(None, Some(7), value)];
    assert_eq!(bench.take("NDATA/edge", Some(0), data(19.0)), [rebirth()]);
    assert_eq!(
        bench.take("NBIRTH/edge", Some(0), birth_of(3)),
        [given(19.0, 0), given(20.0, 1)]
    );
    for (number, value) in [(1, 21.0), (2, 20.0)] {
        let out = bench.take("NDATA/edge", Some(number), data(value));
        assert_eq!(out, [given(value, 1 + number as i64)]);
    }
    // The same once more is nothing new.
    let out = bench.take("NDATA/edge", Some(3), data(20.0));
    assert_eq!(out, [given(20.0, 3)]);
}
