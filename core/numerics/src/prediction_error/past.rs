//! What the past leads to, and how it goes on by a sample; the newest stands first.

/// `Σ p_j x_j` over the first of both.
pub(super) fn product(polynomial: &[f64], past: &[f64]) -> f64 {
    polynomial.iter().zip(past).map(|(p, x)| p * x).sum()
}

/// Puts a value before those of the past, and forgets the oldest.
pub(super) fn push(past: &mut [f64], value: f64) {
    if let Some(last) = past.len().checked_sub(1) {
        past.copy_within(..last, 1);
        past[0] = value;
    }
}
