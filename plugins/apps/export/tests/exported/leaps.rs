//! Positions that are zeroed, homed or pushed: truths whose windows hold the leap are none in exported programs, as they are none in the engine.

use std::sync::Arc;

use athermal_core::compile::Plan;
use athermal_core::engine::{Engine, Fitted};
use athermal_core::prng::Prng;
use athermal_core::time::Duration;
use athermal_export::{Options, Rates, export_c, lower, st, state};

use crate::st::{TOLERANCE, compared};
use crate::support::{Event, Exhibit, Scratch, compilers, difference, made_up, plan, stepped};

/// A tick every 10 s, of which 30 are a window of the truth; the tick of a leap, and how many there are.
const WINDOW: usize = 30;
const AT: usize = 150;
const TICKS: usize = 330;

/// Two temperatures and two positions, and their slopes.
const SLOPES: &str = r#"schema = 1
name = "leaps"
[sets]
axis = ["X", "Z"]
[time]
column = "t"
[signals.temperature]
unit = "K"
channels = ["a", "b"]
max_age = "1min"
[signals.position]
unit = "nm"
channels = "axis"
max_age = "1min"
[nodes.gradient]
type = "slope"
inputs.signal = "temperature"
windows = ["5min"]
unit = "K/min"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
unit = "nm/min"
"#;

/// Two axes, each with a model that learns, one of the past of its truth, and a vote.
fn graph() -> (Arc<Plan>, Fitted) {
    let nodes = r#"
[nodes.model]
type = "rls"
each = "axis"
inputs.features = "gradient"
inputs.truth = "drift.{axis}"
ahead = "0s"
[nodes.past]
type = "ar"
each = "axis"
inputs.truth = "drift.{axis}"
ahead = "0s"
lags = ["5min", "10min"]
[nodes.vote]
type = "auto_weighted"
each = "axis"
inputs.voters = ["model.{axis}", "past.{axis}"]
inputs.truth = "drift.{axis}"
memory = "15min"
[outputs]
drift = "drift"
model = "model"
became = "model:learning"
past = "past"
vote = "vote"
weights = "vote:weights"
"#;
    let plan = plan(&format!("{SLOPES}{nodes}"));
    let fitted = made_up(&plan, &mut Prng::stream(1, "leaps"));
    (plan, fitted)
}

fn options() -> Options {
    Options {
        rates: Rates::every(Duration::from_ns(10_000_000_000)),
        ..Options::default()
    }
}

/// Two temperatures that wander, and two positions that follow them with noise of 2 nm; Z is another from some ticks on.
fn history(leap: impl Fn(usize, f64) -> f64) -> Vec<Event> {
    let mut random = Prng::stream(2, "leaps");
    let [mut a, mut b, mut from] = [0.0; 3];
    let tick = |nth: usize| {
        a = 0.999 * a + 0.01 * random.normal();
        b = 0.999 * b + 0.01 * random.normal();
        let mut follows = |of: f64| 2000.0 * of + 2.0 * random.normal();
        let (x, z) = (follows(a), follows(b - a));
        // What is zeroed stands at 0 then.
        from = if nth == AT { z } else { from };
        let samples = vec![a, b, x, z + leap(nth, from)];
        Event::Tick(10_000_000_000 * (1 + nth as i64), samples)
    };
    (0..TICKS).map(tick).collect()
}

