//! The kernel against the oracles, against sums over every window's samples, and against itself.

use std::path::PathBuf;

use super::*;

const ABSENT: f64 = f64::NAN;

fn no_value() -> NoValue {
    NoValue {
        absent: ABSENT,
        cold: f64::from_bits(0x7ff8_0000_0000_0c01),
    }
}

fn is_cold(y: f64) -> bool {
    y.to_bits() == no_value().cold.to_bits()
}

fn is_absent(y: f64) -> bool {
    y.to_bits() == no_value().absent.to_bits()
}

/// The slope of the oracles: any two samples, however the window begins.
const TEXTBOOK: Coverage = Coverage {
    min_samples: 2,
    min_coverage: 0.0,
    cold_partial: true,
};

const DEFAULT: Coverage = Coverage {
    min_samples: 3,
    min_coverage: 0.5,
    cold_partial: false,
};

fn kernel(windows_s: &[f64], channels: usize, coverage: Coverage) -> RollingSlope {
    let windows: Vec<i64> = windows_s.iter().map(|&s| ns(s)).collect();
    RollingSlope::new(&windows, channels, coverage, no_value(), true)
}

fn ns(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

fn step(kernel: &mut RollingSlope, t_s: f64, y: &[f64]) -> Vec<f64> {
    assert!(kernel.push(ns(t_s), y));
    slopes(kernel)
}

fn slopes(kernel: &mut RollingSlope) -> Vec<f64> {
    let mut out = vec![0.0; kernel.channels() * kernel.windows()];
    kernel.slopes(&mut out);
    out
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Rows of one oracle file, an empty cell as NaN; nothing if the oracles are not there.
fn oracle(file: &str) -> Option<Vec<Vec<f64>>> {
    let shared = std::env::var_os("ATHERMAL_SHARED").map(PathBuf::from);
    let shared = shared
        .unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../../shared"));
    let path = shared.join("oracles/rolling_slope").join(file);
    let Ok(text) = std::fs::read_to_string(&path) else {
        eprintln!("skipped: {} cannot be read", path.display());
        return None;
    };
    let cell = |cell: &str| match cell {
        "" => f64::NAN,
        cell => cell.parse().expect("oracle cells are numbers"),
    };
    Some(
        text.lines()
            .skip(1)
            .map(|line| line.trim_end().split(',').map(cell).collect())
            .collect(),
    )
}

fn assert_close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!(
        (found.is_nan() && expected.is_nan()) || (found - expected).abs() <= tolerance,
        "{what}: found {found:e}, expected {expected:e}"
    );
}

#[test]
fn irregular_times_give_the_slopes_and_standard_errors_of_the_oracle() {
    let Some(input) = oracle("irregular_input.csv") else {
        return;
    };
    let expected = oracle("irregular_expected.csv").expect("it lies beside its input");
    let widths = [20.0, 60.0, 150.0];
    let mut kernel = kernel(&widths, 1, TEXTBOOK);
    let mut errors = [0.0; 3];
    let mut compared = 0;
    for (row, sample) in input.iter().enumerate() {
        let out = step(&mut kernel, sample[0], &sample[1..2]);
        kernel.stderr(&mut errors);
        for (w, width) in widths.iter().enumerate() {
            let line = &expected[w * input.len() + row];
            assert_eq!((line[0], line[1]), (*width, row as f64));
            assert_close(out[w], line[4], 1e-12, "slope");
            assert_close(errors[w], line[7], 1e-12, "standard error");
            compared += usize::from(line[7].is_finite());
        }
    }
    assert!(compared > 600);
}

/// Windows counted in samples are windows of so many seconds at 1 Hz.
fn compare_at_1_hz(input: &str, expected: &str, widths: &[f64], tolerance: f64) {
    let Some(input) = oracle(input) else {
        return;
    };
    let expected = oracle(expected).expect("it lies beside its input");
    let mut kernel = kernel(widths, 1, TEXTBOOK);
    let found: Vec<Vec<f64>> = input
        .iter()
        .map(|row| step(&mut kernel, row[0], &row[1..2]))
        .collect();
    let mut compared = 0;
    for line in expected.iter().filter(|line| line[2].is_finite()) {
        let window = widths.iter().position(|&w| w == line[0]);
        let window = window.expect("the oracle has these windows");
        assert_close(found[line[1] as usize][window], line[2], tolerance, "slope");
        compared += 1;
    }
    assert!(compared > 30);
}

#[test]
fn a_regular_clock_gives_the_slopes_of_the_oracle() {
    compare_at_1_hz(
        "regular_input.csv",
        "regular_expected.csv",
        &[2.0, 3.0, 10.0, 150.0, 300.0],
        1e-12,
    );
}

#[test]
fn unix_time_and_a_large_offset_keep_the_digits_of_the_oracle() {
    compare_at_1_hz(
        "stress_input.csv",
        "stress_expected.csv",
        &[300.0, 1343.0],
        1e-11,
    );
}

#[test]
fn a_bad_sample_leaves_no_trace_in_the_oracle() {
    for file in ["spike1e9", "nan", "inf"] {
        let Some(input) = oracle(&format!("pollution_{file}_input.csv")) else {
            return;
        };
        let expected = oracle("pollution_expected_after.csv").expect("it lies beside its input");
        let mut kernel = kernel(&[150.0], 1, TEXTBOOK);
        let found: Vec<f64> = input
            .iter()
            .map(|row| step(&mut kernel, row[0], &row[1..2])[0])
            .collect();
        assert!(!expected.is_empty());
        for line in &expected {
            assert_close(found[line[0] as usize], line[1], 1e-12, file);
        }
    }
}

/// A small generator, so that the series are the same on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}

struct Series {
    t: Vec<i64>,
    y: Vec<Vec<f64>>,
}

fn series(random: &mut Random, rows: usize, channels: usize, absent: f64, spikes: f64) -> Series {
    let mut t = ns(1.76e9);
    let mut level: Vec<f64> = (0..channels).map(|_| 40.0 * random.next()).collect();
    let mut series = Series {
        t: Vec::new(),
        y: Vec::new(),
    };
    let irregular = random.below(2) == 1;
    let mut row_absence = absent;
    for row in 0..rows {
        if row % 50 == 0 {
            row_absence = if random.below(3) == 0 { 0.0 } else { absent };
        }
        let gap = match random.below(100) {
            0 => 200.0 * random.next(),
            1..=30 => 0.01 + 3.0 * random.next(),
            _ => 1.0,
        };
        t += if irregular { ns(gap) } else { ns(1.0) };
        series.t.push(t);
        series.y.push(
            level
                .iter_mut()
                .map(|level| {
                    *level += 0.02 * (random.next() - 0.5);
                    if random.next() < row_absence {
                        f64::NAN
                    } else if random.next() < spikes {
                        1e9
                    } else {
                        *level
                    }
                })
                .collect(),
        );
    }
    series
}

enum Answer {
    Cold,
    Absent,
    Slope { slope: f64, error: f64, scale: f64 },
}

/// The definition, over all samples of the window; `scale` is the error that one unit in the last place of the samples makes.
fn by_definition(
    series: &Series,
    row: usize,
    channel: usize,
    width: i64,
    rule: Coverage,
) -> Answer {
    let now = series.t[row];
    let all: Vec<(i64, f64)> = (0..=row)
        .map(|r| (series.t[r], series.y[r][channel]))
        .filter(|sample| sample.1.is_finite())
        .collect();
    let Some(&(begun, _)) = all.first() else {
        return Answer::Absent;
    };
    if !rule.cold_partial && now - width < begun {
        return Answer::Cold;
    }
    let window: Vec<(f64, f64)> = all
        .into_iter()
        .filter(|sample| sample.0 > now - width)
        .map(|(t, y)| ((t - now) as f64 / 1e9, y))
        .collect();
    let n = window.len() as f64;
    let span = match (window.first(), window.last()) {
        (Some(first), Some(last)) => last.0 - first.0,
        _ => 0.0,
    };
    if window.len() < rule.min_samples.max(2) || span < rule.min_coverage * width as f64 / 1e9 {
        return Answer::Absent;
    }
    let mean_t = window.iter().map(|s| s.0).sum::<f64>() / n;
    let mean_y = window.iter().map(|s| s.1).sum::<f64>() / n;
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        window.iter().map(|s| f(s.0 - mean_t, s.1 - mean_y)).sum()
    };
    let sxx = sum(&|x, _| x * x);
    let slope = sum(&|x, y| x * y) / sxx;
    let residual = sum(&|x, y| (y - slope * x).powi(2));
    let largest = window.iter().map(|s| s.1.abs()).fold(0.0, f64::max);
    Answer::Slope {
        slope,
        error: (residual / (n - 2.0) / sxx).sqrt(),
        scale: f64::EPSILON * largest * (n / sxx).sqrt(),
    }
}

