//! When a windowed value exists: not while the window is cold, too empty or too short.

use super::samples;
use crate::workbench::Bench;

fn slope(parameters: &str) -> Bench {
    let text = samples()
        .slope("gradients", "temperature", "150s", "mK/min")
        .with(parameters)
        .outputs("out = 'gradients'; position = 'position'");
    Bench::new(&text, &[])
}

/// The instants at which the slope of the room has a value, given those of its samples.
fn there(bench: &mut Bench, instants: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut there = Vec::new();
    for now in instants {
        bench.tick(now, &[("temperature.room", 20.0 + now / 60.0)]);
        let value = bench.value("gradients.room");
        if !value.is_nan() {
            assert!((value - 1000.0).abs() < 1e-6, "{value}");
            there.push(now);
        }
    }
    there
}

fn every_ten(from: u32, to: u32) -> impl Iterator<Item = f64> {
    (from..=to).step_by(10).map(f64::from)
}

#[test]
fn a_window_is_cold_until_it_reaches_back_no_further_than_the_first_value() {
    assert_eq!(
        there(&mut slope(""), every_ten(0, 180)),
        [150.0, 160.0, 170.0, 180.0]
    );
}

#[test]
fn each_channel_warms_up_by_itself() {
    let mut bench = slope("");
    for now in every_ten(0, 240) {
        let mut samples = vec![("temperature.chuck", 30.0)];
        if now >= 60.0 {
            samples.push(("temperature.room", 20.0));
        }
        bench.tick(now, &samples);
        assert_eq!(
            bench.value("gradients.chuck").is_nan(),
            now < 150.0,
            "at {now}"
        );
        assert_eq!(
            bench.value("gradients.room").is_nan(),
            now < 210.0,
            "at {now}"
        );
    }
}

#[test]
fn a_partial_window_needs_three_samples_that_span_half_of_it() {
    let there = there(&mut slope("cold = \"partial\""), every_ten(0, 100));
    assert_eq!(there, [80.0, 90.0, 100.0], "75 s are half of the window");
}

#[test]
fn the_textbook_slope_exists_from_the_second_sample_on() {
    let mut bench = slope("cold = \"partial\"\nmin_samples = 2\nmin_coverage = 0");
    assert_eq!(there(&mut bench, every_ten(0, 30)), [10.0, 20.0, 30.0]);
}

#[test]
fn a_warm_window_with_too_few_or_too_close_samples_has_no_value() {
    let mut bench = slope("");
    let warm = there(&mut bench, every_ten(0, 200));
    assert_eq!(warm[warm.len() - 1], 200.0);
    // After a gap: alone at 400; two at 420; then many, but within less than 75 s; at 480 they span 80 s.
    assert_eq!(
        there(&mut bench, [400.0, 420.0, 440.0, 460.0, 470.0, 480.0]),
        [480.0]
    );
    // Sparse again: (480, 630] holds only the newest, (500, 650] two, (520, 670] three over 40 s.
    assert_eq!(there(&mut bench, [630.0, 650.0, 670.0]), [0.0; 0]);
}

#[test]
fn a_window_is_open_at_its_beginning() {
    // At 300 s the window is (150 s, 300 s]: the sample at 150 s, far off the line, is outside.
    let mut bench = slope("");
    for now in every_ten(0, 300) {
        let value = if now == 150.0 {
            150.0
        } else {
            20.0 + now / 60.0
        };
        bench.tick(now, &[("temperature.room", value)]);
    }
    assert!(
        (bench.value("gradients.room") - 1000.0).abs() < 1e-6,
        "{}",
        bench.value("gradients.room")
    );
}
