//! How numbers and tables look in text for people.

use std::fmt::Write as _;

use jiff::Timestamp;

pub use crate::diagnostic::{count, counted, digits};
use crate::time::{Duration, Instant};

/// How wide tables may be, in characters.
const WIDTH: usize = 80;

/// A number to three or four significant digits, without an exponent where that is readable.
#[must_use]
pub fn number(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        format!("{value}")
    } else if size != 0.0 && !(1e-3..1e6).contains(&size) {
        format!("{value:.2e}")
    } else if size >= 999.95 || size == 0.0 {
        format!("{value:.0}")
    } else if size >= 99.995 {
        format!("{value:.1}")
    } else if size >= 0.9995 {
        format!("{value:.2}")
    } else {
        digits(value, 3)
    }
}

/// Numbers that are compared, each as `usual` writes it, or to as many significant digits as tell apart those that differ.
#[must_use]
pub fn apart_by<const N: usize>(values: [f64; N], usual: fn(f64) -> String) -> [String; N] {
    // More than a number has.
    const MOST: usize = 17;
    let all_differ = |texts: &[String; N]| {
        let differ = |a: usize, b: usize| values[a] == values[b] || texts[a] != texts[b];
        (0..N).all(|b| (0..b).all(|a| differ(a, b)))
    };
    let exact = (4..=MOST).map(|count| values.map(|value| digits(value, count)));
    let mut texts = std::iter::once(values.map(usual)).chain(exact);
    let first = texts.find(all_differ);
    first.unwrap_or_else(|| values.map(|value| value.to_string()))
}

/// Numbers that are compared, as [`number`] writes them, or to as many digits as tell apart those that differ.
#[must_use]
pub fn apart<const N: usize>(values: [f64; N]) -> [String; N] {
    apart_by(values, number)
}

/// A number as [`number`] writes it where that is all of it, else with all its digits: of what stands still each counts.
#[must_use]
pub fn exact(value: f64) -> String {
    let usual = number(value);
    match usual.parse::<f64>() {
        Ok(read) if read != value => value.to_string(),
        _ => usual,
    }
}

/// A number that may be missing.
#[must_use]
pub fn or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), number)
}

/// A unit of times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeUnit {
    /// Its name, of several: `minutes`.
    pub name: &'static str,
    /// Its symbol: `min`.
    pub symbol: &'static str,
    /// How many seconds it has.
    pub seconds: f64,
}

impl TimeUnit {
    /// The unit in which times of up to so many seconds are read best: the longest of which they have two.
    #[must_use]
    pub fn of(longest_s: f64) -> Self {
        let (name, symbol, seconds) = match longest_s.abs() {
            short if short > 0.0 && short < 1.0 => ("milliseconds", "ms", 1e-3),
            short if short < 120.0 => ("seconds", "s", 1.0),
            long if long >= 172_800.0 => ("days", "d", 86_400.0),
            long if long >= 7_200.0 => ("hours", "h", 3_600.0),
            _ => ("minutes", "min", 60.0),
        };
        Self {
            name,
            symbol,
            seconds,
        }
    }
}

/// A time to three significant digits, in the unit in which it is read best.
#[must_use]
pub fn time(seconds: f64) -> String {
    let unit = TimeUnit::of(seconds);
    let number = digits(seconds / unit.seconds, 3);
    let number = match number.contains('.') && !number.contains('e') {
        true => number.trim_end_matches('0').trim_end_matches('.'),
        false => &number,
    };
    format!("{number} {}", unit.symbol)
}

/// Instants from here on, in s, are dates: 1980, by a clock that began in 1970. A machine does not run for ten years.
pub const DATES_S: f64 = 315_532_800.0;

/// An instant in s.
#[must_use]
pub fn seconds(at: Instant) -> f64 {
    at.as_ns() as f64 / 1e9
}

