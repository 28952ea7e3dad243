//! Decides whether a value is made of what the kind says: of its own channels, as far back as its span, of nothing yet to come.

use super::super::compared::{Course, course};
use super::Subject;
use crate::node::{Feature, Reach, Read, Role};
use crate::recording::{Event, Table};
use crate::time::{Duration, Instant};

/// How far outputs may be apart that do not depend on what differs, as a share of their largest: a sum that slides keeps some
/// rounding of what has left it.
const ROUNDING: f64 = 1e-6;

pub(super) fn past(subject: &Subject<'_>) -> Result<(), String> {
    let usual = subject.usual();
    for number in 0..subject.fixture.slots().len() {
        for (now, given) in usual.given(number) {
            let yet_to_come = |&(value, stamp): &(f64, Instant)| !value.is_nan() && stamp > now;
            if let Some((_, stamp)) = given.filter(yet_to_come) {
                let name = subject.name(number);
                return Err(format!(
                    "`{name}` bears the time {stamp} s at {now} s already"
                ));
            }
        }
    }
    match subject.fixture.plan.nodes[0].spec.role() {
        Role::Feature(feature) => Claims::of(subject, feature, usual).hold(),
        Role::Estimator(_) | Role::Combiner(_) => Ok(()),
    }
}

/// For each output channel the measured channels that it is made of by the reach of its port, each with its delay.
pub(super) fn made_of(
    subject: &Subject<'_>,
    reach: impl Fn(&str) -> Reach,
) -> Vec<Vec<(usize, Duration)>> {
    let (mut inputs, mut next) = (Vec::new(), 0);
    for port in (subject.kind.inputs)() {
        let given = subject.given.iter().find(|given| given.port == port.name);
        let first = next;
        next += given.map_or(0, |given| given.channels);
        if port.read != Read::Truth {
            inputs.push((first..next).collect());
        }
    }
    let fixture = &subject.fixture;
    let ports: Vec<&str> = fixture.slots().map(|slot| fixture.port(slot)).collect();
    let parts = ports.iter().enumerate().map(|(number, port)| {
        let first = ports.iter().position(|other| other == port);
        let width = ports.iter().filter(|other| *other == port).count();
        let nth = number - first.unwrap_or(number);
        reach(port).parts(&inputs, nth, width)
    });
    parts.collect()
}

/// What a feature says of what its outputs are made of.
struct Claims<'a> {
    subject: &'a Subject<'a>,
    usual: &'a Course,
    /// Whether nothing is said of how far back it reaches: it depends on all of the past, or gives what earlier ticks have brought.
    endless: bool,
    /// For each output channel the measured channels, each with its delay.
    made_of: Vec<Vec<(usize, Duration)>>,
}

impl<'a> Claims<'a> {
    fn of(subject: &'a Subject<'a>, feature: &dyn Feature, usual: &'a Course) -> Self {
        Self {
            subject,
            usual,
            endless: feature.is_endless() || feature.closes_loops(),
            made_of: made_of(subject, |port| feature.reach(port)),
        }
    }

    fn hold(&self) -> Result<(), String> {
        let sources = &self.subject.fixture.plan.sources;
        for (channel, source) in sources.iter().enumerate() {
            let other = self.course(|_, of| of == channel);
            self.same(&other, |number, _, _| {
                self.made_of[number].iter().all(|part| part.0 != channel)
            })
            .map_err(|found| {
                format!(
                    "{found} with other values of `{}`, of which `reach` says that it is not made",
                    source.name
                )
            })?;
        }
        let instants: Vec<Instant> = self.usual.instants().collect();
        let cut = instants[instants.len() / 2];
        let after = self.course(|now, _| now > cut);
        self.same(&after, |number, now, _| {
            let delays = self.made_of[number].iter().map(|part| part.1);
            now - delays.min().unwrap_or_default() <= cut
        })
        .map_err(|found| {
            format!("{found} with other values after {cut} s, which `reach` says to be delayed")
        })?;
        if self.endless {
            return Ok(());
        }
        let mut ports = (self.subject.kind.inputs)().iter();
        let held = ports.any(|port| port.read == Read::Held);
        let held = if held {
            self.subject.case.held()
        } else {
            Duration::ZERO
        };
        let before = self.course(|now, _| now <= cut);
        self.same(&before, |number, _, stamp| {
            // Whether there is a value may depend on more than what it is.
            let Some(stamp) = stamp else { return false };
            let slot = self.subject.fixture.slots().start + number;
            let span = self.subject.fixture.plan.channels[slot].channel.span;
            let delays = self.made_of[number].iter().map(|part| part.1);
            stamp - span - held - delays.max().unwrap_or_default() > cut
        })
        .map_err(|found| {
            format!(
                "{found} with other values up to {cut} s, further back than the span of the channel"
            )
        })
    }

    /// What comes out where some values are mirrored within their range.
    fn course(&self, differs: impl Fn(Instant, usize) -> bool) -> Course {
        let subject = self.subject;
        let ranges = subject.given.iter().flat_map(|given| {
            let (low, high) = given.range();
            std::iter::repeat_n(low + high, given.channels)
        });
        let ranges: Vec<f64> = ranges.collect();
        let mut table = Table::clone(&subject.table);
        for (event, row) in table.events_mut() {
            let Event::Row(now) = *event else { continue };
            for (channel, value) in row.iter_mut().enumerate() {
                if differs(now, channel) {
                    *value = ranges[channel] - *value;
                }
            }
        }
        course(&subject.fixture, &mut subject.engine(), table.events())
    }

    /// Where a value differs from the usual that must not: which must not is said of the output channel, the instant and, where there
    /// is a value in both, its stamp.
    fn same(
        &self,
        other: &Course,
        must: impl Fn(usize, Instant, Option<Instant>) -> bool,
    ) -> Result<(), String> {
        for number in 0..self.made_of.len() {
            let largest = self.usual.largest(number);
            let pairs = self.usual.given(number).zip(other.given(number));
            for ((now, one), (_, two)) in pairs {
                let value = |given: Option<(f64, Instant)>| given.map_or(f64::NAN, |given| given.0);
                let stamp = one.map(|given| given.1);
                let (one, two) = (value(one), value(two));
                let stamp = stamp.filter(|_| !one.is_nan() && !two.is_nan());
                let close = (one - two).abs() <= ROUNDING * largest;
                if close || (one.is_nan() && two.is_nan()) {
                    continue;
                }
                if must(number, now, stamp) {
                    let name = self.subject.name(number);
                    return Err(format!("`{name}` is {two} rather than {one} at {now} s"));
                }
            }
        }
        Ok(())
    }
}
