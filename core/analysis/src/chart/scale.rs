//! How numbers fall on an axis: ranges, round marks, decimation of lines that keeps extremes and of dots that keeps density.

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

/// At most so many points and the outermost four, one of each stretch, so that of many dots as large a share is left anywhere: where they are
/// dense stays seen. Those without a value are left out.
pub(super) fn thinned(x: &[f64], y: &[f64], most: usize) -> Vec<(f64, f64)> {
    let points = x.iter().copied().zip(y.iter().copied());
    let there: Vec<(f64, f64)> = points.filter(|(x, y)| !x.is_nan() && !y.is_nan()).collect();
    let count = there.len();
    if count <= most {
        return there;
    }
    // One of each stretch, and not the same in all: what comes again and again in the data would be met always or never.
    let one_of = |nth: usize| {
        let (from, to) = (nth * count / most, (nth + 1) * count / most);
        let mixed = (nth as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32;
        from + mixed as usize % (to - from)
    };
    let mut kept: Vec<usize> = (0..most).map(one_of).collect();
    for of in [|of: &(f64, f64)| of.0, |of: &(f64, f64)| of.1] {
        let by = |a: &usize, b: &usize| of(&there[*a]).total_cmp(&of(&there[*b]));
        kept.extend((0..count).min_by(by));
        kept.extend((0..count).max_by(by));
    }
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|nth| there[nth]).collect()
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
    fn of_many_dots_an_equal_share_is_left_anywhere_and_the_outermost() {
        let sizes = (0..20_000_u32).map(|nth| f64::from(nth.wrapping_mul(2_654_435_761) >> 8));
        let mut x: Vec<f64> = sizes.map(|of| of / f64::from(1_u32 << 24)).collect();
        // Nine in ten lie in the lower half.
        for (nth, x) in x.iter_mut().enumerate() {
            *x = 0.5 * *x + if nth % 10 == 7 { 0.5 } else { 0.0 };
        }
        let mut y = x.clone();
        (x[5], y[777], y[778]) = (-3.0, 9.0, f64::NAN);
        let kept = thinned(&x, &y, 3000);
        assert!(kept.len() <= 3004 && kept.len() >= 3000);
        let low = kept.iter().filter(|of| of.0 < 0.5).count() as f64;
        let share = low / kept.len() as f64;
        assert!((share - 0.9).abs() < 0.03, "{share}");
        assert!(kept.contains(&(-3.0, y[5])) && kept.contains(&(x[777], 9.0)));
        assert!(kept.iter().all(|of| !of.1.is_nan()));
        assert_eq!(thinned(&x[..100], &y[..100], 3000).len(), 100);
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(-3.0, 103.0, 5), [0.0, 50.0, 100.0]);
        assert_eq!(ticks(0.0, 1.0, 5).len(), 6);
        assert_eq!(ticks(1.0, 1.0, 5), [1.0]);
    }
}
