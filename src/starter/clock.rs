//! Decides which column of a log gives the time, and in which form.

use athermal::core::time::Duration;
use athermal::files::{Description, TimeForm, has_zone};

use super::column::ends_in_unit;
use crate::figures::time;

/// The time of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// The column.
    pub column: String,
    /// How its cells are written.
    pub form: TimeForm,
    /// What a graph file says of it, after the column.
    pub declared: Option<&'static str>,
    /// Why it was taken.
    why: String,
}

const NAMES: [&str; 8] = [
    "time",
    "timestamp",
    "datetime",
    "date",
    "t",
    "sample",
    "index",
    "n",
];

/// Units of a time column's name, as a graph file names them, in nanoseconds.
const UNITS: [(&str, &str, i64); 8] = [
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

    /// What was found, for people.
    #[must_use]
    pub fn remark(&self) -> String {
        format!("time: `{}`, {}", self.column, self.why)
    }
}

/// The time of a described log, in the column that was named or the likeliest one.
///
/// # Errors
/// A text that says why there is none.
pub fn find(described: &Description, named: Option<&str>) -> Result<Clock, String> {
    if let Some(name) = named {
        let index = described.columns.iter().position(|column| column == name);
        let index = index.ok_or_else(|| {
            format!(
                "there is no column `{name}`; there are {}",
                described.columns.join(", ")
            )
        })?;
        return clock(described, index)
            .ok_or_else(|| format!("`{name}` does not advance from row to row as a time does"));
    }
    // What is in degrees or in nanometres is no time, however steadily it grows.
    let measured = |index: &usize| ends_in_unit(&described.columns[*index]);
    let mut likely: Vec<usize> = (0..described.columns.len()).collect();
    likely.retain(|index| !measured(index));
    likely.sort_by_key(|&index| {
        let name = described.columns[index].to_lowercase();
        let first = words(&name).into_iter().next().unwrap_or_default();
        NAMES
            .iter()
            .position(|known| *known == first)
            .unwrap_or(NAMES.len())
    });
    likely
        .into_iter()
        .find_map(|index| clock(described, index))
        .ok_or_else(|| {
            format!(
                "no column advances from row to row as a time does; name it with --time (there are {})",
                described.columns.join(", ")
            )
        })
}

/// The parts of a column's name.
pub fn words(name: &str) -> Vec<&str> {
    name.split(|c: char| !(c.is_alphanumeric() || c == '°' || c == '%' || c == '/'))
        .filter(|word| !word.is_empty())
        .collect()
}

/// What is told of times that do not say how far they are from UTC.
pub const WITHOUT_ZONE: &str = "dates and times without a zone, taken for UTC; if they are local time, the hour that comes twice when \
     the clocks go back in autumn is lost: log in UTC, or with an offset such as +01:00";

fn clock(described: &Description, index: usize) -> Option<Clock> {
    let column = described.columns[index].clone();
    let cells: Vec<&str> = described
        .rows
        .iter()
        .filter_map(|row| row.get(index))
        .map(|cell| cell.trim())
        .filter(|cell| !cell.is_empty())
        .collect();
    if cells.len() < 2 {
        return None;
    }
    let numbers: Option<Vec<f64>> = cells
        .iter()
        .map(|cell| cell.replace(',', ".").parse::<f64>().ok())
        .collect();
    let Some(numbers) = numbers else {
        let dated = cells.iter().all(|cell| {
            let bytes = cell.as_bytes();
            bytes.len() >= 10 && bytes[..4].iter().all(u8::is_ascii_digit) && bytes[4] == b'-'
        });
        let why = if cells.iter().all(|cell| has_zone(cell.as_bytes())) {
            "dates and times as in RFC 3339"
        } else {
            WITHOUT_ZONE
        };
        return dated.then(|| Clock {
            column,
            form: TimeForm::Rfc3339,
            declared: Some("unit = \"rfc3339\""),
            why: why.to_owned(),
        });
    };
    // A clock that steps back once is still a clock.
    let steps = numbers.windows(2).filter(|pair| pair[1] > pair[0]).count();
    if steps * 100 < (numbers.len() - 1) * 95 {
        return None;
    }
    let lower = column.to_lowercase();
    let parts = words(&lower);
    let unit = parts
        .iter()
        .skip(1)
        .rev()
        .find_map(|word| UNITS.iter().find(|(name, ..)| name == word));
    if let Some(&(_, name, ns_per_unit)) = unit {
        return Some(Clock {
            column,
            form: TimeForm::Numbers { ns_per_unit },
            declared: declared(name),
            why: format!("numbers in {name}, by its name"),
        });
    }
    let numbered = parts
        .first()
        .is_some_and(|first| ["sample", "index", "n"].contains(first))
        && numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0);
    if numbered {
        return Some(Clock {
            column,
            form: TimeForm::Samples { step_ns: SAMPLE_NS },
            declared: Some("step = \"1s\""),
            why: "a sample number; how long a sample takes the log does not say".to_owned(),
        });
    }
    if counts_days(&numbers) {
        return Some(Clock {
            column,
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
    // Seconds since 1970 have ten digits before the point until 2286, milliseconds thirteen.
    let (name, ns_per_unit) = if numbers[0] >= 1e11 {
        ("ms", 1_000_000)
    } else {
        ("s", 1_000_000_000)
    };
    Some(Clock {
        column,
        form: TimeForm::Numbers { ns_per_unit },
        declared: declared(name),
        why: format!("numbers, taken for {name} since its name does not say"),
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

fn declared(unit: &str) -> Option<&'static str> {
    Some(match unit {
        "ns" => "unit = \"ns\"",
        "us" => "unit = \"us\"",
        "ms" => "unit = \"ms\"",
        "min" => "unit = \"min\"",
        "h" => "unit = \"h\"",
        "d" => "unit = \"d\"",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &'static str) -> Result<Clock, String> {
        find(
            &Description::of_read("log", text.as_bytes(), None, 10).unwrap(),
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
            assert_eq!((clock.column.as_str(), clock.form), (column, form));
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
            let told = find(&described, None).unwrap().remark();
            assert_eq!(told.contains("without a zone"), !zoned, "{told}");
            assert_eq!(told.contains("taken for UTC"), !zoned, "{told}");
        }
    }

    #[test]
    fn a_log_without_a_time_is_told_to_name_one() {
        let refused = found("a,b\n1,1\n0,0\n2,0\n").unwrap_err();
        assert!(refused.contains("--time"), "{refused}");
    }
}
