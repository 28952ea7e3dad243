//! Decides in which order a product of two vectors is summed.

/// `Σ a_j b_j` of two vectors of one length, in four strands so that it does not wait for each addition. Strands are summed with the
/// next but one: a processor that adds two numbers at once then takes them as they lie. Inlined wherever it is
/// called, so that it is compiled for the vectors of its caller.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a4.iter().zip(b4) {
        for strand in 0..4 {
            sums[strand] += a[strand] * b[strand];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}
