//! Decides whether the roots of a polynomial in the delay operator lie inside a circle, and brings them there. Without its
//! leading 1 it is a list of coefficients: `1 + p₁ q⁻¹ + … + p_n q⁻ⁿ`.

use faer::Mat;

/// How far inside the circle a root must lie that is brought there, as a share of the radius.
const LARGEST: f64 = 0.9995;

/// Whether all roots lie inside the circle of this radius: of the polynomial stretched to the unit circle, the step-down
/// recursion meets no reflection coefficient of 1 or more (Jury 1964; Söderström and Stoica 1989, section 4.9).
pub(super) fn is_within(polynomial: &[f64], radius: f64) -> bool {
    let mut stretch = 1.0;
    let stretched = polynomial.iter().map(|p| {
        stretch *= radius;
        p / stretch
    });
    let mut p: Vec<f64> = stretched.collect();
    while let Some(&last) = p.last() {
        // So that NaN fails.
        let inside = last.abs() < 1.0 - 1e-9;
        if !inside {
            return false;
        }
        let n = p.len();
        let scale = 1.0 - last * last;
        p = (0..n - 1)
            .map(|j| (p[j] - last * p[n - 2 - j]) / scale)
            .collect();
    }
    true
}

/// The polynomial with its roots outside of the unit circle reflected into it, and those that are then outside of the circle
/// of this radius drawn into that; of zeros where they cannot be found.
pub(super) fn reflected(polynomial: &[f64], radius: f64) -> Vec<f64> {
    if is_within(polynomial, radius) {
        return polynomial.to_vec();
    }
    let n = polynomial.len();
    let whole = polynomial.iter().all(|p| p.is_finite());
    let companion = Mat::from_fn(n, n, |i, j| match (i, j) {
        (0, j) => -polynomial[j],
        (i, j) if i == j + 1 => 1.0,
        _ => 0.0,
    });
    let roots = if whole {
        companion.eigenvalues().ok()
    } else {
        None
    };
    let Some(roots) = roots else {
        return vec![0.0; n];
    };
    // Multiplied out again, with an imaginary part that cancels.
    let mut product = vec![(1.0, 0.0)];
    for root in roots {
        let (mut re, mut im) = (root.re, root.im);
        let square = re * re + im * im;
        if square > 1.0 {
            (re, im) = (re / square, im / square);
        }
        let size = re.hypot(im);
        let largest = LARGEST * radius;
        if size > largest {
            (re, im) = (re * largest / size, im * largest / size);
        }
        product.push((0.0, 0.0));
        for j in (1..product.len()).rev() {
            let (a, b) = product[j - 1];
            product[j].0 -= a * re - b * im;
            product[j].1 -= a * im + b * re;
        }
    }
    let reflected: Vec<f64> = product[1..].iter().map(|&(re, _)| re).collect();
    if is_within(&reflected, radius) {
        reflected
    } else {
        vec![0.0; n]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_inside_the_unit_circle_are_stable_and_others_are_not() {
        let is_stable = |p: &[f64]| is_within(p, 1.0);
        assert!(is_stable(&[]) && is_stable(&[-0.9]) && is_stable(&[-1.6, 0.8]));
        assert!(!is_stable(&[-1.0]) && !is_stable(&[-2.0, 0.9]) && !is_stable(&[f64::NAN]));
        // A pair of radius √0.8.
        assert!(is_within(&[-1.6, 0.8], 0.9) && !is_within(&[-1.6, 0.8], 0.89));
    }

    #[test]
    fn roots_outside_are_reflected_and_those_inside_stay() {
        // (1 − 2q⁻¹)(1 − 0.5q⁻¹): 2 becomes 0.5.
        let reflected = reflected(&[-2.5, 1.0], 1.0);
        assert!((reflected[0] + 1.0).abs() < 1e-12 && (reflected[1] - 0.25).abs() < 1e-12);
        // A pair: radius 2 at 60 degrees becomes radius 1/2.
        let pair = super::reflected(&[-2.0, 4.0], 1.0);
        assert!(
            (pair[0] + 0.5).abs() < 1e-12 && (pair[1] - 0.25).abs() < 1e-12,
            "{pair:?}"
        );
        assert_eq!(super::reflected(&[-0.3], 1.0), [-0.3]);
        assert_eq!(super::reflected(&[-0.99], 0.9), [-0.9 * LARGEST]);
    }
}
