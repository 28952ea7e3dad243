//! Units for co-simulation: what FMPy says of them, and that they give the bits of the engine.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use athermal_core::engine::Engine;
use athermal_core::time::Instant;
use athermal_export::c::bits;
use athermal_export::fmu::{Binary, write};
use athermal_export::{Exported, Rates};
use serde_json::{Value, json};

use crate::onnx::python;
use crate::shipped::{second, shipped};
use crate::support::{Scratch, has, ran};

/// Validates a unit, builds it where it has sources alone, and answers to what is asked of it.
const SCRIPT: &str = r#"
import ctypes, json, re, struct, sys, os
import fmpy, fmpy.fmi3, fmpy.validation
from fmpy.build import build_platform_binary
unit, asked = sys.argv[1], json.load(open(sys.argv[2]))
answer = {"problems": fmpy.validation.validate_fmu(unit)}
description = fmpy.read_model_description(unit)
variables = {of.name: of for of in description.modelVariables}
answer["units"] = sorted({of.unit for of in description.modelVariables if of.unit})
answer["described"] = all(of.description for of in description.modelVariables)
answer["definitions"] = {of.name: [of.baseUnit.m, of.baseUnit.s, of.baseUnit.K, of.baseUnit.factor, of.baseUnit.offset]
                         for of in description.unitDefinitions if of.baseUnit}
folder = fmpy.extract(unit)
if asked["compile"]:
    build_platform_binary(folder)
said = []
def begun(token=None):
    instance = fmpy.fmi3.FMU3Slave(guid=token or description.guid, unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier, instanceName="one")
    instance.instantiate(loggingOn=True, logMessage=lambda env, status, category, text: said.append(text.decode()))
    return instance
one = begun()
dll = one.dll
header = open(os.path.join(os.path.dirname(fmpy.__file__), "c-code", "fmi3Functions.h")).read()
answer["missing"] = [name for name in re.findall(r"\b(fmi3[A-Z]\w+)TYPE\s+fmi3FullName", header) if not hasattr(dll, name)] \
    or [name for name in re.findall(r"FMI3_Export\s+fmi3\w+TYPE\s+(fmi3\w+)", header) if not hasattr(dll, name)]
ins = [variables[name].valueReference for name in asked["inputs"]]
outs = [variables[name].valueReference for name in asked["outputs"]]
def ready(instance):
    instance.enterInitializationMode(startTime=0.0)
    instance.exitInitializationMode()
def of_bits(word): return struct.unpack("<d", struct.pack("<Q", int(word)))[0]
def bits(value): return 0x7ff8000000000000 if value != value else struct.unpack("<Q", struct.pack("<d", value))[0]
ready(one)
rows, half = [], len(asked["ticks"]) // 2
for nth, (ns, samples) in enumerate(asked["ticks"]):
    if nth == half:
        # Another instance goes on from the bytes of the first.
        state = one.getFMUState()
        kept = one.serializeFMUState(state)
        two = begun()
        ready(two)
        two.setFMUState(two.deserializeFMUState(kept))
        one.terminate(); one.freeInstance()
        one = two
        answer["carried"] = [str(bits(value)) for value in one.getFloat64(outs)]
    one.setFloat64(ins, [of_bits(word) for word in samples])
    one.doStep(currentCommunicationPoint=ns / 1e9, communicationStepSize=asked["step"])
    rows.append([str(bits(value)) for value in one.getFloat64(outs)])
answer["rows"] = rows
del said[:]
for what in ["token", "time", "set"]:
    try:
        if what == "token": begun("another")
        if what == "time": one.doStep(currentCommunicationPoint=0.0, communicationStepSize=1.0)
        if what == "set": one.setFloat64(outs, [0.0] * len(outs))
        answer[what] = "taken"
    except Exception: answer[what] = said[-1] if said else "refused without a word"
print(json.dumps(answer))
"#;

