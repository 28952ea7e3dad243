//! How often a machine must be aligned anew under its correction: when it is asked for, against a fixed interval.

use athermal_core::time::Instant;
use serde::Serialize;

use super::figure;
use super::track::{Track, TrackRow};

/// Alignments that a `remeasure` node asks for on recorded positions, and a fixed interval that is as good.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Realignment {
    /// The node.
    pub node: String,
    /// What it keeps to, as in the graph: `20 nm`.
    pub tolerance: String,
    /// How many it asks for in a day.
    pub per_day: f64,
    /// The farthest that a corrected position departs from where it was at the alignment before, of all axes.
    pub largest: Option<f64>,
    /// The unit of that.
    pub unit: String,
    /// The longest fixed interval in min up to which no position departs farther; none where one minute is too long.
    pub as_good_every_min: Option<u32>,
}

impl Realignment {
    /// For people.
    #[must_use]
    pub fn sentence(&self) -> String {
        let fixed = self.as_good_every_min.map_or_else(
            || "no fixed interval of whole minutes is as good".to_owned(),
            |every| {
                let per_day = 1440.0 / f64::from(every);
                format!("a fixed interval as good is {every} min, {per_day:.0} a day")
            },
        );
        format!(
            "For ±{}, {} asks for {:.0} alignments a day; between them corrected positions depart by {} {} at most; {fixed}.",
            self.tolerance,
            self.node,
            self.per_day,
            figure(self.largest),
            self.unit
        )
    }
}

/// The longest interval that is looked at, in min.
const LONGEST_MIN: u32 = 240;

/// What the first `remeasure` node does on a track; none where there is no such node or no position.
pub(super) fn realignment(track: &Track) -> Option<Realignment> {
    let (node, tolerance) = track.remeasures.clone()?;
    let (count, largest) = aligned(&track.rows, |row, _| row.asks);
    let rows = track.rows.windows(2).filter(|pair| !pair[0].begins);
    let days = rows
        .map(|pair| (pair[1].at - pair[0].at).secs())
        .sum::<f64>()
        / 86_400.0;
    let is_as_good = |every: &u32| {
        let due = f64::from(60 * every);
        aligned(&track.rows, |_, since_s| since_s >= due).1 <= largest
    };
    Some(Realignment {
        node,
        tolerance,
        per_day: count as f64 / days,
        largest,
        unit: track.positions.first()?.1.clone(),
        as_good_every_min: (1..=LONGEST_MIN).take_while(is_as_good).last(),
    })
}

/// How often axes are aligned where `is_due` says so, of a row and the seconds since the alignment before; and the farthest that corrected
/// positions depart in between.
fn aligned(rows: &[TrackRow], is_due: impl Fn(&TrackRow, f64) -> bool) -> (usize, Option<f64>) {
    let (mut count, mut largest) = (0, None);
    let (mut from, mut last, mut waits) = (Vec::new(), None::<Instant>, false);
    for row in rows {
        let axes = row.position.iter().zip(&row.correction);
        let now: Vec<f64> = axes
            .map(|(position, correction)| position + correction)
            .collect();
        from.resize(now.len(), f64::NAN);
        let since_s = last.map_or(f64::INFINITY, |last| (row.at - last).secs());
        // What is asked for is done where something is measured.
        waits |= is_due(row, since_s);
        let is_aligned = waits && now.iter().any(|position| !position.is_nan());
        waits &= !is_aligned;
        for (from, now) in from.iter_mut().zip(now) {
            let off = (now - *from).abs();
            if !off.is_nan() {
                largest = Some(off.max(largest.unwrap_or(0.0)));
            }
            if from.is_nan() || (is_aligned && !now.is_nan()) {
                *from = now;
            }
        }
        if is_aligned {
            (count, last) = (count + 1, Some(row.at));
        }
        if row.begins {
            (from, last) = (Vec::new(), None);
        }
    }
    (count, largest)
}

#[cfg(test)]
mod tests {
    use std::iter::once;

    use super::*;

    /// A row a minute: the corrected position, and whether an alignment is asked for.
    fn rows(of: &[(f64, bool)]) -> Vec<TrackRow> {
        let row = |(minute, (position, asks)): (usize, &(f64, bool))| TrackRow {
            at: Instant::from_ns(minute as i64 * 60_000_000_000),
            position: vec![position + 1.0],
            correction: vec![-1.0],
            set_points: Vec::new(),
            begins: false,
            asks: *asks,
        };
        of.iter().enumerate().map(row).collect()
    }

    #[test]
    fn positions_depart_from_the_alignment_before_and_fixed_intervals_must_be_as_good() {
        // It drifts by 1 a minute, and from the tenth minute on by 5: alignments are asked for just as often as it needs them.
        let slow = (0..10).map(|minute| (f64::from(minute), minute % 5 == 0));
        let fast = (0..10).map(|minute| (10.0 + 5.0 * f64::from(minute), true));
        let all: Vec<_> = slow.chain(fast).collect();
        let mut track = Track::default();
        track.positions.push(("Z".to_owned(), "nm".to_owned()));
        track.rows = rows(&all);
        track.remeasures = Some(("again".to_owned(), "5 nm".to_owned()));
        let found = realignment(&track).unwrap();
        assert_eq!(found.largest, Some(5.0));
        assert!(
            (found.per_day - 12.0 / 19.0 * 1440.0).abs() < 1e-9,
            "{found:?}"
        );
        assert_eq!(found.as_good_every_min, Some(1));
        let sentence = found.sentence();
        assert!(
            sentence.contains("909 alignments a day") && sentence.contains("1 min, 1440 a day"),
            "{sentence}"
        );
        // Where a segment ends, what was is forgotten.
        track.rows[9].begins = true;
        track.rows.truncate(11);
        assert_eq!(realignment(&track).unwrap().largest, Some(5.0));
        track.remeasures = None;
        assert_eq!(realignment(&track), None);
    }

    #[test]
    fn an_absent_position_is_waited_for() {
        let all: Vec<_> = once((0.0, true))
            .chain([(f64::NAN, true), (3.0, false)])
            .collect();
        assert_eq!(aligned(&rows(&all), |row, _| row.asks), (2, Some(3.0)));
    }
}