#[test]
fn any_absence_times_windows_and_rules_give_the_slope_by_definition() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut values, mut colds, mut absents) = (0, 0, 0);
    for round in 0..60 {
        let channels = 1 + random.below(5);
        let absent = [0.0, 0.02, 0.3, 0.9][random.below(4)];
        let spikes = [0.0, 0.01][random.below(2)];
        let rows = 60 + random.below(400);
        let series = series(&mut random, rows, channels, absent, spikes);
        let widths: Vec<f64> = (0..1 + random.below(4))
            .map(|_| [1.5, 7.0, 32.0, 33.0, 150.0, 290.25][random.below(6)])
            .collect();
        let rule = [TEXTBOOK, DEFAULT][round % 2];
        let mut kernel = kernel(&widths, channels, rule);
        let mut errors = vec![0.0; channels * widths.len()];
        for (row, &t) in series.t.iter().enumerate() {
            assert!(kernel.push(t, &series.y[row]));
            let out = slopes(&mut kernel);
            kernel.stderr(&mut errors);
            for (place, &found) in out.iter().enumerate() {
                let (channel, window) = (place / widths.len(), place % widths.len());
                match by_definition(&series, row, channel, ns(widths[window]), rule) {
                    Answer::Cold => {
                        assert!(is_cold(found), "round {round} row {row}: {found}");
                        colds += 1;
                    }
                    Answer::Absent => {
                        assert!(is_absent(found), "round {round} row {row}: {found}");
                        absents += 1;
                    }
                    Answer::Slope {
                        slope,
                        error,
                        scale,
                    } => {
                        let what = format!("round {round} row {row} place {place}");
                        let tolerance = 1e-9 * slope.abs() + 20.0 * scale;
                        assert_close(found, slope, tolerance, &what);
                        // Where two samples make up the whole error it is the rounding of the slope.
                        if error.is_finite() && error > 1e6 * scale {
                            assert_close(errors[place], error, 1e-6 * error, &what);
                        }
                        values += 1;
                    }
                }
            }
        }
    }
    assert!(values > 10_000 && colds > 1_000 && absents > 1_000);
}

