//! Numbers that tests draw. Does not decide what they make of them.

/// Numbers between −1 and 1 that nobody could guess, the same for the same seed (Knuth 1997, section 3.3.4, table 1).
pub(crate) fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1 << 30) - 1.0
    }
}

/// Numbers that are nearly normal, about 0 with a variance of 1: sums of twelve even ones.
pub(crate) fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut even = uniform(seed);
    move || (0..12).map(|_| 0.5 * even()).sum()
}
