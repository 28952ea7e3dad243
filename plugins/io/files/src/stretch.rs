//! The stretch of time that is taken of a recording. Not which rows may be passed over unread.

use athermal_core::time::{Civil, Instant};

use crate::decimal::Decimal;
use crate::{FileError, TimeColumn, TimeForm};

/// Rows from one time on, and before another; what is none has no end there.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Stretch {
    /// The first time that is taken.
    pub from: Option<Bound>,
    /// The first behind it that is not.
    pub to: Option<Bound>,
}

/// Where a stretch of time begins or ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Bound {
    /// As it is written: as RFC 3339 has it, also a date alone and without an offset, or else as the times of the log are.
    Text(String),
    /// In ns, as the times of rows are.
    Ns(i64),
}

impl Bound {
    /// In ns, where the times of rows are such.
    fn ns(&self, time: &TimeColumn) -> Option<i64> {
        let text = match self {
            Self::Ns(ns) => return Some(*ns),
            Self::Text(text) => text.trim().as_bytes(),
        };
        let is_number = !matches!(time.form, TimeForm::Rfc3339 | TimeForm::Format(_));
        if let Some(number) = Decimal::parse(text).filter(|_| is_number) {
            return match time.form {
                TimeForm::Elapsed => number.times(1_000_000_000),
                _ => time.form.read(text),
            };
        }
        let of_date = TimeColumn {
            form: TimeForm::Rfc3339,
            ..time.clone()
        };
        match of_date.read(text, None).or_else(|| time.read(text, None))? {
            Civil::At(at) => Some(at.as_ns()),
            // The first instant of a day whose midnight no clock has shown, and such.
            Civil::Skipped { offset_s } => TimeForm::Rfc3339
                .read(text)?
                .checked_sub(i64::from(offset_s) * 1_000_000_000),
            Civil::Beyond => None,
        }
    }
}

impl Stretch {
    /// Whether it has an end on either side.
    #[must_use]
    pub fn is_part(&self) -> bool {
        self.from.is_some() || self.to.is_some()
    }

    /// The same in ns, of a log whose times are such.
    ///
    /// # Errors
    /// When a time cannot be read, or no time lies within.
    pub fn of(&self, time: &TimeColumn) -> Result<Self, FileError> {
        let ns = |option: &str, bound: &Option<Bound>| {
            let Some(bound) = bound else { return Ok(None) };
            let ns = bound.ns(time);
            ns.map(Some).ok_or_else(|| FileError::Stretch {
                reason: format!(
                    "{option} {}: this is no time of this log; give an instant such as `2026-03-01T06:00:00Z`, a date such as \
                     `2026-03-01`, or what stands in its column `{}`: {}",
                    words(bound),
                    time.columns.title(),
                    time.form.expected()
                ),
            })
        };
        let (from, to) = (ns("--from", &self.from)?, ns("--to", &self.to)?);
        if let (Some(from_ns), Some(to_ns)) = (from, to)
            && from_ns >= to_ns
        {
            return Err(FileError::Stretch {
                reason: format!(
                    "{}: no time is both at or after the one and before the other; give an earlier `--from` or a later `--to`",
                    self.words()
                ),
            });
        }
        Ok(Self {
            from: from.map(Bound::Ns),
            to: to.map(Bound::Ns),
        })
    }

    /// The options of the command line that name it.
    #[must_use]
    pub fn words(&self) -> String {
        let one = |option: &str, bound: &Option<Bound>| {
            let bound = bound.as_ref()?;
            Some(format!("{option} {}", words(bound)))
        };
        let all = [one("--from", &self.from), one("--to", &self.to)];
        all.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }

    /// The first instant within in ns, and the first behind, of one that is in ns.
    pub(crate) fn ends(&self) -> Option<(i64, i64)> {
        let ns = |bound: &Option<Bound>, all: i64| match bound {
            Some(Bound::Ns(ns)) => *ns,
            _ => all,
        };
        let ends = (ns(&self.from, i64::MIN), ns(&self.to, i64::MAX));
        self.is_part().then_some(ends)
    }

    /// That no row lies within, where those that were read lie from one instant to another.
    pub(crate) fn without_rows(
        &self,
        files: &str,
        time: &TimeColumn,
        outside: Option<(i64, i64)>,
    ) -> FileError {
        let text = |ns| match time.write(Instant::from_ns(ns)) {
            text if text.is_empty() => (ns as f64 / 1e9).to_string(),
            text => text,
        };
        let are = outside.map_or(String::new(), |(first, last)| {
            format!("; its rows are from `{}` to `{}`", text(first), text(last))
        });
        FileError::Stretch {
            reason: format!(
                "{}: {files} has no row of this time{are}; give other times, or leave `--from` and `--to` out",
                self.words()
            ),
        }
    }
}

fn words(bound: &Bound) -> String {
    match bound {
        Bound::Text(text) => text.clone(),
        Bound::Ns(ns) => format!("{ns} ns"),
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::time::TimeColumns;

    use super::*;

    fn ends(
        form: TimeForm,
        zone: Option<&str>,
        from: &str,
        to: &str,
    ) -> Result<(i64, i64), String> {
        let time = TimeColumn {
            columns: TimeColumns::one("t"),
            form,
            zone: zone.map(|zone| zone.parse().unwrap()),
        };
        let of = |text: &str| Some(Bound::Text(text.to_owned())).filter(|_| !text.is_empty());
        let stretch = Stretch {
            from: of(from),
            to: of(to),
        };
        let ends = stretch.of(&time).map_err(|error| error.to_string())?.ends();
        let (from, to) = ends.unwrap();
        Ok((from / 1_000_000_000, to / 1_000_000_000))
    }

    #[test]
    fn dates_instants_and_what_the_log_has_are_read_and_a_date_goes_by_the_clock_of_the_log() {
        let day = 86_400;
        let dates = ("1970-01-02", "1970-01-02T12:00:00+02:00");
        let of = |form, zone| ends(form, zone, dates.0, dates.1);
        assert_eq!(of(TimeForm::Rfc3339, None), Ok((day, day + 10 * 3600)));
        assert_eq!(of(TimeForm::SECONDS, None), Ok((day, day + 10 * 3600)));
        let berlin = of(TimeForm::Rfc3339, Some("Europe/Berlin"));
        assert_eq!(berlin, Ok((day - 3600, day + 10 * 3600)));
        assert_eq!(
            ends(TimeForm::SECONDS, None, "1.5e2", "200"),
            Ok((150, 200))
        );
        let minutes = TimeForm::Numbers {
            ns_per_unit: 60_000_000_000,
        };
        assert_eq!(ends(minutes, None, "2", "3"), Ok((120, 180)));
        let elapsed = ends(TimeForm::Elapsed, None, "0:02:00", "600");
        assert_eq!(elapsed, Ok((120, 600)));
        // Clocks of Beirut were set forward at midnight.
        let at = ends(TimeForm::Rfc3339, Some("Asia/Beirut"), "2024-03-31", "");
        assert_eq!(at.unwrap().0, 1_711_836_000);
    }

    #[test]
    fn what_cannot_be_read_and_what_holds_no_time_is_refused_with_what_to_do() {
        let of = |from, to| ends(TimeForm::Rfc3339, None, from, to).unwrap_err();
        let wrong = of("300", "");
        assert!(
            wrong.contains("--from 300") && wrong.contains("2026-03-01"),
            "{wrong}"
        );
        for (from, to) in [("2026-03-02", "2026-03-01"), ("2026-03-01", "2026-03-01")] {
            let wrong = of(from, to);
            assert!(wrong.contains("earlier `--from`"), "{wrong}");
        }
    }
}
