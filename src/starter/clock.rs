//! Decides which column of a log gives the time, or which two, and in which form.

use athermal::core::time::{Duration, TimeColumns, TimeFormat};
use athermal::files::{Description, TimeForm, is_time_of_day};

use super::column::ends_in_unit;
use super::dates::{self, Dates};
use super::texts::Texts;
use crate::figures::time;

/// The time of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// The column, or those of dates and of times of day.
    pub columns: TimeColumns,
    /// How it is written.
    pub form: TimeForm,
    /// What a graph file says of it beside the column: a key of `[time]` and its value.
    pub declared: Option<(&'static str, String)>,
    /// Why it was taken.
    why: String,
}

const NAMES: [&str; 16] = [
    "time",
    "timestamp",
    "datetime",
    "date",
    "utc",
    "epoch",
    "ts",
    "t",
    "datum",
    "zeit",
    "uhrzeit",
    "clock",
    "elapsed",
    "sample",
    "index",
    "n",
];

/// A unit of a time column's name, as a graph file names it, in nanoseconds.
type Unit = (&'static str, &'static str, i64);

const UNITS: [Unit; 8] = [
    ("ns", "ns", 1),
    ("us", "us", 1_000),
    ("ms", "ms", 1_000_000),
    ("s", "s", 1_000_000_000),
    ("sec", "s", 1_000_000_000),
    ("min", "min", 60_000_000_000),
    ("h", "h", 3_600_000_000_000),
    ("d", "d", 86_400_000_000_000),
];

/// How many nanoseconds stand for one sample, where a log only numbers them.
const SAMPLE_NS: i64 = 1_000_000_000;

impl Clock {
    /// Whether the log only numbers its samples.
    #[must_use]
    pub fn counts_samples(&self) -> bool {
        matches!(self.form, TimeForm::Samples { .. })
    }

    /// A length of time as this log's graph should write it.
    #[must_use]
    pub fn length(&self, seconds: f64) -> String {
        if self.counts_samples() {
            let samples = seconds.round();
            let plural = if samples == 1.0 { "" } else { "s" };
            return format!("{samples} sample{plural}");
        }
        Duration::from_secs_f64(seconds)
            .unwrap_or(Duration::ZERO)
            .to_string()
    }

    /// A length of time for people, to three digits.
    #[must_use]
    pub fn about(&self, seconds: f64) -> String {
        if self.counts_samples() {
            return self.length(seconds);
        }
        time(seconds)
    }

    fn dated(columns: TimeColumns, dates: Dates) -> Self {
        Self {
            columns,
            form: dates.form,
            declared: Some(dates.declared),
            why: dates.why,
        }
    }

    /// What was found, for people.
    #[must_use]
    pub fn remark(&self) -> String {
        let together = match self.columns.is_one() {
            true => "",
            false => " put together,",
        };
        format!("time: `{}`,{together} {}", self.columns, self.why)
    }
}

/// The time of a described log, in the column that was named or the likeliest one.
///
/// # Errors
/// A text that says why there is none.
pub fn find(
    described: &Description,
    named: Option<&str>,
    format: Option<&TimeFormat>,
) -> Result<Clock, String> {
    let clock = |texts: &Texts| match format {
        Some(format) => by_format(texts, format),
        None => clock(described, texts),
    };
    if let Some(name) = named {
        let texts = Texts::named(described, name)?;
        return clock(&texts).ok_or_else(|| no_clock(&texts, format));
    }
    // What is in degrees or in nanometres is no time, however steadily it grows. A name with braces cannot be that of a graph's
    // column of time.
    let may_be = |index: &usize| {
        let name = &described.columns[*index];
        !(ends_in_unit(name) || name.contains(['{', '}']))
    };
    let rank = |index: usize| {
        let name = described.columns[index].to_lowercase();
        let first = words(&name).into_iter().next().unwrap_or_default();
        let known = NAMES.iter().position(|known| *known == first);
        known.unwrap_or(NAMES.len())
    };
    let likely = (0..described.columns.len()).filter(may_be);
    let likely = likely.map(|index| (rank(index), Texts::of(described, index)));
    let mut likely: Vec<(usize, Texts)> = likely.collect();
    likely.sort_by_key(|(rank, _)| *rank);
    let texts = likely.iter().map(|(_, texts)| texts);
    let mut unread = texts.filter(|texts| dates::look_like_times(&texts.read()));
    let unread = unread.find(|texts| clock(texts).is_none());
    // Beside what is meant to be a time, no other column that happens to grow is one.
    let mut found = likely
        .iter()
        .filter(|(rank, _)| unread.is_none() || *rank < NAMES.len())
        .filter_map(|(_, texts)| clock(texts));
    match (found.next(), unread) {
        (Some(clock), _) => Ok(clock),
        (None, Some(unread)) => Err(no_clock(unread, format)),
        (None, None)
            if let Some(back) = likely
                .iter()
                .find(|(rank, texts)| *rank < NAMES.len() && goes_back(texts)) =>
        {
            Err(no_clock(&back.1, format))
        }
        (None, None) => Err(format!(
            "no column advances from row to row as a time does, and a log needs one: a time, or a number that counts its \
             samples; name it with --time (there are {})",
            described.columns.join(", ")
        )),
    }
}

