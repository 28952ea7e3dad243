//! What follows each change of the set point: how long until it is settled, and the largest loss until the next.

use serde::Serialize;

/// The largest losses in dB after all changes from one set point to another, until the next change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepLoss {
    /// The set point before.
    pub from: f64,
    /// The set point after; the same for the time before any change.
    pub to: f64,
    /// How many such changes there were.
    pub changes: usize,
    /// Largest loss without the correction; none where none was measured.
    pub largest_without: Option<f64>,
    /// The same with it.
    pub largest_with: Option<f64>,
}

/// A change of the set point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Settling {
    /// When it was noticed, in s.
    pub at_s: f64,
    /// The set point before, and ten minutes later.
    pub from: f64,
    /// See `from`.
    pub to: f64,
    /// Minutes until the first ten stable ones, without the correction; none where they did not come.
    pub without_min: Option<f64>,
    /// The same with the correction.
    pub with_min: Option<f64>,
    /// Largest loss in dB until the next change, without and with; none where none was measured.
    pub largest_without: Option<f64>,
    /// See `largest_without`.
    pub largest_with: Option<f64>,
}

/// How long after a change the set point may still move, in s: what it is then is what was meant.
const MOVES_S: f64 = 600.0;

/// The changes of the set point of a recording, row by row.
#[derive(Debug, Default)]
pub(super) struct Changes {
    settling: Vec<Settling>,
    /// The largest losses before any change.
    steady: Option<StepLoss>,
    /// The change whose losses are counted.
    current: Option<usize>,
    /// For each way, without and with, which change it waits for.
    waits: [Option<usize>; 2],
    /// The set point of the segment's first row that has one, and the newest.
    set_points: Option<(f64, f64)>,
}

impl Changes {
    /// Takes the set point of a row, NaN for none.
    pub(super) fn set(&mut self, set_point: f64) {
        if !set_point.is_nan() {
            let (first, _) = self.set_points.unwrap_or((set_point, set_point));
            self.set_points = Some((first, set_point));
        }
    }

    /// The newest set point; NaN before the first.
    pub(super) fn set_point(&self) -> f64 {
        self.set_points.map_or(f64::NAN, |(_, newest)| newest)
    }

    /// Counts the losses in dB of a row, without and with.
    pub(super) fn lose(&mut self, losses: [f64; 2]) {
        let set_point = self.set_point();
        let largest = match self.current {
            Some(nth) => {
                let settling = &mut self.settling[nth];
                [&mut settling.largest_without, &mut settling.largest_with]
            }
            None => {
                let steady = self.steady.get_or_insert(StepLoss {
                    from: set_point,
                    to: set_point,
                    changes: 0,
                    largest_without: None,
                    largest_with: None,
                });
                if steady.from.is_nan() {
                    (steady.from, steady.to) = (set_point, set_point);
                }
                [&mut steady.largest_without, &mut steady.largest_with]
            }
        };
        for (largest, loss) in largest.into_iter().zip(losses) {
            *largest = larger(*largest, Some(loss));
        }
    }

    /// Goes on to a row, by the output of `settled` nodes: the minutes since a change that has not settled, and of each way the
    /// settle time in min where it has just come; NaN for none.
    pub(super) fn go_on(&mut self, at_s: f64, since_min: f64, settled_min: [f64; 2]) {
        // The time since an unsettled change gives its instant.
        let start_s = at_s - 60.0 * since_min;
        let known = |nth: usize| (self.settling[nth].at_s - start_s).abs() < 1.0;
        if since_min > 0.0 && !self.current.is_some_and(known) {
            self.begin(start_s);
        }
        for (way, time) in settled_min.into_iter().enumerate() {
            if !time.is_nan()
                && let Some(nth) = self.waits[way].take()
            {
                let settling = &mut self.settling[nth];
                *[&mut settling.without_min, &mut settling.with_min][way] = Some(time);
            }
        }
        let set_point = self.set_point();
        if let Some(nth) = self.current
            && at_s - self.settling[nth].at_s <= MOVES_S
        {
            self.settling[nth].to = set_point;
        }
    }

