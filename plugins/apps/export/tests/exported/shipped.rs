//! The graphs of the die tester in C: the bits of the engine, the memory that they take, and a self test that sees what compilers do.

use std::process::Command;

use athermal_core::engine::Engine;
use athermal_core::prng::Prng;
use athermal_core::time::Duration;
use athermal_export::c::{SinglePrecisionError, single_precision_error};
use athermal_export::{Exported, Options, Rates, export_c};

use crate::random::{events, leaping, options};
use crate::support::{
    Event, Exhibit, Scratch, SelfTest, compilers, difference, has, made_up, plan, project, ran,
    stepped,
};

pub fn second(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds).unwrap()
}

/// A shipped graph with a fit that is made up, as the tests of what it computes need no other.
pub fn shipped(name: &str, rates: Rates) -> (Engine, Exported) {
    let text = std::fs::read_to_string(project().join("graphs").join(name)).unwrap();
    let plan = plan(&text);
    let fitted = made_up(&plan, &mut Prng::stream(3, name));
    let engine = Engine::new(plan, &fitted).unwrap();
    let options = Options {
        rates,
        ..Options::default()
    };
    let exported = export_c(&engine, &options, false).unwrap();
    (engine, exported)
}

pub const GRAPHS: [&str; 4] = [
    "die-tester.toml",
    "die-tester-sensor.toml",
    "die-tester-compensate.toml",
    "die-tester-control.toml",
];

/// Others that are exported.
const MORE: [&str; 11] = [
    "die-tester-fleet.toml",
    "die-tester-redundant.toml",
    "linear-axis.toml",
    "linear-axis-sensor.toml",
    "linear-axis-compensate.toml",
    "z-probe.toml",
    "die-tester-virtual-sensor.toml",
    "linear-axis-virtual-sensor.toml",
    "linear-axis-control.toml",
    "machine-temperature.toml",
    "ambient-temperature.toml",
];

#[test]
fn the_shipped_graphs_give_the_bits_of_the_engine() {
    let scratch = Scratch::new("shipped");
    for compiler in compilers().into_iter().take(1) {
        for (nth, name) in GRAPHS.into_iter().chain(MORE).enumerate() {
            let (mut engine, exported) = shipped(name, Rates::every(second(0.2)));
            let exhibit = Exhibit::new(&exported, &scratch.path(name));
            // Others have windows of hours, which take as long to be saved.
            let ticks = if MORE[6..].contains(&name) {
                1_500
            } else {
                6_000
            };
            let events = events(&mut Prng::stream(5, name), engine.plan(), ticks);
            // Every second of them leaps.
            let events = match nth % 2 {
                0 => events,
                _ => leaping(&events, engine.plan(), nth as u64),
            };
            let expected = stepped(&mut engine, &events);
            // With no more of the runtime than the graph uses.
            let part = format!("-DATHERMAL_PLAN=\"{}.h\"", exhibit.form.name);
            let program = exhibit.built(compiler, &["-O2", &part], "driver.c");
            let (found, said) = exhibit.stepped(&program, &events);
            assert_eq!(difference(&exhibit.form, &expected, &found), None, "{name}");
            assert_eq!(said & 3, 0, "{name}: refused or full");
        }
    }
}

#[test]
fn sums_that_are_kept_are_those_of_the_engine_after_origins_have_been_chosen_anew() {
    let Some(compiler) = compilers().into_iter().next() else {
        return;
    };
    let scratch = Scratch::new("kept");
    let (mut engine, _) = shipped("die-tester.toml", Rates::every(second(0.2)));
    let options = Options {
        rates: Rates::every(second(0.24)),
        fast: true,
        ..Options::default()
    };
    let exported = export_c(&engine, &options, false).unwrap();
    let exhibit = Exhibit::new(&exported, &scratch.path("c"));
    // Origins are chosen anew after 8,192 rows.
    let events = events(&mut Prng::stream(6, "kept"), engine.plan(), 20_000);
    let events: Vec<Event> = (events.into_iter())
        .filter(|event| matches!(event, Event::Tick(..)))
        .scan(0, |last, event| {
            let Event::Tick(_, samples) = event else {
                return None;
            };
            *last += 1_000_000_000;
            Some(Event::Tick(*last, samples))
        })
        .collect();
    let expected = stepped(&mut engine, &events);
    let program = exhibit.built(compiler, &["-O2"], "driver.c");
    let (found, said) = exhibit.stepped(&program, &events);
    assert_eq!(difference(&exhibit.form, &expected, &found), None);
    assert_eq!(said & 3, 0, "refused or full");
}

