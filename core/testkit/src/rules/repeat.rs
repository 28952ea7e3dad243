//! Decides whether the same samples give the same bits: again, elsewhere, beside others, after a break.

use super::super::compared::{Course, course, same_bits};
use super::Subject;
use crate::engine::Engine;
use crate::recording::{Event, Samples, Table, pass};
use crate::time::{Duration, Instant};

pub(super) fn deterministic(subject: &Subject<'_>) -> Result<(), String> {
    let run = || course(&subject.fixture, &mut subject.engine(), subject.events());
    let first = subject.usual();
    let again = run();
    let elsewhere = std::thread::scope(|scope| scope.spawn(run).join());
    let elsewhere = elsewhere.map_err(|_| "it panics on another thread".to_owned())?;
    for (other, which) in [(again, "run again"), (elsewhere, "run on another thread")] {
        if let Some(difference) = first.difference(&other, &subject.fixture) {
            return Err(format!("{which}, it gives other bits: {difference}"));
        }
    }
    Ok(())
}

/// One run over a recording, against one tick by tick beside another instance that is fed something else.
pub(super) fn long_run(subject: &Subject<'_>) -> Result<(), String> {
    // Each on a thread of its own, where nothing of earlier runs is left.
    let (long, by_ticks) = std::thread::scope(|scope| {
        let long = scope.spawn(|| in_one_piece(subject)).join();
        let by_ticks = scope.spawn(|| beside_another(subject)).join();
        (long, by_ticks)
    });
    let panics = |_| "it panics on another thread".to_owned();
    let (long, by_ticks) = (long.map_err(panics)??, by_ticks.map_err(panics)??);
    match long.difference(&by_ticks, &subject.fixture) {
        None => Ok(()),
        Some(difference) => Err(format!(
            "tick by tick beside another instance it gives other bits than in one long run: {difference}"
        )),
    }
}

fn in_one_piece(subject: &Subject<'_>) -> Result<Course, String> {
    let mut course = Course::default();
    let look = |engine: &Engine, event: Event, _: &Samples| {
        if let Event::Row(now) = event {
            course.note(&subject.fixture, engine, now);
        }
    };
    pass(&mut subject.engine(), &subject.table, look).map_err(|error| error.to_string())?;
    Ok(course)
}

fn beside_another(subject: &Subject<'_>) -> Result<Course, String> {
    let (mut engine, mut beside) = (subject.engine(), subject.engine());
    let mut course = Course::default();
    let others = subject.events().iter().rev();
    for ((now, values), (_, other)) in rows(subject.events()).zip(others) {
        beside.step(now, other).map_err(|error| error.to_string())?;
        engine
            .step(now, values)
            .map_err(|error| error.to_string())?;
        course.note(&subject.fixture, &engine, now);
    }
    Ok(course)
}

/// What a feature gives after a break is what a new one gives, at other times too; others must live through it.
pub(super) fn segments(subject: &Subject<'_>) -> Result<(), String> {
    let fixture = &subject.fixture;
    let half = subject.events().len() / 2;
    let (before, after) = subject.events().split_at(half);
    for (shift_s, when) in [(0, "goes on"), (-1_000_000, "starts again in the past")] {
        let shift = Duration::from_ns(shift_s * 1_000_000_000);
        let after = shifted(after, shift);
        let mut engine = subject.engine();
        course(fixture, &mut engine, before);
        engine.segment();
        let broken_off = course(fixture, &mut engine, after.events());
        if !subject.is_feature() {
            elsewhen(subject, before, &after, &broken_off, when)?;
            continue;
        }
        let afresh = course(fixture, &mut subject.engine(), after.events());
        if let Some(difference) = afresh.difference(&broken_off, fixture) {
            return Err(format!(
                "in a segment whose time {when} it gives other outputs than a new node: {difference}"
            ));
        }
    }
    Ok(())
}

/// What was learned before a break goes on after it, and is as old then whenever that is.
fn elsewhen(
    subject: &Subject<'_>,
    before: &[(Event, Vec<f64>)],
    after: &Table,
    found: &Course,
    when: &str,
) -> Result<(), String> {
    let later = shifted(after.events(), Duration::from_ns(3_600_000_000_000));
    let mut engine = subject.engine();
    course(&subject.fixture, &mut engine, before);
    engine.segment();
    let other = course(&subject.fixture, &mut engine, later.events());
    for number in 0..subject.fixture.slots().len() {
        let mut pairs = found.values(number).zip(other.values(number));
        if let Some((one, two)) = pairs.find(|&(one, two)| !same_bits(one, two)) {
            return Err(format!(
                "in a segment whose time {when} `{}` is {one:?}, and {two:?} where that begins an hour later",
                subject.name(number)
            ));
        }
    }
    Ok(())
}

fn rows(events: &[(Event, Vec<f64>)]) -> impl Iterator<Item = (Instant, &[f64])> {
    events.iter().filter_map(|(event, values)| match event {
        Event::Row(now) => Some((*now, values.as_slice())),
        Event::Segment => None,
    })
}

fn shifted(events: &[(Event, Vec<f64>)], by: Duration) -> Table {
    let mut table = Table::default();
    for (now, values) in rows(events) {
        table.push(now + by, values);
    }
    table
}