/// Why texts are not the time.
fn no_clock(texts: &Texts, format: Option<&TimeFormat>) -> String {
    let columns = &texts.columns;
    match (texts.first(), format) {
        (Some(first), Some(format)) => {
            format!("`{columns}` has no time as `{format}` says, but such as `{first}`")
        }
        (Some(first), None) if is_time_of_day(first) => format!(
            "`{columns}` has times of day such as `{first}`, and no other column their dates: log these too"
        ),
        (Some(first), None) if dates::look_like_times(&texts.read()) => format!(
            "`{columns}` has times such as `{first}`, in a form that is not known; name it with --time-format as strptime does, \
             e.g. --time-format \"%d.%m.%Y %H:%M:%S\". A time of day alone is not enough: log the date too"
        ),
        _ if goes_back(texts) => {
            format!("`{columns}` goes back from row to row: sort the log, oldest first")
        }
        _ => format!("`{columns}` does not advance from row to row as a time does"),
    }
}

/// Whether these are numbers that fall from row to row.
fn goes_back(texts: &Texts) -> bool {
    let cells = texts.read();
    let numbers = cells.iter().map(|cell| cell.parse::<f64>());
    let numbers: Vec<f64> = numbers.filter_map(Result::ok).collect();
    let fall = numbers.windows(2).filter(|pair| pair[1] < pair[0]).count();
    numbers.len() > 2 && numbers.len() == cells.len() && fall * 100 >= (numbers.len() - 1) * 95
}

/// Texts that have a format.
fn by_format(texts: &Texts, format: &TimeFormat) -> Option<Clock> {
    let dates = dates::by(format.clone());
    let mut cells = texts.read().into_iter();
    let read = cells.any(|cell| dates.form.read(cell.as_bytes()).is_some());
    read.then(|| Clock::dated(texts.columns.clone(), dates))
}

/// The parts of a column's name.
pub fn words(name: &str) -> Vec<&str> {
    name.split(|c: char| !(c.is_alphanumeric() || c == '°' || c == '%' || c == '/'))
        .filter(|word| !word.is_empty())
        .collect()
}

