//! How rows are cut for cross-validation. Decides edges and which rows train and test; does not decide what is scored.

use crate::{Gram, NumericsError};
use std::ops::Range;

/// The statistics of the rows that train and of the rows that test one fold.
#[derive(Debug, Clone, PartialEq)]
pub struct Split {
    /// What the model of this fold is fitted on.
    pub train: Gram,
    /// What it is scored on.
    pub test: Gram,
}

/// The row ranges of `folds` contiguous folds, the first `rows % folds` of which have one row more (`KFold` of scikit-learn
/// without shuffling).
///
/// # Errors
/// [`NumericsError::Folds`] for fewer than two folds or fewer rows than folds.
pub fn contiguous_folds(rows: u64, folds: usize) -> Result<Vec<Range<u64>>, NumericsError> {
    let k = folds as u64;
    if k < 2 || rows < k {
        return Err(NumericsError::Folds { folds, rows });
    }
    let mut start = 0;
    Ok((0..k)
        .map(|fold| {
            let end = start + rows / k + u64::from(fold < rows % k);
            let range = start..end;
            start = end;
            range
        })
        .collect())
}

/// Each fold once as the test, the others as training rows. Training rows are summed, not subtracted from a total, so
/// that a fold of large values leaves no rounding in the others.
///
/// # Errors
/// [`NumericsError::Folds`] for fewer than two folds or an empty one, [`NumericsError::Width`] when widths differ.
pub fn leave_one_out(folds: &[Gram]) -> Result<Vec<Split>, NumericsError> {
    if folds.len() < 2 || folds.iter().any(|fold| fold.count() == 0) {
        return Err(NumericsError::Folds {
            folds: folds.len(),
            rows: folds.iter().map(Gram::count).sum(),
        });
    }
    folds
        .iter()
        .enumerate()
        .map(|(left_out, test)| {
            let mut train = Gram::new(test.width());
            for (index, fold) in folds.iter().enumerate() {
                if index != left_out {
                    train.merge(fold)?;
                }
            }
            Ok(Split {
                train,
                test: test.clone(),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle;

    #[test]
    fn contiguous_folds_have_the_edges_of_the_oracle() {
        let Some(table) = oracle::table("cv_splits/splits.csv") else {
            return;
        };
        let mut compared = 0;
        for row in &table.records {
            if row[0] != "KFold" {
                continue;
            }
            let number = |column: usize| row[column].parse::<u64>().unwrap();
            let folds = contiguous_folds(number(1), number(2) as usize).unwrap();
            assert_eq!(folds[number(6) as usize], number(9)..number(10));
            compared += 1;
        }
        assert!(compared >= 3);
    }

    #[test]
    fn fewer_rows_than_folds_are_refused() {
        assert!(contiguous_folds(2, 3).is_err());
        assert!(contiguous_folds(10, 1).is_err());
        assert!(contiguous_folds(3, 3).is_ok());
    }
}
