//! What every request must hold. Decides which penalties, scales and splits can be worked with; does not decide what for.

use crate::{NumericsError, Split};

/// A penalty is finite and not negative.
pub(crate) fn check_penalty(alpha: f64) -> Result<(), NumericsError> {
    check_parameter(
        "alpha",
        alpha,
        alpha >= 0.0 && alpha.is_finite(),
        "finite and not negative",
    )
}

pub(crate) fn check_parameter(
    name: &'static str,
    value: f64,
    fine: bool,
    allowed: &'static str,
) -> Result<(), NumericsError> {
    if fine {
        Ok(())
    } else {
        Err(NumericsError::Parameter {
            name,
            value,
            allowed,
        })
    }
}

/// What was stored has as many numbers as the rest of it asks for.
pub(crate) fn check_length(
    name: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), NumericsError> {
    if found == expected {
        Ok(())
    } else {
        Err(NumericsError::Length {
            name,
            expected,
            found,
        })
    }
}

/// A scale is positive and finite.
pub(crate) fn check_scale(column: usize, scale: f64) -> Result<(), NumericsError> {
    if scale > 0.0 && scale.is_finite() {
        Ok(())
    } else {
        Err(NumericsError::Scale { column, scale })
    }
}

/// Columns are below the width and none stands twice.
pub(crate) fn check_columns(columns: &[usize], width: usize) -> Result<(), NumericsError> {
    let mut seen = vec![false; width];
    for &column in columns {
        match seen.get_mut(column) {
            None => return Err(NumericsError::Column { column, width }),
            Some(true) => return Err(NumericsError::RepeatedColumn { column }),
            Some(mark) => *mark = true,
        }
    }
    Ok(())
}

/// Splits are there, hold rows and fit the scales.
pub(crate) fn check_splits(splits: &[Split], scales: &[f64]) -> Result<(), NumericsError> {
    for (column, &scale) in scales.iter().enumerate() {
        check_scale(column, scale)?;
    }
    let empty = NumericsError::Folds {
        folds: splits.len(),
        rows: 0,
    };
    if splits.is_empty() {
        return Err(empty);
    }
    for gram in splits.iter().flat_map(|split| [&split.train, &split.test]) {
        if gram.width() != scales.len() {
            return Err(NumericsError::Width {
                expected: gram.width(),
                found: scales.len(),
            });
        }
        if gram.count() == 0 {
            return Err(empty);
        }
        if !gram.is_finite() {
            return Err(NumericsError::NotFinite);
        }
    }
    Ok(())
}
