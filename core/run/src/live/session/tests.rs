use super::super::SinkError;
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