/// What comes of ticks with their samples, in the unit.
fn asked(scratch: &Scratch, unit: &Path, exported: &Exported, compile: bool) -> Option<Value> {
    let python = python("fmpy")?;
    let form = &exported.form;
    let names = |ports: &[athermal_export::Port]| -> Vec<String> {
        ports.iter().map(|port| port.name.clone()).collect()
    };
    let ticks = exported.ticks.times.iter().zip(&exported.ticks.inputs);
    let ticks: Vec<Value> = ticks
        .map(|(&time, samples)| {
            let samples: Vec<String> = samples.iter().map(|&of| of.to_bits().to_string()).collect();
            json!([time, samples])
        })
        .collect();
    let question = json!({
        "inputs": names(&form.sources),
        "outputs": names(&form.outputs),
        "ticks": ticks,
        "step": form.period_ns as f64 / 1e9,
        "compile": compile,
    });
    let path = scratch.path("asked.json");
    std::fs::write(&path, question.to_string()).unwrap();
    let said = ran(Command::new(python)
        .args(["-c", SCRIPT])
        .args([unit, &*path]));
    let answer = said.lines().last().unwrap();
    Some(serde_json::from_str(answer).unwrap())
}

/// The bits of what the engine gave, as a question is answered.
fn expected(exported: &Exported) -> Value {
    let rows: Vec<Vec<String>> = (exported.ticks.outputs.iter())
        .map(|row| row.iter().map(|&of| bits(of).to_string()).collect())
        .collect();
    json!(rows)
}

