//! How rows are cut for cross-validation. Decides edges and which rows train and test; does not decide what is scored.

use crate::{Gram, NumericsError};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The statistics of the rows that train and of the rows that test one fold.
#[derive(Debug, Clone, PartialEq)]
pub struct Split {
    /// What the model of this fold is fitted on.
    pub train: Gram,
    /// What it is scored on.
    pub test: Gram,
}

/// How rows in the order of time are cut into pairs of training and test rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Folds {
    /// Each of `folds` contiguous parts is the test once; the rows before and after it train, apart from `gap` rows on
    /// either side and `embargo` more after it (López de Prado 2018, section 7.4). Without both this is `KFold` of
    /// scikit-learn.
    Blocked {
        /// How many parts, 2 or more.
        folds: usize,
        /// Rows left out on either side of the test, since windows that reach across the edge share measurements.
        gap: u64,
        /// Rows left out after the test and its gap, since what follows remembers it.
        embargo: u64,
    },
    /// The last `folds` of `folds + 1` equal parts are the tests, and the rows before each but for `gap` train
    /// (`TimeSeriesSplit` of scikit-learn).
    Expanding {
        /// How many tests, 2 or more.
        folds: usize,
        /// Rows left out between training and test.
        gap: u64,
    },
    /// Up to `folds` contiguous parts of whole segments, of sizes as equal as these allow; each is the test once. Of a single segment
    /// these are parts as of `Blocked`.
    Segments {
        /// How many parts at most, 2 or more.
        folds: usize,
    },
}

/// Where rows may be cut, beside their first and their last.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Edges<'a> {
    /// After every so many of them.
    Every(u64),
    /// At these rows, in order.
    At(&'a [u64]),
}

impl Edges<'_> {
    /// The edge nearest to a row among so many.
    fn nearest(self, row: u64, rows: u64) -> u64 {
        match self {
            Self::Every(size) => match (row + size / 2) / size * size {
                nearest if nearest <= rows / size * size && row < rows => nearest,
                _ => rows,
            },
            Self::At(_) => {
                let (before, after) = (self.before(row), self.after(row, rows));
                let nearer = row - before < after - row;
                if nearer { before } else { after }
            }
        }
    }

    /// The last edge at or before a row.
    fn before(self, row: u64) -> u64 {
        match self {
            Self::Every(size) => row / size * size,
            Self::At(edges) => match edges.partition_point(|edge| *edge <= row) {
                0 => 0,
                nth => edges[nth - 1],
            },
        }
    }

    /// The first edge at or after a row.
    fn after(self, row: u64, rows: u64) -> u64 {
        match self {
            Self::Every(size) => row.div_ceil(size).saturating_mul(size).min(rows),
            Self::At(_) if row == 0 => 0,
            Self::At(edges) => {
                let nth = edges.partition_point(|edge| *edge < row);
                edges.get(nth).copied().unwrap_or(rows)
            }
        }
    }
}

/// The rows of one fold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoldRows {
    /// Those that train: one range or two.
    pub train: Vec<Range<u64>>,
    /// Those that test.
    pub test: Range<u64>,
}

impl Folds {
    /// Contiguous parts without gap or embargo.
    pub fn contiguous(folds: usize) -> Self {
        Self::Blocked {
            folds,
            gap: 0,
            embargo: 0,
        }
    }

    /// Into how many parts rows are cut.
    pub fn parts(&self) -> usize {
        self.count() + usize::from(matches!(self, Self::Expanding { .. }))
    }

    /// How many folds there are.
    pub fn count(&self) -> usize {
        match *self {
            Self::Blocked { folds, .. }
            | Self::Expanding { folds, .. }
            | Self::Segments { folds } => folds,
        }
    }

    /// The folds of so many rows.
    ///
    /// # Errors
    /// [`NumericsError::Folds`] for fewer than two folds or fewer rows than folds; [`NumericsError::FoldsApart`] for a fold without a row to train on.
    pub fn of(&self, rows: u64) -> Result<Vec<FoldRows>, NumericsError> {
        self.of_blocks(rows, Edges::Every(1), &[])
    }

