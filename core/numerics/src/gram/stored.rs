//! How Gram statistics are stored. Decides the stored fields and refuses what does not fit together; does not decide the
//! file format.

use super::{Gram, triangle};
use crate::NumericsError;
use serde::Deserialize;

/// The stored form, of which the lengths are not known to be right.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredGram {
    width: usize,
    count: u64,
    weight: f64,
    shift: Vec<f64>,
    sum: Vec<f64>,
    cross: Vec<f64>,
}

impl TryFrom<StoredGram> for Gram {
    type Error = NumericsError;

    fn try_from(stored: StoredGram) -> Result<Self, NumericsError> {
        let order = stored.width.saturating_add(1);
        let fits = |found: usize, expected: usize| {
            (found == expected)
                .then_some(())
                .ok_or(NumericsError::Width { expected, found })
        };
        fits(stored.sum.len(), order)?;
        if stored.count > 0 || !stored.shift.is_empty() {
            fits(stored.shift.len(), order)?;
        }
        fits(stored.cross.len(), triangle(order))?;
        Ok(Self {
            width: stored.width,
            count: stored.count,
            weight: stored.weight,
            shift: stored.shift,
            sum: stored.sum,
            cross: stored.cross,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_statistics_come_back_bit_for_bit_and_wrong_ones_are_refused() {
        let mut gram = Gram::new(2);
        gram.push(&[21.0, -3.0], 1.0);
        gram.push(&[23.1, 5.0], -2.0);
        let text = serde_json::to_string(&gram).unwrap();
        assert_eq!(serde_json::from_str::<Gram>(&text).unwrap(), gram);
        let wrong = text.replace("\"width\":2", "\"width\":3");
        assert!(serde_json::from_str::<Gram>(&wrong).is_err());
        let huge = text.replace("\"width\":2", "\"width\":18446744073709551615");
        assert!(serde_json::from_str::<Gram>(&huge).is_err());
    }
}
