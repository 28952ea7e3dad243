//! Decides which column of a log gives the time, or which two, and in which form.

use athermal_core::time::{Duration, Instant, TimeColumns, TimeFormat};
use athermal_files::{
    Description, NumberForm, TimeColumn, TimeForm, is_time_of_day, zone_in_name, zone_of,
};

use super::dates::{self, Dates};
use super::name::{ends_in_unit, words};
use super::texts::Texts;
use super::time_form;
use athermal_analysis::figures::{exact, number, time};

/// The time of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// The column, or those of dates and of times of day.
    pub columns: TimeColumns,
    /// How it is written.
    pub form: TimeForm,
    /// What a graph file says of it beside the column: a key of `[time]` and its value.
    pub declared: Option<(&'static str, String)>,
    /// Whether these are dates and times that do not say how far they are from UTC.
    pub lacks_zone: bool,
    /// The zone that the log states beside them.
    pub zone: Option<String>,
    /// Why it was taken.
    pub(super) why: String,
    /// Other forms that read the first rows as well, and otherwise.
    pub(super) others: Vec<TimeFormat>,
}

/// What a time is called, the likeliest first.
const NAMES: &str = "time timestamp datetime date utc epoch ts t datum zeit uhrzeit clock elapsed uptime jd mjd bjd hjd datenum filetime millis \
     milliseconds micros microseconds ms us seconds secs minutes mins hours hrs days stunden minuten sekunden sample index n";

/// The place of a word among the names of a time.
fn place_of(word: &str) -> Option<usize> {
    NAMES.split(' ').position(|name| name == word)
}

/// What a column of zones beside the times is called.
const ZONE_NAMES: &str = "zone|tz|timezone|time zone|utc offset|utc_offset|zeitzone";

/// How many nanoseconds stand for one sample, where a log only numbers them.
const SAMPLE_NS: i64 = 1_000_000_000;

impl Clock {
    /// Whether the log only numbers its samples.
    #[must_use]
    pub fn counts_samples(&self) -> bool {
        matches!(self.form, TimeForm::Samples { .. })
    }