    /// The same where rows come in blocks that cannot be cut: edges of tests move to the nearest edge of a
    /// block, and gaps become no smaller than stated. Segments but for the first begin at the rows `starts`.
    ///
    /// # Errors
    /// [`NumericsError::Folds`] for fewer than two folds or fewer rows than folds; [`NumericsError::FoldsOfBlocks`] and
    /// [`NumericsError::FoldsOfStretches`] where rows one by one would do; [`NumericsError::FoldsApart`] for a fold without a row to train on.
    pub(crate) fn of_blocks(
        &self,
        rows: u64,
        edges: Edges<'_>,
        starts: &[u64],
    ) -> Result<Vec<FoldRows>, NumericsError> {
        let folds = self.count();
        let parts = self.parts() as u64;
        if folds < 2 || rows < parts {
            return Err(NumericsError::Folds { folds, rows });
        }
        let snap = |row: u64| edges.nearest(row, rows);
        let cut: Vec<FoldRows> = self
            .tests(rows, starts)
            .into_iter()
            .map(|test| snap(test.start)..snap(test.end))
            .map(|test| FoldRows {
                train: self.train(&test, rows, edges),
                test,
            })
            .collect();
        let lacks = |fold: &&FoldRows| fold.test.is_empty() || fold.train.is_empty();
        let Some(lacking) = cut.iter().find(lacks) else {
            return Ok(cut);
        };
        match edges {
            Edges::Every(1) => {}
            // What fails one by one too is not the fault of the blocks.
            Edges::Every(block) => {
                self.of(rows)?;
                return Err(NumericsError::FoldsOfBlocks { folds, rows, block });
            }
            Edges::At(edges) => {
                self.of(rows)?;
                let stretches = edges.len();
                return Err(NumericsError::FoldsOfStretches { folds, stretches });
            }
        }
        let (gap, embargo) = self.apart();
        Err(NumericsError::FoldsApart {
            test: lacking.test.clone(),
            rows,
            gap,
            embargo,
        })
    }

    fn tests(&self, rows: u64, starts: &[u64]) -> Vec<Range<u64>> {
        match *self {
            Self::Segments { folds } if !starts.is_empty() => {
                let k = folds as u64;
                // No part is much smaller than the others, however short its segment.
                let least = (rows / (2 * k)).max(1);
                let mut edges = vec![0];
                for part in 1..k {
                    let nearest = starts
                        .iter()
                        .min_by_key(|start| start.abs_diff(part * rows / k));
                    let from = edges[edges.len() - 1] + least;
                    edges.extend(nearest.filter(|start| (from..=rows - least).contains(*start)));
                }
                match edges.as_slice() {
                    [_] => Self::contiguous(folds).tests(rows, &[]),
                    _ => edges
                        .iter()
                        .zip(edges[1..].iter().chain([&rows]))
                        .map(|(a, b)| *a..*b)
                        .collect(),
                }
            }
            Self::Blocked { folds, .. } | Self::Segments { folds } => {
                let k = folds as u64;
                let start = |fold: u64| fold * (rows / k) + fold.min(rows % k);
                (0..k).map(|fold| start(fold)..start(fold + 1)).collect()
            }
            Self::Expanding { folds, .. } => {
                let size = rows / (folds as u64 + 1);
                let start = |left: u64| rows - left * size;
                let left = (1..=folds as u64).rev();
                left.map(|left| start(left)..start(left - 1)).collect()
            }
        }
    }

    /// Rows left out beside a test, and behind that after it.
    fn apart(&self) -> (u64, u64) {
        match *self {
            Self::Blocked { gap, embargo, .. } => (gap, embargo),
            Self::Expanding { gap, .. } => (gap, 0),
            Self::Segments { .. } => (0, 0),
        }
    }

    fn train(&self, test: &Range<u64>, rows: u64, edges: Edges<'_>) -> Vec<Range<u64>> {
        let (gap, embargo) = self.apart();
        let before = 0..edges.before(test.start.saturating_sub(gap));
        let left_out = test.end.saturating_add(gap).saturating_add(embargo);
        let after = match self {
            Self::Expanding { .. } => rows..rows,
            _ => edges.after(left_out.min(rows), rows)..rows,
        };
        [before, after]
            .into_iter()
            .filter(|range| !range.is_empty())
            .collect()
    }
}

#[cfg(test)]
#[allow(clippy::single_range_in_vec_init)]
mod tests {
    use super::*;
    use crate::oracle;

    #[test]
    fn folds_have_the_edges_of_the_oracle() {
        let Some(table) = oracle::table("cv_splits/splits.csv") else {
            return;
        };
        let mut compared = [0, 0];
        for row in &table.records {
            let number = |column: usize| row[column].parse::<i64>().unwrap();
            let (rows, folds) = (number(1) as u64, number(2) as usize);
            // Neither the size of a test nor the most rows to train on can be stated here.
            if number(4) >= 0 || number(5) >= 0 {
                continue;
            }
            let how = if row[0] == "KFold" {
                Folds::contiguous(folds)
            } else {
                let gap = number(3).max(0) as u64;
                Folds::Expanding { folds, gap }
            };
            let found = &how.of(rows).unwrap()[number(6) as usize];
            assert_eq!(found.test, number(9) as u64..number(10) as u64);
            let expanding = matches!(how, Folds::Expanding { .. });
            if expanding {
                assert_eq!(found.train, [number(7) as u64..number(8) as u64]);
            }
            compared[usize::from(expanding)] += 1;
        }
        assert!(compared[0] >= 3 && compared[1] >= 3, "{compared:?}");
    }

