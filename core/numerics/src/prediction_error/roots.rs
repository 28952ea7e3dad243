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
    while !p.is_empty() {
        let Some(shorter) = stepped_down(&p) else {
            return false;
        };
        p = shorter;
    }
    true
}

/// The polynomial with a coefficient less in the step-down recursion; none where one of its roots is not inside the unit circle,
/// as far as the last coefficient tells.
fn stepped_down(p: &[f64]) -> Option<Vec<f64>> {
    let (&last, rest) = p.split_last()?;
    let scale = 1.0 - last * last;
    let shorter = rest.iter().zip(rest.iter().rev());
    // So that NaN fails.
    let inside = last.abs() < 1.0 - 1e-9;
    inside.then(|| {
        shorter
            .map(|(p, other)| (p - last * other) / scale)
            .collect()
    })
}

/// The correlation of what `1/(1 + p₁ q⁻¹ + … + p_n q⁻ⁿ)` makes of white noise with itself so many samples before, from none to one
/// less than there are coefficients: each from the shorter ones by the polynomial of its order in the step-down recursion (Brockwell
/// and Davis 1991, section 5.2). Those of a filter that grows are 0 but for the first.
pub(super) fn alike(polynomial: &[f64]) -> Vec<f64> {
    let mut orders = vec![polynomial.to_vec()];
    while let Some(shorter) = orders.last().and_then(|of| stepped_down(of)) {
        orders.push(shorter);
    }
    let mut alike = vec![0.0; polynomial.len()];
    if let Some(first) = alike.first_mut() {
        *first = 1.0;
    }
    // Down to the one without coefficients, or a root was not inside.
    if orders.len() == polynomial.len() + 1 {
        for lag in 1..alike.len() {
            let of_order = orders[orders.len() - 1 - lag].iter();
            let earlier = of_order.zip(alike[..lag].iter().rev());
            alike[lag] = -earlier.map(|(p, alike)| p * alike).sum::<f64>();
        }
    }
    alike
}

/// The same polynomial with all roots so many times as large that the largest just lies within the radius.
pub(super) fn on_edge(p: &[f64], radius: f64) -> Vec<f64> {
    let scaled = |by: f64| -> Vec<f64> {
        let powers = (1..).map(|power| by.powi(power));
        p.iter().zip(powers).map(|(p, by)| p * by).collect()
    };
    let (mut inside, mut outside) = (1.0, 2.0);
    while outside - inside > f64::EPSILON {
        let middle = 0.5 * (inside + outside);
        if middle <= inside || middle >= outside {
            break;
        }
        if is_within(&scaled(middle), radius) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    scaled(inside)
}

/// The polynomial with its roots outside of the unit circle reflected into it, and those that are then outside of the circle
/// of this radius drawn into that; of zeros where they cannot be found.
pub(super) fn reflected(polynomial: &[f64], radius: f64) -> Vec<f64> {
    if is_within(polynomial, radius) {
        return polynomial.to_vec();
    }
    let Some(roots) = roots(polynomial) else {
        return vec![0.0; polynomial.len()];
    };
    // Multiplied out again, with an imaginary part that cancels.
    let mut product = vec![(1.0, 0.0)];
    for (mut re, mut im) in roots {
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
        vec![0.0; polynomial.len()]
    }
}

/// The roots, each as its real and its imaginary part; none where they cannot be found.
fn roots(polynomial: &[f64]) -> Option<Vec<(f64, f64)>> {
    let n = polynomial.len();
    if !polynomial.iter().all(|p| p.is_finite()) {
        return None;
    }
    let companion = Mat::from_fn(n, n, |i, j| match (i, j) {
        (0, j) => -polynomial[j],
        (i, j) if i == j + 1 => 1.0,
        _ => 0.0,
    });
    let roots = companion.eigenvalues().ok()?;
    Some(roots.iter().map(|root| (root.re, root.im)).collect())
}

/// How a filter `1/(1 + p₁ q⁻¹ + … + p_n q⁻ⁿ)` comes to rest, in steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fading {
    /// In how many steps it does, but for 1/e of the way; infinite where it stays, negative where it grows.
    pub time_constant: f64,
    /// The steps of a swing, where there are two roots that swing together, or one that alternates.
    pub period: Option<f64>,
}

impl Fading {
    /// One for each real root and each pair of the polynomial without its leading 1, the slowest first.
    #[must_use]
    pub fn of(polynomial: &[f64]) -> Vec<Self> {
        let roots = roots(polynomial).unwrap_or_default();
        let upper = roots.into_iter().filter(|&(_, im)| im >= 0.0);
        let mut fading: Vec<Self> = upper
            .map(|(re, im)| Self {
                time_constant: match re.hypot(im).ln() {
                    // A root that rounding alone keeps off the unit circle.
                    log if log.abs() < 1e-9 => f64::INFINITY,
                    log => -1.0 / log,
                },
                period: (im > 0.0 || re < 0.0).then(|| std::f64::consts::TAU / im.atan2(re)),
            })
            .collect();
        fading.sort_by(|a, b| {
            let rate = |of: &Self| 1.0 / of.time_constant;
            rate(a).total_cmp(&rate(b))
        });
        fading
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
    fn a_filter_fades_as_its_roots_do() {
        let root = |time_constant: f64| (-1.0 / time_constant).exp();
        let (slow, fast) = (root(20.0), root(3.0));
        let [first, second] = Fading::of(&[-slow - fast, slow * fast])[..] else {
            panic!("two roots")
        };
        assert!((first.time_constant - 20.0).abs() < 1e-9 && first.period.is_none());
        assert!((second.time_constant - 3.0).abs() < 1e-9 && second.period.is_none());
        // A pair that takes 12 steps for a swing.
        let (size, angle) = (root(8.0), std::f64::consts::TAU / 12.0);
        let [pair] = Fading::of(&[-2.0 * size * angle.cos(), size * size])[..] else {
            panic!("a pair is one")
        };
        assert!((pair.time_constant - 8.0).abs() < 1e-9);
        assert!((pair.period.unwrap() - 12.0).abs() < 1e-9);
        assert_eq!(Fading::of(&[-1.0])[0].time_constant, f64::INFINITY);
        assert_eq!(Fading::of(&[0.5])[0].period, Some(2.0));
        assert!(Fading::of(&[-1.1])[0].time_constant < 0.0);
        assert!(Fading::of(&[]).is_empty() && Fading::of(&[f64::NAN]).is_empty());
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