/// An instant: its date where it has one, else in s as the data have it.
#[must_use]
pub fn instant(at_s: f64) -> String {
    let date = (at_s >= DATES_S).then(|| Timestamp::from_second(at_s as i64).ok());
    date.flatten()
        .map_or_else(|| format!("{at_s} s"), |date| date.to_string())
}

/// The seconds since 1970 of a time as RFC 3339 writes it.
#[must_use]
pub fn unix_seconds(text: &str) -> Option<f64> {
    let at: Timestamp = text.parse().ok()?;
    Some(at.as_second() as f64)
}

/// A time as a graph file states it; one that is too long for that as [`time`] writes it.
#[must_use]
pub fn stated(seconds: f64) -> String {
    Duration::from_secs_f64(seconds).map_or_else(|| time(seconds), length)
}

/// A length of time, to the second where it is longer than a minute, and to the minute where it is longer than an hour.
#[must_use]
pub fn rounded(seconds: f64) -> String {
    let to = match seconds.abs() {
        size if size > 3600.0 => 60.0,
        size if size > 60.0 => 1.0,
        _ => return stated(seconds),
    };
    stated((seconds / to).round() * to)
}

/// A length of time, rounded to the millisecond where it is longer than that.
#[must_use]
pub fn length(duration: Duration) -> String {
    const MILLISECOND_NS: i64 = 1_000_000;
    let ns = duration.as_ns();
    if ns.unsigned_abs() < MILLISECOND_NS as u64 {
        return duration.to_string();
    }
    let rounded = (ns as f64 / MILLISECOND_NS as f64).round() as i64;
    Duration::from_ns(rounded.saturating_mul(MILLISECOND_NS)).to_string()
}

