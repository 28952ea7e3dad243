//! Decides in which form a column's dates and times are written; whether it is the time is decided beside it.

use std::sync::LazyLock;

use athermal_core::time::TimeFormat;
use athermal_files::{TimeForm, has_clock, has_zone, zone_of};

/// A remark on dates and times that do not say how far they are from UTC.
pub const WITHOUT_ZONE: &str = "without a zone, taken for UTC; if they are local time, say whose, so that no hour is lost \
     when the clocks go back in autumn: `zone = \"Europe/Berlin\"` in `[time]`";

/// Dates in numbers, the likeliest first. A day that comes first stands before a month that does, where only the numbers could decide.
const DATES: &str = "%d.%m.%Y|%d.%m.%y|%Y/%m/%d|%Y.%m.%d|%Y-%m-%d|%d-%m-%Y|%d-%m-%y|%d/%m/%Y|%d/%m/%y|%m/%d/%Y|%m/%d/%y|\
     %m-%d-%Y|%m-%d-%y|%y/%m/%d|%y-%m-%d|%y.%m.%d|%Y-%d-%m|%Y/%d/%m|%Y.%d.%m";

/// Dates with the name of a month.
const NAMED_DATES: &str =
    "%d-%b-%Y|%d %b %Y|%d-%b-%y|%d %b %y|%d/%b/%Y|%b %d, %Y|%b %d %Y|%Y-%b-%d";

/// Times of day behind a date.
const CLOCKS: &str = "%H:%M:%S%.f|%H:%M|%I:%M:%S%.f %p|%I:%M %p|%H:%M:%S%.f %z|%H:%M %z";

/// Forms that loggers, spreadsheets and measuring programs write, beside that of RFC 3339.
static FORMATS: LazyLock<Vec<TimeFormat>> = LazyLock::new(|| {
    let dates = DATES.split('|').chain(NAMED_DATES.split('|'));
    let with_clocks = |date| {
        CLOCKS
            .split('|')
            .map(move |clock| format!("{date} {clock}"))
    };
    let others =
        "%Y-%m-%d_%H-%M-%S|%a %b %d %H:%M:%S %Y|%Y%m%d %H%M%S|%Y%m%d_%H%M%S|%Y-%d-%mT%H:%M:%S%.f";
    let all = dates.flat_map(with_clocks);
    let all = all.chain(others.split('|').map(str::to_owned));
    all.filter_map(|format| format.parse().ok()).collect()
});

/// Forms that only rows can speak for, since nobody means them who does not say so.
pub fn is_rare(format: &TimeFormat) -> bool {
    let mut orders = ["%Y-%d", "%Y/%d", "%Y.%d"].into_iter();
    orders.any(|order| format.as_str().starts_with(order))
}

/// Two digits are no year before this, in ns since 1970, where another form reads a later one: 2010.
const FIRST_YEAR_NS: i64 = 1_262_304_000_000_000_000;

/// A form of dates and times, with remarks on it.
pub struct Dates {
    /// The form.
    pub form: TimeForm,
    /// What a graph file says of it: a key of `[time]` and its value.
    pub declared: (&'static str, String),
    /// Whether they do not say how far they are from UTC.
    pub lacks_zone: bool,
    /// The zone that a word behind each says.
    pub zone: Option<String>,
    /// Why it was taken.
    pub why: String,
    /// Other forms that read these cells as well, and otherwise.
    pub others: Vec<TimeFormat>,
}

/// The known forms that nearly all of these cells have.
fn fitting(cells: &[String]) -> impl Iterator<Item = TimeFormat> + '_ {
    let fits = |format: &&TimeFormat| {
        let form = TimeForm::Format(TimeFormat::clone(format));
        // There are many forms: few of them read any of the first cells.
        let mut first = cells.iter().take(20);
        first.any(|cell| form.read(cell.as_bytes()).is_some()) && fits(&form, cells)
    };
    FORMATS.iter().filter(fits).cloned()
}

/// The known form that most of these cells have, and how many.
pub fn most(cells: &[String]) -> Option<(TimeFormat, usize)> {
    let read = |format: &TimeFormat| {
        let form = TimeForm::Format(format.clone());
        let read = cells
            .iter()
            .filter(|cell| form.read(cell.as_bytes()).is_some());
        (format.clone(), read.count())
    };
    // The first of equals is the likeliest.
    FORMATS
        .iter()
        .rev()
        .map(read)
        .max_by_key(|(_, count)| *count)
}