#[test]
fn two_spikes_in_a_row_leave_no_trace_in_any_window() {
    let widths = [5.0, 20.0, 150.0];
    for at in 40..80 {
        let mut clean = kernel(&widths, 2, TEXTBOOK);
        let mut spiked = kernel(&widths, 2, TEXTBOOK);
        for row in 0..400 {
            let t = f64::from(row);
            let y = [22.0 + 1e-3 * (t / 9.0).sin(), 5.0 - 1e-4 * t];
            let bad = [1e9, if row % 3 == 0 { f64::NAN } else { y[1] }];
            let wanted = step(&mut clean, t, &y);
            let found = step(&mut spiked, t, if row / 2 * 2 == at { &bad } else { &y });
            for (place, found) in found.iter().enumerate() {
                let width = widths[place % 3];
                if row < at || t - f64::from(at + 1) >= width {
                    assert_close(*found, wanted[place], 1e-13, "after the spikes");
                }
            }
        }
    }
}

#[test]
fn a_window_is_cold_until_it_has_been_open_since_the_channels_first_sample() {
    let mut kernel = kernel(&[10.0], 3, DEFAULT);
    for row in 0..40 {
        let t = f64::from(row);
        let late = if row < 7 { f64::NAN } else { 3.0 * t };
        let out = step(&mut kernel, t, &[2.0 * t, late, f64::NAN]);
        assert_eq!(is_cold(out[0]), row < 10, "row {row}");
        assert_eq!(is_absent(out[1]), row < 7, "row {row}");
        assert_eq!(is_cold(out[1]), (7..17).contains(&row), "row {row}");
        assert!(is_absent(out[2]));
        if row >= 17 {
            assert_close(out[0], 2.0, 1e-13, "first channel");
            assert_close(out[1], 3.0, 1e-13, "late channel");
        }
    }
}

#[test]
fn samples_must_span_the_stated_part_of_the_window() {
    let mut kernel = kernel(&[10.0], 2, DEFAULT);
    for row in 0..20 {
        step(&mut kernel, f64::from(row), &[1.0, 1.0]);
    }
    // The second channel is silent from 20 s on: at 24 s its window holds 15 s to 19 s, which is less than half.
    for row in 20..26 {
        let out = step(&mut kernel, f64::from(row), &[1.0, f64::NAN]);
        assert_close(out[0], 0.0, 1e-15, "first channel");
        assert_eq!(is_absent(out[1]), row >= 24, "row {row}");
    }
    assert_eq!(kernel.newest_ns(0), Some(ns(25.0)));
    assert_eq!(kernel.newest_ns(1), Some(ns(19.0)));
}

#[test]
fn half_of_the_width_exactly_is_enough() {
    let mut kernel = kernel(&[10.0], 1, DEFAULT);
    for t in [0.0, 0.1, 10.1, 12.6] {
        step(&mut kernel, t, &[t]);
    }
    let out = step(&mut kernel, 15.1, &[15.1]);
    assert_close(out[0], 1.0, 1e-12, "10.1 s to 15.1 s");
    let out = step(&mut kernel, 20.1 - 1e-9, &[20.1]);
    assert!(out[0].is_finite());
}