/// A table with the first column to the left and the others to the right, each as wide as it must be. A cell beyond those of the
/// header is a remark, which stands below its row where it does not fit into 80 columns.
#[must_use]
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows
            .iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count());
        cells
            .chain([header[column].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let mut text = String::new();
    let header: Vec<String> = header.iter().map(|&cell| cell.to_owned()).collect();
    for row in std::iter::once(&header).chain(rows) {
        let mut line = String::new();
        for (column, cell) in row.iter().enumerate() {
            match widths.get(column) {
                Some(&width) => {
                    // A width of `format!` ends at 65,535, and a name may be longer.
                    let room = " ".repeat(width - cell.chars().count());
                    let _ = match column {
                        0 => write!(line, "{cell}{room}"),
                        _ => write!(line, "  {room}{cell}"),
                    };
                }
                None if line.chars().count() + 2 + cell.chars().count() > WIDTH => {
                    let _ = write!(line, "\n    {cell}");
                }
                None => {
                    let _ = write!(line, "  {cell}");
                }
            }
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// A table with a row and a column for each of many; columns that do not fit into 80 columns go on below.
#[must_use]
pub fn matrix(corner: &str, columns: &[String], rows: &[(String, Vec<String>)]) -> String {
    let long = |texts: &mut dyn Iterator<Item = &String>| {
        let lengths = texts.map(|text| text.chars().count());
        lengths.max().unwrap_or(0)
    };
    let label = long(&mut rows.iter().map(|(label, _)| label)).max(corner.chars().count()) + 2;
    let mut text = String::new();
    let mut from = 0;
    while from < columns.len() {
        let (mut to, mut used) = (from, label);
        while to < columns.len() {
            let cells = rows.iter().filter_map(|(_, cells)| cells.get(to));
            used += 2 + long(&mut cells.chain([&columns[to]]));
            if used > WIDTH && to > from {
                break;
            }
            to += 1;
        }
        let first = format!("  {corner}");
        let header = std::iter::once(first.as_str());
        let header = header.chain(columns[from..to].iter().map(String::as_str));
        let line = |(label, cells): &(String, Vec<String>)| {
            let label = std::iter::once(format!("  {label}"));
            label.chain(cells[from..to].iter().cloned()).collect()
        };
        let lines: Vec<Vec<String>> = rows.iter().map(line).collect();
        text.push_str(&table(&header.collect::<Vec<_>>(), &lines));
        from = to;
    }
    text
}

/// Words that follow a label, in lines that fit into 80 columns; lines after the first are indented.
#[must_use]
pub fn paragraph(label: &str, indent: usize, words: &str) -> String {
    let mut text = label.to_owned();
    let mut used = label.chars().count();
    let mut begins = label.trim_end().len() < label.len() || label.is_empty();
    for word in words.split_whitespace() {
        let length = word.chars().count();
        let gap = usize::from(!begins);
        if used + gap + length > WIDTH && !begins {
            let _ = write!(text, "\n{:indent$}{word}", "");
            used = indent + length;
        } else {
            text.push_str(&" "[..gap]);
            text.push_str(word);
            used += gap + length;
        }
        begins = false;
    }
    text.push('\n');
    text
}

/// A text of paragraphs and lists in lines that fit into 80 columns; tables and code stay as they are.
#[must_use]
pub fn page(text: &str) -> String {
    let stays = |line: &str| line.starts_with('|') || line.starts_with("    ");
    // Code may have empty lines, and then goes on in the next block.
    let mut in_code = false;
    let blocks = text.split("\n\n").map(|block| {
        let fences = block.lines().filter(|line| line.starts_with("```")).count();
        let is_code = in_code || fences > 0;
        in_code ^= fences % 2 == 1;
        if is_code || block.lines().any(stays) {
            return format!("{block}\n");
        }
        let mut parts: Vec<(&str, String)> = Vec::new();
        for line in block.lines() {
            match (line.strip_prefix("- "), parts.last_mut()) {
                (Some(item), _) => parts.push(("- ", item.to_owned())),
                (None, Some((_, part))) => {
                    part.push(' ');
                    part.push_str(line);
                }
                (None, None) => parts.push(("", line.to_owned())),
            }
        }
        let parts = parts.iter();
        parts
            .map(|(mark, words)| paragraph(mark, mark.len(), words))
            .collect()
    });
    blocks.collect::<Vec<String>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_compared_have_as_many_digits_as_tell_them_apart() {
        let texts = apart([6.637_22, 6.637_24, 6.638_82, 6.638_84]);
        assert_eq!(texts, ["6.63722", "6.63724", "6.63882", "6.63884"]);
        assert_eq!(apart([4957.558, 4957.561]), ["4957.558", "4957.561"]);
        assert_eq!(apart([12_083.7, 12_084.2]), ["12083.7", "12084.2"]);
        assert_eq!(apart([21.5, 850.0]), ["21.50", "850.0"], "as usual");
        assert_eq!(apart([2.0, 2.0]), ["2.00", "2.00"], "they are one");
        let next = [1.0, f64::from_bits(1.0_f64.to_bits() + 1)];
        assert_eq!(apart(next), ["1.0000000000000000", "1.0000000000000002"]);
        assert_eq!(apart([f64::NAN, 0.0]), ["NaN", "0"]);
        assert_eq!(apart([1e9, 1e9 + 1.0]), ["1.000000000e9", "1.000000001e9"]);
    }

    #[test]
    fn pages_keep_lists_and_tables() {
        let long = "word ".repeat(20);
        let text = page(&format!(
            "{long}\n\n- one\n  more\n- {long}\n\n| a | {long} |"
        ));
        let lines: Vec<_> = text.lines().collect();
        let words = |count| vec!["word"; count].join(" ");
        assert_eq!(lines[..4], [&*words(16), &words(4), "", "- one more"]);
        assert_eq!(
            lines[4..6],
            [format!("- {}", words(15)), format!("  {}", words(5))]
        );
        assert!(lines[7].starts_with("| a | word") && lines[7].len() > 80);
    }

    #[test]
    fn pages_keep_code_with_empty_lines() {
        let code = "```toml\n[nodes.a]\n\n[nodes.b]\nahead = 0\n```";
        assert_eq!(
            page(&format!("{code}\n\none\nmore")),
            format!("{code}\n\none more\n")
        );
    }

    #[test]
    fn paragraphs_fit_and_a_word_that_is_too_long_has_a_line_of_its_own() {
        let text = paragraph(
            "  note:",
            6,
            &format!("{} {}", "word ".repeat(20), "x".repeat(90)),
        );
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert_eq!(lines[0], format!("  note:{}", " word".repeat(14)));
        assert_eq!(lines[1], format!("     {}", " word".repeat(6)));
        assert_eq!(lines[2].trim_start().len(), 90);
    }

    #[test]
    fn numbers_keep_the_digits_that_matter() {
        assert_eq!(number(31.7149), "31.71");
        assert_eq!(
            [0.412_3, -0.041_23, 0.009_5].map(number),
            ["0.412", "-0.0412", "0.00950"]
        );
        assert_eq!(number(1234.6), "1235");
        let rounded_up = [999.96, 99.996, 0.9996].map(number);
        assert_eq!(rounded_up, ["1000", "100.0", "1.00"]);
        assert_eq!(number(1e-9), "1.00e-9");
        assert_eq!(number(f64::NAN), "NaN");
    }

    #[test]
    fn times_have_the_unit_in_which_they_are_read_best() {
        let times = [0.0456, 90.0, 3_600.0, 12.0 * 3_600.0, 7.65 * 60.0, 1e7].map(time);
        let expected = ["45.6 ms", "90 s", "60 min", "12 h", "7.65 min", "116 d"];
        assert_eq!(times, expected);
        assert_eq!(TimeUnit::of(0.0).symbol, "s");
        assert_eq!(stated(-150.0), "-150s");
    }

    #[test]
    fn columns_that_do_not_fit_go_on_below() {
        let columns: Vec<String> = (0..20).map(|n| format!("column{n}")).collect();
        let cells = (0..20).map(|n| n.to_string()).collect();
        let text = matrix("of", &columns, &[("row".to_owned(), cells)]);
        assert!(
            text.lines().all(|line| line.chars().count() <= WIDTH),
            "{text}"
        );
        assert_eq!(text.matches("  of ").count(), 3, "{text}");
        assert!(text.contains("column19") && text.trim_end().ends_with("19"));
    }

    #[test]
    fn lengths_are_told_to_the_millisecond() {
        let text = |ns| length(Duration::from_ns(ns));
        assert_eq!(text(1_343_222_575_030), "1343.223s");
        assert_eq!(text(300_000_000_000), "5min");
        assert_eq!(text(12_345), "12.345us");
        assert_eq!(text(0), "0s");
    }

    #[test]
    fn a_remark_that_does_not_fit_beside_its_row_stands_below() {
        let row = |cell: &str, remark: String| vec![cell.to_owned(), "1".to_owned(), remark];
        let rows = [
            row("a", "worse".to_owned()),
            row("b", "x".repeat(70)),
            row("c", "worse".to_owned()),
        ];
        let text = table(&["name", "value"], &rows);
        let below = format!("b         1\n    {}", "x".repeat(70));
        let expected = format!("name  value\na         1  worse\n{below}\nc         1  worse\n");
        assert_eq!(text, expected);
    }

    #[test]
    fn a_cell_may_be_longer_than_formatting_allows() {
        let long = "x".repeat(70_000);
        let text = table(&["name", "value"], &[vec!["a".to_owned(), long.clone()]]);
        assert_eq!(text.lines().nth(1), Some(&*format!("a     {long}")));
    }

    #[test]
    fn lags_are_told_to_the_second_from_a_minute_on_and_to_the_minute_from_an_hour_on() {
        assert_eq!(rounded(-150.05), "-150s");
        assert_eq!(rounded(0.08), "80ms");
        assert_eq!(rounded(-26.666_666_666), "-26.667s");
        assert_eq!(
            (rounded(11_160.0), rounded(15_810.0)),
            ("3h6min".into(), "4h24min".into())
        );
    }
}
