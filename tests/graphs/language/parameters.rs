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
        ("type = \"lag\"\nlags = []", "`lags` has 0 values"),
        ("type = \"difference\"\nover = \"0s\"", "`over` is 0s"),
        ("type = \"resample\"\nevery = \"0s\"", "`every` is 0s"),
        (
            "type = \"first_order\"\ntime_constants = []",
            "`time_constants` has 0 values",
        ),
        ("type = \"scale\"\nfactor = inf", "`factor` is inf"),
        ("type = \"sum\"\nweights = [inf]", "`weights` is inf"),
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

/// A chain of so many nodes, each of which gives 101 channels for every one that it reads.
fn multiplied(nodes: usize) -> String {
    let lags: Vec<String> = (0..101).map(|lag| format!("\"{lag}s\"")).collect();
    let lags = lags.join(", ");
    let mut text =
        "schema = 1\n[signals.n0]\nunit = \"nm\"\nchannels = [\"X\"]\nmax_age = \"3min\"\n"
            .to_owned();
    for node in 1..=nodes {
        let last = node - 1;
        text += &format!(
            "[nodes.n{node}]\ntype = \"lag\"\ninputs.signal = \"n{last}\"\nlags = [{lags}]\n"
        );
    }
    text
}

#[test]
fn more_regressors_than_a_fit_has_room_for_are_refused() {
    for kind in [
        "\"linear\"",
        "\"lasso\"",
        "\"elastic_net\"",
        "\"huber\"",
        "\"rls\"",
        "\"kalman\"",
        "\"oe\"",
        "\"arx\"\nlags = [\"5min\"]",
    ] {
        let text = multiplied(2)
            + &format!(
                "[nodes.a]\ntype = {kind}\ninputs = {{ features = \"n2\", truth = \"n0.X\" }}\nahead = \"5min\"\n\
                 [outputs]\nout = \"a\"\n"
            );
        let told = Read::new(&text).told();
        let wanted =
            "it would learn from 10201 regressors, more than the 4000 that there is room for";
        assert!(told.contains(wanted), "{kind}: {told}");
    }
}

#[test]
fn channels_that_every_node_multiplies_are_stopped() {
    let told = Read::new(&(multiplied(3) + "[outputs]\nout = \"n3\"\n")).told();
    assert!(
        told.contains("with its channels the graph has 1040604, more than 1000000"),
        "{told}"
    );
}

#[test]
fn the_keys_that_a_node_may_have_are_listed_with_those_of_all_nodes() {
    let read = Read::new(
        "schema = 1\n[signals.position]\nunit = \"nm\"\nchannels = [\"X\"]\nmax_age = \"3min\"\n\
         [nodes.a]\ntype = \"scale\"\ninputs.signal = \"position\"\nxyzzy_unlike_any = 1\n[outputs]\no = \"a\"\n",
    );
    let told = read.told();
    let keys = told.lines().find(|line| line.contains("the keys are"));
    let keys = keys.unwrap_or_else(|| panic!("{told}"));
    for key in ["type", "inputs", "each", "factor"] {
        assert!(keys.contains(&format!("\"{key}\"")), "{key}: {keys}");
    }
}
