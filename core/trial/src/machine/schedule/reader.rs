//! Reading a schedule file. Its mistakes are worded in `error.rs`.

use super::{Reason, Schedule, ScheduleError, Track};
use crate::machine::{LONGEST_DAYS, SECOND_NS, SetPoint};

/// The schedule in `text`, or all of its mistakes.
pub(super) fn read(text: &str, set_points: &[SetPoint]) -> Result<Schedule, Vec<ScheduleError>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| {
            (
                index + 1,
                line.split_once('#').map_or(line, |(before, _)| before),
            )
        })
        .filter(|(_, line)| !line.trim().is_empty());
    let Some((line, header)) = lines.next() else {
        return Err(vec![ScheduleError {
            line: 1,
            reason: Reason::Empty,
        }]);
    };
    let mut reader = Reader::default();
    let Some(columns) = reader.header(line, header, set_points) else {
        return Err(reader.errors);
    };
    let mut last_line = line;
    for (line, row) in lines {
        last_line = line;
        reader.row(line, row, &columns);
    }
    reader.finish(last_line, columns)
}

const LONGEST_NS: i64 = LONGEST_DAYS as i64 * 86_400 * SECOND_NS;

/// The columns after the time; the name of the time and its unit in s.
struct Columns {
    time: String,
    unit_s: f64,
    set_points: Vec<SetPoint>,
}

fn column_of(set_point: &SetPoint) -> String {
    format!("{}_degC", set_point.name)
}

/// What has been read so far.
#[derive(Default)]
struct Reader {
    errors: Vec<ScheduleError>,
    tracks: Vec<Vec<(i64, f64)>>,
    started: bool,
    last_ns: Option<i64>,
    repeat_ns: Option<i64>,
}

impl Reader {
    fn error(&mut self, line: usize, reason: Reason) {
        self.errors.push(ScheduleError { line, reason });
    }

    fn header(&mut self, line: usize, header: &str, known: &[SetPoint]) -> Option<Columns> {
        let mut names = header.split(',').map(str::trim);
        let time = names.next().unwrap_or_default();
        let unit_s = match time {
            "time_s" => Some(1.0),
            "time_min" => Some(60.0),
            "time_h" => Some(3600.0),
            _ => {
                let found = time.to_owned();
                self.error(line, Reason::TimeColumn { found });
                None
            }
        };
        let mut set_points: Vec<SetPoint> = Vec::new();
        for name in names {
            let found = name.to_owned();
            match known.iter().find(|known| column_of(known) == name) {
                None => {
                    let known = known.iter().map(column_of).collect();
                    self.error(line, Reason::UnknownColumn { found, known });
                }
                Some(known) if set_points.contains(known) => {
                    self.error(line, Reason::RepeatedColumn { found });
                }
                Some(known) => set_points.push(*known),
            }
        }
        if set_points.is_empty() && self.errors.is_empty() {
            self.error(line, Reason::NoSetPoint);
        }
        self.tracks = vec![Vec::new(); set_points.len()];
        let unit_s = unit_s.filter(|_| self.errors.is_empty())?;
        Some(Columns {
            time: time.to_owned(),
            unit_s,
            set_points,
        })
    }

    fn row(&mut self, line: usize, row: &str, columns: &Columns) {
        if self.repeat_ns.is_some() {
            self.error(line, Reason::AfterRepeat);
            return;
        }
        let first = !std::mem::replace(&mut self.started, true);
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        let expected = columns.set_points.len() + 1;
        let repeats = cells.get(1) == Some(&"repeat") && cells[2..].iter().all(|c| c.is_empty());
        if cells.len() != expected && !repeats {
            let found = cells.len();
            self.error(line, Reason::Cells { found, expected });
            return;
        }
        if repeats && first {
            self.error(line, Reason::NothingToRepeat);
            return;
        }
        let Some(time_ns) = self.time(line, cells[0], columns, first) else {
            return;
        };
        if repeats {
            self.repeat_ns = Some(time_ns);
            return;
        }
        for (index, cell) in cells[1..].iter().enumerate() {
            let set_point = &columns.set_points[index];
            let column = column_of(set_point);
            if cell.is_empty() {
                if first {
                    self.error(line, Reason::Open { column });
                }
                continue;
            }
            let [low, high] = set_point.range;
            match number(cell) {
                None => {
                    let found = (*cell).to_owned();
                    self.error(line, Reason::Number { column, found });
                }
                Some(found) if !(low <= found && found <= high) => {
                    let range = set_point.range;
                    self.error(
                        line,
                        Reason::Range {
                            column,
                            found,
                            range,
                        },
                    );
                }
                Some(value) => self.tracks[index].push((time_ns, value)),
            }
        }
    }