/// The form of these cells, if one is known that nearly all of them have: a log may have been written into by hand.
pub fn of(cells: &[String]) -> Option<Dates> {
    if fits(&TimeForm::Rfc3339, cells) {
        let zoned = cells.iter().all(|cell| has_zone(cell.as_bytes()));
        let which = if zoned {
            "as in RFC 3339"
        } else {
            WITHOUT_ZONE
        };
        return Some(Dates {
            form: TimeForm::Rfc3339,
            declared: ("unit", "rfc3339".to_owned()),
            lacks_zone: !zoned,
            zone: None,
            why: format!("dates and times {which}"),
            others: fitting(cells).filter(is_rare).collect(),
        });
    }
    let mut fitting: Vec<TimeFormat> = fitting(cells).collect();
    let year = |format: &TimeFormat| {
        let form = TimeForm::Format(format.clone());
        cells.iter().find_map(|cell| form.read(cell.as_bytes()))
    };
    let is_later = |format: &TimeFormat| year(format) >= Some(FIRST_YEAR_NS);
    if fitting.iter().any(is_later) {
        fitting.retain(is_later);
    }
    let mut fitting = fitting.into_iter();
    let Some(format) = fitting.next() else {
        return with_word(cells);
    };
    let mut found = by(format);
    // That they read these alike says nothing of those that follow: on 03/03 and on 16-05-16 orders are not known apart.
    found.others = fitting.collect();
    Some(found)
}

/// That of dates and times with one word for a zone behind each: `2026-03-02 00:00:00 CET`.
fn with_word(cells: &[String]) -> Option<Dates> {
    let first = cells.first()?;
    let (before, mut word) = first.rsplit_once(' ')?;
    // An offset may stand apart from the word before it: `UTC +1`.
    if let Some(apart) = ["UTC", "GMT"].iter().find(|of| before.ends_with(*of)) {
        word = &first[before.len() - apart.len()..];
    }
    let zone = zone_of(word).filter(|_| word.starts_with(|c: char| c.is_ascii_alphabetic()))?;
    let bare = cells.iter().map(|cell| {
        cell.strip_suffix(word)
            .map(|cell| cell.trim_end().to_owned())
    });
    let bare: Vec<String> = bare.collect::<Option<_>>()?;
    let behind = |format: &TimeFormat| format!("{format} {word}").parse::<TimeFormat>().ok();
    let mut known = fitting(&bare);
    let mut found = by(behind(&known.next()?)?);
    found.others = known.filter_map(|format| behind(&format)).collect();
    found.zone = Some(zone);
    Some(found)
}

/// What elapsed times are called.
const ELAPSED: &str = "elapsed|duration|dauer|laufzeit|runtime|uptime|run time|h:m";

/// That of hours, minutes and seconds since a beginning: they grow, and begin at zero, or go beyond a day, or are called so.
pub fn elapsed(cells: &[String], name: &str) -> Option<Dates> {
    let form = TimeForm::Elapsed;
    let times = cells.iter().filter_map(|cell| form.read(cell.as_bytes()));
    let times: Vec<i64> = times.collect();
    let last = *times.last()?;
    let grow = times.windows(2).filter(|pair| pair[1] >= pair[0]).count();
    let (name, step) = (name.to_lowercase(), last / times.len() as i64);
    let is_called = ELAPSED.split('|').any(|of| name.contains(of));
    let begins = times[0] == 0 || last >= DAY_NS || is_called && times[0] <= 2 * step.max(1);
    let fits = fits(&form, cells) && grow * 100 >= (times.len() - 1) * 95 && last > times[0];
    (fits && (begins || is_called)).then(|| Dates {
        form,
        declared: ("unit", "h:min:s".to_owned()),
        lacks_zone: false,
        zone: None,
        why: format!(
            "hours, minutes and seconds that have elapsed, from {} on",
            cells[0]
        ),
        others: Vec::new(),
    })
}

/// A day in ns.
const DAY_NS: i64 = 86_400_000_000_000;

/// That of a format.
pub fn by(format: TimeFormat) -> Dates {
    let mut why = format!("dates and times as `{format}`");
    let lacks_zone = !format.has_offset();
    if lacks_zone {
        why = format!("{why} {WITHOUT_ZONE}");
    }
    Dates {
        declared: ("format", format.to_string()),
        lacks_zone,
        zone: None,
        why,
        others: Vec::new(),
        form: TimeForm::Format(format),
    }
}

/// Whether cells look like times of day, with or without a date.
pub fn look_like_times(cells: &[String]) -> bool {
    let like = cells.iter().filter(|cell| has_clock(cell));
    like.count() * 2 > cells.len()
}

