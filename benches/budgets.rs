//! The figures that the project promises, beside what this machine gives: one run, one table.
//!
//! `cargo bench --bench budgets` measures ticks one by one, and the program as a user starts it, on a simulated die tester.
//! Times of the program are the best of five; a tick's include the clock's own cost of some 25 ns.

mod die_tester;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant as Clock};

use athermal::Model;
use die_tester::by_hand::{Dense, Learning, Shipped};
use die_tester::{Tick, dense, has_truth, model, passing, ticks};

fn main() {
    println!("{:<52}{:>14}{:>14}", "", "measured", "budget");
    let shipped = model();
    let mut by_hand = Shipped::new(&shipped);
    let mut step = |tick: &Tick| by_hand.step(tick);
    live("selected slopes", &shipped, ticks(9.0, 2), &mut step);
    novelty(&shipped, ticks(9.0, 2));
    let all = dense::model();
    let mut by_hand = Dense::new(&all);
    let mut step = |tick: &Tick| by_hand.step(tick);
    let of_all = dense::ticks(9.0, 2);
    live("all of 64 slopes", &all, of_all.clone(), &mut step);
    novelty(&all, of_all.clone());
    let learning = dense::learning();
    let mut by_hand = Learning::new(&learning);
    let mut step = |tick: &Tick| by_hand.step(tick);
    let of = "all of 64 slopes that go on learning";
    live(of, &learning, of_all.clone(), &mut step);
    novelty(&learning, of_all);
    program();
}

fn print_line(work: &str, measured: &str, budget: &str) {
    println!("{work:<52}{measured:>14}{budget:>14}");
}

type ByHand<'a> = &'a mut dyn FnMut(&Tick) -> [f64; 6];

fn live(of: &str, model: &Model, mut warm: Vec<Tick>, by_hand: ByHand<'_>) {
    println!("models of {of}:");
    let measured = warm.split_off(17_280);
    let mut engine = passing(model)
        .engine()
        .expect("the fit belongs to the graph");
    for tick in &warm {
        engine.step(tick.0, &tick.1).expect("ticks are in order");
        by_hand(tick);
    }
    let start = Clock::now();
    let engine = times(&measured, |tick| {
        let outputs = engine.step(tick.0, &tick.1);
        std::hint::black_box(outputs.expect("ticks are in order"));
    });
    let seconds = start.elapsed().as_secs_f64();
    let by_hand = times(&measured, |tick| {
        std::hint::black_box(by_hand(tick));
    });
    for (name, truth, budgets) in [
        ("a tick that carries truth", true, ["3 µs", "15 µs", "1.5"]),
        ("a tick without truth", false, ["", "", ""]),
    ] {
        let of = |times: &[Duration]| Quantiles::of(times, &measured, truth);
        let engine = of(&engine);
        print_line(&format!("{name}, median"), &us(engine.median), budgets[0]);
        print_line(&format!("{name}, 99.9 %"), &us(engine.rare), budgets[1]);
        let by_hand = of(&by_hand);
        print_line(&format!("{name}, by hand, median"), &us(by_hand.median), "");
        let ratio = engine.median.as_secs_f64() / by_hand.median.as_secs_f64();
        print_line(
            &format!("{name}, engine by hand"),
            &format!("{ratio:.2}"),
            budgets[2],
        );
    }
    let rate = measured.len() as f64 / seconds;
    print_line(
        "ticks from memory per second, each timed",
        &format!("{rate:.0}"),
        "500000",
    );
}

/// What it costs to know how far regressors are outside, tick by tick beside an engine that does not.
fn novelty(model: &Model, mut warm: Vec<Tick>) {
    let measured = warm.split_off(17_280);
    let mut engines = [model, &passing(model)].map(|model| {
        let mut engine = model.engine().expect("the fit belongs to the graph");
        for tick in &warm {
            engine.step(tick.0, &tick.1).expect("ticks are in order");
        }
        engine
    });
    let mut all = [Vec::new(), Vec::new()];
    for (nth, tick) in measured.iter().enumerate() {
        // In turn, so that neither has the other's caches for itself.
        for which in [nth % 2, 1 - nth % 2] {
            let start = Clock::now();
            let outputs = engines[which].step(tick.0, &tick.1);
            std::hint::black_box(outputs.expect("ticks are in order"));
            all[which].push(start.elapsed());
        }
    }
    for (name, truth) in [
        ("a tick that carries truth", true),
        ("a tick without truth", false),
    ] {
        let [with, without] =
            [&all[0], &all[1]].map(|times| Quantiles::of(times, &measured, truth));
        let ratio = with.median.as_secs_f64() / without.median.as_secs_f64();
        for (of, measured, budget) in [
            ("`outside = \"pass\"`", us(without.median), ""),
            ("\"shrink\"", us(with.median), ""),
            ("\"shrink\" by \"pass\"", format!("{ratio:.2}"), "1.20"),
        ] {
            print_line(&format!("{name}, {of}"), &measured, budget);
        }
    }
}

