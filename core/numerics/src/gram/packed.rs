//! How Gram statistics are stored. Decides the stored fields and refuses what does not fit together; does not decide the
//! file format.

use super::Gram;
use crate::NumericsError;
use serde::{Deserialize, Serialize};

/// The stored form: the lower triangle alone, column by column.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PackedGram {
    width: usize,
    count: u64,
    weight: f64,
    shift: Vec<f64>,
    sum: Vec<f64>,
    cross: Vec<f64>,
}

impl From<Gram> for PackedGram {
    fn from(gram: Gram) -> Self {
        let order = gram.width + 1;
        let cross = (0..order)
            .flat_map(|j| gram.cross[j * order + j..(j + 1) * order].iter().copied())
            .collect();
        Self {
            width: gram.width,
            count: gram.count,
            weight: gram.weight,
            shift: gram.shift,
            sum: gram.sum,
            cross,
        }
    }
}

impl TryFrom<PackedGram> for Gram {
    type Error = NumericsError;

    fn try_from(packed: PackedGram) -> Result<Self, NumericsError> {
        let needed = packed.width.saturating_add(1);
        let fits = |found: usize, expected: usize| {
            (found == expected)
                .then_some(())
                .ok_or(NumericsError::Width { expected, found })
        };
        fits(packed.sum.len(), needed)?;
        if packed.count > 0 || !packed.shift.is_empty() {
            fits(packed.shift.len(), needed)?;
        }
        fits(packed.cross.len(), needed * (needed + 1) / 2)?;
        let mut cross = vec![0.0; needed * needed];
        let mut read = packed.cross.into_iter();
        for j in 0..needed {
            for (entry, value) in cross[j * needed + j..(j + 1) * needed]
                .iter_mut()
                .zip(&mut read)
            {
                *entry = value;
            }
        }
        Ok(Self {
            width: packed.width,
            count: packed.count,
            weight: packed.weight,
            shift: packed.shift,
            sum: packed.sum,
            cross,
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