#[test]
fn a_restored_kernel_continues_with_the_same_bits() {
    let mut random = Random(77);
    for absent in [0.0, 0.05, 0.7] {
        let series = series(&mut random, 900, 3, absent, 0.01);
        let mut kernel = kernel(&[3.0, 40.0, 300.0], 3, DEFAULT);
        for cut in 0..30 {
            let text = serde_json::to_string(&kernel).expect("the state is plain data");
            let mut restored: RollingSlope =
                serde_json::from_str(&text).expect("it was written so");
            let rows = cut * 30..cut * 30 + 30;
            let mut ahead = kernel.clone();
            assert_eq!(bits(&slopes(&mut kernel)), bits(&slopes(&mut restored)));
            for row in rows.start..(rows.start + 400).min(900) {
                assert!(ahead.push(series.t[row], &series.y[row]));
                assert!(restored.push(series.t[row], &series.y[row]));
                assert_eq!(
                    bits(&slopes(&mut ahead)),
                    bits(&slopes(&mut restored)),
                    "{row}"
                );
            }
            for row in rows {
                kernel.push(series.t[row], &series.y[row]);
            }
        }
    }
}

#[test]
fn a_state_that_does_not_fit_is_refused() {
    let mut kernel = kernel(&[3.0], 1, DEFAULT);
    for row in 0..50 {
        step(&mut kernel, f64::from(row), &[1.0]);
    }
    let state = serde_json::to_value(&kernel).expect("the state is plain data");
    let broken = |key: &str, value: serde_json::Value| {
        let mut state = state.clone();
        state[key] = value;
        serde_json::from_value::<RollingSlope>(state)
            .err()
            .map(|e| e.to_string())
            .unwrap_or_default()
    };
    assert!(broken("samples", serde_json::json!([1.0])).contains("lengths"));
    let times = state["times_ns"].as_array().cloned().unwrap_or_default();
    let backwards = times.into_iter().rev().collect();
    assert!(broken("times_ns", backwards).contains("increase"));
    assert!(broken("origins", serde_json::json!([])).contains("lengths"));
    assert!(broken("cuts", serde_json::json!([99])).contains("cuts"));
}

#[test]
fn a_reset_kernel_gives_the_bits_of_a_new_one() {
    let mut random = Random(5);
    let series = series(&mut random, 300, 2, 0.1, 0.01);
    let mut used = kernel(&[3.0, 40.0], 2, DEFAULT);
    for row in 0..300 {
        used.push(series.t[row], &series.y[row]);
    }
    used.reset();
    assert_eq!(used.last_time(), None);
    let mut new = kernel(&[3.0, 40.0], 2, DEFAULT);
    for row in 0..300 {
        assert!(used.push(series.t[row], &series.y[row]));
        assert!(new.push(series.t[row], &series.y[row]));
        assert_eq!(bits(&slopes(&mut used)), bits(&slopes(&mut new)));
    }
}

#[test]
fn a_time_that_does_not_advance_changes_nothing() {
    let mut kernel = kernel(&[5.0], 1, TEXTBOOK);
    step(&mut kernel, 1.0, &[1.0]);
    let out = step(&mut kernel, 2.0, &[3.0]);
    assert!(!kernel.push(ns(2.0), &[100.0]));
    assert!(!kernel.push(i64::MIN, &[100.0]));
    assert_eq!(bits(&slopes(&mut kernel)), bits(&out));
    assert!(kernel.push(i64::MAX, &[1e300]));
    assert!(is_absent(slopes(&mut kernel)[0]));
}

#[test]
fn a_channel_that_is_absent_does_not_touch_a_bit_of_the_others() {
    let windows = [50.0, 150.0, 700.0];
    let absent: [fn(usize) -> bool; 3] =
        [|_| true, |row| row >= 100, |row| row > 0 && row % 3 == 0];
    for (nth, when) in absent.into_iter().enumerate() {
        let (mut whole, mut holed) = (kernel(&windows, 6, DEFAULT), kernel(&windows, 6, DEFAULT));
        let mut t = 0.0;
        for row in 0..400_usize {
            t += 7.0 + (row * 37 % 11) as f64 * 0.61;
            let y: Vec<f64> = (0..6)
                .map(|c| 20.0 + c as f64 + (0.01 * t * (c + 1) as f64).sin())
                .collect();
            let mut with_hole = y.clone();
            if when(row) {
                with_hole[2] = f64::NAN;
            }
            let (one, other) = (step(&mut whole, t, &y), step(&mut holed, t, &with_hole));
            for channel in [0, 1, 3, 4, 5] {
                let its = channel * 3..channel * 3 + 3;
                assert_eq!(
                    bits(&one[its.clone()]),
                    bits(&other[its]),
                    "slopes of {channel} in row {row}, absence {nth}"
                );
            }
        }
        assert!(
            slopes(&mut whole)[..3]
                .iter()
                .all(|slope| slope.is_finite())
        );
    }
}