fn times(ticks: &[Tick], mut step: impl FnMut(&Tick)) -> Vec<Duration> {
    let mut times = Vec::with_capacity(ticks.len());
    for tick in ticks {
        let start = Clock::now();
        step(tick);
        times.push(start.elapsed());
    }
    times
}

struct Quantiles {
    median: Duration,
    rare: Duration,
}

impl Quantiles {
    fn of(times: &[Duration], ticks: &[Tick], truth: bool) -> Self {
        let chosen = times.iter().zip(ticks);
        let chosen = chosen.filter(|(_, tick)| has_truth(tick) == truth);
        let mut sorted: Vec<_> = chosen.map(|(time, _)| *time).collect();
        sorted.sort_unstable();
        Self {
            median: sorted[sorted.len() / 2],
            rare: sorted[sorted.len() * 999 / 1000],
        }
    }
}

fn us(time: Duration) -> String {
    format!("{:.2} µs", time.as_secs_f64() * 1e6)
}

fn program() {
    let folder = std::env::temp_dir().join(format!("athermal-budgets-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("there is a temporary folder");
    let file = |name: &str| folder.join(name);
    let (train, test, fitted) = (file("train.csv"), file("test.csv"), file("model.json"));
    die_tester::write(&train, 7.0, 1);
    die_tester::write(&test, 2.5, 2);
    let graph = die_tester::graph();

    let run = best(&[
        "fit",
        path(&graph),
        "--data",
        path(&train),
        "-o",
        path(&fitted),
    ]);
    print_line("fit a week, whole process", &ms(run.time), "400 ms");
    print_line("its memory", &run.memory(), "50 MB");
    let run = best(&["evaluate", path(&fitted), "--data", path(&test)]);
    print_line(
        "evaluate two days and a half, whole process",
        &ms(run.time),
        "150 ms",
    );
    print_line("its memory", &run.memory(), "50 MB");
    let predicted = file("predicted.csv");
    let week = best(&[
        "run",
        path(&fitted),
        "-i",
        path(&train),
        "-o",
        path(&predicted),
    ]);
    let rate = 60_480.0 / week.time.as_secs_f64();
    print_line(
        "run from CSV to CSV, rows per second",
        &format!("{rate:.0}"),
        "150000",
    );
    print_line("its memory", &week.memory(), "");
    let start = best(&["--version"]);
    print_line("start to first output", &ms(start.time), "20 ms");
    std::fs::remove_dir_all(&folder).expect("the folder was made above");
}

fn path(path: &Path) -> &str {
    path.to_str()
        .expect("the temporary folder has a name in UTF-8")
}

fn ms(time: Duration) -> String {
    format!("{:.0} ms", time.as_secs_f64() * 1e3)
}

struct Run {
    time: Duration,
    /// The most memory that was seen in use, where the system reports it.
    peak_kb: Option<u64>,
}

impl Run {
    fn memory(&self) -> String {
        self.peak_kb.map_or_else(
            || "-".to_owned(),
            |kb| format!("{:.1} MB", kb as f64 / 1024.0),
        )
    }
}

fn best(arguments: &[&str]) -> Run {
    let time = |_| {
        let start = Clock::now();
        let status = program_with(arguments).status();
        assert!(status.is_ok_and(|status| status.success()), "{arguments:?}");
        start.elapsed()
    };
    Run {
        time: (0..5).map(time).min().expect("five is more than none"),
        peak_kb: peak_kb(arguments),
    }
}

fn program_with(arguments: &[&str]) -> Command {
    let mut command = Command::new(PathBuf::from(env!("CARGO_BIN_EXE_athermal")));
    command
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

/// Asks the system for the peak of a running program until it ends.
fn peak_kb(arguments: &[&str]) -> Option<u64> {
    let mut child = program_with(arguments).spawn().ok()?;
    let status = format!("/proc/{}/status", child.id());
    let mut peak = None;
    while child.try_wait().ok()?.is_none() {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let now = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        peak = peak.max(now);
        std::thread::sleep(Duration::from_micros(500));
    }
    peak
}
