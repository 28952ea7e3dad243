//! Set points over time. The schedule file, and the set points at an instant.
//!
//! A schedule file is a table with a line of names; `#` starts a comment:
//!
//! ```csv
//! time_h,chuck_degC
//! 0,20
//! 4,30
//! 8,50
//! 12,repeat
//! ```
//!
//! The time is in `time_s`, `time_min` or `time_h` and starts at 0; each other column sets one set point of the machine, an empty cell
//! leaves it as it is. The last row holds to the end, or says `repeat`: from there the table starts again.

mod error;
mod reader;

pub use error::{Reason, ScheduleError};

use super::{SECOND_NS, SetPoint};

/// One set point over time: steps at instants, held in between.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    steps: Vec<(i64, f64)>,
    repeat_ns: Option<i64>,
}

impl Track {
    /// A set point that never changes.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self {
            steps: vec![(0, value)],
            repeat_ns: None,
        }
    }

    /// The set point at `time_ns`; before the start that of the start.
    #[must_use]
    pub fn at(&self, time_ns: i64) -> f64 {
        let time_ns = match self.repeat_ns {
            Some(repeat_ns) if time_ns > 0 => time_ns % repeat_ns,
            _ => time_ns,
        };
        let after = self.steps.partition_point(|step| step.0 <= time_ns);
        self.steps[after.max(1) - 1].1
    }

    /// The first step after `time_ns`, by its instant and its value; none where it holds from there on.
    #[must_use]
    pub fn after(&self, time_ns: i64) -> Option<(i64, f64)> {
        let (first, _) = *self.steps.first()?;
        let round = |begin: i64, within: i64| {
            let mut steps = self.steps.iter();
            let (at, value) = *steps.find(|step| step.0 > within)?;
            Some((begin.saturating_add(at), value))
        };
        let Some(repeat_ns) = self.repeat_ns.filter(|_| time_ns >= 0) else {
            return round(0, time_ns);
        };
        let begin = time_ns - time_ns % repeat_ns;
        let begin_again = begin.saturating_add(repeat_ns);
        round(begin, time_ns % repeat_ns).or_else(|| round(begin_again, first - 1))
    }
}

/// Set points over time, by name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Schedule {
    tracks: Vec<(String, Track)>,
}

impl Schedule {
    /// A schedule that holds each of `levels` of the set point `name` for `hold_s` seconds and then starts again.
    #[must_use]
    pub fn cycle(name: &str, levels: &[f64], hold_s: i64) -> Self {
        let hold_ns = hold_s.max(1).saturating_mul(SECOND_NS);
        let steps: Vec<(i64, f64)> = (0_i64..)
            .map(|index| index.saturating_mul(hold_ns))
            .zip(levels.iter().copied())
            .collect();
        if steps.is_empty() {
            return Self::default();
        }
        let repeat_ns = Some(hold_ns.saturating_mul(steps.len() as i64));
        Self {
            tracks: vec![(name.to_owned(), Track { steps, repeat_ns })],
        }
    }

    /// The names that it sets, in the order of its columns.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.tracks.iter().map(|(name, _)| name.as_str())
    }

    /// Its value of a set point: the default if there is none.
    #[must_use]
    pub fn track(&self, set_point: &SetPoint) -> Track {
        self.tracks
            .iter()
            .find(|(name, _)| name == set_point.name)
            .map_or_else(
                || Track::constant(set_point.default),
                |(_, track)| track.clone(),
            )
    }

    /// Reads a schedule file for a machine that has `set_points`.
    ///
    /// # Errors
    /// All mistakes of the text at once, each with its line.
    pub fn parse(text: &str, set_points: &[SetPoint]) -> Result<Self, Vec<ScheduleError>> {
        reader::read(text, set_points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) const SET_POINTS: [SetPoint; 2] = [
        SetPoint {
            name: "chuck",
            default: 20.0,
            range: [0.0, 150.0],
        },
        SetPoint {
            name: "room",
            default: 21.5,
            range: [15.0, 30.0],
        },
    ];
    const HOUR_NS: i64 = 3600 * SECOND_NS;

    fn parse(text: &str) -> Result<Schedule, Vec<ScheduleError>> {
        Schedule::parse(text, &SET_POINTS)
    }

    #[test]
    fn a_set_point_holds_until_the_next_row_and_the_last_to_the_end() {
        let text =
            "# warm\ntime_h,chuck_degC,room_degC\n0,20,21\n\n1.5,30, # room as it is\n3,,22\n";
        let schedule = parse(text).unwrap();
        let [chuck, room] = [0, 1].map(|i| schedule.track(&SET_POINTS[i]));
        for (at_h, chuck_degc, room_degc) in [
            (0.0, 20.0, 21.0),
            (1.49, 20.0, 21.0),
            (1.5, 30.0, 21.0),
            (3.0, 30.0, 22.0),
            (99.0, 30.0, 22.0),
        ] {
            let at_ns = (at_h * HOUR_NS as f64) as i64;
            assert_eq!(chuck.at(at_ns), chuck_degc, "chuck at {at_h} h");
            assert_eq!(room.at(at_ns), room_degc, "room at {at_h} h");
        }
    }

    #[test]
    fn repeat_starts_the_table_again() {
        let schedule = parse("time_min,chuck_degC\r\n0,20\r\n60,30\r\n120,repeat\r\n").unwrap();
        assert_eq!(schedule, Schedule::cycle("chuck", &[20.0, 30.0], 3600));
        let chuck = schedule.track(&SET_POINTS[0]);
        let hourly: Vec<f64> = (0..5).map(|h| chuck.at(h * HOUR_NS)).collect();
        assert_eq!(hourly, [20.0, 30.0, 20.0, 30.0, 20.0]);
    }

    #[test]
    fn what_a_schedule_does_not_set_has_its_default() {
        let schedule = parse("time_s,chuck_degC\n0,40\n").unwrap();
        assert_eq!(schedule.track(&SET_POINTS[1]).at(HOUR_NS), 21.5);
        assert_eq!(schedule.track(&SET_POINTS[0]).at(-HOUR_NS), 40.0);
    }
}
