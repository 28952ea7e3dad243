//! A log in any of the known forms, written at random from one truth, is read to the same instants and values, or refused with the
//! cause. `ATHERMAL_LONG=1` writes a hundred thousand, `ATHERMAL_SEED=7` that one, `ATHERMAL_SEED=0..50000` those.

use athermal::core::watch::Kept;
use std::collections::BTreeMap;
use std::path::Path;

use athermal::core::prng::Prng;
use athermal::core::time::{TimeFormat, Zone};
use athermal::files::{Dataset, Options};
use athermal::jobs::asked::{Asked, done};
use athermal::jobs::init::Init;
use athermal::run::recording::{Event, Recording, Samples};
use athermal::{Instant, Model};

use crate::workbench::Scratch;

/// Forms of dates and times; those behind the bar have the year first and the day before the month, which only nights can show.
const FORMS: [&str; 22] = [
    "%Y-%m-%dT%H:%M:%SZ",
    "%Y-%m-%d %H:%M:%S",
    "%Y-%m-%dT%H:%M:%S%:z",
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%Y %H:%M",
    "%d.%m.%y %H:%M:%S",
    "%d/%m/%Y %H:%M:%S",
    "%d/%m/%Y %I:%M:%S %p",
    "%d/%m/%y %I:%M %p",
    "%d-%m-%Y %H:%M",
    "%m/%d/%Y %H:%M:%S",
    "%m/%d/%Y %I:%M %p",
    "%m/%d/%y %H:%M",
    "%y/%m/%d %H:%M:%S",
    "%y-%m-%d %H:%M",
    "%d-%b-%Y %H:%M:%S",
    "%d %b %y %I:%M %p",
    "%b %d, %Y %H:%M:%S",
    "%Y%m%d_%H%M%S",
    "%Y-%d-%m %H:%M:%S",
    "%Y/%d/%m %H:%M",
    "%d.%m.%Y %H:%M:%S %z",
];

/// A zone as its name stands in that of a column, and as a graph names it.
const ZONES: [(&str, &str); 6] = [
    ("", "+00:00"),
    (" - GMT +05:00", "+05:00"),
    (" (UTC+1)", "+01:00"),
    (", GMT-07:00", "-07:00"),
    (" UTC -03:30", "-03:30"),
    (" [UTC]", "+00:00"),
];

const COLUMNS: [&str; 3] = ["plate_degC", "room_degC", "Z_um"];

/// What was measured: instants in s with a value of each column, or none.
type Truth = Vec<(i64, [Option<f64>; 3])>;

fn pick<T: Copy>(random: &mut Prng, of: &[T]) -> T {
    of[(random.between(0.0, of.len() as f64) as usize).min(of.len() - 1)]
}

fn truth(random: &mut Prng) -> Truth {
    let step = pick(random, &[300, 600, 1200, 3600]);
    let from = 1_293_840_000 + (random.between(0.0, 7000.0) as i64) * 86_400;
    let by_day = random.between(0.0, 1.0) < 0.3;
    let missing = pick(random, &[0.0, 0.0, 0.1]);
    let (mut at, mut walk) = (from, [0.0_f64; 2]);
    let mut rows = Vec::new();
    while rows.len() < 700 {
        at += step;
        if random.between(0.0, 1.0) < 0.002 {
            at += step * random.between(2.0, 60.0) as i64;
        }
        if by_day && !(6 * 3600..20 * 3600).contains(&(at.rem_euclid(86_400))) {
            continue;
        }
        walk.iter_mut()
            .for_each(|of| *of += random.between(-0.2, 0.2));
        let z = 3.0 * walk[0] - walk[1] + random.between(-0.01, 0.01);
        let values = [21.0 + walk[0], 20.0 + walk[1], 100.0 + z];
        let values = values.map(|value| {
            let is_there = random.between(0.0, 1.0) >= missing;
            is_there.then_some((value * 1000.0).round() / 1000.0)
        });
        rows.push((at, values));
    }
    rows
}

/// The text of a log, and the form of its times.
fn written(random: &mut Prng, truth: &Truth) -> (String, String) {
    let form = pick(random, &FORMS);
    let has_zone = form.ends_with('z') || form.ends_with('Z');
    let (in_name, zone) = if has_zone {
        ZONES[0]
    } else {
        pick(random, &ZONES)
    };
    let zone: Zone = zone.parse().unwrap();
    let format: TimeFormat = form.parse().unwrap();
    let comma = random.between(0.0, 1.0) < 0.4;
    let separator = if comma {
        ";"
    } else {
        pick(random, &[",", ";", "\t"])
    };
    let quote = form.contains(", ") && separator == ",";
    let in_two = random.between(0.0, 1.0) < 0.3 && form.matches(' ').count() == 1 && !has_zone;
    let is_long = !in_two && random.between(0.0, 1.0) < 0.2;
    let time = |at: i64| {
        let text = format
            .write(Instant::from_ns(at * 1_000_000_000), Some(&zone))
            .unwrap();
        match (in_two, quote) {
            (true, _) => text.replacen(' ', separator, 1),
            (_, true) => format!("\"{text}\""),
            _ => text,
        }
    };
    let name = match (in_two, in_name.contains(',') && separator == ",") {
        (true, _) => format!("Date{}{separator}Clock", in_name.replace(',', " ")),
        (_, true) => format!("\"Time{in_name}\""),
        _ => format!("Time{in_name}"),
    };
    let number = |value: f64| {
        let text = format!("{value:.3}");
        if comma { text.replace('.', ",") } else { text }
    };
    let mut text = String::new();
    if random.between(0.0, 1.0) < 0.2 {
        text += "Logger 12\nSerial number: A77\n\n";
    }
    if is_long {
        text += &format!("{name}{separator}name{separator}value\n");
        for (at, values) in truth {
            for (column, value) in COLUMNS.iter().zip(values) {
                if let Some(value) = value {
                    text += &format!(
                        "{}{separator}{column}{separator}{}\n",
                        time(*at),
                        number(*value)
                    );
                }
            }
        }
    } else {
        text += &format!("{name}{separator}{}\n", COLUMNS.join(separator));
        for (at, values) in truth {
            let cells = values.map(|value| value.map_or_else(String::new, number));
            text += &format!("{}{separator}{}\n", time(*at), cells.join(separator));
        }
    }
    (text, form.to_owned())
}

