//! The revision of a fitted graph: a hash of what it computes, not of how it is written.

use std::collections::BTreeMap;
use std::hash::Hasher;

use serde_json::json;

use crate::compile::{Plan, meaning};
use crate::engine::Fitted;

/// The revision of a plan with what was fitted: the same for two files that mean the same.
///
/// Sixteen hexadecimal digits: Fowler, Noll and Vo's hash (variant 1a, 64 bits) over the [`meaning`] of the plan and the fits.
#[must_use]
pub fn revision(plan: &Plan, fitted: &Fitted) -> String {
    let fitted: BTreeMap<_, _> = fitted
        .iter()
        .map(|(node, predictor)| (node, serde_json::to_value(predictor.as_ref()).ok()))
        .collect();
    let whole = json!({ "plan": meaning(plan), "fitted": fitted });
    format!("{:016x}", fnv_1a(whole.to_string().as_bytes()))
}

/// Fowler, Noll and Vo's hash in its variant 1a with 64 bits: for telling contents apart, not for guarding them.
#[must_use]
pub fn fnv_1a(content: &[u8]) -> u64 {
    let mut hash = Fnv1a::default();
    hash.write(content);
    hash.finish()
}

/// The same hash of a content in pieces.
#[derive(Debug, Clone)]
pub struct Fnv1a(u64);

impl Default for Fnv1a {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Hasher for Fnv1a {
    fn write(&mut self, piece: &[u8]) {
        self.0 = piece.iter().fold(self.0, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        });
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_that_of_the_published_test_vectors() {
        // Vectors from the reference page of FNV: the empty string, "a" and "foobar".
        assert_eq!(fnv_1a(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv_1a(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv_1a(b"foobar"), 0x8594_4171_f739_67e8);
        let mut pieces = Fnv1a::default();
        pieces.write(b"foo");
        pieces.write(b"bar");
        assert_eq!(pieces.finish(), fnv_1a(b"foobar"));
    }
}
