//! Instants as texts.

use std::fmt::Write;

/// Writes instants as RFC 3339 has them. Those of one day cost no calendar.
#[derive(Debug, Default)]
pub(crate) struct Stamp {
    day: Option<i64>,
    date: String,
    text: String,
}

impl Stamp {
    /// Writes an instant in ns since 1970; without the `Z` where it is not known to be one of UTC.
    pub fn write(&mut self, ns: i64, is_utc: bool) -> &str {
        const DAY_NS: i64 = 86_400_000_000_000;
        let (day, ns) = (ns.div_euclid(DAY_NS), ns.rem_euclid(DAY_NS));
        if self.day != Some(day) {
            let at = jiff::Timestamp::from_second(day * 86_400);
            let date = at.map(|at| at.strftime("%Y-%m-%dT").to_string());
            (self.day, self.date) = (Some(day), date.unwrap_or_default());
        }
        self.text.clone_from(&self.date);
        let (seconds, ns) = (ns / 1_000_000_000, ns % 1_000_000_000);
        let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
        // Writing to a `String` cannot fail.
        let _ = write!(self.text, "{hours:02}:{minutes:02}:{seconds:02}");
        if ns > 0 {
            let _ = write!(self.text, ".{ns:09}");
            self.text.truncate(self.text.trim_end_matches('0').len());
        }
        if is_utc {
            self.text.push('Z');
        }
        &self.text
    }

    /// What was written last.
    pub fn text(&self) -> &str {
        &self.text
    }
}