#[test]
fn fmpy_validates_a_unit_and_its_steps_give_the_bits_of_the_engine_over_a_state_that_is_carried() {
    let scratch = Scratch::new("fmu");
    if !has("cc") {
        return;
    }
    let (_, exported) = shipped("die-tester-compensate.toml", Rates::every(second(10.0)));
    let unit = scratch.path("machine.fmu");
    let binary = write(&exported, &unit, "cc").unwrap();
    assert!(matches!(binary, Binary::Built(_)), "{binary:?}");
    let bytes = std::fs::read(&unit).unwrap();
    println!("a unit of {} kB", bytes.len() / 1000);
    let Some(answer) = asked(&scratch, &unit, &exported, false) else {
        return;
    };
    assert_eq!(answer["problems"], json!([]));
    assert_eq!(answer["missing"], json!([]));
    assert_eq!(answer["described"], json!(true));
    assert!(
        answer["rows"] == expected(&exported),
        "other bits than the engine"
    );
    let half = exported.ticks.times.len() / 2;
    assert_eq!(answer["carried"], expected(&exported)[half - 1]);
    // Units are what they say, in units of the SI.
    assert_eq!(answer["definitions"]["Cel"], json!([0, 0, 1, 1.0, 273.15]));
    assert_eq!(answer["definitions"]["nm"], json!([1, 0, 0, 1e-9, 0.0]));
    for (what, words) in [
        ("token", "their tokens differ"),
        ("time", "not after that of the last step"),
        ("set", "only inputs can be set"),
    ] {
        let said = answer[what].as_str().unwrap();
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn a_unit_without_a_binary_is_built_by_the_simulator_and_gives_the_same_bits() {
    let scratch = Scratch::new("fmu-sources");
    if !has("cmake") {
        return;
    }
    let (_, exported) = shipped("die-tester-sensor.toml", Rates::every(second(10.0)));
    let unit = scratch.path("machine.fmu");
    let binary = write(&exported, &unit, "no-such-compiler").unwrap();
    assert!(matches!(binary, Binary::Without(_)), "{binary:?}");
    let Some(answer) = asked(&scratch, &unit, &exported, true) else {
        return;
    };
    assert_eq!(answer["problems"], json!([]));
    assert!(
        answer["rows"] == expected(&exported),
        "other bits than the engine"
    );
}

#[test]
fn the_same_export_is_the_same_unit_and_another_has_another_token() {
    let scratch = Scratch::new("fmu-twice");
    let paths = ["one.fmu", "two.fmu", "other.fmu"].map(|name| scratch.path(name));
    let (_, exported) = shipped("die-tester-sensor.toml", Rates::every(second(10.0)));
    let (_, other) = shipped("die-tester-sensor.toml", Rates::every(second(5.0)));
    for (path, exported) in paths.iter().zip([&exported, &exported, &other]) {
        write(exported, path, "no-such-compiler").unwrap();
    }
    let [one, two, other] = paths.map(|path| std::fs::read(path).unwrap());
    assert!(one == two);
    assert!(one != other);
}

const SIMULATED: &str = r#"
import json, sys, numpy, fmpy
unit, asked = sys.argv[1], json.load(open(sys.argv[2]))
kinds = [("time", numpy.float64)] + [(name, numpy.float64) for name in asked["inputs"]]
rows = numpy.array([tuple(row) for row in asked["rows"]], dtype=kinds)
step = asked["step"]
result = fmpy.simulate_fmu(unit, start_time=0.0, stop_time=step * len(rows), output_interval=step, input=rows, output=asked["outputs"])
print(json.dumps([[repr(float(row[name])) for name in asked["outputs"]] for row in result[1:]]))
"#;

#[test]
fn a_simulation_of_fmpy_is_the_engine_stepped_at_the_same_instants() {
    let scratch = Scratch::new("fmu-simulated");
    let Some(python) = python("fmpy") else { return };
    let (engine, exported) = shipped("die-tester-sensor.toml", Rates::every(second(10.0)));
    let unit = scratch.path("machine.fmu");
    write(&exported, &unit, "cc").unwrap();
    let form = &exported.form;
    let row = |nth: usize| -> Vec<f64> {
        let swing = |of: usize| 21.0 + 3.0 * ((nth * (of + 2)) as f64 / 40.0).sin();
        (0..form.sources.len()).map(swing).collect()
    };
    let rows: Vec<Vec<f64>> = (0..400)
        .map(|nth| std::iter::once(10.0 * nth as f64).chain(row(nth)).collect())
        .collect();
    let names = |ports: &[athermal_export::Port]| -> Vec<String> {
        ports.iter().map(|port| port.name.clone()).collect()
    };
    let outputs = names(&form.outputs);
    let question =
        json!({"inputs": names(&form.sources), "outputs": outputs, "rows": rows, "step": 10.0});
    let path = scratch.path("asked.json");
    std::fs::write(&path, question.to_string()).unwrap();
    let said = ran(Command::new(python)
        .args(["-c", SIMULATED])
        .args([&unit, &path]));
    let found: Vec<Vec<String>> = serde_json::from_str(said.lines().last().unwrap()).unwrap();
    let mut engine = Engine::new(Arc::clone(engine.plan()), engine.fitted()).unwrap();
    let mut given = 0;
    assert_eq!(found.len(), rows.len());
    for (nth, found) in found.iter().enumerate() {
        let time = Instant::from_ns(10_000_000_000 * nth as i64);
        let out = engine.step(time, &row(nth)).unwrap();
        for (value, found) in out.iter().zip(found) {
            assert_eq!(bits(found.parse().unwrap()), bits(*value), "tick {nth}");
            given += usize::from(!value.is_nan());
        }
    }
    assert!(given > 200, "{given}");
}

const BEGUN: &str = r#"
import sys, fmpy, fmpy.fmi3
unit = sys.argv[1]
description = fmpy.read_model_description(unit)
one = fmpy.fmi3.FMU3Slave(guid=description.guid, unzipDirectory=fmpy.extract(unit),
    modelIdentifier=description.coSimulation.modelIdentifier, instanceName="one")
try:
    one.instantiate(logMessage=lambda env, status, category, text: print(text.decode()))
    print("begun")
except Exception: print("refused")
"#;

#[test]
fn a_unit_that_computes_otherwise_than_the_engine_is_not_instantiated_and_says_so() {
    let scratch = Scratch::new("fmu-otherwise");
    let Some(python) = python("fmpy") else { return };
    let (_, mut exported) = shipped("die-tester-sensor.toml", Rates::every(second(10.0)));
    let file = (exported.files.iter_mut()).find(|file| file.path.ends_with("sensor.c"));
    let file = file.unwrap();
    let (before, after) = file.text.split_once("test_out[").unwrap();
    // The last of what is expected is made another.
    let (bits, last) = after.rsplit_once("UINT64_C(0x").unwrap();
    let (_, end) = last.split_once(')').unwrap();
    file.text = format!("{before}test_out[{bits}UINT64_C(1){end}");
    let unit = scratch.path("machine.fmu");
    write(&exported, &unit, "cc").unwrap();
    let said = ran(Command::new(python).args(["-c", BEGUN]).arg(&unit));
    assert!(
        said.contains("tick 200 of the self test is not that of the engine"),
        "{said}"
    );
    assert!(said.ends_with("refused\n"), "{said}");
}
