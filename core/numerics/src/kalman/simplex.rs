//! Minimisation without derivatives, for functions of a few variables. Decides where the minimum is; not where to start.

/// How much smaller the values at the corners may still differ when the search ends.
const TOLERANCE: f64 = 1e-9;
const MOST_STEPS: usize = 400;

/// The least value found near `start` by a simplex that moves and shrinks (Nelder and Mead 1965), and where it is. Places
/// outside of `bounds` are moved to their edge; a value that is not a number counts as infinite.
pub(super) fn minimum(
    mut of: impl FnMut(&[f64]) -> f64,
    start: &[f64],
    step: f64,
    bounds: (f64, f64),
) -> (Vec<f64>, f64) {
    let order = start.len();
    let mut value = |at: &mut Vec<f64>| {
        for place in at.iter_mut() {
            *place = place.clamp(bounds.0, bounds.1);
        }
        let value = of(at);
        if value.is_nan() { f64::INFINITY } else { value }
    };
    let mut corners: Vec<(Vec<f64>, f64)> = (0..=order)
        .map(|nth| {
            let mut at = start.to_vec();
            if nth > 0 {
                at[nth - 1] += step;
            }
            let found = value(&mut at);
            (at, found)
        })
        .collect();
    for _ in 0..MOST_STEPS {
        corners.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (best, worst) = (corners[0].1, corners[order].1);
        if !best.is_finite() || worst - best <= TOLERANCE * (1.0 + best.abs()) && close(&corners) {
            break;
        }
        let middle: Vec<f64> = (0..order)
            .map(|i| corners[..order].iter().map(|(at, _)| at[i]).sum::<f64>() / order as f64)
            .collect();
        let mut beyond = |by: f64| {
            let from = &corners[order].0;
            let mut at: Vec<f64> = middle
                .iter()
                .zip(from)
                .map(|(m, w)| m + by * (m - w))
                .collect();
            let found = value(&mut at);
            (at, found)
        };
        let reflected = beyond(1.0);
        let next = if reflected.1 < best {
            let expanded = beyond(2.0);
            Some(if expanded.1 < reflected.1 {
                expanded
            } else {
                reflected
            })
        } else if reflected.1 < corners[order - 1].1 {
            Some(reflected)
        } else {
            let contracted = if reflected.1 < worst {
                beyond(0.5)
            } else {
                beyond(-0.5)
            };
            (contracted.1 < worst.min(reflected.1)).then_some(contracted)
        };
        if let Some(next) = next {
            corners[order] = next;
        } else {
            let best = corners[0].0.clone();
            for (at, found) in &mut corners[1..] {
                for (place, best) in at.iter_mut().zip(&best) {
                    *place = 0.5 * (*place + best);
                }
                *found = value(at);
            }
        }
    }
    corners.sort_by(|a, b| a.1.total_cmp(&b.1));
    corners.swap_remove(0)
}

/// Whether the corners lie together, so that equal values on either side of a minimum do not end the search.
fn close(corners: &[(Vec<f64>, f64)]) -> bool {
    let (best, others) = (&corners[0].0, &corners[1..]);
    others
        .iter()
        .all(|(at, _)| at.iter().zip(best).all(|(a, b)| (a - b).abs() < 1e-3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        let valley = |at: &[f64]| (1.0 - at[0]).powi(2) + 100.0 * (at[1] - at[0] * at[0]).powi(2);
        let (at, least) = minimum(valley, &[-1.2, 1.0], 0.5, (-5.0, 5.0));
        assert!(least < 1e-8 && (at[0] - 1.0).abs() < 1e-3, "{at:?} {least}");
    }

    #[test]
    fn a_minimum_beyond_the_bounds_is_looked_for_at_their_edge() {
        let (at, _) = minimum(|at| at[0], &[0.0], 1.0, (-3.0, 3.0));
        assert_eq!(at, [-3.0]);
    }
}
