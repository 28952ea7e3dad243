//! Decides what the middle and the spread of numbers are where some of them may be wild.

/// The median; of two in the middle the upper one. The numbers are left in another order.
#[must_use]
pub fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The standard deviation of normal errors of these sizes, `1.4826 · median` (Hampel 1974). They are left in another order.
#[must_use]
pub fn robust_deviation(sizes: &mut [f64]) -> Option<f64> {
    median(sizes).map(|median| 1.4826 * median)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wild_number_moves_neither_middle_nor_spread() {
        assert_eq!(median(&mut [3.0, 1.0, 1e9]), Some(3.0));
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(robust_deviation(&mut [1.0, 1e9, 1.0]), Some(1.4826));
        assert_eq!((median(&mut []), robust_deviation(&mut [])), (None, None));
    }
}