    /// How a reader reads it.
    #[must_use]
    pub fn column(&self) -> TimeColumn {
        TimeColumn {
            columns: self.columns.clone(),
            form: self.form.clone(),
            zone: self.zone.as_ref().and_then(|zone| zone.parse().ok()),
        }
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

    /// The time at which the last fifth of a log begins, as `--from` and `--to` take it; none where the log is too short for that.
    #[must_use]
    pub fn last_fifth(&self, (first, last): (i64, i64)) -> Option<String> {
        const MINUTE_NS: i128 = 60_000_000_000;
        let (from, length) = (i128::from(first), i128::from(last) - i128::from(first));
        let (unit, origin) = match self.form {
            TimeForm::Numbers { ns_per_unit } => (i128::from(ns_per_unit), 0),
            TimeForm::Samples { step_ns } => (i128::from(step_ns), 0),
            TimeForm::Since {
                ns_per_unit,
                origin_ns,
            } => (i128::from(ns_per_unit), origin_ns),
            _ if length > 3000 * MINUTE_NS => (60 * MINUTE_NS, 0),
            _ if length > 100 * MINUTE_NS => (MINUTE_NS, 0),
            _ => (1_000_000_000, 0),
        };
        // A round number of the log's own units, of which a fifth has many.
        let mut step = unit;
        let is_number = matches!(
            self.form,
            TimeForm::Numbers { .. } | TimeForm::Since { .. } | TimeForm::Samples { .. }
        );
        while step > length / 100 && step % 10 == 0 && is_number && !self.counts_samples() {
            step /= 10;
        }
        while step * 10 <= length / 100 && is_number {
            step *= 10;
        }
        let at = (from + length * 4 / 5 + origin).div_euclid(step) * step - origin;
        let at = i64::try_from(at)
            .ok()
            .filter(|at| (first + 1..=last).contains(at))?;
        let text = self.column().write(Instant::from_ns(at));
        Some(match text.is_empty() {
            true => exact(at as f64 / 1e9),
            false => text,
        })
    }

    pub(super) fn dated(columns: TimeColumns, dates: Dates) -> Self {
        Self {
            columns,
            form: dates.form,
            declared: Some(dates.declared),
            lacks_zone: dates.lacks_zone,
            zone: dates.zone,
            why: dates.why,
            others: dates.others,
        }
    }

    /// The same with the zone that the name of its column states, or that a column beside it has in each row.
    fn with_zone(mut self, described: &Description) -> Self {
        if !self.lacks_zone {
            return self;
        }
        let mut names = self.columns.names().iter();
        let in_name = names.find_map(|name| zone_in_name(name));
        let is_zone = |name: &String| ZONE_NAMES.split('|').any(|of| of == name.to_lowercase());
        let beside = described.columns.iter().position(is_zone).and_then(|at| {
            let mut cells = described.rows.iter().map(|row| row.get(at));
            let first = cells.next()??;
            cells
                .all(|cell| cell == Some(first))
                .then(|| zone_of(first))?
        });
        if let Some(zone) = in_name.or(beside).or_else(|| self.zone.clone()) {
            self.why = self.why.replace(dates::WITHOUT_ZONE, "");
            self.why = format!("{} in the zone {zone}", self.why.trim_end());
            self.zone = Some(zone);
            self.lacks_zone = false;
        }
        self
    }

    /// What was found, for people.
    #[must_use]
    pub fn remark(&self) -> String {
        let together = match self.columns.is_one() {
            true => "",
            false => " put together,",
        };
        let mut others = self.others.iter().map(|other| format!("`{other}`"));
        let other = others.next().map_or_else(String::new, |first| {
            let all = others.fold(first, |all, other| format!("{all} or {other}"));
            format!("; they may as well be {all}: if so, give that with --time-format")
        });
        format!("time: `{}`,{together} {}{other}", self.columns, self.why)
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
        Some(format) => by_format(texts, format).ok(),
        None => clock(described, texts),
    };
    if let Some(name) = named {
        let texts = Texts::named(described, name)?;
        let clock = clock(&texts).ok_or_else(|| no_clock(&texts, format))?;
        return Ok(clock.with_zone(described));
    }
    // What is in degrees or in nanometres is no time, however steadily it grows. A name with braces cannot be that of a graph's
    // column of time.
    let may_be = |index: &usize| {
        let name = &described.columns[*index];
        !(ends_in_unit(name) || name.contains(['{', '}']))
    };
    let rank = |index: usize| {
        let name = described.columns[index].to_lowercase();
        let first = words_of_time(&name).into_iter().next().unwrap_or_default();
        place_of(first).unwrap_or(usize::MAX)
    };
    let likely = (0..described.columns.len()).filter(may_be);
    let likely = likely.map(|index| (rank(index), Texts::of(described, index)));
    let mut likely: Vec<(usize, Texts)> = likely.collect();
    // A number that grows may count anything, a date is one.
    let is_number = |texts: &Texts| {
        texts
            .first()
            .is_some_and(|text| text.parse::<f64>().is_ok())
    };
    likely.sort_by_key(|(rank, texts)| (*rank, is_number(texts)));
    let texts = likely.iter().map(|(_, texts)| texts);
    let mut unread = texts.filter(|texts| looks_like_times(texts));
    let unread = unread.find(|texts| clock(texts).is_none());
    // Beside what is meant to be a time, no other column that happens to grow is one.
    let mut found = likely
        .iter()
        .filter(|(rank, _)| unread.is_none() || *rank < usize::MAX)
        .filter_map(|(_, texts)| clock(texts));
    match (found.next(), unread) {
        (Some(clock), _) => Ok(clock.with_zone(described)),
        (None, Some(unread)) => Err(no_clock(unread, format)),
        (None, None)
            if let Some(back) = likely
                .iter()
                .find(|(rank, texts)| *rank < usize::MAX && goes_back(texts)) =>
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

/// Whether texts are dates and times, in whatever form.
fn looks_like_times(texts: &Texts) -> bool {
    let cells = texts.read();
    dates::look_like_times(&cells) || time_form::fitting(&cells).is_some()
}

/// Why texts are not the time.
fn no_clock(texts: &Texts, format: Option<&TimeFormat>) -> String {
    let columns = &texts.columns;
    match (texts.first(), format) {
        (Some(first), Some(format)) => {
            let cells = texts.read();
            let fitting = dates::of(&cells).map(|of| of.why);
            let other = by_format(texts, format).err().flatten();
            let other = other.map(|other| format!("`{other}` fits more of them"));
            let way =
                other.or(fitting.map(|why| format!("leave --time-format out: they are {why}")));
            let way = way
                .or(cure(&cells))
                .map_or_else(String::new, |way| format!("; {way}"));
            format!("`{columns}` has no time as `{format}` says, but such as `{first}`{way}")
        }
        (Some(first), None) if is_time_of_day(first) => format!(
            "`{columns}` has times of day such as `{first}`, and no other column their dates: log these too"
        ),
        (Some(first), None) if looks_like_times(texts) => format!(
            "`{columns}` has times such as `{first}`, in a form that is not known; {}",
            cure(&texts.read()).unwrap_or_default()
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

/// What can be done about times of an unknown form.
fn cure(cells: &[String]) -> Option<String> {
    cells.first()?;
    Some(match time_form::fitting(cells) {
        Some(format) => format!("give it: --time-format \"{format}\""),
        None => {
            "no form of --time-format fits them all: write them as 2026-03-31 14:05:00, with the date".to_owned()
        }
    })
}

/// Texts that have a format: most of those with digits, and no fewer than have another.
///
/// # Errors
/// The form that more of them have, where one is known.
fn by_format(texts: &Texts, format: &TimeFormat) -> Result<Clock, Option<TimeFormat>> {
    let dates = dates::by(format.clone());
    let cells = texts.read();
    let read = cells
        .iter()
        .filter(|cell| dates.form.read(cell.as_bytes()).is_some());
    let (read, has_digit) = (read.count(), |cell: &&String| {
        cell.contains(|c: char| c.is_ascii_digit())
    });
    let most = dates::most(&cells).filter(|(_, others)| *others > read);
    if read == 0 || read * 2 < cells.iter().filter(has_digit).count() || most.is_some() {
        return Err(most.map(|(format, _)| format));
    }
    Ok(Clock::dated(texts.columns.clone(), dates))
}

/// The parts of the name of a time in small letters, a unit behind a slash too.
fn words_of_time(name: &str) -> Vec<&str> {
    let words = words(name).into_iter();
    words.flat_map(|word| word.split('/')).collect()
}

/// What texts are as a time.
pub(super) fn clock(described: &Description, texts: &Texts) -> Option<Clock> {
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
        let dates = dates.or_else(|| dates::elapsed(&cells, &texts.columns.title()));
        return dates.map(|dates| Clock::dated(texts.columns.clone(), dates));
    };
    let columns = texts.columns.clone();
    let column = columns.title();
    let lower = column.to_lowercase();
    let parts = words_of_time(&lower);
    // A clock that steps back once is still a clock; one that is called so may also stand still, where rows share a time.
    let steps = |is: fn(&f64, &f64) -> bool| {
        let pairs = numbers.windows(2);
        pairs.filter(|pair| is(&pair[1], &pair[0])).count()
    };
    let (all, advance) = (numbers.len() - 1, steps(f64::gt));
    let is_called = parts.first().is_some_and(|first| place_of(first).is_some());
    let stands = is_called && steps(f64::ge) * 100 >= all * 95 && advance * 10 >= all;
    if advance * 100 < all * 95 && !stands {
        return None;
    }
    let below = NumberForm::of_unit(described.unit(&column));
    let x_value = (lower == "x_value").then(|| NumberForm::of_unit("s"));
    let unit = below.or_else(|| x_value.unwrap_or_else(|| NumberForm::of_name(&parts)));
    // One wild cell says nothing of the unit that a name says.
    let fits = |form: &&NumberForm| {
        let form = form.time_form();
        let is_read = |cell: &&String| form.read(cell.as_bytes()).is_some();
        cells.iter().filter(is_read).count() * 2 > cells.len()
    };
    let counted = |name: &'static str, form: TimeForm, why| Clock {
        columns: columns.clone(),
        form,
        declared: (name != "s").then(|| ("unit", name.to_owned())),
        lacks_zone: false,
        zone: None,
        why,
        others: Vec::new(),
    };
    let of_number = |ns_per_unit| TimeForm::Numbers { ns_per_unit };
    if let Some(form) = unit.filter(fits) {
        let by = match below {
            Some(_) => "as the row below its name says",
            None => "by its name",
        };
        return Some(counted(
            form.unit,
            form.time_form(),
            format!("numbers in {}, {by}", form.title),
        ));
    }
    let numbered = parts
        .first()
        .is_some_and(|first| ["sample", "index", "n"].contains(first))
        && numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0);
    if numbered {
        return Some(Clock {
            form: TimeForm::Samples { step_ns: SAMPLE_NS },
            declared: Some(("step", "1s".to_owned())),
            ..counted(
                "s",
                of_number(SAMPLE_NS),
                "a sample number; how long a sample takes the log does not say".to_owned(),
            )
        });
    }
    if counts_days(&numbers) {
        let why = format!(
            "numbers from {} on that rise by parts of one, taken for days as a spreadsheet counts them; if they are another unit, its \
             name must say so: time_s, time_ms, time_min, time_h",
            numbers[0].floor()
        );
        return Some(counted("d", of_number(86_400_000_000_000), why));
    }
    if let Some(form) = NumberForm::of_size(&numbers).filter(|_| unit.is_none()) {
        let why = format!(
            "numbers from {} on, taken for {} since these lie between 1990 and 2100; if they are another unit, its name must say so: \
             time_s, time_ms, time_min, time_h",
            numbers[0], form.title
        );
        return Some(counted(form.unit, form.time_form(), why));
    }
    // Seconds since 1970 have ten digits before the point until 2286, milliseconds thirteen, and so on.
    let (name, ns_per_unit) = match numbers[0] {
        first if first >= 1e17 => ("ns", 1),
        first if first >= 1e14 => ("us", 1_000),
        first if first >= 1e11 => ("ms", 1_000_000),
        _ => ("s", 1_000_000_000),
    };
    let why = match unit {
        Some(by_name) => format!(
            "numbers, taken for {name} since 1970: in {}, as its name says, they lie centuries away",
            by_name.title
        ),
        None => {
            let mut steps: Vec<f64> = numbers.windows(2).map(|pair| pair[1] - pair[0]).collect();
            steps.sort_by(f64::total_cmp);
            format!(
                "numbers, taken for {name} since its name does not say, as time_s, time_ms or time_min would: a row every {} {name}",
                number(steps[steps.len() / 2])
            )
        }
    };
    Some(counted(name, of_number(ns_per_unit), why))
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

#[cfg(test)]
mod tests;
