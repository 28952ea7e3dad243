//! Services that are looked at: what they keep for that, what is said of axes, and alarms.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use athermal::serve::journal::{Entry, Log, Record};
use serde_json::{Value, json};

use crate::workbench::{Scratch, athermal};

const GRAPH: &str = r#"schema = 1
name = "looked-at"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s"] }
nodes.state = { type = "stability", inputs.drift = "trend", stable_below = "3 K/min", transient_above = "9 K/min" }
outputs.trend = "trend"
outputs.state = "state"
"#;

fn service(socket: &Path) -> String {
    format!(
        r#"
[runtime]
wait = "0 s"
settle = "0 s"
checkpoint = "1s"
[sources.log]
type = "replay"
path = "log.csv"
speed = 20
[control]
socket = "{}"
"#,
        socket.display()
    )
}

/// A service in a folder of its own, killed when it is dropped.
struct Desk {
    scratch: Scratch,
    socket: PathBuf,
    child: Child,
}

impl Desk {
    /// `of_row` is the temperature of the plate at each row of 0.1 s.
    fn new(name: &str, more: &str, rows: u32, of_row: impl Fn(u32) -> f64) -> Self {
        let scratch = Scratch::new(&format!("looked-at-{name}"));
        let socket = format!("athermal-{name}-{}.sock", std::process::id());
        let socket = std::env::temp_dir().join(socket);
        let row = |nth| {
            format!(
                "{}.{},{},{}\n",
                nth / 10,
                nth % 10,
                of_row(nth),
                21 + nth % 5
            )
        };
        let rows: String = (0..rows).map(row).collect();
        scratch.file("log.csv", &("time_s,plate,room\n".to_owned() + &rows));
        scratch.file("graph.toml", GRAPH);
        scratch.file("line.toml", format!("{GRAPH}{}{more}", service(&socket)));
        let child = start(&scratch);
        Self {
            scratch,
            socket,
            child,
        }
    }