/// Whether a cell is a date without a time of day.
pub fn is_date(cell: &str) -> bool {
    let is_number = |part: &str| part.parse::<u16>().is_ok();
    let is_month = |part: &str| part.len() == 3 && part.bytes().all(|b| b.is_ascii_alphabetic());
    let parts: Vec<&str> = cell.split(['.', '-', '/', ' ']).collect();
    match parts[..] {
        [first, month, last] => {
            is_number(first) && is_number(last) && (is_number(month) || is_month(month))
        }
        [day] => day.len() == 8 && day.bytes().all(|b| b.is_ascii_digit()),
        _ => false,
    }
}

/// Whether so many are such that the others may be mistakes.
pub fn nearly_all<'a>(
    cells: impl Iterator<Item = &'a str>,
    is_such: impl Fn(&str) -> bool,
) -> bool {
    let (mut such, mut all) = (0, 0);
    for cell in cells {
        such += usize::from(is_such(cell));
        all += 1;
    }
    such * 100 >= all * 95
}

fn fits(form: &TimeForm, cells: &[String]) -> bool {
    let is_read = |cell: &str| form.read(cell.as_bytes()).is_some();
    nearly_all(cells.iter().map(String::as_str), is_read)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(cells: &[&str]) -> Option<Dates> {
        of(&cells
            .iter()
            .map(|&cell| cell.to_owned())
            .collect::<Vec<_>>())
    }

    #[test]
    fn every_format_is_one_and_known_cells_are_read_by_theirs() {
        let count =
            (DATES.split('|').count() + NAMED_DATES.split('|').count()) * CLOCKS.split('|').count();
        assert_eq!(FORMATS.len(), count + 5, "each is a format");
        for (cell, format) in [
            ("01.03.2026 12:00:00", "%d.%m.%Y %H:%M:%S%.f"),
            ("1.3.2026 12:00:00.500", "%d.%m.%Y %H:%M:%S%.f"),
            ("01.03.2026 12:00", "%d.%m.%Y %H:%M"),
            ("01.03.26 12:00:00", "%d.%m.%y %H:%M:%S%.f"),
            ("2026/03/01 12:00:00", "%Y/%m/%d %H:%M:%S%.f"),
            ("01-Mar-2026 12:00:00", "%d-%b-%Y %H:%M:%S%.f"),
            ("13/03/2026 12:00:00", "%d/%m/%Y %H:%M:%S%.f"),
            ("03/13/2026 12:00:00", "%m/%d/%Y %H:%M:%S%.f"),
            ("3/13/26 12:00", "%m/%d/%y %H:%M"),
            ("3/13/26 12:00:00", "%m/%d/%y %H:%M:%S%.f"),
            ("3/13/2026 12:00:00 PM", "%m/%d/%Y %I:%M:%S%.f %p"),
            ("40/03/13 12:00", "%y/%m/%d %H:%M"),
            ("2026-13-03 12:00", "%Y-%d-%m %H:%M"),
            ("13-Mar-2026 1:00 PM", "%d-%b-%Y %I:%M %p"),
            ("20260301_120000", "%Y%m%d_%H%M%S"),
        ] {
            let found = found(&[cell]).unwrap();
            assert_eq!(found.declared, ("format", format.to_owned()), "{cell}");
            assert!(found.others.iter().all(is_rare), "{cell}");
        }
    }

    #[test]
    fn a_day_before_two_digits_of_a_year_stands_before_a_year_that_may_be_first() {
        let found = found(&["21/08/16 9:05:00 PM"]).unwrap();
        assert_eq!(found.declared.1, "%d/%m/%y %I:%M:%S%.f %p");
        assert_eq!(found.others[0].as_str(), "%y/%m/%d %I:%M:%S%.f %p");
    }

    #[test]
    fn a_day_that_may_be_a_month_has_another_form() {
        let found = found(&["01/03/2026 12:00:00", "01/03/2026 12:00:10"]).unwrap();
        assert_eq!(found.declared.1, "%d/%m/%Y %H:%M:%S%.f");
        let others: Vec<&str> = found.others.iter().map(TimeFormat::as_str).collect();
        assert_eq!(others, ["%m/%d/%Y %H:%M:%S%.f"]);
    }

    #[test]
    fn a_time_of_day_alone_is_no_time_and_looks_like_one() {
        for cell in ["12:00:00", "Sunday 12:00"] {
            assert!(found(&[cell]).is_none(), "{cell}");
            assert!(look_like_times(&[cell.to_owned()]), "{cell}");
        }
        for cell in ["12.5", "a:b", ""] {
            assert!(!look_like_times(&[cell.to_owned()]), "{cell}");
        }
    }
}
