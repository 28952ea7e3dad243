//! Several files as one recording: their order, and where one does not continue the other. Not how a file is read.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use athermal_core::time::Duration;

use crate::{FileError, Layout, Options, Reader, Report, Row, TimeForm};

/// What comes next in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A row.
    Row,
    /// The rows that follow do not continue those before: windows, lags and filters start afresh.
    Segment,
    /// There is nothing more.
    End,
}

/// The rows of one or more files, one file open at a time.
///
/// Files of one clock are read in the order of time: those whose times are dates and whose first instants all differ, and those
/// of which, in that order, each begins after the last instant of the one before. Others, such as those that each count from their
/// beginning, are read in the order given. A file that starts after the last instant of the one before continues it; one that starts
/// at or before it is a segment of its own. With [`Options::segments`] every file is one. A file without rows is passed over.
/// Logs of different columns are merged before ([`Dataset`](crate::Dataset)).
///
/// Where times are dates, or numbers that must be some, the reports count the rows that lie in the period of another file.
pub struct Recording {
    rest: std::vec::IntoIter<PathBuf>,
    layout: Layout,
    options: Options,
    current: Option<(String, Reader)>,
    /// What is added to the times of the file that is read, in ns.
    offset_ns: i64,
    last_ns: Option<i64>,
    /// The first row of a segment, until the break before it was given.
    waiting: Option<Row>,
    reports: Vec<(String, Report)>,
    /// The first and last instants of the files that have been read, by their place among the reports.
    periods: Vec<(usize, RangeInclusive<i64>)>,
    /// The period of the file that is read, as far as it has been.
    period: Option<RangeInclusive<i64>>,
    /// How many rows of it lie in each period before.
    within: Vec<u64>,
}

/// From here on, in nanoseconds since 1970, a number is taken for a date: it is of 2001, or a machine that has counted for 31 years.
pub const DATED_NS: i64 = 1_000_000_000_000_000_000;

impl Recording {
    /// Opens each file once to check its columns and to see its first row, and puts them in order. Rows of one time are put
    /// together ([`Options::joins`]).
    ///
    /// `-` is standard input and cannot be read twice; it is taken as it comes when it stands alone.
    ///
    /// # Errors
    /// As for [`Reader::open`] and, for the first row of each file, [`Reader::next_into`].
    pub fn join<P: AsRef<Path>>(
        paths: impl IntoIterator<Item = P>,
        layout: Layout,
        options: Options,
    ) -> Result<Self, FileError> {
        let options = Options {
            joins: true,
            ..options
        };
        let mut paths: Vec<PathBuf> = paths.into_iter().map(|p| p.as_ref().to_owned()).collect();
        if paths.len() > 1 {
            if paths.iter().any(|path| path == Path::new("-")) {
                return Err(FileError::StandardInputInList);
            }
            paths = in_order(paths, &layout, &options)?;
        }
        Ok(Self {
            rest: paths.into_iter(),
            layout,
            options,
            current: None,
            offset_ns: 0,
            last_ns: None,
            waiting: None,
            reports: Vec::new(),
            periods: Vec::new(),
            period: None,
            within: Vec::new(),
        })
    }

    /// Goes on to what comes next, with `row` filled if it is a row.
    ///
    /// # Errors
    /// As for [`Reader::open`] and [`Reader::next_into`].
    pub fn next_into(&mut self, row: &mut Row) -> Result<Event, FileError> {
        if let Some(waiting) = self.waiting.take() {
            *row = waiting;
            return Ok(self.advanced_to(row));
        }
        loop {
            if let Some((_, reader)) = &mut self.current {
                let first = reader.report().rows == 0;
                if reader.next_into(row)? {
                    let apart = self.options.segments || reader.is_of_several();
                    self.shift(row);
                    let apart = |last| apart || row.time_ns <= last;
                    let of_file = first && self.last_ns.is_some_and(apart);
                    if of_file || row.begins_segment {
                        self.waiting = Some(std::mem::take(row));
                        return Ok(Event::Segment);
                    }
                    return Ok(self.advanced_to(row));
                }
            }
            self.close();
            let Some(path) = self.rest.next() else {
                return Ok(Event::End);
            };
            self.offset_ns = offset_of(&path, &self.options);
            let reader = Reader::open(&path, self.layout.clone(), self.options.clone())?;
            self.current = Some((path.display().to_string(), reader));
        }
    }