fn clock(described: &Description, texts: &Texts) -> Option<Clock> {
    let cells = texts.read();
    if cells.len() < 2 {
        return None;
    }
    let numbers: Option<Vec<f64>> = cells.iter().map(|cell| cell.parse::<f64>().ok()).collect();
    let Some(numbers) = numbers else {
        // A date that stands beside a time of day is that of many rows.
        let again = cells.windows(2).filter(|pair| pair[0] == pair[1]).count();
        let is_clock = !(again * 2 >= cells.len() && cells.iter().all(|cell| dates::is_date(cell)));
        let dates = dates::of(&cells).filter(|_| is_clock);
        return dates.map(|dates| Clock::dated(texts.columns.clone(), dates));
    };
    let columns = texts.columns.clone();
    let column = columns.title();
    let lower = column.to_lowercase();
    let parts = words(&lower);
    // A clock that steps back once is still a clock; one that is called so may also stand still, where rows share a time.
    let steps = |is: fn(&f64, &f64) -> bool| {
        let pairs = numbers.windows(2);
        pairs.filter(|pair| is(&pair[1], &pair[0])).count()
    };
    let (all, advance) = (numbers.len() - 1, steps(f64::gt));
    let is_called = parts.first().is_some_and(|first| NAMES.contains(first));
    let stands = is_called && steps(f64::ge) * 100 >= all * 95 && advance * 10 >= all;
    if advance * 100 < all * 95 && !stands {
        return None;
    }
    let known = |word: &&str| UNITS.iter().find(|(name, ..)| name == word);
    let below = described.unit(&column);
    let unit = known(&below).or_else(|| parts.iter().skip(1).rev().find_map(known));
    // One wild cell says nothing of the unit that a name says.
    let fits = |&&(_, _, ns_per_unit): &&Unit| {
        let beyond = |number: &&f64| number.abs() * ns_per_unit as f64 >= i64::MAX as f64;
        numbers.iter().filter(beyond).count() * 2 < numbers.len()
    };
    if let Some(&(_, name, ns_per_unit)) = unit.filter(fits) {
        return Some(Clock {
            columns,
            form: TimeForm::Numbers { ns_per_unit },
            declared: declared(name),
            why: match known(&below) {
                Some(_) => format!("numbers in {name}, as the row below its name says"),
                None => format!("numbers in {name}, by its name"),
            },
        });
    }
    let numbered = parts
        .first()
        .is_some_and(|first| ["sample", "index", "n"].contains(first))
        && numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0);
    if numbered {
        return Some(Clock {
            columns,
            form: TimeForm::Samples { step_ns: SAMPLE_NS },
            declared: Some(("step", "1s".to_owned())),
            why: "a sample number; how long a sample takes the log does not say".to_owned(),
        });
    }
    if counts_days(&numbers) {
        return Some(Clock {
            columns,
            form: TimeForm::Numbers {
                ns_per_unit: 86_400_000_000_000,
            },
            declared: declared("d"),
            why: format!(
                "numbers from {} on that rise by parts of one, taken for days as a spreadsheet counts them; if they are \
                 another unit, its name must say so: time_s, time_ms, time_min, time_h",
                numbers[0].floor()
            ),
        });
    }
    // Seconds since 1970 have ten digits before the point until 2286, milliseconds thirteen, and so on.
    let (name, ns_per_unit) = match numbers[0] {
        first if first >= 1e17 => ("ns", 1),
        first if first >= 1e14 => ("us", 1_000),
        first if first >= 1e11 => ("ms", 1_000_000),
        _ => ("s", 1_000_000_000),
    };
    let why = match unit {
        Some((_, by_name, _)) => format!(
            "numbers, taken for {name} since 1970: in {by_name}, as its name says, they lie centuries away"
        ),
        None => format!(
            "numbers, taken for {name} since its name does not say, as time_s, time_ms or time_min would"
        ),
    };
    Some(Clock {
        columns,
        form: TimeForm::Numbers { ns_per_unit },
        declared: declared(name),
        why,
    })
}

/// Whether numbers look like the days of a spreadsheet, of which 40,000 is in 2009 and 60,000 in 2064, at a rate of more
/// than two a day.
fn counts_days(numbers: &[f64]) -> bool {
    let mut steps: Vec<f64> = numbers.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(1.0);
    let days = numbers
        .iter()
        .all(|number| (40_000.0..60_000.0).contains(number));
    days && usual < 0.5
}

