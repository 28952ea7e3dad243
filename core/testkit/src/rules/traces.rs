//! Decides whether an answer that is asked for changes later ones.

use super::super::compared::Course;
use super::Subject;
use crate::prng::Prng;
use crate::recording::Event;

pub(super) fn no_trace(subject: &Subject<'_>) -> Result<(), String> {
    let fixture = &subject.fixture;
    let undisturbed = subject.usual();
    let (mut engine, mut disturbed) = (subject.engine(), Course::default());
    let mut random = Prng::stream(31, "idle questions");
    for (event, values) in subject.events() {
        if let Event::Row(now) = event {
            engine.ask_idly(&mut || random.between(-1e3, 1e3));
            engine
                .step(*now, values)
                .map_err(|error| error.to_string())?;
            engine.ask_idly(&mut || random.between(-1e3, 1e3));
            disturbed.note(fixture, &engine, *now);
        }
    }
    match undisturbed.difference(&disturbed, fixture) {
        None => Ok(()),
        Some(difference) => Err(format!(
            "asked for answers that nobody wanted, it gives others later: {difference}"
        )),
    }
}
