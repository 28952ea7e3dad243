//! The forms of numbers that are times, by their names and by their size; and the zone that a name or a word states. Not which
//! column has the time.

use crate::TimeForm;

/// A form of numbers that are times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NumberForm {
    /// Its unit, as `[time]` of a graph file names it.
    pub unit: &'static str,
    /// Nanoseconds in one.
    pub ns: i64,
    /// How far before 1970 it counts from, in ns, where that is its own.
    origin_ns: i128,
    /// What it is called in the names of columns, in small letters; the longer words also with an `s` behind them.
    words: &'static str,
    /// From 1990 to 2100, for numbers that count from a known beginning.
    plausible: Option<(f64, f64)>,
    /// What it is, for people.
    pub title: &'static str,
}

const fn form(unit: &'static str, ns: i64, words: &'static str, title: &'static str) -> NumberForm {
    NumberForm {
        unit,
        ns,
        origin_ns: 0,
        words,
        plausible: None,
        title,
    }
}

const fn since(mut form: NumberForm, origin_ns: i128, from: f64, to: f64) -> NumberForm {
    form.origin_ns = origin_ns;
    form.plausible = Some((from, to));
    form
}

const D: i64 = 86_400_000_000_000;

/// All forms; of several that numbers fit by their size, the first is the likeliest.
const NUMBER_FORMS: [NumberForm; 15] = [
    form("ns", 1, "ns nsec nanos nanosecond", "ns"),
    form("us", 1_000, "us µs μs usec micros microsecond", "µs"),
    form("ms", 1_000_000, "ms msec millis millisecond", "ms"),
    form("s", 1_000_000_000, "s sec second sek sekunde sekunden", "s"),
    form("min", 60_000_000_000, "min minute minuten", "min"),
    form("h", 3_600_000_000_000, "h hr hour std stunde stunden", "h"),
    form("d", D, "d days tage", "days"),
    since(
        form("jd", D, "jd hjd bjd julian juliandate", "Julian days"),
        210_866_760_000_000_000_000,
        2_447_892.5,
        2_488_069.5,
    ),
    since(
        form("mjd", D, "mjd", "modified Julian days"),
        3_506_716_800_000_000_000,
        47_892.0,
        88_069.0,
    ),
    since(
        form(
            "datenum",
            D,
            "datenum",
            "days since the year 0, as MATLAB counts them",
        ),
        62_167_305_600_000_000_000,
        726_834.0,
        767_010.0,
    ),
    since(
        form("d", D, "excel oadate", "days as a spreadsheet counts them"),
        0,
        32_874.0,
        73_051.0,
    ),
    since(
        form("filetime", 100, "filetime", "steps of 100 ns since 1601"),
        11_644_473_600_000_000_000,
        122_756_256_000_000_000.0,
        157_469_184_000_000_000.0,
    ),
    since(
        form("ticks", 100, "ticks", "steps of 100 ns since the year 1"),
        62_135_596_800_000_000_000,
        627_667_488_000_000_000.0,
        662_380_416_000_000_000.0,
    ),
    since(
        form("ms", 1_000_000, "", "ms since 1970"),
        0,
        631_152_000e3,
        4_102_444_800e3,
    ),
    since(
        form("us", 1_000, "", "µs since 1970"),
        0,
        631_152_000e6,
        4_102_444_800e6,
    ),
];

/// The words that a unit stands right behind: `timems`.
const BEFORE_UNITS: [&str; 5] = ["timestamp", "time", "uptime", "elapsed", "zeit"];

impl NumberForm {
    /// How a reader reads it.
    #[must_use]
    pub fn time_form(&self) -> TimeForm {
        match (self.ns, self.origin_ns) {
            (ns_per_unit, 0) => TimeForm::Numbers { ns_per_unit },
            (ns_per_unit, origin_ns) => TimeForm::Since {
                ns_per_unit,
                origin_ns,
            },
        }
    }

