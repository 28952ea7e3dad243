//! How far the difference of two samples may lie from that of the decimal numbers that they were written as.

/// What two numbers lost when they were read as binary ones: a sensor's step from 20.00 to 20.01 is 0.010000000000001563.
pub(crate) fn rounding(a: f64, b: f64) -> f64 {
    f64::EPSILON * (a.abs() + b.abs())
}
