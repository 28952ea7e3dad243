use std::cell::RefCell;

use super::super::monitor::Watch;
use super::super::{LiveOptions, SinkError, pair};
use super::*;

/// How often it was flushed.
struct Flushed(u32);

impl Sink for Flushed {
    fn put(&mut self, _frame: &Frame<'_>) -> Result<(), SinkError> {
        Ok(())
    }

    fn flush(&mut self) -> Result<(), SinkError> {
        self.0 += 1;
        Ok(())
    }
}

#[test]
fn a_state_is_saved_after_the_first_row_and_once_a_minute_when_what_came_of_it_was_put_out() {
    let name = format!("athermal-session-{}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let graph = folder.join("graph.toml");
    let text = "schema = 1\nname = \"none\"\nsignals.room = { unit = \"Cel\", channels = [\"air\"] }\n\
                time.column = \"time_s\"\noutputs.room = \"room\"\n";
    std::fs::write(&graph, text).unwrap();
    let model = Model::load(&graph).unwrap();
    let path = folder.join("state");
    let options = SessionOptions {
        state: Some(StateStore::open(&path, false).unwrap()),
        ..SessionOptions::default()
    };
    let mut session = Session::begin(model, options, &()).unwrap();
    let mut sink = Flushed(0);
    let samples = Samples {
        time_text: String::new(),
        values: vec![20.0],
    };
    let mut row = |session: &mut Session<'_>, ns| {
        let event = Event::Row(Instant::from_ns(ns));
        session.take(event, &samples, &mut sink).unwrap();
        sink.0
    };
    assert_eq!(row(&mut session, 1), 1);
    let first = std::fs::read(&path).unwrap();
    assert_eq!(first, session.engine().snapshot());
    assert_eq!(row(&mut session, 2), 1);
    assert_eq!(std::fs::read(&path).unwrap(), first);
    session.saved = Clock::now().checked_sub(SAVE_EVERY).unwrap();
    assert_eq!(row(&mut session, 3), 2);
    assert_eq!(std::fs::read(&path).unwrap(), session.engine().snapshot());
    std::fs::remove_dir_all(&folder).unwrap();
    // The run goes on without its folder too, and fails at the end since nothing is saved.
    session.saved = Clock::now().checked_sub(SAVE_EVERY).unwrap();
    row(&mut session, 4);
    assert!(session.saved.elapsed() < SAVE_EVERY, "it was tried");
    let ended = session.finish(&mut Flushed(0));
    assert!(matches!(ended, Err(RunError::State(_))));
}

/// What was found, with the instants of the rows.
#[derive(Default)]
struct Found(RefCell<Vec<(Instant, Finding)>>);

impl Reporter for Found {
    fn report(&self, report: Report) {
        if let Report::Found(at, _, finding) = report {
            self.0.borrow_mut().push((at, finding));
        }
    }
}

#[test]
fn a_session_and_a_control_find_the_same_of_the_same_rows_also_over_a_swap() {
    let folder = std::env::temp_dir().join(format!("athermal-found-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("graph.toml");
    let graph = |highest: u32| {
        let text = format!(
            "schema = 1\ntime.column = \"time_s\"\noutputs.room = \"room\"\n[signals.room]\nunit = \"Cel\"\nchannels = [\"air\"]\n\
             range = [\"0 Cel\", \"{highest} Cel\"]\n"
        );
        std::fs::write(&path, text).unwrap();
        Model::load(&path).unwrap()
    };
    let (first, second) = (graph(100), graph(50));
    // A row a minute: stuck, out of the range of the first, then of the second, which takes over at row 200; silent at the end.
    let value = |row: i64| match row {
        60..=90 => 21.5,
        100 => 200.0,
        150 | 260 => 75.0,
        300.. => f64::NAN,
        _ => 20.0 + (row % 7) as f64,
    };
    let at = |row: i64| Instant::from_ns(row * 60_000_000_000);

    let found = Found::default();
    let mut watch = Watch::new(&first.plan, &first.plan.sources, &[]);
    let swaps = vec![Swap {
        at: SwapTime::At(at(200)),
        path: path.clone(),
        model: graph(50),
    }];
    let replacement = Some(Replacement {
        swaps,
        ..Replacement::default()
    });
    let options = SessionOptions {
        replacement,
        ..SessionOptions::default()
    };
    let mut session = Session::begin(graph(100), options, &found).unwrap();
    session.watch(&mut watch);
    for row in 0..400 {
        let samples = Samples {
            time_text: String::new(),
            values: vec![value(row)],
        };
        let event = Event::Row(at(row));
        assert!(session.take(event, &samples, &mut Flushed(0)).unwrap());
    }
    session.finish(&mut Flushed(0)).unwrap();

    let (mut stepper, mut control) = pair(&first, LiveOptions::default()).unwrap();
    control.watch(first.sample_ranges());
    let mut by_control = Vec::new();
    for row in 0..400 {
        if row == 200 {
            control.stage(&second, false).unwrap();
            control.commit().unwrap();
        }
        stepper.step(at(row), &[value(row)]).unwrap();
        control.pump();
        by_control.extend(control.found());
    }
    control.end_watch();
    by_control.extend(control.found());

    let by_session = found.0.into_inner();
    let rows = by_session.iter().map(|(at, _)| at.as_ns() / 60_000_000_000);
    assert_eq!(
        rows.collect::<Vec<_>>(),
        [79, 91, 100, 260, 320],
        "{by_session:#?}"
    );
    assert_eq!(by_session, by_control);
    let warnings: Vec<_> = watch.warnings().collect();
    let by_control: Vec<_> = control.watched().unwrap().warnings().collect();
    assert_eq!(warnings, by_control);
    std::fs::remove_dir_all(&folder).unwrap();
}
