//! Any payload is either read or left out for a reason.

use proptest::prelude::*;
use serde_json::json;

use super::*;

const ARRIVAL: Instant = Instant::from_ns(7);

fn at(pointer: &str, unit: Option<i64>) -> Time {
    Time::At(pointer.to_owned(), unit)
}

fn one(time: Time) -> Form {
    Form {
        time,
        sequence: None,
        quality: None,
        values: Values::One("/value".to_owned(), 3),
        instants: Box::default(),
        flags: Box::default(),
    }
}

fn each() -> Form {
    Form {
        time: at("/t", Some(1_000_000)),
        sequence: Some("/n".to_owned()),
        quality: Some(Quality {
            at: "/q".to_owned(),
            good: vec![json!(192), json!("good")],
        }),
        values: Values::Each {
            list: "/values".to_owned(),
            name: "/id".to_owned(),
            value: "/v".to_owned(),
            channels: HashMap::from([("Ch1.Room".to_owned(), 0), ("7".to_owned(), 1)]),
        },
        instants: Box::default(),
        flags: Box::default(),
    }
}

fn plain() -> Form {
    Form {
        time: Time::Arrival,
        sequence: None,
        quality: None,
        values: Values::Plain(2),
        instants: Box::default(),
        flags: Box::default(),
    }
}

fn fields() -> Form {
    Form {
        values: Values::Fields(vec![("/T/a".to_owned(), 0), ("/T/b".to_owned(), 1)]),
        ..one(at("/time", None))
    }
}

fn reading(channel: usize, ns: i64, value: f64) -> Reading {
    Reading {
        channel,
        stamp: Instant::from_ns(ns),
        value,
    }
}

/// The reasons for which parts of a payload are left out.
fn reasons(form: &Form, payload: &[u8]) -> Vec<Reason> {
    let readings = form.read(payload, ARRIVAL);
    readings.left_out.iter().map(|of| of.reason).collect()
}

#[test]
fn behaviour_06_the_time_of_a_value_is_that_of_its_source() {
    for (unit, text, ns) in [
        (Some(1_000_000_000), "1764279677", 1_764_279_677_000_000_000),
        (
            Some(1_000_000_000),
            "1764279677.123456",
            1_764_279_677_123_456_000,
        ),
        (
            Some(1_000_000_000),
            "1.764279677123456e9",
            1_764_279_677_123_456_000,
        ),
        (
            Some(1_000_000_000),
            "\"1764279677.123456789\"",
            1_764_279_677_123_456_789,
        ),
        (Some(1_000_000), "1764279677123", 1_764_279_677_123_000_000),
        (Some(1_000), "-1", -1_000),
        (Some(1), "1764279677123456789", 1_764_279_677_123_456_789),
        (Some(60_000_000_000), "0.5", 30_000_000_000),
        (
            None,
            "\"2025-11-27T22:41:17.123+01:00\"",
            1_764_279_677_123_000_000,
        ),
        (
            None,
            "\"2025-11-27T21:41:17.123Z\"",
            1_764_279_677_123_000_000,
        ),
    ] {
        let payload = format!("{{\"value\": 1, \"ts\": {text}}}");
        let form = one(at("/ts", unit));
        let read = form.read(payload.as_bytes(), ARRIVAL);
        assert_eq!(read.given, [reading(3, ns, 1.0)], "{text} in {unit:?}");
    }
}

#[test]
fn from_when_on_a_planned_value_applies_is_written_as_the_time_is() {
    let planned = |time: Time| Form {
        values: Values::Fields(vec![
            ("/chuck".to_owned(), 0),
            ("/applies_at".to_owned(), 1),
        ]),
        instants: Box::new([1]),
        ..one(time)
    };
    let (rfc, ms) = (at("/time", None), at("/time", Some(1_000_000)));
    let (now, then) = (1_764_279_677_000_000_000, 1_764_281_477.5);
    for (time, texts) in [
        (
            rfc,
            [
                "\"2025-11-27T21:41:17Z\"",
                "\"2025-11-27T23:11:17.5+01:00\"",
            ],
        ),
        (ms, ["1764279677000", "1764281477500"]),
    ] {
        let form = planned(time);
        let [now_text, then_text] = texts;
        let payload = |rest: &str| format!("{{\"time\": {now_text}, \"chuck\": 50{rest}}}");
        let applies = payload(&format!(", \"applies_at\": {then_text}"));
        let read = form.read(applies.as_bytes(), ARRIVAL);
        assert_eq!(
            read.given,
            [reading(0, now, 50.0), reading(1, now, then)],
            "{applies}"
        );
        // Without it a value applies at once, which is no fault.
        for rest in ["", ", \"applies_at\": null"] {
            let read = form.read(payload(rest).as_bytes(), ARRIVAL);
            assert_eq!(read.given, [reading(0, now, 50.0)], "{rest}");
            assert_eq!(read.left_out, []);
        }
        let wrong = payload(", \"applies_at\": \"soon\"");
        assert_eq!(reasons(&form, wrong.as_bytes()), [Reason::WrongTime]);
    }
    let form = planned(Time::Arrival);
    for text in ["90.5", "\"1970-01-01T00:01:30.5Z\""] {
        let payload = format!("{{\"chuck\": 50, \"applies_at\": {text}}}");
        let read = form.read(payload.as_bytes(), ARRIVAL);
        assert_eq!(read.given, [reading(0, 7, 50.0), reading(1, 7, 90.5)]);
    }
}

