//! A session from a program, without the command line: state, restart, beats, and graphs that take over.

use std::cell::RefCell;
use std::path::Path;
use std::time::{Duration as Span, Instant as Clock};

use athermal::run::live::session::WatchedGraph;
use athermal::run::live::{
    Frame, Notice, Replacement, Report, Reporter, Session, SessionOptions, Sink, SinkError,
    StateError, StateStore,
};
use athermal::run::recording::{Event, Recording, Samples, Table};
use athermal::{Instant, Model};

use super::model::s;
use crate::workbench::Scratch;

/// The drift of a position over a window of this length.
fn drift(window: &str) -> String {
    format!(
        "schema = 1\n[time]\ncolumn = \"t\"\n[signals.position]\nunit = \"nm\"\nchannels = [\"Z\"]\nmax_age = \"1min\"\n\
         [nodes.drift]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"{window}\"]\nunit = \"nm/min\"\n\
         [outputs]\nnow = \"drift\"\n"
    )
}

/// What came out: instants, bits and revisions.
#[derive(Default)]
struct Frames(Vec<(Instant, u64, String)>);

impl Sink for Frames {
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
        let bits = frame.outputs[0].to_bits();
        self.0.push((frame.time, bits, frame.revision.to_owned()));
        Ok(())
    }
}

/// The names of reports, in order.
#[derive(Default)]
struct Names(RefCell<Vec<&'static str>>);

impl Reporter for Names {
    fn report(&self, report: Report) {
        self.0.borrow_mut().push(match report {
            Report::NoState(_) => "no state",
            Report::Skipped { .. } => "skipped",
            Report::AllSkipped { .. } => "all skipped",
            Report::Staged { .. } => "staged",
            Report::Swap(Notice::TookOver { .. }) => "took over",
            Report::NotTakenOver { .. } => "not taken over",
            Report::Doubts(..) => return,
            _ => "other",
        });
    }
}

fn value(second: i64) -> f64 {
    (second * second % 17) as f64
}

fn rows(seconds: std::ops::Range<i64>) -> Table {
    let mut table = Table::default();
    for second in seconds {
        table.push(s(second), &[value(second)]);
    }
    table
}

fn options(state: &Path) -> SessionOptions {
    SessionOptions {
        state: Some(StateStore::open(state, false).unwrap()),
        ..SessionOptions::default()
    }
}

/// Runs a model over rows; what came out, and what was reported.
fn run(model: &Model, options: SessionOptions, table: &Table) -> (Frames, Vec<&'static str>) {
    let (names, mut frames) = (Names::default(), Frames::default());
    let mut session = Session::begin(model.clone(), options, &names).unwrap();
    let mut source = table.open(&model.plan).unwrap();
    session.run(&mut *source, &mut frames).unwrap();
    drop(session);
    (frames, names.0.into_inner())
}

#[test]
fn a_session_that_is_started_again_goes_on_to_the_same_bits() {
    let scratch = Scratch::new("session-state");
    let model = Model::load(scratch.file("graph.toml", drift("30s"))).unwrap();
    let state = scratch.path("state");
    let (whole, _) = run(&model, SessionOptions::default(), &rows(0..200));
    let (mut first, reports) = run(&model, options(&state), &rows(0..120));
    assert_eq!(reports, ["no state"]);
    // All rows come again: those that were seen are skipped.
    let (rest, reports) = run(&model, options(&state), &rows(0..200));
    assert_eq!(
        reports,
        ["skipped", "skipped", "skipped"],
        "the 1st, 10th and 100th"
    );
    assert_eq!(rest.0[0].0, s(120));
    first.0.extend(rest.0);
    assert_eq!(first.0, whole.0);
    // From cold, the first rows have no drift.
    let (cold, _) = run(&model, SessionOptions::default(), &rows(120..200));
    assert_ne!(cold.0, whole.0[120..]);
    let (nothing, reports) = run(&model, options(&state), &rows(0..200));
    assert!(nothing.0.is_empty());
    assert_eq!(reports.last(), Some(&"all skipped"));
}

#[test]
fn of_two_sessions_no_more_than_one_holds_a_state() {
    let scratch = Scratch::new("session-held");
    let state = scratch.path("state");
    let _one = StateStore::open(&state, false).unwrap();
    let other = StateStore::open(&state, false);
    assert!(matches!(other, Err(StateError::Held { path }) if path == state));
}

#[test]
fn a_watched_graph_takes_over_and_a_restart_goes_on_with_it() {
    let scratch = Scratch::new("session-watched");
    let graph = scratch.file("graph.toml", drift("30s"));
    let state = scratch.path("state");
    let watched_options = |watched| SessionOptions {
        state: Some(StateStore::open(&state, true).unwrap()),
        frozen: false,
        replacement: Some(Replacement {
            watched: Some(watched),
            ..Replacement::default()
        }),
    };
    let model = Model::load(&graph).unwrap();
    let (names, mut frames) = (Names::default(), Frames::default());
    let options = watched_options(WatchedGraph::of(&graph));
    let mut session = Session::begin(model.clone(), options, &names).unwrap();
    let (mut second, mut samples) = (0, Samples::default());
    let mut push = |session: &mut Session<'_>, frames: &mut Frames| {
        samples.values = vec![value(second)];
        session
            .take(Event::Row(s(second)), &samples, frames)
            .unwrap();
        second += 1;
        frames.0.last().unwrap().2.clone()
    };
    let before = push(&mut session, &mut frames);
    std::fs::write(&graph, drift("20s")).unwrap();
    let began = Clock::now();
    while push(&mut session, &mut frames) == before {
        assert!(began.elapsed() < Span::from_secs(30), "it never took over");
        std::thread::sleep(Span::from_millis(20));
    }
    session.finish(&mut frames).unwrap();
    let after = session.model().revision();
    drop(session);
    assert_eq!(names.0.into_inner(), ["no state", "staged", "took over"]);
    let times: Vec<_> = frames.0.iter().map(|frame| frame.0).collect();
    assert_eq!(
        times,
        (0..second).map(s).collect::<Vec<_>>(),
        "no row is lost"
    );
    // What ran last is there for the next session, whatever the file holds by then.
    let store = StateStore::open(&state, true).unwrap();
    let last = store.last_model().unwrap();
    assert_eq!(last.revision(), after);
    assert_ne!(last.revision(), model.revision());
}