    /// Adds the offset of the file to all instants of a row.
    fn shift(&self, row: &mut Row) {
        if self.offset_ns == 0 {
            return;
        }
        row.time_ns = row.time_ns.saturating_add(self.offset_ns);
        for (value, of) in row.values.iter_mut().zip(&self.layout.channels) {
            if of.is_instant {
                *value += Duration::from_ns(self.offset_ns).secs();
            }
        }
    }

    /// Whether rows of several machines are read, one machine after the other.
    pub(crate) fn is_of_several(&self) -> bool {
        let current = self.current.as_ref();
        current.is_some_and(|(_, of)| of.is_of_several())
    }

    /// How the times of the file that is read are written.
    pub(crate) fn form(&self) -> &TimeForm {
        let current = self.current.as_ref();
        current.map_or(&self.layout.time.form, |(_, of)| &of.layout().time.form)
    }

    /// The files read to their end so far, in the order of reading, and what was met in each.
    pub fn reports(&self) -> &[(String, Report)] {
        &self.reports
    }

    fn advanced_to(&mut self, row: &Row) -> Event {
        let now = row.time_ns;
        self.last_ns = Some(now);
        let first = self.period.as_ref().map_or(now, |period| *period.start());
        self.period = Some(first..=now);
        if is_dated(self.form(), now) {
            for (rows, (_, period)) in self.within.iter_mut().zip(&self.periods) {
                *rows += u64::from(period.contains(&now));
            }
        }
        Event::Row
    }

    fn close(&mut self) {
        let Some((name, reader)) = self.current.take() else {
            return;
        };
        let mut report = reader.report().clone();
        for (&rows, (file, _)) in self.within.iter().zip(&self.periods) {
            let file = &self.reports[*file].0;
            if rows > 0 && *file != name {
                report.overlaps.push((file.clone(), rows));
            }
        }
        if let Some(period) = self.period.take() {
            report.period = Some((*period.start(), *period.end()));
            self.periods.push((self.reports.len(), period));
        }
        self.within = vec![0; self.periods.len()];
        self.reports.push((name, report));
    }
}

/// What is added to the times of a file, in ns.
pub(crate) fn offset_of(path: &Path, options: &Options) -> i64 {
    let mut offsets = options.offsets.iter();
    let of = offsets.find(|(file, _)| file == path);
    of.map_or(0, |(_, offset_ns)| *offset_ns)
}

/// Whether an instant is the same in all files, and not counted from the beginning of its own.
pub(crate) fn is_dated(form: &TimeForm, time_ns: i64) -> bool {
    match form {
        TimeForm::Rfc3339 | TimeForm::Format(_) => true,
        TimeForm::Numbers { .. } | TimeForm::Since { .. } => time_ns >= DATED_NS,
        TimeForm::Samples { .. } | TimeForm::Elapsed => false,
    }
}

/// The files as they are to be read.
fn in_order(
    paths: Vec<PathBuf>,
    layout: &Layout,
    options: &Options,
) -> Result<Vec<PathBuf>, FileError> {
    let mut row = Row::default();
    let mut as_given = Vec::with_capacity(paths.len());
    let mut all_dated = true;
    for path in paths {
        let mut reader = Reader::open(&path, layout.clone(), options.clone())?;
        let offset_ns = offset_of(&path, options);
        let start = reader.next_into(&mut row)?;
        let start = start.then(|| row.time_ns.saturating_add(offset_ns));
        all_dated &= start.is_none_or(|start| is_dated(&reader.layout().time.form, start));
        as_given.push((start, path));
    }
    let mut by_time = as_given.clone();
    by_time.sort_by_key(|(start, _)| *start);
    let starts = || by_time.iter().filter_map(|(start, _)| *start);
    let all_differ = starts().zip(starts().skip(1)).all(|(one, next)| one < next);
    let one_clock = by_time != as_given
        && all_differ
        && (all_dated || follow_each_other(&by_time, layout, options)?);
    let files = if one_clock { by_time } else { as_given };
    Ok(files.into_iter().map(|(_, path)| path).collect())
}