    /// Ends it as a power cut would, and starts it again.
    fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        self.child = start(&self.scratch);
    }

    fn get(&self, path: &str) -> Option<Value> {
        let mut stream = UnixStream::connect(&self.socket).ok()?;
        let request =
            format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).ok()?;
        let mut text = String::new();
        stream.read_to_string(&mut text).ok()?;
        let (_, body) = text.split_once("\r\n\r\n")?;
        serde_json::from_str(body).ok()
    }

    fn until<T>(&self, what: &str, path: &str, find: impl Fn(&Value) -> Option<T>) -> T {
        let began = Instant::now();
        loop {
            let found = self.get(path);
            if let Some(of) = found.as_ref().and_then(&find) {
                return of;
            }
            assert!(
                began.elapsed() < Duration::from_secs(30),
                "{what}: {found:?}"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn start(scratch: &Scratch) -> Child {
    Command::new(env!("CARGO_BIN_EXE_athermal"))
        .arg("serve")
        .arg(scratch.path("line.toml"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn numbers(of: &Value) -> Vec<f64> {
    of.as_array()
        .unwrap()
        .iter()
        .map(|of| of.as_f64().unwrap_or(f64::NAN))
        .collect()
}

/// What a run puts out, by the time of the row in ms.
fn run(scratch: &Scratch, column: &str) -> BTreeMap<i64, f64> {
    let out = scratch.path("run.csv");
    athermal(&[
        &"run",
        &scratch.path("graph.toml"),
        &"--input",
        &scratch.path("log.csv"),
        &"-o",
        &out,
    ])
    .ended(0);
    let text = std::fs::read_to_string(out).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let place = header.iter().position(|of| of.starts_with(column)).unwrap();
    let number = |text: &str| text.parse().unwrap_or(f64::NAN);
    let ms = |text: &str| (number(text) * 1e3).round() as i64;
    lines
        .map(|line| (ms(line[0]), number(line[place])))
        .collect()
}

#[test]
fn the_history_after_a_kill_is_that_of_a_run_point_by_point() {
    let mut desk = Desk::new("history", "", 100_000, |nth| {
        20.0 + f64::from(nth % 300) / 50.0
    });
    let path = "/v1/history?channel=trend.plate&channel=temperature.plate&points=2000&from=0";
    let count = |of: &Value| of["time_s"].as_array().map(Vec::len);
    desk.until("a history", path, |of| {
        count(of).filter(|count| *count > 300)
    });
    for _ in 0..2 {
        let before = desk.get(path).unwrap();
        let last = before["to_s"].as_f64().unwrap();
        desk.kill();
        let covers = |of: &Value| {
            // Before the first tick there is none.
            of["time_s"].as_array()?;
            let times = numbers(&of["time_s"]);
            (times.first() == Some(&0.0) && *times.last()? > last + 5.0).then(|| of.clone())
        };
        // Not cut into stretches: each point is a row.
        let path = format!("{path}&to={}", last + 20.0);
        let after = desk.until("what was before", &path, covers);
        let expected = run(&desk.scratch, "trend.plate");
        let (times, values) = (numbers(&after["time_s"]), numbers(&after["last"][0]));
        let mut compared = 0;
        for (time, value) in times.iter().zip(&values) {
            let run = expected[&((time * 1e3).round() as i64)];
            assert!(
                run == *value || run.is_nan() && value.is_nan(),
                "{time}: {value} and {run}"
            );
            compared += usize::from(!run.is_nan());
        }
        assert!(compared > 200, "{compared}");
        // None is lacking before the kill.
        let whole = times.iter().filter(|time| **time <= last).count();
        assert!(whole as f64 > last * 10.0 - 5.0, "{whole} of {last} s");
    }
    // A picture of a minute in thirty stretches has its lowest and highest value.
    let of = |points: u32| {
        desk.get(&format!(
            "/v1/history?channel=temperature.plate&from=0&to=30&points={points}"
        ))
    };
    let (fine, coarse) = (of(2000).unwrap(), of(30).unwrap());
    let extreme = |of: &Value, key: &str, pick: fn(f64, f64) -> f64| {
        numbers(&of[key][0]).into_iter().reduce(pick)
    };
    assert_eq!(
        extreme(&fine, "lowest", f64::min),
        extreme(&coarse, "lowest", f64::min)
    );
    assert_eq!(
        extreme(&fine, "highest", f64::max),
        extreme(&coarse, "highest", f64::max)
    );
    let wrong = desk.get("/v1/history?channel=nothing").unwrap();
    assert!(
        wrong["error"]
            .as_str()
            .unwrap()
            .contains("`nothing` is not kept")
    );
    for wrong in [
        "from=x",
        "points=0",
        "points=9999",
        "to=1e300",
        "from=9&to=3",
        "other=1",
    ] {
        let answer = desk.get(&format!("/v1/history?{wrong}")).unwrap();
        assert!(answer["error"].is_string(), "{wrong}: {answer}");
    }
}

#[test]
fn each_axis_is_said_in_a_sentence_and_nothing_is_when_ticks_stay_away() {
    let of_row = |nth: u32| 20.0 + f64::from(nth) / 600.0;
    let mut desk = Desk::new("axes", "[page]\nmay_measure = \"trend\"\n", 300, of_row);
    // A logger that writes a row each tenth of a second.
    let machine = desk.scratch.path("line.toml");
    let text = std::fs::read_to_string(&machine).unwrap();
    std::fs::write(
        &machine,
        text.replace("type = \"replay\"", "type = \"csv\"")
            .replace("speed = 20\n", ""),
    )
    .unwrap();
    desk.kill();
    let is_over = Arc::<AtomicBool>::default();
    let (log, stop) = (desk.scratch.path("log.csv"), Arc::clone(&is_over));
    let logger = std::thread::spawn(move || {
        let mut file = std::fs::File::options().append(true).open(log).unwrap();
        for nth in (300..).take_while(|_| !stop.load(Ordering::Relaxed)) {
            writeln!(file, "{}.{},{},21", nth / 10, nth % 10, of_row(nth)).unwrap();
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    let sentence = |of: &Value| {
        let axes = of["axes"].as_array()?;
        let axis = axes.iter().find(|of| of["axis"] == "plate")?;
        Some((axis["sentence"].as_str()?.to_owned(), of["stale"].clone()))
    };
    let stable = |of: &Value| sentence(of).filter(|(words, _)| words.contains("stable for"));
    let (words, stale) = desk.until("a sentence", "/v1/axes", stable);
    assert!(
        words.starts_with("plate drifts 1.0 K/min; stable for ")
            && words.ends_with("; may measure: yes"),
        "{words}"
    );
    assert_eq!(stale, Value::Null);
    // The boxes of the graph are what they give.
    let graph = desk.get("/v1/graph").unwrap();
    let of = |name: &str| {
        let boxes = graph["boxes"].as_array().unwrap();
        let found = boxes
            .iter()
            .find(|of| of["name"] == name && of["kind"].is_string());
        found.unwrap()["channels"].clone()
    };
    assert_eq!(of("trend")[0], "trend.plate");
    is_over.store(true, Ordering::Relaxed);
    logger.join().unwrap();
    let stale = |of: &Value| sentence(of).filter(|(_, stale)| !stale.is_null());
    let (words, stale) = desk.until("that nothing comes", "/v1/axes", stale);
    assert!(
        words.starts_with("plate: not known, no tick for "),
        "{words}"
    );
    assert!(stale["since_s"].as_f64() > Some(1.7e9), "{stale}");
    let now = desk.get("/v1/axes").unwrap();
    assert_eq!(now["axes"][0]["may_measure"], Value::Null, "{now}");
}

/// A receiver of messages; what it was given comes out. Until it answers, it is as one that is killed in the midst of each.
fn receiver(listener: TcpListener, answers: Arc<AtomicBool>) -> Receiver<Value> {
    let (give, taken) = channel();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let Ok(mut stream) = stream else { return };
            let mut bytes = Vec::new();
            let mut part = [0; 4096];
            let body = loop {
                let Ok(count @ 1..) = stream.read(&mut part) else {
                    break None;
                };
                bytes.extend_from_slice(&part[..count]);
                let text = String::from_utf8_lossy(&bytes).into_owned();
                if let Some((_, body)) = text.split_once("\r\n\r\n")
                    && let Ok(body) = serde_json::from_str::<Value>(body)
                {
                    break Some(body);
                }
            };
            if !answers.load(Ordering::Relaxed) {
                continue;
            }
            let _ = write!(
                stream,
                "HTTP/1.1 204 X\r\ncontent-length: 0\r\nconnection: close\r\n\r\n"
            );
            if let Some(body) = body
                && give.send(body).is_err()
            {
                return;
            }
        }
    });
    taken
}

#[test]
fn alarms_reach_a_webhook_in_order_through_kills_of_both_sides_and_stand_in_the_journal() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let alarms = r#"
[alarms.hot]
of = "temperature.plate"
above = "25 Cel"
for = "1s"
hysteresis = "1 K"
text = "the plate is <hot>"
webhook.file = "hook"
"#;
    drop(listener);
    // Five seconds hot, five seconds cold, of data: half a second each.
    let of_row = |nth: u32| if nth % 400 < 200 { 20.0 } else { 30.0 };
    let scratch = |desk: &Desk| desk.scratch.path("hook");
    let mut desk = {
        let desk = Desk::new("alarms", "", 100_000, of_row);
        std::fs::write(
            scratch(&desk),
            format!("http://{address}/path?key=secret\n"),
        )
        .unwrap();
        std::fs::write(
            desk.scratch.path("line.toml"),
            format!("{GRAPH}{}{alarms}", service(&desk.socket)),
        )
        .unwrap();
        desk
    };
    desk.kill();
    let states = |of: &Value| {
        let changes = of["changes"].as_array()?;
        (changes.len() >= 2).then(|| of.clone())
    };
    // Nobody listens yet.
    desk.until("changes", "/v1/alarms", states);
    desk.kill();
    desk.until("more", "/v1/alarms", states);
    let answers = Arc::<AtomicBool>::default();
    let listener = TcpListener::bind(address).unwrap();
    let taken = receiver(listener, Arc::clone(&answers));
    std::thread::sleep(Duration::from_secs(1));
    answers.store(true, Ordering::Relaxed);
    let mut numbers: Vec<u64> = Vec::new();
    let mut read = |least: usize| {
        let began = Instant::now();
        while numbers.len() < least {
            assert!(began.elapsed() < Duration::from_secs(40), "{numbers:?}");
            let Ok(message) = taken.recv_timeout(Duration::from_secs(1)) else {
                continue;
            };
            assert_eq!(
                (&message["machine"], &message["left_out"]),
                (&json!("looked-at"), &json!(0))
            );
            for change in message["changes"].as_array().unwrap() {
                assert_eq!(change["text"], "the plate is <hot>");
                numbers.push(change["number"].as_u64().unwrap());
            }
        }
    };
    read(3);
    desk.kill();
    read(6);
    // Each at least once, in order.
    let mut once = numbers.clone();
    once.dedup();
    let whole: Vec<u64> = (1..=once.len() as u64).collect();
    let mut sorted = once.clone();
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!(sorted, whole[..sorted.len()], "{numbers:?}");
    let firsts: Vec<_> = sorted
        .iter()
        .map(|of| numbers.iter().position(|it| it == of))
        .collect();
    assert!(firsts.is_sorted(), "{numbers:?}");

    // Acknowledged on the command line, shown, counted, and a note of the journal.
    let machine = desk.scratch.path("line.toml");
    let began = Instant::now();
    loop {
        let done = athermal(&[&"alarm", &"acknowledge", &machine, &"hot"]);
        if done.out.contains("hot is acknowledged") {
            break;
        }
        assert!(
            began.elapsed() < Duration::from_secs(20),
            "{} {}",
            done.out,
            done.told
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    let listed = athermal(&[&"alarm", &"list", &machine]);
    assert!(
        listed.out.contains("hot") && listed.out.contains("Cel"),
        "{}",
        listed.out
    );
    let unknown = athermal(&[&"alarm", &"acknowledge", &machine, &"cold"]).ended(2);
    assert!(
        unknown.told.contains("no alarm `cold`; there are: hot"),
        "{}",
        unknown.told
    );
    let status = desk.until("a status", "/v1/status", |of| Some(of.clone()));
    assert!(!status.to_string().contains("secret"));
    let tried = athermal(&[&"alarm", &"test", &machine]).ended(0);
    assert!(
        tried.out.contains("webhook 127.0.0.1") && tried.out.contains("has it"),
        "{}",
        tried.out
    );
    assert!(!tried.out.contains("secret"));
    let journal = desk.scratch.path("line.state").join("journal");
    let words = [
        "alarm hot raised: the plate is <hot>",
        "alarm hot acknowledged",
        "alarm hot gone",
    ];
    // It is written a moment after it was answered.
    let began = Instant::now();
    loop {
        let notes = notes(&journal).unwrap_or_default();
        let is_there = |words: &&str| notes.iter().any(|of| of.contains(words));
        if words.iter().all(is_there) {
            break;
        }
        assert!(began.elapsed() < Duration::from_secs(20), "{notes:?}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The notes of a journal; none where it is being written to and cannot be read.
fn notes(journal: &Path) -> Option<Vec<String>> {
    let mut log = Log::open(journal).ok()?;
    let mut notes = Vec::new();
    while let Some(entry) = log.read().ok()? {
        if let Entry::Record(_, Record::Note(text)) = entry {
            notes.push(text.to_string());
        }
    }
    Some(notes)
}

#[test]
fn alarms_that_do_not_fit_the_graph_are_refused_where_they_stand() {
    let scratch = Scratch::new("looked-at-mistakes");
    for (alarm, words) in [
        (
            "of = \"trend.plate\"",
            "one of `above`, `below` and `absent = true`",
        ),
        (
            "of = \"trend.plates\"\nabove = 1",
            "did you mean `trend.plate`",
        ),
        ("of = \"trend.plate\"\nabove = \"3 nm\"", "is in"),
        ("of = \"trend.plate\"\nabove = \"3\"", "unit"),
        (
            "of = \"trend.plate\"\nabove = 3\nbelow = 1",
            "one of `above`",
        ),
        (
            "of = \"trend.plate\"\nabsent = true\nhysteresis = 1",
            "how far back from a limit",
        ),
        (
            "of = \"trend.plate\"\nabove = 3\ntopic = \"a/b\"",
            "there is none",
        ),
        (
            "of = \"trend.plate\"\nabove = 3\nwebhook = \"http://x\"",
            "a secret has no place",
        ),
        ("of = \"trend.plate\"\nabove = 3\nlonger = \"1s\"", "longer"),
    ] {
        let machine = scratch.file(
            "line.toml",
            format!(
                "{GRAPH}{}[alarms.a]\n{alarm}\n",
                service(Path::new("a.sock"))
            ),
        );
        let refused = athermal(&[&"check", &machine]).ended(2);
        let all = format!("{}{}", refused.out, refused.told);
        assert!(
            all.contains(words) && all.contains("line.toml:"),
            "{alarm}: {all}"
        );
    }
}
