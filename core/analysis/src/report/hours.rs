//! From where hours are counted: dates from the first of the data, all other times as the data have them.

use jiff::Timestamp;

use super::Course;
use crate::figures::DATES_S;

/// Where hours are counted from, and what that is called.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hours {
    pub(super) from_s: f64,
    /// `hours`, or `hours since 2026-03-15T08:00:00Z`.
    pub(super) label: String,
}

impl Hours {
    pub(super) fn of(course: &Course) -> Self {
        let first = course.period_s.map(|(first, _)| first.floor());
        let date = first.filter(|first| *first >= DATES_S);
        let date = date.and_then(|from_s| {
            let date = Timestamp::from_second(from_s as i64).ok()?;
            Some((from_s, format!("hours since {date}")))
        });
        let (from_s, label) = date.unwrap_or((0.0, "hours".to_owned()));
        Self { from_s, label }
    }

    /// The first date and the last, where there are dates.
    pub(super) fn dates(&self, last_s: f64) -> Option<String> {
        let date = |at_s: f64| {
            let date = Timestamp::from_second(at_s as i64).ok()?.to_string();
            Some(date.get(..16)?.replace('T', " "))
        };
        let dated = self.from_s > 0.0;
        Some(format!(
            "{} to {} UTC",
            date(dated.then_some(self.from_s)?)?,
            date(last_s)?
        ))
    }

    /// An instant in hours.
    pub(super) fn at(&self, time_s: f64) -> f64 {
        (time_s - self.from_s) / 3600.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hours_are_counted_from_the_first_date_and_else_as_the_data_have_them() {
        let of = |first: f64| {
            Hours::of(&Course {
                period_s: Some((first, first + 3600.0)),
                ..Course::default()
            })
        };
        let dates = of(1_773_561_600.25);
        assert_eq!(dates.label, "hours since 2026-03-15T08:00:00Z");
        assert_eq!(dates.at(1_773_561_600.0 + 7200.0), 2.0);
        let times = of(7200.0);
        assert_eq!((times.label.as_str(), times.at(7200.0)), ("hours", 2.0));
    }
}