    fn time(&mut self, line: usize, cell: &str, columns: &Columns, first: bool) -> Option<i64> {
        let found = cell.to_owned();
        let Some(time) = number(cell) else {
            let column = columns.time.clone();
            self.error(line, Reason::Number { column, found });
            return None;
        };
        let time_ns = (time * columns.unit_s * SECOND_NS as f64).round() as i64;
        if first && time_ns != 0 {
            self.error(line, Reason::Start { found });
        } else if self.last_ns.is_some_and(|last_ns| time_ns <= last_ns) || time_ns > LONGEST_NS {
            self.error(line, Reason::Order { found });
            return None;
        }
        self.last_ns = Some(time_ns);
        Some(time_ns)
    }

    fn finish(mut self, line: usize, columns: Columns) -> Result<Schedule, Vec<ScheduleError>> {
        if !self.started && self.errors.is_empty() {
            self.error(line, Reason::NoRow);
        }
        if !self.errors.is_empty() {
            return Err(self.errors);
        }
        let repeat_ns = self.repeat_ns;
        let tracks = columns.set_points.iter().zip(self.tracks);
        Ok(Schedule {
            tracks: tracks
                .map(|(set_point, steps)| (set_point.name.to_owned(), Track { steps, repeat_ns }))
                .collect(),
        })
    }
}

fn number(cell: &str) -> Option<f64> {
    cell.parse().ok().filter(|number: &f64| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::super::tests::SET_POINTS;
    use super::*;

    fn mistakes(text: &str) -> Vec<String> {
        match read(text, &SET_POINTS) {
            Ok(schedule) => panic!("read as {schedule:?}"),
            Err(errors) => errors.iter().map(ToString::to_string).collect(),
        }
    }

    #[test]
    fn every_mistake_in_the_names_has_its_line_and_reason() {
        for (text, expected) in [
            ("", "line 1: no line of names, such as `time_h,chuck_degC`"),
            (
                "\ntime,chuck_degC\n0,20\n",
                "line 2: the first column is `time`; it must be `time_s`, `time_min` or `time_h`",
            ),
            (
                "time_s,chuk_degC\n0,20\n",
                "line 1: no set point has the column `chuk_degC`; there are chuck_degC, room_degC",
            ),
            (
                "time_s,chuck_degC,chuck_degC\n0,20,20\n",
                "line 1: the column `chuck_degC` stands twice",
            ),
            ("time_s\n0\n", "line 1: no column sets anything"),
            (
                "time_s,chuck_degC\n# nothing\n",
                "line 1: no row of values follows the names",
            ),
        ] {
            assert_eq!(mistakes(text), [expected], "{text:?}");
        }
    }

    #[test]
    fn every_mistake_in_a_row_has_its_line_and_reason() {
        for (rows, expected) in [
            ("0,20\n", "line 2: 2 cells where 3 are named"),
            ("0,20,21,22\n", "line 2: 4 cells where 3 are named"),
            (
                "0,hot,21\n",
                "line 2: `hot` in `chuck_degC` is not a finite number",
            ),
            (
                "0,NaN,21\n",
                "line 2: `NaN` in `chuck_degC` is not a finite number",
            ),
            (
                "noon,20,21\n",
                "line 2: `noon` in `time_h` is not a finite number",
            ),
            (
                "1,20,21\n",
                "line 2: the first row is at 1; it must be at 0",
            ),
            ("0,,21\n", "line 2: the first row must set `chuck_degC`"),
            (
                "0,20,21\n5,500,\n",
                "line 3: 500 in `chuck_degC` is outside 0 to 150",
            ),
            (
                "0,20,21\n5,30,\n5,40,\n",
                "line 4: the time 5 must be after that of the row before, and within 3653 days",
            ),
            (
                "0,20,21\n1e300,30,\n",
                "line 3: the time 1e300 must be after that of the row before, and within 3653 days",
            ),
            (
                "0,20,21\n9,repeat\n10,30,\n",
                "line 4: nothing may follow the row that says `repeat`",
            ),
            (
                "0,repeat\n",
                "line 2: `repeat` needs a row of values before it",
            ),
        ] {
            let text = format!("time_h,chuck_degC,room_degC\n{rows}");
            assert_eq!(mistakes(&text), [expected], "{rows:?}");
        }
    }

    #[test]
    fn all_mistakes_are_reported_together() {
        let found = mistakes("time_h,chuck_degC\nnow,20\n0,cold\n1,900\n0.5,30\n");
        let lines: Vec<&str> = found.iter().map(|text| &text[..6]).collect();
        assert_eq!(lines, ["line 2", "line 3", "line 4", "line 5"], "{found:?}");
    }
}