/// A graph of the shape that `athermal init` writes, with its predictions as they stand there.
pub fn starter() -> String {
    let module =
        std::fs::read_to_string(project().join("plugins/work/starter/src/prediction.toml"))
            .unwrap();
    let module = module.replace("MEMORY", "8min");
    let head = r#"schema = 1
name = "starter"
[sets]
axis = ["X", "Z"]
[time]
column = "t"
[signals.temperature]
unit = "Cel"
channels = ["a", "b", "c", "d"]
max_age = "20s"
[signals.position]
unit = "um"
channels = "axis"
max_age = "20s"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["1min"]
unit = "nm/min"
[nodes.trusted]
type = "cross_check"
inputs.signal = "temperature"
inputs.truth = "drift.X"
ahead = "0s"
lag = "2min"
after = "12s"
recover = "2min"
[nodes.gradients]
type = "slope"
inputs.signal = "trusted"
windows = ["30s", "1min", "2min"]
unit = "mK/min"
"#;
    let node = |name: &str, ahead: &str, lags: &str| {
        format!(
            r#"
[nodes.{name}]
module = "prediction"
each = "axis"
ahead = "{ahead}"
lags = {lags}
[nodes.{name}.inputs]
sensors = "gradients"
half-1 = ["gradients.a@*", "gradients.c@*"]
half-2 = ["gradients.b@*", "gradients.d@*"]
drift = "drift.{{axis}}"
more = []
"#
        )
    };
    let now = node("now", "0s", r#"["1min", "2min", "3min"]"#);
    let next = node("next", "1min", r#"["0s", "1min", "2min"]"#);
    format!("{head}{module}{now}{next}\n[outputs]\nnow = \"now\"\nnext = \"next\"\n")
}

/// That graph with a fit that is made up.
pub fn exported_starter(options: &Options) -> (Engine, Exported) {
    let plan = plan(&starter());
    let fitted = made_up(&plan, &mut Prng::stream(4, "starter"));
    let engine = Engine::new(plan, &fitted).unwrap();
    let exported = export_c(&engine, options, false).unwrap();
    (engine, exported)
}

#[test]
fn the_predictions_that_init_writes_are_exported_as_they_are_and_give_the_bits_of_the_engine() {
    let (mut engine, exported) = exported_starter(&options());
    let events = events(&mut Prng::stream(6, "starter"), engine.plan(), 6_000);
    let expected = stepped(&mut engine, &events);
    let scratch = Scratch::new("starter");
    let exhibit = Exhibit::new(&exported, &scratch.path("c"));
    for compiler in compilers() {
        let program = exhibit.built(compiler, &["-O2"], "driver.c");
        let (found, said) = exhibit.stepped(&program, &events);
        assert_eq!(difference(&exhibit.form, &expected, &found), None);
        assert_eq!(said & 3, 0, "refused or full");
        let said = ran(&mut Command::new(exhibit.built(
            compiler,
            &["-O2"],
            "example/main.c",
        )));
        assert_eq!(SelfTest::of(&said).differs, 0, "{said}");
    }
}

#[test]
fn a_compensation_once_a_second_takes_less_than_256_kib_where_positions_come_each_ten_seconds() {
    let second_and_ten = Rates::every(second(1.0)).with("position", second(10.0));
    let (_, exported) = shipped("die-tester-compensate.toml", second_and_ten);
    let bytes = exported.form.layout.bytes(8);
    println!("die-tester-compensate at 1 s, positions each 10 s: {bytes} bytes");
    // A quarter of it is the past of ten minutes with which sensors are compared.
    assert!(bytes < 256 * 1024, "{bytes}");
    let (_, every) = shipped("die-tester-compensate.toml", Rates::every(second(1.0)));
    println!("all at 1 s: {} bytes", every.form.layout.bytes(8));
    assert!(every.form.layout.bytes(8) > bytes);
}

#[test]
fn the_self_test_passes_sees_fused_products_and_measures_single_precision() {
    let scratch = Scratch::new("self-test");
    for compiler in compilers() {
        let (_, exported) = shipped("die-tester-compensate.toml", Rates::every(second(10.0)));
        let exhibit = Exhibit::new(&exported, &scratch.path(compiler));
        let example = |flags: &[&str]| exhibit.built(compiler, flags, "example/main.c");
        let said = ran(&mut Command::new(example(&["-O2"])));
        let test = SelfTest::of(&said);
        assert_eq!((test.differs, test.millionths), (0, 0), "{said}");
        // Most outputs have values at most ticks, or the self test would test nothing.
        let all = exported.ticks.outputs.iter().flatten();
        let given = all.clone().filter(|value| !value.is_nan()).count();
        assert!(2 * given > all.count(), "{given}");
        let said = ran(&mut Command::new(example(&["-O2", "-DATHERMAL_FLOAT"])));
        let test = SelfTest::of(&said);
        assert!(
            test.differs == 0 && test.millionths > 0 && test.millionths < 10_000,
            "{said}"
        );
        let fuses =
            std::fs::read_to_string("/proc/cpuinfo").is_ok_and(|info| info.contains(" fma "));
        if fuses && compiler == "gcc" {
            let fused = example(&["-O2", "-march=x86-64-v3", "-ffp-contract=fast"]);
            let output = Command::new(fused).output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(
                !output.status.success() && said.contains("is not that of the engine"),
                "{said}"
            );
        }
    }
}

#[test]
fn the_error_of_single_precision_is_known_or_it_is_said_why_not() {
    if !has("gcc") {
        return;
    }
    let scratch = Scratch::new("single");
    let (_, exported) = shipped("die-tester.toml", Rates::every(second(10.0)));
    let Exhibit { folder, form } = Exhibit::new(&exported, &scratch.path("exported"));
    let error = || single_precision_error("gcc", &folder, &form);
    let least = error().unwrap();
    assert!(least > 0.0 && least < 0.01, "{least}");
    let none = single_precision_error("a compiler that there is not", &folder, &form);
    assert!(
        matches!(none, Err(SinglePrecisionError::NoCompiler(_))),
        "{none:?}"
    );
    let tables = folder.join(format!("{}.c", form.name));
    let text = std::fs::read_to_string(&tables).unwrap();
    // A self test that lets no error pass, one that ends early, and one that is no C.
    std::fs::write(&tables, text.replace("off <= 0.01", "off < 0.0")).unwrap();
    let failed = error().unwrap_err();
    assert!(failed.to_string().contains("fails at tick "), "{failed}");
    let early = text.replace("int tick;", "int tick = *(volatile int *)0;");
    std::fs::write(&tables, early).unwrap();
    let failed = error().unwrap_err();
    assert!(
        matches!(failed, SinglePrecisionError::Example(_)),
        "{failed}"
    );
    std::fs::write(&tables, text + "\n#error no C\n").unwrap();
    let failed = error().unwrap_err();
    assert!(
        matches!(failed, SinglePrecisionError::Compiler(..)) && failed.to_string().contains("no C"),
        "{failed}"
    );
}

#[test]
fn a_compiler_that_takes_no_number_for_absent_is_refused() {
    let scratch = Scratch::new("finite");
    let (_, exported) = shipped("die-tester.toml", Rates::every(second(10.0)));
    let exhibit = Exhibit::new(&exported, &scratch.path("exported"));
    for compiler in compilers() {
        for flag in ["-ffast-math", "-Ofast", "-ffinite-math-only"] {
            let output = Command::new(compiler)
                .current_dir(&exhibit.folder)
                .args(["-std=c99", "-fsyntax-only", flag, "athermal_rt.c"])
                .output()
                .unwrap();
            let complaint = String::from_utf8_lossy(&output.stderr);
            assert!(
                !output.status.success() && complaint.contains("absence is NaN"),
                "{compiler} {flag}: {complaint}"
            );
        }
    }
}

#[test]
fn the_recipes_build_and_run_the_self_test() {
    if !has("make") || compilers().is_empty() {
        return;
    }
    let scratch = Scratch::new("recipes");
    let (_, exported) = shipped("die-tester.toml", Rates::every(second(10.0)));
    let exhibit = Exhibit::new(&exported, &scratch.path("made"));
    let said = ran(Command::new("make")
        .arg("test")
        .current_dir(&exhibit.folder));
    assert_eq!(SelfTest::of(&said).differs, 0, "{said}");
    if has("cmake") {
        ran(Command::new("cmake")
            .args(["-S", ".", "-B", "build"])
            .current_dir(&exhibit.folder));
        ran(Command::new("cmake")
            .args(["--build", "build"])
            .current_dir(&exhibit.folder));
        ran(Command::new("ctest")
            .args(["--test-dir", "build"])
            .current_dir(&exhibit.folder));
    }
}
