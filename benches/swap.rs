//! What the engine thread pays for a hand-over: the tick at which another graph takes over, beside its neighbours.
//!
//! `cargo bench --bench swap` swaps two graphs of the die tester back and forth two hundred times: one, and the same with a
//! sensor out, a voter in and another memory. A neighbour is a tick of the same kind, with or without positions, among the
//! twenty before and the twenty after. It fails where a tick allocates or frees.

mod die_tester;

use std::time::{Duration, Instant as Clock};

use athermal::Model;
use athermal::run::live::{LiveOptions, pair};
use die_tester::{Tick, fitted, ticks};

const SWAPS: usize = 200;
/// Ticks from one swap to the next; no multiple of those from one position to the next.
const APART: usize = 61;
const NEIGHBOURS: usize = 20;

fn main() {
    let week = ticks(7.0, 1);
    let text = die_tester::text();
    let other = text
        .replace(
            "inputs.signal = \"temperature\"",
            "inputs.signal = \"temperature.{holder1,plate2,holder2,room,chuck}\"",
        )
        .replace(
            "[nodes.vote]",
            "[nodes.last]\ntype = \"persistence\"\neach = \"axis\"\ninputs.truth = \"drift.{axis}\"\nahead = \"5min\"\n\n[nodes.vote]",
        )
        .replace("\"both.{axis}\"]", "\"both.{axis}\", \"last.{axis}\"]")
        .replace("memory = \"15min\"", "memory = \"20min\"");
    let models = [fitted(&text, &week), fitted(&other, &week)];
    assert!(models[1].plan.nodes.len() > models[0].plan.nodes.len());
    let data = ticks(9.0, 2);

    let allocated = course(&models, &data, |step| {
        let counted = allocation_counter::measure(step);
        counted.count_total + counted.count_current.unsigned_abs()
    });
    let total: u64 = allocated.iter().map(|tick| tick.cost).sum();
    let times = course(&models, &data, |step| {
        let start = Clock::now();
        step();
        start.elapsed()
    });
    let mut commits = of(&times, |tick| tick.takes_over);
    let mut others = of(&times, |tick| !tick.takes_over);
    let mut more = extra(&times);
    print_line("a tick, median", &us(quantile(&mut others, 0.5)), "");
    print_line(
        "the tick of a commit, median",
        &us(quantile(&mut commits, 0.5)),
        "",
    );
    print_line(
        "more than its neighbours, median",
        &us(quantile(&mut more, 0.5)),
        "20 µs",
    );
    print_line(
        "more than its neighbours, 95 %",
        &us(quantile(&mut more, 0.95)),
        "20 µs",
    );
    print_line(
        "more than its neighbours, at most",
        &us(quantile(&mut more, 1.0)),
        "",
    );
    print_line("allocations of all ticks", &total.to_string(), "0");
    assert_eq!(total, 0, "the engine thread neither allocates nor frees");
}

fn print_line(work: &str, measured: &str, budget: &str) {
    println!("{work:<40}{measured:>14}{budget:>10}");
}

fn us(time: Duration) -> String {
    format!("{:.2} µs", time.as_secs_f64() * 1e6)
}

/// What a tick cost.
struct Cost<T> {
    cost: T,
    takes_over: bool,
    truth: bool,
}

/// Two thousand ticks to warm up, then all swaps; the control thread's work is done between ticks and not counted.
fn course<T>(
    models: &[Model; 2],
    data: &[Tick],
    mut measure: impl FnMut(&mut dyn FnMut()) -> T,
) -> Vec<Cost<T>> {
    let (mut stepper, mut control) =
        pair(&models[0], LiveOptions::default()).expect("the fit belongs to the graph");
    let (warm, rest) = data.split_at(2000);
    for (time, values) in warm {
        stepper.step(*time, values).expect("ticks are in order");
    }
    let mut costs = Vec::new();
    for (nth, (time, values)) in rest[..SWAPS * APART].iter().enumerate() {
        let takes_over = nth % APART == APART / 2;
        if takes_over {
            control
                .stage(&models[(nth / APART + 1) % 2], false)
                .expect("both read the same channels");
            control.commit().expect("the last one has been taken over");
        }
        let before = stepper.engine().plan().nodes.len();
        let cost = measure(&mut || {
            let stepped = stepper.step(*time, values);
            std::hint::black_box(stepped.expect("ticks are in order").outputs);
        });
        let swapped = stepper.engine().plan().nodes.len() != before;
        assert_eq!(swapped, takes_over, "a graph takes over at the next tick");
        costs.push(Cost {
            cost,
            takes_over,
            truth: !values[6].is_nan(),
        });
        control.pump();
    }
    costs
}

fn of(times: &[Cost<Duration>], which: impl Fn(&Cost<Duration>) -> bool) -> Vec<Duration> {
    let chosen = times.iter().filter(|tick| which(tick));
    chosen.map(|tick| tick.cost).collect()
}

/// By how much each commit's tick is longer than the median of its neighbours.
fn extra(times: &[Cost<Duration>]) -> Vec<Duration> {
    let commits = times.iter().enumerate().filter(|(_, tick)| tick.takes_over);
    commits
        .map(|(nth, commit)| {
            let around = &times[nth - NEIGHBOURS..=nth + NEIGHBOURS];
            let mut alike = of(around, |tick| {
                !tick.takes_over && tick.truth == commit.truth
            });
            commit.cost.saturating_sub(quantile(&mut alike, 0.5))
        })
        .collect()
}

fn quantile(times: &mut [Duration], share: f64) -> Duration {
    times.sort_unstable();
    times[((times.len() - 1) as f64 * share).round() as usize]
}