/// What a graph reads of a log: by column and instant in ns.
fn read(graph: &str, log: &Path) -> BTreeMap<(String, i64), f64> {
    let path = log.with_extension("toml");
    std::fs::write(&path, graph).unwrap();
    let model = Model::load(&path).unwrap();
    let dataset = Dataset::new(vec![log.to_path_buf()], Options::default());
    let mut source = dataset.open(&model.plan).unwrap();
    let (mut samples, mut found) = (Samples::default(), BTreeMap::new());
    while let Some(event) = source.next(&mut samples).unwrap() {
        if let Event::Row(at) = event {
            let values = model.plan.sources.iter().zip(&samples.values);
            let there = values.filter(|(_, value)| !value.is_nan());
            found.extend(there.map(|(of, value)| ((of.column.clone(), at.as_ns()), *value)));
        }
    }
    found
}

/// Whether a log of this seed is read to what was written; or why not.
fn is_read(seed: u64, scratch: &Scratch) -> Result<(), Miss> {
    let random = &mut Prng::stream(seed, "rows");
    let truth = truth(random);
    let (text, form) = written(random, &truth);
    let log = scratch.file("log.csv", &text);
    let head = text.lines().take(6).collect::<Vec<_>>().join("\n");
    let mut asked = Asked::default();
    asked
        .options
        .insert("data".to_owned(), serde_json::json!(log));
    let starter = done(&asked, &Kept::default(), |job: &Init, _| job.find());
    let starter = starter.map_err(|why| Miss::Refused(format!("{form}: {why:?}\n{head}")))?;
    let found = read(&starter.text, &log);
    let is_minutes = !form.contains("%S");
    let rows = truth.iter().flat_map(|(at, values)| {
        let at = if is_minutes { at - at % 60 } else { *at };
        let values = COLUMNS.iter().zip(values);
        values.filter_map(move |(column, value)| {
            Some((((*column).to_owned(), at * 1_000_000_000), (*value)?))
        })
    });
    let mut expected: BTreeMap<_, _> = rows.collect();
    // Of a last row after a night nothing says whether its time is wrong: it is left out, which is said.
    let is_doubted = |remark: &String| remark.contains("no row follows that decides");
    if starter.remarks.iter().any(is_doubted) {
        let last = expected.keys().map(|(_, at)| *at).max();
        expected.retain(|(_, at), _| Some(*at) != last);
    }
    if found == expected {
        return Ok(());
    }
    let differs = expected.iter().zip(&found).find(|(a, b)| a != b);
    Err(Miss::Other(format!(
        "{form}: {differs:?} of {} and {}\n{head}\n{:?}\n{}",
        expected.len(),
        found.len(),
        starter.remarks,
        starter.text
    )))
}

/// Why a log is not read to what was written.
enum Miss {
    Refused(String),
    Other(String),
}

#[test]
fn a_log_in_any_form_is_read_to_what_was_written_or_refused() {
    let seeds = std::env::var("ATHERMAL_SEED");
    let number = |text: &str| text.parse::<u64>().unwrap();
    let cases = match (seeds.as_deref(), std::env::var_os("ATHERMAL_LONG")) {
        (Ok(seeds), _) => match seeds.split_once("..") {
            Some((from, to)) => number(from)..number(to),
            None => number(seeds)..number(seeds) + 1,
        },
        (_, Some(_)) => 0..100_000,
        _ => 0..24,
    };
    let scratch = Scratch::new(&format!("random-forms-{}", cases.start));
    let all = cases.end - cases.start;
    let (mut refused, mut others) = (0, Vec::new());
    for seed in cases {
        match is_read(seed, &scratch) {
            Ok(()) => {}
            Err(Miss::Refused(why)) => {
                refused += 1;
                eprintln!("seed {seed}, refused: {why}");
            }
            Err(Miss::Other(why)) => others.push(format!("seed {seed}, {why}")),
        }
    }
    let first = others.iter().take(20).cloned().collect::<Vec<_>>();
    assert!(
        others.is_empty(),
        "{} of {all}:\n{}",
        others.len(),
        first.join("\n\n")
    );
    assert!(refused * 20 <= all, "{refused} of {all} are refused");
}
