//! Decides what is measured of a log's columns: rates, gaps, extremes; not what they mean.

use std::path::Path;

use athermal::files::{ChannelColumn, Layout, Options, Reader, Row, TimeColumn};

use super::NoStarter;
use super::clock::Clock;
use super::column::Column;

/// The values of a log, column by column.
#[derive(Debug)]
pub struct Survey {
    /// For each column the instants in s, from the first row, and the values.
    pub series: Vec<Series>,
    /// From the first row to the last, in s.
    pub duration_s: f64,
    /// Rows.
    pub rows: u64,
}

/// The values of one column.
#[derive(Debug, Default)]
pub struct Series {
    /// When, in s from the first row of the log.
    pub time_s: Vec<f64>,
    /// What.
    pub values: Vec<f64>,
}

impl Series {
    /// The mean time between two values in s, interruptions not counted.
    #[must_use]
    pub fn interval_s(&self) -> Option<f64> {
        let usual = 3.0 * self.gap(0.5)?;
        let gaps = self.time_s.windows(2).map(|pair| pair[1] - pair[0]);
        let (sum, count) = gaps
            .filter(|gap| *gap <= usual)
            .fold((0.0, 0.0), |(sum, count), gap| (sum + gap, count + 1.0));
        Some(sum / count)
    }

    /// The time between two values in s that the share `share` of them does not exceed.
    #[must_use]
    pub fn gap(&self, share: f64) -> Option<f64> {
        let mut gaps: Vec<f64> = self
            .time_s
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect();
        gaps.sort_by(f64::total_cmp);
        let last = gaps.len().checked_sub(1)?;
        Some(gaps[(share * last as f64).round() as usize])
    }

    /// The smallest and the largest value.
    #[must_use]
    pub fn extremes(&self) -> (f64, f64) {
        let each = || self.values.iter().copied();
        (
            each().fold(f64::INFINITY, f64::min),
            each().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

impl Survey {
    /// Reads a log to its end. What cannot be read is passed over.
    ///
    /// # Errors
    /// When the file cannot be read, or has less than two rows.
    pub fn of(path: &Path, clock: &Clock, columns: &[Column]) -> Result<Self, NoStarter> {
        let layout = Layout {
            time: TimeColumn {
                column: clock.column.clone(),
                form: clock.form,
            },
            channels: columns
                .iter()
                .map(|column| ChannelColumn {
                    column: column.name.clone(),
                    optional: true,
                })
                .collect(),
        };
        let options = Options {
            lenient: true,
            ..Options::default()
        };
        let mut reader = Reader::open(path, layout, options)?;
        let mut series: Vec<Series> = columns.iter().map(|_| Series::default()).collect();
        let (mut row, mut first, mut last, mut rows) = (Row::default(), None, 0, 0);
        while reader.next_into(&mut row)? {
            let first = *first.get_or_insert(row.time_ns);
            last = row.time_ns;
            rows += 1;
            let time_s = (row.time_ns - first) as f64 / 1e9;
            for (series, &value) in series.iter_mut().zip(&row.values) {
                if value.is_finite() {
                    series.time_s.push(time_s);
                    series.values.push(value);
                }
            }
        }
        let duration_s = first.map_or(0.0, |first| (last - first) as f64 / 1e9);
        if rows < 2 || duration_s <= 0.0 {
            return Err(NoStarter::Unfit(
                "it has less than two rows with a time".to_owned(),
            ));
        }
        Ok(Self {
            series,
            duration_s,
            rows,
        })
    }

    /// Leaves out the columns that say nothing.
    pub fn judge(&self, columns: &mut [Column]) {
        for (series, column) in self.series.iter().zip(columns) {
            let (low, high) = series.extremes();
            if series.values.len() < 10 {
                column.leave_out(format!("it has {} values", series.values.len()));
            } else if low == high {
                column.leave_out(format!("it is {low} throughout"));
            }
        }
    }
}
