//! Decides how numbers fall on an axis: ranges, round marks, decimation that keeps extremes.

/// At most about twice as many points as `buckets`: of each stretch of x the lowest and the highest, in their order.
pub(super) fn decimated(x: &[f64], y: &[f64], buckets: usize) -> Vec<(f64, f64)> {
    let count = x.len().min(y.len());
    if count <= 2 * buckets {
        return (0..count).map(|i| (x[i], y[i])).collect();
    }
    let per = count.div_ceil(buckets);
    let mut kept = Vec::with_capacity(2 * buckets);
    for from in (0..count).step_by(per) {
        let stretch = from..(from + per).min(count);
        let present = || stretch.clone().filter(|&i| !y[i].is_nan());
        let low = present().min_by(|&a, &b| y[a].total_cmp(&y[b]));
        let high = present().max_by(|&a, &b| y[a].total_cmp(&y[b]));
        match (low, high) {
            (Some(low), Some(high)) => {
                kept.push((x[low.min(high)], y[low.min(high)]));
                if low != high {
                    kept.push((x[low.max(high)], y[low.max(high)]));
                }
            }
            _ => kept.push((x[from], f64::NAN)),
        }
    }
    kept
}

/// Round numbers that divide a range.
pub(super) fn ticks(low: f64, high: f64, about: usize) -> Vec<f64> {
    let raw = (high - low) / about as f64;
    if !(raw > 0.0 && raw.is_finite()) {
        return vec![low];
    }
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|nice| nice * power)
        .find(|step| *step >= raw)
        .unwrap_or(10.0 * power);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).map(|n| n as f64 * step).collect()
}

/// The same for a number of decimals that the step needs.
pub(super) fn label(value: f64, step: f64) -> String {
    let decimals = (-step.log10()).ceil().max(0.0) as usize;
    if decimals > 6 {
        return format!("{value:.1e}");
    }
    format!("{value:.decimals$}")
}

pub(super) fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .filter(|value| value.is_finite())
        .fold(None, |range, value| {
            let (low, high) = range.unwrap_or((value, value));
            Some((f64::min(low, value), f64::max(high, value)))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimation_keeps_the_lowest_and_the_highest_and_shows_gaps() {
        let x: Vec<f64> = (0..100_000).map(f64::from).collect();
        let mut y: Vec<f64> = x.iter().map(|x| (x * 0.001).sin()).collect();
        (y[12_345], y[70_001]) = (50.0, -40.0);
        y[30_000..40_000].fill(f64::NAN);
        let kept = decimated(&x, &y, 1000);
        assert!(kept.len() <= 2000);
        assert!(kept.contains(&(12_345.0, 50.0)) && kept.contains(&(70_001.0, -40.0)));
        assert!(kept.iter().any(|(_, y)| y.is_nan()));
        assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(-3.0, 103.0, 5), [0.0, 50.0, 100.0]);
        assert_eq!(ticks(0.0, 1.0, 5).len(), 6);
        assert_eq!(ticks(1.0, 1.0, 5), [1.0]);
    }
}
