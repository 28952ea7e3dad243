//! What to report of the rows that a log has and no command takes, with the likely cause.

use athermal_files::{Description, FileError, Report, with_decimal_point};

use super::clock::Clock;
use super::texts::Texts;
use athermal_analysis::figures::{count, counted};

/// So many rows whose time is out of order are no slips: the clock was set back.
const SET_BACK: u64 = 10;

/// Where all rows but so many are such, they are as the log is.
const FEW: u64 = 3;

/// Remarks on the rows of a log that were not taken, and on those that were put together.
pub fn remarks(report: &Report, clock: &Clock) -> Vec<String> {
    let left_out = [
        &report.repeated_time,
        &report.refused_time,
        &report.refused_rows,
    ];
    let all = report.rows + report.joined + left_out.map(|found| found.count).iter().sum::<u64>();
    let mut remarks = Vec::new();
    if report.joined > 0 {
        let [have, are] = verbs(report.joined);
        remarks.push(format!(
            "{} of {} {have} the time of the row before, and {are} put together with it",
            count(report.joined),
            counted(all, "row")
        ));
    }
    for (place, found) in left_out.iter().enumerate() {
        if let Some(first) = &found.first {
            let [have, are] = verbs(found.count);
            let (what, cause) = match place {
                0 => (format!("{have} the time of the row before"), String::new()),
                1 => (format!("{are} out of order"), out_of_order(report, clock)),
                _ => ("cannot be read".to_owned(), String::new()),
            };
            remarks.push(format!(
                "{} of {} {what}, and {are} left out; the first: {first}{cause}",
                count(found.count),
                counted(all, "row")
            ));
        }
    }
    let kept = [
        (
            &report.short_rows,
            "without their last cells",
            "taken as missing",
        ),
        (&report.notes, "with a note behind them", "passed over"),
    ];
    for (found, what, then) in kept {
        let is_usual = found.count > 20 && report.rows.saturating_sub(found.count) <= FEW;
        if let Some(first) = found.first.as_ref().filter(|_| !is_usual) {
            remarks.push(format!(
                "{} of {} stand {what}, which are {then}; the first: {first}",
                count(found.count),
                counted(all, "row")
            ));
        }
    }
    if let Some(place) = &report.truncated {
        remarks.push(format!("{place}: the last line is cut off and left out"));
    }
    remarks
}

/// What so many rows do.
fn verbs(rows: u64) -> [&'static str; 2] {
    match rows {
        1 => ["has", "is"],
        _ => ["have", "are"],
    }
}

/// Why times may be out of order, and what to do.
fn out_of_order(report: &Report, clock: &Clock) -> String {
    let Some(FileError::TimeNotAfter {
        place,
        time,
        previous,
    }) = &report.refused_time.first
    else {
        return String::new();
    };
    let read = |text: &str| clock.form.read(with_decimal_point(text).as_bytes());
    let (Some(now), Some(before)) = (read(time), read(previous)) else {
        return String::new();
    };
    if report.refused_time.count < SET_BACK {
        return String::new();
    }
    let back_s = before.saturating_sub(now) as f64 / 1e9;
    if clock.lacks_zone && (3000.0..=3600.0).contains(&back_s) {
        return "; did the clocks go back in autumn? With their zone in the graph these rows are read too: `zone = \"Europe/Berlin\"` \
                in `[time]`"
            .to_owned();
    }
    format!(
        "; if the times start again at line {}, give what stands before it and what stands from it on as two files, each a segment \
         of its own; if `{previous}` before it is wrong, correct that",
        place.line
    )
}

/// Why a log has no rows that follow each other, where its newest rows come first.
pub fn newest_first(described: &Description, clock: &Clock) -> Option<String> {
    let texts = Texts::from(described, clock.columns.clone()).read();
    let mut times: Vec<(&str, i64)> = Vec::new();
    for text in &texts {
        times.extend(clock.form.read(text.as_bytes()).map(|time| (&**text, time)));
    }
    let back = |pair: &&[(&str, i64)]| pair[1].1 < pair[0].1;
    let all = times.len().saturating_sub(1);
    let first = times.windows(2).find(back)?;
    let many = times.windows(2).filter(back).count();
    (all >= 2 && many * 100 >= all * 95).then(|| {
        format!(
            "its times go back from row to row, `{}` before `{}`: sort it, oldest first",
            first[0].0, first[1].0
        )
    })
}