#[test]
fn a_time_that_is_none_leaves_the_value_out() {
    for (unit, text, reason) in [
        (Some(1_000_000_000), "\"now\"", Reason::WrongTime),
        (Some(1_000_000_000), "1e300", Reason::WrongTime),
        (
            Some(1_000_000_000),
            "9223372036854775807",
            Reason::WrongTime,
        ),
        (Some(1_000_000_000), "true", Reason::WrongTime),
        (Some(1_000_000_000), "null", Reason::NoTime),
        (None, "1764279677", Reason::WrongTime),
        (None, "\"2025-13-27T00:00:00Z\"", Reason::WrongTime),
    ] {
        let payload = format!("{{\"value\": 1, \"ts\": {text}}}");
        let form = one(at("/ts", unit));
        assert_eq!(reasons(&form, payload.as_bytes()), [reason], "{text}");
    }
    assert_eq!(
        reasons(&one(at("/ts", None)), b"{\"value\": 1}"),
        [Reason::NoTime]
    );
}

#[test]
fn behaviour_22_a_list_gives_each_name_to_its_channel() {
    let payload = br#"{"n": 5, "q": 192, "t": 1, "values": [
        {"id": "Ch1.Room", "v": 21.5, "t": 2},
        {"id": 7, "v": "3e1"},
        {"id": "Ch1.Room", "v": 9, "q": 0},
        {"id": "Ch2", "v": 9},
        {"v": 9}]}"#;
    let readings = each().read(payload, ARRIVAL);
    let expected = [reading(0, 2_000_000, 21.5), reading(1, 1_000_000, 30.0)];
    assert_eq!(readings.given, expected);
    assert_eq!(readings.sequence, Some(5));
    let reasons: Vec<_> = readings.left_out.iter().map(|of| of.reason).collect();
    assert_eq!(reasons, [Reason::Bad, Reason::UnknownName, Reason::NoName]);
}

#[test]
fn behaviour_22_an_object_gives_each_field_to_its_channel() {
    let payload = br#"{"time": "1970-01-01T00:00:01Z", "T": {"a": 1.5, "b": null}}"#;
    let readings = fields().read(payload, ARRIVAL);
    assert_eq!(readings.given, [reading(0, 1_000_000_000, 1.5)]);
}

#[test]
fn a_value_that_is_null_or_not_there_is_left_out_in_words_only_where_a_message_has_no_other() {
    let with =
        |values: &str| format!("{{\"time\": \"1970-01-01T00:00:01Z\", \"T\": {{{values}}}}}");
    for (values, expected) in [
        ("\"a\": 1.5, \"b\": null", &[][..]),
        ("\"b\": 1.5", &[]),
        ("\"a\": 1.5, \"b\": \"x\"", &[Reason::NotANumber]),
        ("\"a\": null", &[Reason::Null, Reason::NotThere]),
    ] {
        assert_eq!(
            reasons(&fields(), with(values).as_bytes()),
            expected,
            "{values}"
        );
    }
}

#[test]
fn true_is_one_of_a_channel_whose_unit_is_one_and_no_number_of_any_other() {
    for (mut form, text, channel) in [
        (one(Time::Arrival), "{\"value\": true}", 3),
        (plain(), " true\n", 2),
    ] {
        assert_eq!(reasons(&form, text.as_bytes()), [Reason::Truth]);
        form.flags = Box::new([channel]);
        let of = |text: &str| form.read(text.as_bytes(), ARRIVAL).given;
        assert_eq!(of(text), [reading(channel, 7, 1.0)]);
        assert_eq!(
            of(&text.replace("true", "false")),
            [reading(channel, 7, 0.0)]
        );
    }
}

#[test]
fn behaviour_21_a_plain_number_has_the_time_of_its_arrival() {
    for text in ["21.5", " 21.5\n", "2.15e1"] {
        let read = plain().read(text.as_bytes(), ARRIVAL);
        assert_eq!(read.given, [reading(2, 7, 21.5)], "{text}");
    }
}

#[test]
fn behaviour_09_what_is_not_good_is_no_value() {
    let mut form = one(Time::Arrival);
    form.quality = each().quality;
    for (quality, is_good) in [
        ("192", true),
        ("192.0", true),
        ("\"good\"", true),
        ("0", false),
        ("\"Good\"", false),
        ("null", false),
        ("[192]", false),
    ] {
        let payload = format!("{{\"value\": 1, \"q\": {quality}}}");
        let read = form.read(payload.as_bytes(), ARRIVAL);
        assert_eq!(read.given.len(), usize::from(is_good), "{quality}");
        assert_eq!(read.left_out.is_empty(), is_good, "{quality}");
    }
    assert_eq!(reasons(&form, b"{\"value\": 1}"), [Reason::Bad]);
}

