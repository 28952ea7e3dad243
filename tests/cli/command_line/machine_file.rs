//! What a machine's own file says and `run` does not read yet is told, since whoever wrote it expects it to work; and what it removes
//! of the file that it extends.

use super::{desk, plain};
use crate::workbench::{Scratch, athermal};

const TOLD: &str = "does not read";

#[test]
fn run_tells_once_which_sections_of_a_machine_file_it_does_not_read() {
    let (scratch, plain, data, _) = desk("machine-file");
    let text = "extends = \"plain.toml\"\nschema = 1\n\
                [sources.a]\n[sinks.log]\n[runtime]\nheartbeat = \"1s\"\n[control]\n[retrain]\n";
    let machine = scratch.file("machine.toml", text);
    let ran = athermal(&[&"run", &machine, &"--input", &data]).ended(0);
    ran.tells(&[
        "warning: ",
        "machine.toml: `athermal run` goes by its options alone and does not read `[sources]`, `[sinks]`, `[runtime]`, `[control]`, `[retrain]`; `athermal serve",
    ]);
    assert_eq!(ran.told.matches(TOLD).count(), 1, "{}", ran.told);
    let quiet = athermal(&[&"run", &plain, &"--input", &data]).ended(0);
    assert_eq!(quiet.out, ran.out);
    assert!(!quiet.told.contains(TOLD), "{}", quiet.told);
}

#[test]
fn a_sensor_that_the_simulated_machine_of_inherited_tests_lacks_is_one_mistake() {
    let scratch = Scratch::new("command-line-more-sensors");
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/die-tester.toml");
    let machine = |more: &str| {
        let text = format!(
            "schema = 1\nextends = {shipped:?}\n{more}[signals.temperature]\n\
             channels = [\"plate1\", \"holder1\", \"plate2\", \"holder2\", \"room\", \"chuck\", \"spindle\"]\n"
        );
        scratch.file("machine.toml", text)
    };
    let checked = athermal(&[&"check", &machine("")]).ended(2);
    let path = scratch.path("machine.toml");
    let way_out = format!(
        "help: a signal may call channels `optional`; `tests = []` in {}, or tests of its own there",
        path.display()
    );
    checked.tells(&[
        "error[A074]: the machine `die-tester` does not measure `temperature.spindle`",
        &way_out,
        "1 error",
    ]);
    assert_eq!(checked.told.matches("A074").count(), 1, "{}", checked.told);
    athermal(&[&"check", &machine("tests = []\n")]).ended(0);
}

#[test]
fn what_refers_to_a_node_that_is_removed_is_told_so_and_how_to_remove_it_too() {
    let scratch = Scratch::new("command-line-removed");
    scratch.file("base.toml", plain());
    let variant = |more: &str| {
        let text = format!("schema = 1\nextends = \"base.toml\"\nnodes.same = false\n{more}");
        scratch.file("variant.toml", text)
    };
    athermal(&[&"check", &variant("")]).ended(2).tells(&[
        "error[A042]: `same` is referred to, and `nodes.same = false` removes it",
        "predicted = \"same\"",
        "`outputs.NAME = false`",
    ]);
    athermal(&[&"check", &variant("outputs.predicted = false")]).ended(0);
    let again = variant("outputs.predicted = \"some\"");
    athermal(&[&"check", &again])
        .ended(2)
        .tells(&["there is no node or signal `some`"]);
}

#[test]
#[cfg(feature = "mqtt")]
fn behaviour_21_numbers_without_a_time_are_doubtful_and_a_retained_one_is_refused() {
    let scratch = Scratch::new("command-line-arrival");
    let machine = |retained: &str| {
        let text = format!(
            "schema = 1\n[signals.t]\nunit = \"Cel\"\nchannels = [\"room\"]\nmax_age = \"1min\"\n[outputs]\nroom = \"t\"\n\
             [sources.line]\ntype = \"mqtt\"\nbroker = \"mqtt://localhost\"\n{retained}channels = {{ \"t.room\" = \"plant/room\" }}\n"
        );
        scratch.file("machine.toml", text)
    };
    athermal(&[&"check", &machine("")]).ended(0).tells(&[
        "warning[A213]: what the broker sends again after an outage cannot be told apart from what is new",
        "channels = ",
    ]);
    athermal(&[&"check", &machine("retained = \"take\"\n")])
        .ended(2)
        .tells(&["error[A212]: a retained message without a time would be taken for a fresh one"]);
}