/// How the position Z leaps, and after how many ticks the last time.
type Leap = (&'static str, usize, fn(usize, f64) -> f64);
const LEAPS: [Leap; 4] = [
    (
        "zeroed",
        0,
        |nth, from| if nth < AT { 0.0 } else { -3_000.0 - from },
    ),
    ("homed", 0, |nth, _| if nth < AT { 0.0 } else { -60_000.0 }),
    ("pushed", 3, |nth, _| {
        if (AT..AT + 3).contains(&nth) {
            5_000.0
        } else {
            0.0
        }
    }),
    ("leapt twice", 11, |nth, _| match nth {
        ..AT => 0.0,
        nth if nth < AT + 11 => 4_000.0,
        _ => -8_000.0,
    }),
];

#[test]
fn truths_over_a_leap_are_none_in_c_and_in_structured_text_and_those_of_other_axes_stay() {
    let (plan, fitted) = graph();
    let engine = || Engine::new(plan.clone(), &fitted).unwrap();
    let scratch = Scratch::new("leaps");
    let exported = export_c(&engine(), &options(), false).unwrap();
    let exhibit = Exhibit::new(&exported, &scratch.path("c"));
    let in_st = st::export(&engine(), &options()).unwrap();
    let programs: Vec<_> = (compilers().into_iter())
        .map(|compiler| exhibit.built(compiler, &["-O2"], "driver.c"))
        .collect();
    for (name, after, leap) in LEAPS {
        let events = history(leap);
        let expected = stepped(&mut engine(), &events);
        // Drifts of X and Z are the first outputs.
        for (nth, row) in expected.iter().enumerate().skip(WINDOW) {
            let has = |axis: usize| !f64::from_bits(row[axis]).is_nan();
            assert!(has(0), "{name}: X at {nth}");
            let holds = (AT..AT + after + WINDOW - 1).contains(&nth);
            assert!(!(holds && has(1)), "{name}: Z at {nth}");
            let is_beside = (AT - 1..=AT + after + WINDOW).contains(&nth);
            assert!(is_beside || has(1), "{name}: Z at {nth}");
        }
        for program in &programs {
            let (found, said) = exhibit.stepped(program, &events);
            assert_eq!(difference(&exhibit.form, &expected, &found), None, "{name}");
            assert_eq!(said & 3, 0, "{name}: refused or full");
        }
        let (error, values) = compared(&in_st, &engine(), &events, &[]);
        assert!(
            error <= TOLERANCE && values > 2_000,
            "{name}: {error}, {values}"
        );
    }
}

#[test]
fn a_state_that_is_moved_over_amid_a_leap_goes_on_with_the_same_bits() {
    let (plan, fitted) = graph();
    let Some(compiler) = compilers().into_iter().next() else {
        return;
    };
    let scratch = Scratch::new("leaps-moved");
    let engine = || Engine::new(plan.clone(), &fitted).unwrap();
    let exported = export_c(&engine(), &options(), false).unwrap();
    let exhibit = Exhibit::new(&exported, &scratch.path("c"));
    let program = exhibit.built(compiler, &["-O2"], "driver.c");
    let [begin, end] = ["begin", "end"].map(|name| exhibit.folder.join(name));
    for (name, _, leap) in LEAPS {
        let mut events = history(leap);
        // A segment, after which the usual is known still.
        events.insert(AT + 80, Event::Break);
        for cut in [5, AT + 1, AT + 2, AT + 12, AT + 81] {
            let (before, after) = events.split_at(cut);
            let mut through = engine();
            stepped(&mut through, before);
            let saved = state::to_c(&through, &exhibit.form).unwrap();
            std::fs::write(&begin, &saved).unwrap();
            let expected = stepped(&mut through, after);
            let (found, _) = exhibit.stepped_from(&program, after, Some(&begin), None);
            let differs = difference(&exhibit.form, &expected, &found);
            assert_eq!(differs, None, "{name}, to C at {cut}");
            let mut other = engine();
            state::from_c(&mut other, &exhibit.form, &saved).unwrap();
            assert!(
                state::to_c(&other, &exhibit.form).unwrap() == saved,
                "{name}: what the engine takes it gives"
            );
            exhibit.stepped_from(&program, before, None, Some(&end));
            let mut other = engine();
            let saved = std::fs::read(&end).unwrap();
            state::from_c(&mut other, &exhibit.form, &saved).unwrap();
            let found = stepped(&mut other, after);
            let differs = difference(&exhibit.form, &expected, &found);
            assert_eq!(differs, None, "{name}, from C at {cut}");
        }
    }
}

#[test]
fn only_programs_that_go_by_a_truth_with_a_window_look_for_leaps() {
    let text = |inputs: &str, output: &str| {
        format!(
            r#"{SLOPES}
[nodes.model]
type = "linear"
ahead = "0s"
{inputs}
[outputs]
model = "model"
{output}
"#
        )
    };
    let with_window = r#"inputs = { features = "gradient", truth = "drift.Z" }"#;
    let without = r#"inputs = { features = "temperature", truth = "position.Z" }"#;
    let form = |inputs, output| {
        let plan = plan(&text(inputs, output));
        let fitted = made_up(&plan, &mut Prng::stream(1, "few"));
        lower(&Engine::new(plan, &fitted).unwrap(), &options()).unwrap()
    };
    let looks = |form: &athermal_export::Form| form.nodes.iter().any(|of| of.kind == "windowed");
    // As it was fitted, it goes by no truth; nor has a position a window.
    let fixed = form(with_window, "");
    assert!(!looks(&fixed) && !looks(&form(without, "now = \"position.Z\"")));
    let shown = form(with_window, "drift = \"drift.Z\"");
    assert!(looks(&shown));
    assert_eq!(shown.layout.bytes(8) - fixed.layout.bytes(8), 8 * (14 + 18));
}