    #[test]
    fn gap_and_embargo_leave_rows_out_on_the_right_sides() {
        let how = Folds::Blocked {
            folds: 4,
            gap: 3,
            embargo: 5,
        };
        let folds = how.of(100).unwrap();
        assert_eq!(folds[0].train, [33..100]);
        assert_eq!(folds[1].train, [0..22, 58..100]);
        assert_eq!(folds[3].train, [0..72]);
        assert_eq!(folds[3].test, 75..100);
    }

    #[test]
    fn a_gap_never_shrinks_where_edges_move_to_blocks() {
        let how = Folds::Blocked {
            folds: 2,
            gap: 1,
            embargo: 0,
        };
        let folds = how.of_blocks(1000, Edges::Every(100), &[]).unwrap();
        assert_eq!(folds[0].test, 0..500);
        assert_eq!(folds[0].train, [600..1000]);
        assert_eq!(folds[1].train, [0..400]);
    }

    #[test]
    fn a_refusal_tells_whether_rows_or_blocks_or_what_is_left_out_are_the_cause() {
        let three = Folds::contiguous(3);
        let refusal =
            |refused: Result<Vec<FoldRows>, NumericsError>| refused.unwrap_err().to_string();
        assert!(
            refusal(three.of(2)).contains("2 rows cannot be cut into 3 folds; at least two folds")
        );
        let blocks = refusal(three.of_blocks(12, Edges::Every(256), &[]));
        assert!(blocks.contains("12 rows") && blocks.contains("in blocks of 256 rows"));
        let wide = Folds::Blocked {
            folds: 3,
            gap: 2,
            embargo: 7,
        };
        for size in [1, 4] {
            let apart = refusal(wide.of_blocks(12, Edges::Every(size), &[]));
            assert_eq!(
                apart,
                "of 12 rows none is left to train on where rows 1 to 4 are tested, with a gap of 2 rows and an embargo of 7"
            );
        }
    }

    #[test]
    fn folds_by_segments_never_cut_one() {
        let tests = |folds: usize, starts: &[u64]| {
            let folds = Folds::Segments { folds }
                .of_blocks(100, Edges::Every(1), starts)
                .unwrap();
            folds.into_iter().map(|fold| fold.test).collect::<Vec<_>>()
        };
        assert_eq!(tests(2, &[40, 70]), [0..40, 40..100]);
        assert_eq!(tests(3, &[40, 70]), [0..40, 40..70, 70..100]);
        // There are two segments only, and more parts than these are none.
        assert_eq!(tests(5, &[90]), [0..90, 90..100]);
        assert_eq!(tests(2, &[40, 41]), [0..41, 41..100]);
        assert_eq!(tests(2, &[3, 99]), [0..50, 50..100]);
        assert_eq!(tests(4, &[]), [0..25, 25..50, 50..75, 75..100]);
        let third = &Folds::Segments { folds: 3 }
            .of_blocks(100, Edges::Every(1), &[40, 70])
            .unwrap()[1];
        assert_eq!(third.train, [0..40, 70..100]);
    }

    #[test]
    fn folds_without_a_row_are_refused() {
        assert!(Folds::contiguous(3).of(2).is_err());
        assert!(Folds::contiguous(1).of(10).is_err());
        assert!(Folds::contiguous(3).of(3).is_ok());
        let wide = Folds::Blocked {
            folds: 2,
            gap: u64::MAX,
            embargo: u64::MAX,
        };
        assert!(wide.of(10).is_err());
        let late = Folds::Expanding { folds: 3, gap: 25 };
        assert!(late.of(100).is_err());
    }

    #[test]
    fn of_stretches_folds_end_where_these_do() {
        let ends = [10, 30, 60, 70, 90];
        let thirds = Folds::contiguous(3).of_blocks(90, Edges::At(&ends), &[]);
        let tests: Vec<Range<u64>> = thirds.unwrap().into_iter().map(|fold| fold.test).collect();
        assert_eq!(tests, [0..30, 30..60, 60..90]);
        let apart = Folds::Blocked {
            folds: 2,
            gap: 1,
            embargo: 0,
        };
        let apart = apart.of_blocks(90, Edges::At(&ends), &[]).unwrap();
        assert_eq!(apart[0].test, 0..60);
        assert_eq!(apart[0].train, [70..90]);
        assert_eq!(apart[1].train, [0..30]);
        let few = Folds::contiguous(3).of_blocks(90, Edges::At(&[45, 90]), &[]);
        let few = few.map_err(|error| error.to_string());
        assert!(few.is_err_and(|error| error.contains("2 blocks cannot be cut into 3 folds")));
    }
}