#[test]
fn what_is_pushed_may_swap_freeze_and_let_time_pass() {
    let scratch = Scratch::new("session-pushed");
    let model = Model::load(scratch.file("graph.toml", drift("30s"))).unwrap();
    let other = Model::load(scratch.file("other.toml", drift("20s"))).unwrap();
    let replacement = Some(Replacement::default());
    let options = SessionOptions {
        replacement,
        ..SessionOptions::default()
    };
    let (names, mut frames) = (Names::default(), Frames::default());
    let mut session = Session::begin(model.clone(), options, &names).unwrap();
    let samples = |second: i64| Samples {
        time_text: String::new(),
        values: vec![value(second)],
    };
    for second in 0..60 {
        let taken = session.take(Event::Row(s(second)), &samples(second), &mut frames);
        assert!(taken.unwrap());
    }
    assert!(
        !session.beat(s(30), &mut frames).unwrap(),
        "time does not go back"
    );
    session.freeze(true);
    session.swap("other.toml".into(), other.clone()).unwrap();
    session
        .take(Event::Row(s(60)), &samples(60), &mut frames)
        .unwrap();
    assert_eq!(session.model().revision(), other.revision());
    // Two minutes later nothing in the window is left.
    session.beat(s(180), &mut frames).unwrap();
    session.finish(&mut frames).unwrap();
    drop(session);
    let is_there = |nth: usize| !f64::from_bits(frames.0[nth].1).is_nan();
    assert!(is_there(59) && is_there(60) && !is_there(61));
    assert_eq!(names.0.into_inner(), ["staged", "took over"]);
    // A session without a replacement gives the graph back.
    let mut fixed = Session::begin(model, SessionOptions::default(), &()).unwrap();
    assert!(fixed.swap("other.toml".into(), other).is_err());
}