    /// That of a unit that stands by itself, below a name or in brackets.
    #[must_use]
    pub fn of_unit(text: &str) -> Option<&'static Self> {
        let text = text.to_lowercase();
        let singular = text.strip_suffix('s').filter(|of| of.len() > 1);
        let is_it = |word| word == text || Some(word) == singular;
        let is_such = |form: &&Self| form.words.split(' ').any(is_it);
        NUMBER_FORMS
            .iter()
            .find(is_such)
            .filter(|_| !text.is_empty())
    }

    /// That which the words of a name say, in small letters: the last that says one; the first word only where it cannot be a letter
    /// for something else.
    #[must_use]
    pub fn of_name(words: &[&str]) -> Option<&'static Self> {
        let mut known = words.iter().enumerate().rev();
        known.find_map(|(place, word)| {
            let whole = Self::of_unit(word).filter(|_| place > 0 || word.chars().count() > 1);
            whole.or_else(|| {
                let mut rest = BEFORE_UNITS.iter();
                Self::of_unit(rest.find_map(|before| word.strip_prefix(before))?)
            })
        })
    }

    /// That of numbers that lie between 1990 and 2100 and rise by steps that a logger has.
    #[must_use]
    pub fn of_size(numbers: &[f64]) -> Option<&'static Self> {
        let mut steps: Vec<f64> = numbers.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        let usual = steps.get(steps.len() / 2).copied()?;
        // Times of a clock in seconds have few digits behind the point, parts of a day have many.
        let is_part = |number: &f64| {
            let thousandths = number * 1e3;
            (thousandths - thousandths.round()).abs() > 1e-4
                || (number * 2.0).fract() == 0.0 && number.fract() != 0.0
        };
        let parts = numbers.iter().filter(|number| is_part(number)).count();
        let fits = |form: &&Self| {
            let (from, to) = form.plausible.unwrap_or((f64::INFINITY, 0.0));
            let within = numbers.iter().filter(|number| (from..to).contains(*number));
            let in_days = form.ns == D;
            within.count() * 100 >= numbers.len() * 95
                && usual > 0.0
                && (!in_days || parts * 2 >= numbers.len() && usual <= 40.0)
        };
        NUMBER_FORMS.iter().find(fits)
    }
}

/// Words for zones, with their offsets; those that name several are none.
const ZONES: &str = "UTC=UTC GMT=UTC CET=+01:00 MEZ=+01:00 CEST=+02:00 MESZ=+02:00 EET=+02:00 EEST=+03:00 EDT=-04:00 \
     CDT=-05:00 MDT=-06:00 MST=-07:00 PDT=-07:00 PST=-08:00 JST=+09:00";

fn zones() -> impl Iterator<Item = (&'static str, &'static str)> {
    ZONES.split(' ').filter_map(|of| of.split_once('='))
}

/// The zone that a text states, as a graph file writes it: `GMT-07:00`, `UTC+1`, `CET`, `+0100`.
#[must_use]
pub fn zone_of(text: &str) -> Option<String> {
    let text = text.trim();
    if let Some((_, zone)) = zones().find(|(word, _)| *word == text) {
        return Some(zone.to_owned());
    }
    let offset = text
        .strip_prefix("UTC")
        .or_else(|| text.strip_prefix("GMT"));
    let offset = offset.unwrap_or(text).trim();
    let digits = offset.strip_prefix(['+', '-'])?;
    let (hours, minutes) = match digits.split_once(':') {
        Some(parts) => parts,
        None if digits.len() == 4 && digits.is_ascii() => digits.split_at(2),
        None => (digits, "0"),
    };
    let number = |part: &str, below: u8| {
        let is_short = (1..=2).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
        is_short
            .then(|| part.parse::<u8>().ok())?
            .filter(|number| *number < below)
    };
    let (hours, minutes) = (number(hours, 15)?, number(minutes, 60)?);
    Some(format!("{}{hours:02}:{minutes:02}", &offset[..1]))
}

