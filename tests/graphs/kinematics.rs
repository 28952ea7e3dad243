//! What links do, carried to a point, and what that costs in light: the nodes `kinematics` and `optical_loss` side by side.

use crate::workbench::{Bench, Graph, problems};

fn arm() -> Graph {
    Graph::new()
        .signal("rate", "nm/min", "column arm", "1min")
        .signal("tilt", "urad/min", "base", "1min")
        .section("nodes.tool", "type = 'kinematics'")
        .with("inputs.links = ['tilt.base', 'rate.column', 'rate.arm']")
        .with("links = [{ length = '0 mm', along = [0, 0, 1], about = [0, 1, 0] },")
        .with("  { length = '400 mm', along = [0, 0, 1] },")
        .with("  { length = '250 mm', along = [1, 0, 0] }]")
        .section("nodes.loss", "type = 'optical_loss'")
        .with("inputs.drift = 'tool'; preset = 'mandelli'")
        .outputs("tool = 'tool'; loss = 'loss'")
}

#[test]
fn the_drifts_of_links_cost_the_light_that_the_drift_of_their_point_costs() {
    let mut bench = Bench::new(&arm(), &[]);
    let samples = [
        ("rate.column", 20.0),
        ("rate.arm", -5.0),
        ("tilt.base", 0.1),
    ];
    let found = bench.tick(0.0, &samples);
    // A turn about Y by 0.1 urad moves what stands 400 mm above by 40 nm along X, and what lies 250 mm beside by −25 nm along Z.
    let drift = [-5.0 + 40.0, 0.0, 20.0 - 25.0];
    for (found, expected) in found.iter().zip(drift) {
        assert!(
            (found - expected).abs() < 1e-9,
            "{found} instead of {expected}"
        );
    }
    let coefficients = [2.09059, 59.4658, 133.798];
    let loss = drift.iter().zip(coefficients);
    let loss: f64 = loss.map(|(nm, cost)| cost * (nm / 1000.0).powi(2)).sum();
    assert!(
        (found[3] - loss).abs() < 1e-6,
        "{} instead of {loss}",
        found[3]
    );
}

#[test]
fn the_displacement_of_what_grows_is_no_drift() {
    let still = arm().replace("nm/min", "nm").replace("urad/min", "urad");
    let problems = problems(&still);
    assert!(
        problems.contains("is in nm, which is no drift"),
        "{problems}"
    );
}
