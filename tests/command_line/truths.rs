//! What is said of the truths that predictions are scored against.

use crate::desk;
use crate::workbench::athermal;

#[test]
fn the_error_of_a_truth_is_told_as_what_it_is() {
    let (_scratch, plain, data, _) = desk("truth-error");
    let told = athermal(&[&"evaluate", &plain, &"--data", &data]).ended(0);
    assert!(told.out.contains("standard error of the truth") && !told.out.contains("noise"));
    for (command, part) in [
        ("evaluate", "curvature"),
        ("diagnose", "standard error of its"),
    ] {
        let help = athermal(&[&command, &"--help"]).ended(0).out;
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(help.contains(part), "{help}");
    }
}
