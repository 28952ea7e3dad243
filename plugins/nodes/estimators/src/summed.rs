//! Decides how the sums of a linear fit are written and read; not how rows are summed.

use athermal_core::node::TrainingError;
use athermal_numerics::{Gram, GramBlocks};

use crate::unsolved::unsolved;

/// The sums of all rows as JSON.
pub(crate) fn sums_of(blocks: &GramBlocks) -> Result<String, TrainingError> {
    let gram = blocks.total();
    if !gram.is_finite() {
        return Err(wrong("products of values overflow"));
    }
    serde_json::to_string(&gram).map_err(|error| wrong(&error.to_string()))
}

/// Adds the sums of rows whose regressors at these places are those of the blocks.
pub(crate) fn add_sums(
    blocks: &mut GramBlocks,
    sums: &str,
    places: &[usize],
) -> Result<(), TrainingError> {
    let gram: Gram = serde_json::from_str(sums).map_err(|error| wrong(&error.to_string()))?;
    let own = match places.len() == gram.width() && places.iter().enumerate().all(|(a, b)| a == *b)
    {
        true => gram,
        false => gram.of_columns(places).map_err(unsolved)?,
    };
    blocks.merge(&own).map_err(unsolved)
}

fn wrong(reason: &str) -> TrainingError {
    TrainingError::Unsolvable {
        reason: format!("the sums of its rows cannot be used: {reason}"),
    }
}
