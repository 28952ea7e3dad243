//! Decides whether missing, huge and infinite samples do harm.

use super::super::compared::{Course, course};
use super::Subject;
use crate::channel::ABSENT;
use crate::recording::{Event, Table};

/// How many ticks later than the others each quarter comes: two gaps of hours, and one of days.
const GAPS: [i64; 4] = [0, 720, 1440, 30_000];

/// Ticks that measure nothing, each channel missing for a while and for all time, and gaps of hours and days.
pub(super) fn absence(subject: &Subject<'_>) -> Result<(), String> {
    let (fixture, ticks) = (&subject.fixture, subject.ticks());
    let mut nothing = subject.table.clone();
    for (_, row) in nothing.events_mut() {
        row.fill(ABSENT);
    }
    let silent = course(fixture, &mut subject.engine(), nothing.events());
    for number in 0..fixture.slots().len() {
        if let Some((_, value)) = silent.find(number, |value| !value.is_nan())
            && !subject.speaks(fixture.slots().start + number)
        {
            let name = subject.name(number);
            return Err(format!(
                "`{name}` is {value} although nothing has ever been measured"
            ));
        }
    }
    for channel in 0..fixture.plan.sources.len() {
        for missing in [0..ticks, ticks / 3..2 * ticks / 3] {
            let always = missing.len() == ticks;
            let mut table = subject.table.clone();
            for (_, row) in &mut table.events_mut()[missing] {
                row[channel] = ABSENT;
            }
            let course = course(fixture, &mut subject.engine(), table.events());
            if always {
                not_made_up(subject, channel, &course)?;
            }
            finite(subject, &course)?;
        }
    }
    let mut late = Table::default();
    for (nth, (event, row)) in subject.events().iter().enumerate() {
        if let Event::Row(now) = event {
            let gap = GAPS[(4 * nth / ticks).min(GAPS.len() - 1)];
            let gap_ns = gap * subject.case.every.as_ns();
            late.push(*now + crate::time::Duration::from_ns(gap_ns), row);
        }
    }
    finite(
        subject,
        &course(fixture, &mut subject.engine(), late.events()),
    )
}

/// Samples of any size for a while; afterwards the node comes back, by itself and in a new segment.
pub(super) fn infinity(subject: &Subject<'_>) -> Result<(), String> {
    let (fixture, ticks) = (&subject.fixture, subject.ticks());
    let ordinary = subject.without_gaps(ticks);
    let expected = course(fixture, &mut subject.engine(), ordinary.events());
    let sizes = [f64::INFINITY, f64::MAX, 1e300, f64::MIN_POSITIVE];
    for (nth, size) in sizes.into_iter().enumerate() {
        let mut table = ordinary.clone();
        for (tick, (_, row)) in table.events_mut()[ticks / 6..ticks / 6 + 40]
            .iter_mut()
            .enumerate()
        {
            for (channel, sample) in row.iter_mut().enumerate() {
                if (tick + channel + nth) % 3 == 0 {
                    // Twice up and twice down, so that a sum of them overflows and its negative does too.
                    *sample = if tick % 12 < 6 { size } else { -size };
                }
            }
        }
        let mut engine = subject.engine();
        let met = course(fixture, &mut engine, table.events());
        engine.segment();
        let after = course(fixture, &mut engine, ordinary.events());
        for (course, when) in [(met, "in the same segment"), (after, "in the next segment")] {
            finite(subject, &course)
                .map_err(|found| format!("with samples of ±{size:e}, {found}"))?;
            for number in 0..fixture.slots().len() {
                let last = ticks / 6 * 5;
                let answers = |of: &Course| of.values(number).skip(last).any(f64::is_finite);
                if answers(&expected) && !answers(&course) {
                    let name = subject.name(number);
                    return Err(format!(
                        "after samples of ±{size:e} `{name}` does not come back {when}"
                    ));
                }
            }
        }
    }
    Ok(())
}

/// What bears the name of a channel that is never there, at the first port of a feature, has no value either.
fn not_made_up(subject: &Subject<'_>, channel: usize, course: &Course) -> Result<(), String> {
    let plan = &subject.fixture.plan;
    let source = &plan.sources[channel].name;
    let first = subject.given.first().map(|given| given.port.as_str());
    let Some((port, missing)) = source.split_once('.') else {
        return Ok(());
    };
    if !subject.is_feature() || first != Some(port) {
        return Ok(());
    }
    for number in 0..subject.fixture.slots().len() {
        let slot = subject.fixture.slots().start + number;
        let named = plan.channels[slot].channel.name.split('@').next();
        if let Some((_, value)) = course.find(number, |value| !value.is_nan())
            && named == Some(missing)
            && !subject.speaks(slot)
        {
            let name = subject.name(number);
            return Err(format!(
                "`{name}` is {value} although `{source}` has never been measured"
            ));
        }
    }
    Ok(())
}

fn finite(subject: &Subject<'_>, course: &Course) -> Result<(), String> {
    for number in 0..subject.fixture.slots().len() {
        if let Some((now, value)) = course.find(number, f64::is_infinite) {
            let name = subject.name(number);
            return Err(format!("`{name}` is {value} at {now} s"));
        }
    }
    Ok(())
}
