//! Mistakes in parameters are told beside those in inputs, at once.

use crate::workbench::Read;

#[test]
fn what_is_wrong_with_a_parameter_is_told_though_the_inputs_are_wrong_too() {
    let head =
        "schema = 1\n[signals.position]\nunit = \"nm\"\nchannels = [\"X\"]\nmax_age = \"3min\"\n";
    for (node, wrong) in [
        (
            "type = \"slope\"\nwindows = [\"5min\"]\nmin_samples = 1",
            "`min_samples` is 1",
        ),
        (
            "type = \"moving\"\nwindows = [\"5min\", \"5min\"]",
            "stands twice",
        ),
        (
            "type = \"hampel\"\nwindow = \"1min\"\nthreshold = -3.0",
            "`threshold` is -3",
        ),
        ("type = \"lag\"\nlags = []", "there is no lag"),
        ("type = \"difference\"\nover = \"0s\"", "`over` is 0s"),
        ("type = \"resample\"\nevery = \"0s\"", "`every` is 0s"),
        (
            "type = \"first_order\"\ntime_constants = []",
            "there must be one",
        ),
        ("type = \"scale\"\nfactor = inf", "`factor` is inf"),
        ("type = \"sum\"\nweights = [inf]", "a weight is inf"),
        (
            "type = \"health\"\nnoise_samples = 1",
            "`noise_samples` is 1",
        ),
    ] {
        for inputs in [
            "inputs.signal = \"nothing\"",
            "inputs.sginal = \"position\"",
        ] {
            let read = Read::new(&format!(
                "{head}[nodes.a]\n{inputs}\n{node}\n[outputs]\no = \"a\"\n"
            ));
            let told = read.told();
            assert!(told.contains(wrong), "{node}: {told}");
            assert_eq!(told.matches(wrong).count(), 1, "{told}");
        }
    }
}
