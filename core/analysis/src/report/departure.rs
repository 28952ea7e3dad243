//! How far each axis departs from where it was, without and with its correction, and what held the correction back.

use std::collections::BTreeMap;

use serde::Serialize;

use super::rms;
use super::track::{Track, TrackAxis, TrackRow};

/// How an axis departs from where it was when its correction began.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Departure {
    /// The axis.
    pub axis: String,
    /// The unit of its positions.
    pub unit: String,
    /// Root mean square without the correction; none where no position was measured.
    pub rms_without: Option<f64>,
    /// The same with it.
    pub rms_with: Option<f64>,
    /// The largest without the correction; none where no position was measured.
    pub largest_without: Option<f64>,
    /// The same with it.
    pub largest_with: Option<f64>,
    /// The share of all ticks at which something held the correction back, by what.
    pub held_back: BTreeMap<&'static str, f64>,
}

/// Shares from here on are worth a word on a terminal.
const MANY: f64 = 0.01;

impl Departure {
    /// Whether the correction leaves the positions farther off than they are without: drift may be less all the same, where a small
    /// bias of the rate adds up.
    #[must_use]
    pub fn is_worse(&self) -> bool {
        let both = self.rms_with.zip(self.rms_without);
        both.is_some_and(|(with, without)| with > without)
    }

    /// What kept the correction from following the prediction though there was one, for people.
    #[must_use]
    pub fn limited(&self) -> Option<String> {
        let limits = ["at the end of its range", "rate cut"];
        let often = limits.iter().filter_map(|by| {
            let share = *self.held_back.get(by)?;
            (share >= MANY).then(|| format!("{by} {:.0} % of the time", 100.0 * share))
        });
        let often: Vec<String> = often.collect();
        (!often.is_empty()).then(|| often.join(", "))
    }
}

/// One for each axis that is corrected.
pub(super) fn departures(track: &Track) -> Vec<Departure> {
    let of_axis = |(nth, axis): (usize, &TrackAxis)| {
        let (without, with) = from_start(&track.rows, nth);
        let largest = |of: &[f64]| of.iter().map(|value| value.abs()).reduce(f64::max);
        let share = |(by, ticks): (&&'static str, &u64)| (*by, *ticks as f64 / track.ticks as f64);
        Departure {
            axis: axis.name.clone(),
            unit: track.positions[nth].1.clone(),
            rms_without: rms(without.iter().copied()),
            rms_with: rms(with.iter().copied()),
            largest_without: largest(&without),
            largest_with: largest(&with),
            held_back: axis.held_back.iter().map(share).collect(),
        }
    };
    track.axes.iter().enumerate().map(of_axis).collect()
}

/// Without and with the correction, the positions of an axis from the first with a correction in each segment.
fn from_start(rows: &[TrackRow], axis: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut without, mut with) = (Vec::new(), Vec::new());
    let mut start = None;
    for row in rows {
        let (position, correction) = (row.position[axis], row.correction[axis]);
        if !position.is_nan() && !correction.is_nan() {
            let (from, of) = *start.get_or_insert((position, correction));
            without.push(position - from);
            with.push(position - from + correction - of);
        }
        if row.begins {
            start = None;
        }
    }
    (without, with)
}

#[cfg(test)]
mod tests {
    use athermal_core::time::Instant;

    use super::*;

    fn row(position: f64, correction: f64, begins: bool) -> TrackRow {
        TrackRow {
            at: Instant::from_ns(0),
            position: vec![position],
            correction: vec![correction],
            set_points: Vec::new(),
            begins,
            asks: false,
        }
    }

    #[test]
    fn an_axis_departs_from_where_it_was_when_its_correction_began_in_each_segment() {
        let rows = [
            row(3.0, f64::NAN, false),
            row(5.0, 0.0, false),
            row(8.0, -2.0, true),
            row(100.0, 0.0, false),
            row(f64::NAN, 0.0, false),
            row(104.0, -4.0, false),
        ];
        let (without, with) = from_start(&rows, 0);
        assert_eq!(without, [0.0, 3.0, 0.0, 4.0]);
        assert_eq!(with, [0.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn limits_that_often_hold_a_correction_back_are_told_and_whether_it_is_of_harm() {
        let mut departure = Departure {
            axis: "Z".into(),
            unit: "nm".into(),
            rms_without: None,
            rms_with: None,
            largest_without: None,
            largest_with: None,
            held_back: [("rate cut", 0.002), ("no valid prediction", 0.3)].into(),
        };
        assert_eq!(departure.limited(), None);
        departure.held_back.insert("at the end of its range", 0.36);
        assert_eq!(
            departure.limited().as_deref(),
            Some("at the end of its range 36 % of the time")
        );
        assert!(!departure.is_worse());
        (departure.rms_without, departure.rms_with) = (Some(233.0), Some(399.0));
        assert!(departure.is_worse());
    }
}