/// The zone in the name of a column: `Date Time, GMT-07:00`, `Time - GMT +05:00`, `Time (UTC)`. None of one whose offset has no sign.
#[must_use]
pub fn zone_in_name(name: &str) -> Option<String> {
    let is_end = |c: char| " ,;()[]_".contains(c);
    let mut begins = name
        .char_indices()
        .filter(|(at, _)| name[..*at].chars().next_back().is_none_or(is_end));
    begins.find_map(|(at, _)| {
        let end = name[at..]
            .find(is_end)
            .map_or(name.len(), |length| at + length);
        let word = &name[at..end];
        let is_word = zones().any(|(known, _)| known == word);
        if !is_word && !["UTC", "GMT"].iter().any(|known| word.starts_with(known)) {
            return None;
        }
        // An offset may stand apart from its word, and from its sign.
        let behind = name[end..].trim_start_matches(' ').replace('\u{2212}', "-");
        let offset = behind.strip_prefix(['+', '-']).map(|clock| {
            let clock = clock.trim_start();
            let length = clock.find(|c: char| !(c.is_ascii_digit() || c == ':'));
            format!(
                "{}{}",
                &behind[..1],
                &clock[..length.unwrap_or(clock.len())]
            )
        });
        match offset.filter(|offset| is_word && offset.len() > 1) {
            Some(offset) => zone_of(&offset),
            None if is_word && behind.starts_with(|c: char| c.is_ascii_digit()) => None,
            None => zone_of(word),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_the_unit_of_a_time() {
        for (name, unit) in [
            ("millis", Some("ms")),
            ("micros", Some("us")),
            ("ms", Some("ms")),
            ("minutes", Some("min")),
            ("hours", Some("h")),
            ("time hours", Some("h")),
            ("t ms", Some("ms")),
            ("timems", Some("ms")),
            ("timestampus", Some("us")),
            ("jd", Some("jd")),
            ("datenum", Some("datenum")),
            ("filetime", Some("filetime")),
            ("time in sekunden", Some("s")),
            ("h", None),
            ("s", None),
            ("time", None),
            ("times", Some("s")),
            ("", None),
        ] {
            let words: Vec<&str> = name.split(' ').collect();
            let found = NumberForm::of_name(&words).map(|form| form.unit);
            assert_eq!(found, unit, "{name}");
        }
    }

    #[test]
    fn numbers_between_1990_and_2100_say_their_form_by_their_size() {
        let from = |first: f64, step: f64| {
            (0..20)
                .map(move |nth| first + step * f64::from(nth))
                .collect::<Vec<_>>()
        };
        let minute = 60.0 / 86_400.0;
        for (numbers, title) in [
            (from(2_461_101.5, minute), Some("Julian days")),
            (from(2_461_101.5, 1.0), Some("Julian days")),
            (from(61_101.07, minute), Some("modified Julian days")),
            (
                from(740_043.07, minute),
                Some("days since the year 0, as MATLAB counts them"),
            ),
            (from(134_168_832e9, 6e8), Some("steps of 100 ns since 1601")),
            (
                from(639_080_064e9, 6e8),
                Some("steps of 100 ns since the year 1"),
            ),
            (from(1_772_409_600e3, 60e3), Some("ms since 1970")),
            (from(61_101.0, 1.0), None),
            (from(61_101.0, 0.1), None),
            (from(1000.0, 60.0), None),
            (from(0.0, minute), None),
        ] {
            let found = NumberForm::of_size(&numbers).map(|form| form.title);
            assert_eq!(found, title, "{}", numbers[0]);
        }
        assert_eq!(NumberForm::of_size(&[]), None);
    }

    #[test]
    fn a_name_states_a_zone() {
        for (name, zone) in [
            ("Date Time, GMT-07:00", Some("-07:00")),
            ("Time (UTC)", Some("UTC")),
            ("Time UTC+1", Some("+01:00")),
            ("timestamp_UTC", Some("UTC")),
            ("Zeit [MEZ]", Some("+01:00")),
            ("Time GMT+0530", Some("+05:30")),
            ("Date Time - GMT +05:00", Some("+05:00")),
            ("Time UTC +1", Some("+01:00")),
            ("Time (UTC +05:30)", Some("+05:30")),
            ("Time, UTC \u{2212} 3", Some("-03:00")),
            ("Time UTC - local", Some("UTC")),
            ("Time GMT 05:00", None),
            ("Time UTC +", Some("UTC")),
            ("Time", None),
            ("Time GMTX", None),
            ("Time GMT+99", None),
            ("Time UTCé+", None),
        ] {
            assert_eq!(zone_in_name(name).as_deref(), zone, "{name}");
        }
    }
}
