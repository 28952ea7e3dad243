//! What makes a sensor faulty, and when it is trusted again.

use super::machine::{Machine, NONE, compiled, goes_on_alike};

const GRAPH: &str = r#"
[signals.t]
unit = "Cel"
channels = ["a"]
max_age = "1min"
[nodes.health]
type = "health"
inputs.signal = "t"
range = ["0 Cel", "100 Cel"]
max_rate = "1 K/s"
stuck_after = "1min"
max_gap = "30s"
recover = "20s"
[outputs]
t = "health"
reason = "health:reason"
"#;

/// A value that is never the same twice.
fn alive(t: f64) -> f64 {
    20.0 + 0.01 * (t * 0.7).sin()
}

fn at(machine: &mut Machine, t: f64, value: f64) -> (f64, bool) {
    machine.step(t, &[value]);
    (machine.get("reason.a"), machine.get("t.a") == value)
}

#[test]
fn a_value_out_of_range_is_absent_and_the_channel_recovers_after_its_time() {
    let mut machine = Machine::new(GRAPH);
    assert_eq!(at(&mut machine, 0.0, alive(0.0)), (0.0, true));
    assert_eq!(at(&mut machine, 10.0, 150.0), (1.0, false));
    assert_eq!(at(&mut machine, 20.0, alive(20.0)), (7.0, false));
    assert_eq!(at(&mut machine, 30.0, alive(30.0)), (7.0, false));
    assert_eq!(at(&mut machine, 40.0, alive(40.0)), (0.0, true));
}

#[test]
fn a_jump_a_stuck_value_and_a_silence_are_told_apart() {
    let mut machine = Machine::new(GRAPH);
    at(&mut machine, 0.0, 20.0);
    assert_eq!(at(&mut machine, 10.0, 30.1).0, 2.0);
    let mut machine = Machine::new(GRAPH);
    let reasons: Vec<f64> = (0..8)
        .map(|i| at(&mut machine, f64::from(i) * 10.0, 20.0).0)
        .collect();
    assert_eq!(reasons, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 3.0]);
    let mut machine = Machine::new(GRAPH);
    at(&mut machine, 0.0, 20.0);
    assert_eq!(at(&mut machine, 30.0, NONE).0, 0.0);
    assert_eq!(at(&mut machine, 31.0, NONE).0, 6.0);
    assert_eq!(Machine::new(GRAPH).step(0.0, &[NONE]).get("reason.a"), 0.0);
}

#[test]
fn a_sensor_that_sends_what_is_out_of_range_is_not_silent() {
    let both = GRAPH.replace("[\"a\"]", "[\"a\", \"b\"]");
    let mut machine = Machine::new(&both);
    for second in 0..100 {
        let t = f64::from(second);
        let value = if second % 10 == 0 { 150.0 } else { NONE };
        machine.step(t, &[value, alive(t)]);
        assert_eq!(machine.get("reason.a"), 1.0, "at {t} s");
    }
}

#[test]
fn a_value_that_comes_again_after_a_silence_is_not_stuck() {
    let without = GRAPH.replace("max_gap = \"30s\"\n", "");
    for graph in [GRAPH, &without] {
        let mut machine = Machine::new(graph);
        at(&mut machine, 0.0, 20.0);
        let reasons = [3600.0, 3610.0, 3650.0, 3660.0].map(|t| at(&mut machine, t, 20.0).0);
        let gap = if graph == GRAPH { 0.0 } else { 3.0 };
        assert_eq!(reasons, [0.0, 0.0, 0.0, gap]);
    }
}

#[test]
fn noise_is_judged_by_successive_differences() {
    let noisy = GRAPH.replace(
        "max_gap = \"30s\"",
        "noise_above = \"1 mK\"\nnoise_below = \"0.1 K\"\nnoise_samples = 11\nmax_gap = \"30s\"",
    );
    // Differences of ±d have the noise d / √2: 1.2 mK give 0.85 mK, 1.6 mK give 1.13 mK, 0.16 K give 0.113 K.
    for (step, expected) in [(0.0012, 4.0), (0.0016, 0.0), (0.16, 5.0)] {
        let mut machine = Machine::new(&noisy);
        let mut reason = NONE;
        for i in 0..11 {
            assert!(
                reason.is_nan() || reason == 0.0,
                "only once there are samples enough"
            );
            reason = at(
                &mut machine,
                f64::from(i) * 10.0,
                20.0 + step * f64::from(i % 2),
            )
            .0;
        }
        assert_eq!(reason, expected, "steps of {step} K");
    }
    let rows: Vec<_> = (0..100)
        .map(|i| (f64::from(i), vec![alive(f64::from(i * i % 17))]))
        .collect();
    goes_on_alike(&noisy, &rows);
}

#[test]
fn of_a_jump_no_noise_remains_once_its_samples_are_past() {
    let long = GRAPH
        .replace("range = [\"0 Cel\", \"100 Cel\"]", "noise_samples = 500")
        .replace("max_rate = \"1 K/s\"", "noise_below = \"5 mK\"");
    let mut machine = Machine::new(&long);
    // The jump and the way back are two differences of 499; their squares leave no digits for those of the others.
    let reasons: Vec<f64> = (0..1100)
        .map(|i| {
            let jump = if i == 550 { 1e9 } else { 0.0 };
            at(&mut machine, f64::from(i), alive(f64::from(i)) + jump).0
        })
        .collect();
    assert!(reasons[..550].iter().all(|&reason| reason == 0.0));
    assert!(reasons[550..1050].iter().all(|&reason| reason == 5.0));
    assert!(reasons[1050..1070].iter().all(|&reason| reason == 7.0));
    assert!(reasons[1070..].iter().all(|&reason| reason == 0.0));
}

#[test]
fn a_watch_without_a_check_is_warned_of_and_one_that_contradicts_itself_refused() {
    let nothing = r#"
[signals.t]
unit = "Cel"
channels = ["a"]
[nodes.health]
type = "health"
inputs.signal = "t"
[outputs]
t = "health"
"#;
    let (plan, told) = compiled(nothing);
    assert!(
        plan.is_ok() && told.contains("every sample passes"),
        "{told}"
    );
    let told = compiled(&GRAPH.replace("\"100 Cel\"", "\"-5 Cel\""))
        .0
        .unwrap_err();
    assert!(told.contains("not below the highest"), "{told}");
    for at in ["stuck_after = \"1min\"", "max_gap = \"30s\""] {
        let (name, _) = at.split_once(' ').unwrap();
        let never = GRAPH.replace(at, &format!("{name} = \"0s\""));
        let told = compiled(&never).0.unwrap_err();
        assert!(
            told.contains(&format!("`{name}` is 0s and must be greater than 0")),
            "{told}"
        );
    }
    let told = compiled(&GRAPH.replace("1 K/s", "1 nm/s")).0.unwrap_err();
    assert!(told.contains("cannot be in K/s"), "{told}");
}
