//! Models of before fits kept where their edge is: they run, and it is said once that they do not know it.

use serde_json::Value;

use super::desk;
use crate::workbench::athermal;

/// Takes the key out of a table and all in it.
fn without(value: &mut Value, key: &str) {
    match value {
        Value::Object(table) => {
            table.remove(key);
            table.values_mut().for_each(|value| without(value, key));
        }
        Value::Array(list) => list.iter_mut().for_each(|value| without(value, key)),
        _ => {}
    }
}

#[test]
fn a_model_whose_fits_do_not_know_their_edge_runs_and_is_warned_of_once() {
    const WARNING: &str = "no `novelty`, since the fit kept no second moments of the regressors";
    let (scratch, _, data, model) = desk("older");
    let run = |model: &std::path::PathBuf| athermal(&[&"run", model, &"--input", &data]).ended(0);
    let new = run(&model);
    assert!(!new.told.contains(WARNING), "{}", new.told);
    let mut text: Value = serde_json::from_str(&std::fs::read_to_string(&model).unwrap()).unwrap();
    without(&mut text["fitted"], "novelty");
    let older = run(&scratch.file("older.json", text.to_string()));
    assert_eq!(older.told.matches(WARNING).count(), 1, "{}", older.told);
    assert_eq!(older.out.lines().count(), new.out.lines().count());
}