/// What a graph file says of numbers of a unit; of seconds nothing.
fn declared(unit: &str) -> Option<(&'static str, String)> {
    (unit != "s").then(|| ("unit", unit.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &'static str) -> Result<Clock, String> {
        find(
            &Description::of_read("log", text.as_bytes(), None, 10).unwrap(),
            None,
            None,
        )
    }

    #[test]
    fn the_form_of_a_time_is_seen_from_its_name_and_cells() {
        for (text, column, form) in [
            ("room,time_s\n1,0\n1,10\n", "time_s", TimeForm::SECONDS),
            (
                "t_ms,a\n0,1\n250,2\n",
                "t_ms",
                TimeForm::Numbers {
                    ns_per_unit: 1_000_000,
                },
            ),
            (
                "Timestamp;a\n2024-01-01T00:00:00Z;1\n2024-01-01T00:00:10Z;2\n",
                "Timestamp",
                TimeForm::Rfc3339,
            ),
            (
                "sample,a\n1,5\n2,5\n3,5\n",
                "sample",
                TimeForm::Samples { step_ns: SAMPLE_NS },
            ),
            (
                "time,a\n1700000000000,5\n1700000000100,5\n",
                "time",
                TimeForm::Numbers {
                    ns_per_unit: 1_000_000,
                },
            ),
            (
                "when;a\n46083,00000000;5\n46083,00034722;5\n46083,00069444;5\n",
                "when",
                TimeForm::Numbers {
                    ns_per_unit: 86_400_000_000_000,
                },
            ),
            (
                "time_s,a\n1772366400000,5\n1772366410000,5\n",
                "time_s",
                TimeForm::Numbers {
                    ns_per_unit: 1_000_000,
                },
            ),
            (
                "time_ms,a\n0,5\n10,5\n20,5\n1e300,5\n",
                "time_ms",
                TimeForm::Numbers {
                    ns_per_unit: 1_000_000,
                },
            ),
            (
                "stamp,a\n1772366400000000,5\n1772366410000000,5\n",
                "stamp",
                TimeForm::Numbers { ns_per_unit: 1_000 },
            ),
            (
                "a;Zeit\n1,5;01.03.2026 12:00:00,0\n1,5;01.03.2026 12:00:00,5\n",
                "Zeit",
                TimeForm::Format("%d.%m.%Y %H:%M:%S%.f".parse().unwrap()),
            ),
            (
                "time_s,a\n46083.00,5\n46083.01,5\n46083.02,5\n",
                "time_s",
                TimeForm::SECONDS,
            ),
            (
                "time,a\n46083,5\n46084,5\n46085,5\n",
                "time",
                TimeForm::SECONDS,
            ),
        ] {
            let clock = found(text).unwrap();
            assert_eq!((&*clock.columns.to_string(), clock.form), (column, form));
        }
    }

    #[test]
    fn what_was_assumed_of_a_time_is_told() {
        let days = found("time,a\n46083.000,5\n46083.001,5\n").unwrap();
        let told = days.remark();
        assert!(told.contains("numbers from 46083 on"), "{told}");
        assert!(
            told.contains("taken for days") && told.contains("time_s"),
            "{told}"
        );
        for (second, zoned) in [
            ("2026-03-02 00:00:30", false),
            ("2026-03-02T00:00:30Z", true),
            ("2026-03-02T00:00:30-01:00", true),
        ] {
            let text = format!("time,a\n2026-03-02T00:00:00Z,1\n{second},2\n");
            let text = std::io::Cursor::new(text);
            let described = Description::of_read("log", text, None, 10).unwrap();
            let told = find(&described, None, None).unwrap().remark();
            assert_eq!(told.contains("without a zone"), !zoned, "{told}");
            assert_eq!(told.contains("taken for UTC"), !zoned, "{told}");
        }
    }

    #[test]
    fn a_time_in_a_form_that_is_not_known_is_told_with_a_cell_and_read_by_a_format_that_is_named() {
        let text = "a,when\n1,12:00 on 01.03.2026\n2,12:01 on 01.03.2026\n";
        let described = Description::of_read("log", text.as_bytes(), None, 10).unwrap();
        for named in [None, Some("when")] {
            let refused = find(&described, named, None).unwrap_err();
            assert!(
                refused.contains("`when` has times such as `12:00 on 01.03.2026`")
                    && refused.contains("--time-format"),
                "{refused}"
            );
        }
        let format: TimeFormat = "%H:%M on %d.%m.%Y".parse().unwrap();
        let clock = find(&described, None, Some(&format)).unwrap();
        assert_eq!(clock.columns, TimeColumns::one("when"));
        let other: TimeFormat = "%d.%m.%Y %H:%M".parse().unwrap();
        for named in [None, Some("when")] {
            let refused = find(&described, named, Some(&other)).unwrap_err();
            assert!(
                refused.contains("`when` has no time as `%d.%m.%Y %H:%M` says"),
                "{refused}"
            );
        }
        assert_eq!(clock.declared, Some(("format", format.to_string())));
        assert!(
            clock.remark().contains("taken for UTC"),
            "{}",
            clock.remark()
        );
    }

    #[test]
    fn a_decimal_comma_is_one_in_seconds_behind_a_date_with_points() {
        let text = "when;a\n01.03.2026 12:00:00,4;1\n01.03.2026 12:00:10,4;2\n";
        let form = TimeForm::Format("%d.%m.%Y %H:%M:%S%.f".parse().unwrap());
        assert_eq!(found(text).unwrap().form, form);
    }

    #[test]
    fn the_unit_of_a_time_may_stand_below_its_name() {
        let clock = found("Time;a\n[ms];\u{b0}C\n0;1\n250;2\n").unwrap();
        assert_eq!(clock.declared, Some(("unit", "ms".to_owned())));
        assert_eq!(clock.why, "numbers in ms, as the row below its name says");
    }

    #[test]
    fn a_time_of_day_is_put_together_with_the_date_beside_it() {
        for (log, columns, declared) in [
            (
                "Date;a;Time\n01.03.2026;1;8:00:00,5\n01.03.2026;2;8:00:10,5\n",
                "{Date} {Time}",
                "%d.%m.%Y %H:%M:%S%.f",
            ),
            (
                "Uhrzeit;Datum;a\n08:00:00;01.03.26;1\n08:00:10;01.03.26;2\n",
                "{Datum} {Uhrzeit}",
                "%d.%m.%y %H:%M:%S%.f",
            ),
            (
                "a,Date,Time\n1,3/13/2026,8:00:00 AM\n2,3/13/2026,8:00:10 AM\n",
                "{Date} {Time}",
                "%m/%d/%Y %I:%M:%S%.f %p",
            ),
            (
                "Date,Time,a\n2026-03-01,08:00,1\n2026-03-01,08:01,2\n",
                "{Date} {Time}",
                "rfc3339",
            ),
            (
                "Date,Time,a\n2026-03-01,8:00:00,1\n2026-03-01,8:00:10,2\n",
                "{Date} {Time}",
                "%Y-%m-%d %H:%M:%S%.f",
            ),
            (
                "Date;Time;a\n20260301;08:00:00;1\n20260301;08:00:10;2\n",
                "{Date} {Time}",
                "rfc3339",
            ),
            (
                "Date;Time;a\n01 Mar 2026;08:00:00;1\n01 Mar 2026;08:00:10;2\n",
                "{Date} {Time}",
                "%d %b %Y %H:%M:%S%.f",
            ),
            // One row a day: the date alone advances too.
            (
                "Day,Clock,a\n2026-03-01,08:00,1\n2026-03-02,08:00,2\n2026-03-03,09:00,2\n",
                "{Day} {Clock}",
                "rfc3339",
            ),
            // What was calibrated once stands further away.
            (
                "calibrated;a;Date;Time\n01.01.2025;1;01.03.2026;08:00:00\n01.01.2025;2;01.03.2026;08:00:10\n",
                "{Date} {Time}",
                "%d.%m.%Y %H:%M:%S%.f",
            ),
        ] {
            let clock = found(log).unwrap();
            assert_eq!(clock.columns.to_string(), columns, "{log}");
            assert_eq!(clock.declared.unwrap().1, declared, "{log}");
        }
        assert_eq!(
            found("Time;a\n12:00:00,400;1\n12:00:10,400;2\n").unwrap_err(),
            "`Time` has times of day such as `12:00:00,400`, and no other column their dates: log these too"
        );
    }

    #[test]
    fn columns_of_date_and_time_may_be_named_each_or_both_with_their_format() {
        let text = "D;T;other;a\n1.13.2026;08:00:00;12:00:00;1\n1.13.2026;08:00:10;12:00:00;2\n";
        let described = Description::of_read("log", text.as_bytes(), None, 10).unwrap();
        assert!(found(text).unwrap_err().contains(
            "`{D} {T}` has times such as `1.13.2026 08:00:00`, in a form that is not known"
        ));
        let format: TimeFormat = "%m.%d.%Y %H:%M:%S".parse().unwrap();
        for named in [None, Some("D"), Some("T"), Some("{D} {T}")] {
            let clock = find(&described, named, Some(&format)).unwrap();
            assert_eq!(clock.columns.to_string(), "{D} {T}", "{named:?}");
            let told = clock.remark();
            assert!(
                told.starts_with("time: `{D} {T}`, put together, dates and times as `%m.%d.%Y %H:%M:%S` without a zone"),
                "{told}"
            );
        }
        let told = |named| find(&described, Some(named), None).unwrap_err();
        assert!(told("{D} {x}").starts_with("there is no column `x`; there are D, T, other, a"));
        assert!(told("{D} {T").starts_with("--time \"{D} {T\": a brace is not closed in `{T`"));
    }

    #[test]
    fn a_log_without_a_time_is_told_to_name_one() {
        let refused = found("a,b\n1,1\n0,0\n2,0\n").unwrap_err();
        assert!(refused.contains("--time"), "{refused}");
    }
}
