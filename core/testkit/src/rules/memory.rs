//! Decides whether a node that starts as far back as its memory reaches knows all that it would know had it always run.

use super::super::compared::course;
use super::Subject;
use crate::node::Role;
use crate::recording::Event;
use crate::time::Instant;

/// How far outputs may be apart, as a share of their largest: what fades is forgotten while a thousandth of it is left.
const LEFT: f64 = 3e-3;

/// After how many ticks others start.
const STARTS: [usize; 3] = [61, 122, 183];

pub(super) fn memory(subject: &Subject<'_>) -> Result<(), String> {
    let plan = &subject.fixture.plan;
    let endless = match plan.nodes[0].spec.role() {
        Role::Feature(feature) => feature.is_endless() || feature.closes_loops(),
        Role::Combiner(combiner) => combiner.is_endless(),
        Role::Estimator(_) => subject.learns(),
    };
    if endless {
        return Ok(());
    }
    let usual = subject.usual();
    for start in STARTS {
        let events = &subject.events()[start..];
        let Some(complete) = complete(events, plan.sources.len()) else {
            continue;
        };
        let late = course(&subject.fixture, &mut subject.engine(), events);
        for number in 0..subject.fixture.slots().len() {
            let largest = usual.largest(number);
            let pairs = usual.values(number).skip(start).zip(late.values(number));
            let known = |now: Instant| now > complete + plan.warm_up;
            let warmed = late.instants().zip(pairs).filter(|(now, _)| known(*now));
            for (now, (always, late)) in warmed {
                // A value more does no harm.
                let close = always.is_nan() || (always - late).abs() <= LEFT * largest;
                if !close {
                    return Err(format!(
                        "`{}` is {late} at {now} s where it started {} before, and {always} where it has always run, though it says to look \
                         back no more than {}",
                        subject.name(number),
                        now - complete,
                        plan.warm_up
                    ));
                }
            }
        }
    }
    Ok(())
}

/// When all channels have been measured.
fn complete(events: &[(Event, Vec<f64>)], channels: usize) -> Option<Instant> {
    let first = |channel: usize| {
        events.iter().find_map(|(event, values)| match event {
            Event::Row(now) if !values[channel].is_nan() => Some(*now),
            _ => None,
        })
    };
    let firsts: Option<Vec<Instant>> = (0..channels).map(first).collect();
    firsts?.into_iter().max()
}