/// Whether each file begins after the last instant of the one before; they are read to their ends.
fn follow_each_other(
    files: &[(Option<i64>, PathBuf)],
    layout: &Layout,
    options: &Options,
) -> Result<bool, FileError> {
    let mut row = Row::default();
    let mut last = None;
    for (start, path) in files {
        if start.is_some() && *start <= last {
            return Ok(false);
        }
        let mut reader = Reader::open(path, layout.clone(), options.clone())?;
        while reader.next_into(&mut row)? {
            last = Some(row.time_ns.saturating_add(offset_of(path, options)));
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimeForm;

    /// Reads the parts, each in a file of its own, to their end: rows by their values and breaks as `|`.
    fn read(test: &str, form: TimeForm, parts: &[&str], look: impl FnOnce(&Recording)) -> String {
        let folder =
            std::env::temp_dir().join(format!("athermal-files-{}-{test}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let paths: Vec<PathBuf> = (0..parts.len())
            .map(|i| folder.join(format!("{i}.csv")))
            .collect();
        for (path, part) in paths.iter().zip(parts) {
            std::fs::write(path, part).unwrap();
        }
        let layout = Layout::new("t", form, ["x"]);
        let mut recording = Recording::join(&paths, layout, Options::default()).unwrap();
        let mut row = Row::default();
        let mut lines = String::new();
        loop {
            match recording.next_into(&mut row).unwrap() {
                Event::Row => lines += &format!("{}@{} ", row.values[0], row.time_text),
                Event::Segment => lines += "| ",
                Event::End => break,
            }
        }
        assert_eq!(recording.reports().len(), parts.len());
        look(&recording);
        std::fs::remove_dir_all(&folder).unwrap();
        lines.trim_end().to_owned()
    }

    fn lines(test: &str, parts: &[&str]) -> String {
        read(test, TimeForm::SECONDS, parts, |_| {})
    }

    #[test]
    fn files_are_put_in_the_order_of_their_first_instants() {
        let parts = ["t,x\n20,3\n30,4\n", "t,x\n0,1\n10,2\n"];
        assert_eq!(lines("order", &parts), "1@0 2@10 3@20 4@30");
    }

    #[test]
    fn files_whose_times_start_again_are_segments_in_the_order_given() {
        let parts = ["t,x\n0,5\n10,6\n", "t,x\n0,1\n10,2\n", "t,x\n20,3\n"];
        assert_eq!(lines("again", &parts), "5@0 6@10 | 1@0 2@10 3@20");
    }

    #[test]
    fn a_file_that_starts_at_the_last_instant_of_the_other_is_a_segment() {
        assert_eq!(
            lines("touch", &["t,x\n0,1\n10,2\n", "t,x\n10,3\n"]),
            "1@0 2@10 | 3@10"
        );
    }

    #[test]
    fn files_that_overlap_are_segments_in_the_order_of_dates_or_else_as_they_are_given() {
        let parts = ["t,x\n5,3\n15,4\n", "t,x\n0,1\n10,2\n"];
        assert_eq!(lines("overlap", &parts), "3@5 4@15 | 1@0 2@10");
        let dated = [
            "t,x\n1700000005,3\n1700000015,4\n",
            "t,x\n1700000000,1\n1700000010,2\n",
        ];
        assert_eq!(
            lines("overlap-dated", &dated),
            "1@1700000000 2@1700000010 | 3@1700000005 4@1700000015"
        );
    }

    #[test]
    fn each_file_is_a_segment_where_that_is_asked_for() {
        let read = |segments: bool| {
            let folder = std::env::temp_dir();
            let of = |nth: u8| {
                let name = format!(
                    "athermal-files-{}-apart-{segments}-{nth}",
                    std::process::id()
                );
                let path = folder.join(name);
                std::fs::write(&path, format!("t,x\n{nth}0,1\n{nth}5,2\n")).unwrap();
                path
            };
            let layout = Layout::new("t", TimeForm::SECONDS, ["x"]);
            let options = Options {
                segments,
                ..Options::default()
            };
            let mut recording = Recording::join([of(1), of(2), of(3)], layout, options).unwrap();
            let (mut row, mut breaks) = (Row::default(), 0);
            loop {
                match recording.next_into(&mut row).unwrap() {
                    Event::Segment => breaks += 1,
                    Event::Row => {}
                    Event::End => return breaks,
                }
            }
        };
        assert_eq!([read(false), read(true)], [0, 2]);
    }

    #[test]
    fn logs_that_each_count_from_their_beginning_stay_in_the_order_given_however_soon_each_begins()
    {
        let parts = [
            "t,x\n0.3,1\n10,2\n",
            "t,x\n0.1,3\n10,4\n",
            "t,x\n0.2,5\n10,6\n",
        ];
        assert_eq!(
            lines("jitter", &parts),
            "1@0.3 2@10 | 3@0.1 4@10 | 5@0.2 6@10"
        );
    }

    #[test]
    fn rows_dated_within_another_file_are_counted_by_that_file() {
        let counted = |test: &str, form: TimeForm, parts: &[&str]| {
            let mut all: Vec<Vec<u64>> = Vec::new();
            read(test, form, parts, |recording| {
                let files = recording.reports().iter();
                all = files
                    .map(|(_, report)| report.overlaps.iter().map(|(_, rows)| *rows).collect())
                    .collect();
            });
            all
        };
        let none: Vec<Vec<u64>> = vec![Vec::new(); 3];
        let dated = |days: [u32; 2]| {
            format!(
                "t,x\n2025-03-{:02}T00:00:00Z,1\n2025-03-{:02}T00:00:00Z,2\n",
                days[0], days[1]
            )
        };
        let (one, two, three) = (dated([1, 5]), dated([4, 9]), dated([5, 7]));
        let parts = [&*one, &*two, &*three];
        assert_eq!(
            counted("dated", TimeForm::Rfc3339, &parts),
            [vec![], vec![1], vec![1, 2]]
        );
        let apart = [dated([1, 2]), dated([3, 4]), dated([5, 6])];
        let apart: Vec<&str> = apart.iter().map(String::as_str).collect();
        assert_eq!(counted("apart", TimeForm::Rfc3339, &apart), none);
        // Seconds since 1970 are dates too; those since each file began are not.
        let seconds = [
            "t,x\n1700000000,1\n1700000100,2\n",
            "t,x\n1700000050,1\n1700000200,2\n",
        ];
        assert_eq!(
            counted("seconds", TimeForm::SECONDS, &seconds),
            [vec![], vec![1]]
        );
        let again = ["t,x\n0,1\n10,2\n"; 3];
        assert_eq!(counted("counted", TimeForm::SECONDS, &again), none);
    }

    #[test]
    fn a_file_without_rows_is_passed_over() {
        let parts = ["t,x\n0,1\n", "t,x\n", "t,x\n0,2\n"];
        assert_eq!(lines("norows", &parts), "1@0 | 2@0");
    }

    #[test]
    fn each_file_has_an_order_of_columns_of_its_own_and_may_change_it() {
        let parts = ["t,x\n0,1\n", "x,t\n2,10\nt,x\n20,3\n"];
        assert_eq!(lines("columns", &parts), "1@0 2@10 3@20");
    }

    #[test]
    fn a_single_file_is_one_segment() {
        assert_eq!(lines("single", &["t,x\n0,1\n10,2\n"]), "1@0 2@10");
    }

    #[test]
    fn standard_input_stands_alone() {
        let layout = Layout::new("t", TimeForm::SECONDS, ["x"]);
        let joined = Recording::join(["-", "a.csv"], layout, Options::default());
        assert!(matches!(joined, Err(FileError::StandardInputInList)));
    }

    #[test]
    fn a_file_that_is_not_there_is_named_before_any_row_is_read() {
        let layout = Layout::new("t", TimeForm::SECONDS, ["x"]);
        let joined = Recording::join(
            ["no-such-a.csv", "no-such-b.csv"],
            layout,
            Options::default(),
        );
        let error = joined.err().unwrap();
        assert!(
            matches!(&error, FileError::Open { file, .. } if &**file == "no-such-a.csv"),
            "{error}"
        );
    }
}