#[test]
fn hostile_payloads_are_left_out_each_for_its_reason() {
    let form = one(Time::Arrival);
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    let long = vec![b' '; LONGEST + 1];
    for (payload, reason) in [
        (&b""[..], Reason::Empty),
        (&long, Reason::TooLong),
        (deep.as_bytes(), Reason::TooDeep),
        (b"\xff\xfe", Reason::NotText),
        (b"\0", Reason::NotJson),
        (b"{\"value\": 1", Reason::NotJson),
        (b"{\"value\": 1}\0", Reason::NotJson),
        (b"{\"value\": 1e999}", Reason::NotJson),
        (b"[]", Reason::NotThere),
        (b"{\"value\": {}}", Reason::NotANumber),
        (b"{\"value\": [1]}", Reason::NotANumber),
        (b"{\"value\": \"\"}", Reason::NotANumber),
        (b"{\"value\": \"NaN\"}", Reason::NotFinite),
        (b"{\"value\": \"-inf\"}", Reason::NotFinite),
        (b"{\"value\": null}", Reason::Null),
    ] {
        let shown = String::from_utf8_lossy(&payload[..payload.len().min(40)]).into_owned();
        assert_eq!(reasons(&form, payload), [reason], "{shown}");
    }
    assert_eq!(reasons(&plain(), b"1\0"), [Reason::NotANumber]);
    assert_eq!(reasons(&plain(), b"1,5"), [Reason::NotANumber]);
    assert_eq!(reasons(&each(), b"{\"values\": {}}"), [Reason::NotThere]);
}

#[test]
fn what_is_shown_of_a_payload_is_short_and_has_no_control_characters() {
    let payload = format!("{{\"value\": \"\u{1b}[2J{}\"}}", "x".repeat(1000));
    let readings = one(Time::Arrival).read(payload.as_bytes(), ARRIVAL);
    let what = &readings.left_out[0].what;
    assert!(what.len() < 100 && !what.contains('\u{1b}'), "{what}");
}

/// Texts that look like what is expected, and are not always.
fn nearly() -> impl Strategy<Value = Vec<u8>> {
    let scalar = prop_oneof![
        Just("null".to_owned()),
        Just("true".to_owned()),
        Just("1e999".to_owned()),
        any::<f64>().prop_map(|of| of.to_string()),
        any::<i64>().prop_map(|of| of.to_string()),
        any::<String>().prop_map(|of| json!(of).to_string()),
        "-?[0-9]{0,30}(\\.[0-9]{0,30})?(e-?[0-9]{1,12})?".prop_map(|of| format!("\"{of}\"")),
    ];
    let value = scalar.prop_recursive(4, 32, 8, |inner| {
        let key = prop_oneof![
            Just("value"),
            Just("values"),
            Just("id"),
            Just("v"),
            Just("t"),
            Just("q"),
            Just("T"),
            Just("a"),
            Just("time"),
            Just("n"),
        ];
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..8).prop_map(|of| format!("[{}]", of.join(","))),
            prop::collection::vec((key, inner), 0..8).prop_map(|of| {
                let entries = of.iter().map(|(key, value)| format!("\"{key}\":{value}"));
                format!("{{{}}}", entries.collect::<Vec<_>>().join(","))
            }),
        ]
    });
    (value, any::<prop::sample::Index>(), any::<Option<u8>>()).prop_map(|(text, place, byte)| {
        let mut bytes = text.into_bytes();
        // A byte of it may be broken.
        if let Some(byte) = byte {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        bytes
    })
}

proptest! {
    #[test]
    fn any_bytes_give_finite_values_of_known_channels_or_a_reason(payload in prop_oneof![
        nearly(),
        prop::collection::vec(any::<u8>(), 0..200),
    ]) {
        for form in [plain(), one(Time::Arrival), one(at("/t", Some(1_000_000_000))), fields(), each()] {
            let readings = form.read(&payload, ARRIVAL);
            for given in &readings.given {
                prop_assert!(given.value.is_finite() && given.channel < 4);
            }
            let is_empty_list = matches!(form.values, Values::Each { .. });
            prop_assert!(is_empty_list || !readings.given.is_empty() || !readings.left_out.is_empty());
            prop_assert_eq!(&readings, &form.read(&payload, ARRIVAL), "it depends on nothing else");
        }
    }

    #[test]
    fn digits_times_a_unit_are_exact(seconds in -9_000_000_000_i64..9_000_000_000, ns in 0_i64..1_000_000_000) {
        let sign = if seconds < 0 { "-" } else { "" };
        let text = format!("{sign}{}.{ns:09}", seconds.abs());
        let expected = seconds.signum() * (seconds.abs() * 1_000_000_000 + ns);
        if seconds != 0 {
            prop_assert_eq!(exact_ns(&text, 1_000_000_000), Some(expected));
        }
    }
}
