//! The linear parts in ONNX: onnxruntime gives what the engine's linear forms give, within 1e-12 of the sum of magnitudes.

use std::process::Command;

use athermal_core::prng::Prng;
use athermal_export::{Rates, onnx};

use crate::shipped::{second, shipped};
use crate::support::{Scratch, installed, ran};

/// The Python that has a package; `ATHERMAL_PYTHON` names another than that of the system.
pub fn python(package: &str) -> Option<String> {
    let python = std::env::var("ATHERMAL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let mut shown_by = Command::new(&python);
    shown_by.args(["-c", &format!("import {package}")]);
    installed(package, &mut shown_by).then_some(python)
}

const SCRIPT: &str = r#"
import sys, json, onnx, onnxruntime, numpy
model, rows = sys.argv[1], json.load(open(sys.argv[2]))
onnx.checker.check_model(model, full_check=True)
session = onnxruntime.InferenceSession(model)
names = {entry.key: entry.value for entry in onnx.load(model).metadata_props}
feed = {node + ":row": numpy.array(of, dtype=numpy.float64) for node, of in rows.items()}
for node, of in rows.items():
    assert len(names[node].split("\n")) == len(of[0])
    out = session.run([node], feed)[0]
    assert out.dtype == numpy.float64 and out.shape == (len(of), 1)
    print(node, *[repr(float(value)) for value in out[:, 0]])
"#;

#[test]
fn onnxruntime_gives_every_linear_estimator_within_1e12th_of_the_sum_of_magnitudes() {
    let Some(python) = python("onnxruntime, onnx") else {
        return;
    };
    let scratch = Scratch::new("onnx");
    let (engine, exported) = shipped("die-tester.toml", Rates::every(second(10.0)));
    let (model, rows) = (scratch.path("model.onnx"), scratch.path("rows.json"));
    std::fs::write(&model, onnx::model(&exported.form)).unwrap();
    let mut random = Prng::stream(9, "rows");
    let mut all = serde_json::Map::new();
    for (node, predictor) in engine.fitted() {
        let width = predictor.uses().len();
        let of: Vec<Vec<f64>> = (0..50)
            .map(|_| (0..width).map(|_| 100.0 * random.normal()).collect())
            .collect();
        all.insert(node.clone(), serde_json::json!(of));
    }
    assert_eq!(all.len(), 18);
    std::fs::write(&rows, serde_json::to_string(&all).unwrap()).unwrap();
    let said = ran(Command::new(python)
        .args(["-c", SCRIPT])
        .args([&model, &rows]));
    let mut largest: f64 = 0.0;
    for line in said.lines() {
        let mut words = line.split(' ');
        let node = words.next().unwrap();
        let form = engine.fitted()[node].linear().unwrap();
        for (word, row) in words.zip(all[node].as_array().unwrap()) {
            let row: Vec<f64> = serde_json::from_value(row.clone()).unwrap();
            let terms = row
                .iter()
                .zip(form.coefficients)
                .map(|(x, b)| (x * b).abs());
            let magnitudes: f64 = form.constant.abs() + terms.sum::<f64>();
            let off = (word.parse::<f64>().unwrap() - form.at(&row)).abs() / magnitudes;
            largest = largest.max(off);
        }
    }
    println!("onnxruntime: off by {largest:.1e} of the sum of magnitudes at most");
    assert_eq!(said.lines().count(), 18);
    assert!(largest <= 1e-12, "{largest}");
}
