//! Decides how gates are opened: the logistic function and the hyperbolic tangent of many values at once.
//!
//! Only integer arithmetic and `+ - * /` are used, which the compiler turns into instructions on several values, and which give the
//! same bits on every machine; the platform's own `exp` does neither.

/// `σ(x) = 1 / (1 + e^(−x))` of each.
pub(crate) fn sigmoid(values: &mut [f64]) {
    for value in values {
        *value = 1.0 / (1.0 + exp(-*value));
    }
}

/// `tanh(x) = 2 σ(2x) − 1` of each.
pub(crate) fn tanh(values: &mut [f64]) {
    for value in values {
        *value = 2.0 / (1.0 + exp(-2.0 * *value)) - 1.0;
    }
}

/// Beyond this, gates are open or shut to the last bit.
const FAR: f64 = 40.0;
/// Adding it leaves the nearest integer in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// `ln 2` in two parts, of which products of the first with small integers are exact.
const LN_2: (f64, f64) = (0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10);
/// `1 / n!`, from 12 down to 0.
const TERMS: [f64; 13] = [
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// `e^x = 2^k e^r` with `|r| ≤ ln 2 / 2`, by the series of `e^r`.
#[inline(always)]
fn exp(x: f64) -> f64 {
    let x = x.clamp(-FAR, FAR);
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (x - k * LN_2.0) - k * LN_2.1;
    let series = TERMS.iter().fold(0.0, |sum, term| sum * r + term);
    series * f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_what_the_platform_finds() {
        for nth in -6000..6000 {
            let x = f64::from(nth) / 300.0;
            let mut found = [x, x, exp(x)];
            sigmoid(&mut found[..1]);
            tanh(&mut found[1..2]);
            let expected = [1.0 / (1.0 + (-x).exp()), x.tanh(), x.exp()];
            for (found, expected) in found.iter().zip(expected) {
                let allowed = 4.0 * f64::EPSILON * expected.abs().max(1.0);
                assert!(
                    (found - expected).abs() <= allowed,
                    "{x}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn far_away_they_rest_and_nothing_stays_nothing() {
        let mut values = [1e300, -1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
        tanh(&mut values);
        assert_eq!(values[..4], [1.0, -1.0, 1.0, -1.0]);
        assert!(values[4].is_nan());
    }
}
