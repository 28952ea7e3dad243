//! The graphs of the die tester in C: the bits of the engine, the memory that they take, and a self test that sees what compilers do.

use std::process::Command;

use athermal_core::engine::Engine;
use athermal_core::prng::Prng;
use athermal_core::time::Duration;
use athermal_export::{Exported, Options, Rates, export_c};

use crate::random::events;
use crate::support::{
    Exhibit, Scratch, compilers, difference, has, made_up, plan, project, ran, stepped,
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

const GRAPHS: [&str; 4] = [
    "die-tester.toml",
    "die-tester-sensor.toml",
    "die-tester-compensate.toml",
    "die-tester-control.toml",
];

#[test]
fn the_graphs_of_the_die_tester_give_the_bits_of_the_engine() {
    let scratch = Scratch::new("shipped");
    for compiler in compilers().into_iter().take(1) {
        for name in GRAPHS {
            let (mut engine, exported) = shipped(name, Rates::every(second(0.2)));
            let exhibit = Exhibit::new(&exported, &scratch.path(name));
            let sources: Vec<String> = exported
                .form
                .sources
                .iter()
                .map(|of| of.name.clone())
                .collect();
            let events = events(&mut Prng::stream(5, name), &sources, 6_000);
            let expected = stepped(&mut engine, &events);
            let program = exhibit.built(compiler, &["-O2"], "driver.c");
            let (found, said) = exhibit.stepped(&program, &events);
            assert_eq!(difference(&exhibit.form, &expected, &found), None, "{name}");
            assert_eq!(said & 3, 0, "{name}: refused or full");
        }
    }
}

#[test]
fn a_compensation_once_a_second_takes_less_than_200_kb_where_positions_come_each_ten_seconds() {
    let second_and_ten = Rates::every(second(1.0)).with("position", second(10.0));
    let (_, exported) = shipped("die-tester-compensate.toml", second_and_ten);
    let bytes = exported.form.layout.bytes(8);
    println!("die-tester-compensate at 1 s, positions each 10 s: {bytes} bytes");
    assert!(bytes < 200_000, "{bytes}");
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
        assert!(
            said.contains("self test 0, hash ") && said.contains("error 0 millionths"),
            "{said}"
        );
        // Most outputs have values at most ticks, or the self test would test nothing.
        let all = exported.ticks.outputs.iter().flatten();
        let given = all.clone().filter(|value| !value.is_nan()).count();
        assert!(2 * given > all.count(), "{given}");
        let said = ran(&mut Command::new(example(&["-O2", "-DATHERMAL_FLOAT"])));
        let error = said
            .split("error ")
            .nth(1)
            .and_then(|rest| rest.split(' ').next());
        let error: f64 = error.unwrap().parse().unwrap();
        assert!(
            said.contains("self test 0") && error > 0.0 && error < 10_000.0,
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
    assert!(said.contains("self test 0"), "{said}");
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
