//! Decides whether what fills a gap says how old it is.

use super::Subject;
use super::past::made_of;
use crate::node::{Reach, Role};
use crate::recording::Event;
use crate::time::Instant;

/// No value of a feature is newer than all that it is made of. Of one whose answer changes with time alone nothing is known.
pub(super) fn stamps(subject: &Subject<'_>) -> Result<(), String> {
    let Role::Feature(feature) = subject.fixture.plan.nodes[0].spec.role() else {
        return Ok(());
    };
    if feature.every_tick() || feature.closes_loops() {
        return Ok(());
    }
    // Where the values of other ports say when, these are of their time.
    let reach = |port: &str| match feature.reach(port) {
        Reach::First(_) => Reach::Own,
        reach => reach,
    };
    let made_of = made_of(subject, reach);
    let newest = newest(subject);
    for (number, parts) in made_of.iter().enumerate() {
        let slot = subject.fixture.slots().start + number;
        if subject.speaks(slot) {
            continue;
        }
        let delay = parts.iter().map(|part| part.1).max().unwrap_or_default();
        let rows = subject.usual().given(number).zip(&newest);
        for ((now, given), newest) in rows {
            // What is yet to come is another rule.
            let counts = |&(value, stamp): &(f64, Instant)| !value.is_nan() && stamp <= now;
            let Some((_, stamp)) = given.filter(counts) else {
                continue;
            };
            let measured = parts
                .iter()
                .filter_map(|&(channel, _)| newest[channel])
                .max();
            if measured.is_none_or(|measured| stamp <= measured + delay) {
                continue;
            }
            let name = subject.name(number);
            let measured = measured.map_or_else(String::new, |at| format!(" after {at} s"));
            return Err(format!(
                "`{name}` bears the time {stamp} s at {now} s, and nothing that `reach` says it is made of has been measured{measured}"
            ));
        }
    }
    Ok(())
}

/// For each tick when each channel was measured last.
fn newest(subject: &Subject<'_>) -> Vec<Vec<Option<Instant>>> {
    let mut newest = vec![None; subject.fixture.plan.sources.len()];
    let mut all = Vec::new();
    for (event, values) in subject.events() {
        let Event::Row(now) = *event else { continue };
        for (newest, value) in newest.iter_mut().zip(values) {
            if !value.is_nan() {
                *newest = Some(now);
            }
        }
        all.push(newest.clone());
    }
    all
}