    fn begin(&mut self, at_s: f64) {
        let first = self.set_points.map_or(f64::NAN, |(first, _)| first);
        self.settling.push(Settling {
            at_s,
            from: self.current.map_or(first, |nth| self.settling[nth].to),
            to: self.set_point(),
            without_min: None,
            with_min: None,
            largest_without: None,
            largest_with: None,
        });
        self.current = Some(self.settling.len() - 1);
        self.waits = [self.current; 2];
    }

    /// Begins a segment: nothing is known of what was before.
    pub(super) fn segment(&mut self) {
        (self.current, self.waits, self.set_points) = (None, [None; 2], None);
    }

    /// The changes in order, and the largest losses after those of one kind; up to half of what counts as a change, set points
    /// are the same.
    pub(super) fn steps(self, change: f64) -> (Vec<Settling>, Vec<StepLoss>) {
        let steps = steps(self.steady, &self.settling, change);
        (self.settling, steps)
    }
}

/// The larger of two losses, or the one that there is.
fn larger(one: Option<f64>, other: Option<f64>) -> Option<f64> {
    one.into_iter().chain(other).reduce(f64::max)
}

/// Changes between the same set points, up to half of what counts as a change, taken together.
fn steps(steady: Option<StepLoss>, settling: &[Settling], change: f64) -> Vec<StepLoss> {
    let mut steps: Vec<StepLoss> = Vec::new();
    for s in settling {
        let same = |step: &&mut StepLoss| {
            (step.from - s.from).abs() < 0.5 * change && (step.to - s.to).abs() < 0.5 * change
        };
        match steps.iter_mut().find(same) {
            Some(step) => {
                step.changes += 1;
                step.largest_without = larger(step.largest_without, s.largest_without);
                step.largest_with = larger(step.largest_with, s.largest_with);
            }
            None => steps.push(StepLoss {
                from: s.from,
                to: s.to,
                changes: 1,
                largest_without: s.largest_without,
                largest_with: s.largest_with,
            }),
        }
    }
    // A recording without a set point has losses only.
    let steady = steady.filter(|steady| !steady.from.is_nan());
    steady.into_iter().chain(steps).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_between_the_same_set_points_are_one_kind_of_step() {
        let change = |from, to, without, with| Settling {
            at_s: 0.0,
            from,
            to,
            without_min: None,
            with_min: None,
            largest_without: Some(without),
            largest_with: Some(with),
        };
        let settling = [
            change(20.001, 49.999, 2.0, 0.2),
            change(50.0, 20.0, 1.0, 0.3),
            change(20.0, 50.002, 3.0, 0.1),
        ];
        let found: Vec<_> = steps(None, &settling, 3.0)
            .iter()
            .map(|step| (step.changes, step.largest_without, step.largest_with))
            .collect();
        assert_eq!(
            found,
            [(2, Some(3.0), Some(0.2)), (1, Some(1.0), Some(0.3))]
        );
    }

    #[test]
    fn a_change_after_which_no_loss_was_measured_has_no_largest_one() {
        let mut changes = Changes::default();
        changes.set(20.0);
        changes.lose([0.3, 0.1]);
        changes.go_on(0.0, f64::NAN, [f64::NAN; 2]);
        changes.set(50.0);
        changes.go_on(600.0, 1.0, [f64::NAN; 2]);
        let (settling, steps) = changes.steps(3.0);
        assert_eq!(
            (settling[0].largest_without, settling[0].largest_with),
            (None, None)
        );
        let largest: Vec<_> = steps.iter().map(|step| step.largest_without).collect();
        assert_eq!(largest, [Some(0.3), None]);
    }

    #[test]
    fn the_time_before_any_change_has_the_first_set_point_that_is_known() {
        let mut changes = Changes::default();
        changes.lose([0.3, 0.1]);
        assert!(steps(changes.steady.clone(), &[], 3.0).is_empty());
        changes.set(20.0);
        changes.lose([0.2, 0.2]);
        let (_, steps) = changes.steps(3.0);
        let steady = &steps[0];
        assert_eq!((steady.from, steady.to), (20.0, 20.0));
        assert_eq!(
            (steady.largest_without, steady.largest_with),
            (Some(0.3), Some(0.2))
        );
    }
}
