//! Decides how a list of numbers stands in a model. For `#[serde(with = …)]`.

use serde::{Deserialize, Deserializer, Serializer};

use super::number::Exact;

/// Writes each number as [`super::number`] does.
///
/// # Errors
/// As the serialiser.
pub fn serialize<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().copied().map(Exact))
}

/// Reads them back.
///
/// # Errors
/// When something in the list is no number.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    Ok(Vec::<Exact>::deserialize(deserializer)?
        .into_iter()
        .map(|exact| exact.0)
        .collect())
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    #[derive(Serialize, Deserialize)]
    struct Holder {
        #[serde(with = "super")]
        numbers: Vec<f64>,
    }

    /// A generator of bit patterns (Marsaglia 2003, xorshift64).
    fn bits(state: &mut u64) -> u64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        *state
    }

    #[test]
    fn a_million_random_doubles_read_back_to_the_last_bit() {
        let mut state = 0x9e37_79b9_7f4a_7c15;
        let numbers: Vec<f64> = (0..1_000_000)
            .map(|_| f64::from_bits(bits(&mut state)))
            .collect();
        let text = serde_json::to_string(&Holder {
            numbers: numbers.clone(),
        })
        .unwrap();
        let back: Holder = serde_json::from_str(&text).unwrap();
        for (before, after) in numbers.iter().zip(&back.numbers) {
            assert!(
                before.to_bits() == after.to_bits() || (before.is_nan() && after.is_nan()),
                "{before:e}"
            );
        }
    }
}
