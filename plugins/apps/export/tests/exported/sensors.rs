//! Sensors that are compared with each other, as a fit found how they go together: the one that comes loose is named in C as in the engine.

use std::sync::Arc;

use athermal_core::engine::Engine;
use athermal_core::registry::find;
use athermal_export::{Options, Rates, export_c};
use athermal_run::fit::{FitOptions, fit};
use athermal_run::recording::{self, Recording as _, Samples};
use athermal_trial::machine::{KnownMachine, Setup, Simulated};

use crate::shipped::second;
use crate::support::{
    Event, Exhibit, Scratch, SelfTest, compilers, difference, plan, ran, stepped,
};

const GRAPH: &str = r#"schema = 1
extends = "die-tester-compensate.toml"
name = "compared"
[outputs]
trusted = "trusted"
why_trusted = "trusted:reason"
"#;

fn day() -> Simulated<'static> {
    let setup = Setup {
        days: 1.0,
        ..Setup::default()
    };
    Simulated::new(find::<KnownMachine>("die-tester").unwrap().machine, setup)
}

#[test]
fn a_sensor_that_comes_loose_is_named_and_comes_back_in_c_as_in_the_engine() {
    let plan = plan(GRAPH);
    let (fitted, _) = fit(&plan, &day(), &FitOptions::default(), &mut |_| {}).unwrap();
    let mut engine = Engine::new(Arc::clone(&plan), &fitted).unwrap();
    let loose = plan
        .sources
        .iter()
        .position(|of| of.name == "temperature.plate2");
    // The day of the fit, in which all others go together as they did.
    let recorded = day();
    let mut source = recorded.open(&plan).unwrap();
    let (mut samples, mut events) = (Samples::default(), Vec::new());
    while let Some(recording::Event::Row(time)) = source.next(&mut samples).unwrap() {
        let nth = events.len();
        if (2_000..2_500).contains(&nth) {
            samples.values[loose.unwrap()] -= 3.0;
        }
        events.push(Event::Tick(time.as_ns(), samples.values.clone()));
    }
    let expected = stepped(&mut engine, &events);
    let options = Options {
        rates: Rates::every(second(5.0)),
        ..Options::default()
    };
    let exported = export_c(&engine, &options, false).unwrap();
    let scratch = Scratch::new("sensors");
    let exhibit = Exhibit::new(&exported, &scratch.path("c"));
    for compiler in compilers() {
        let program = exhibit.built(compiler, &["-O2"], "driver.c");
        let (found, said) = exhibit.stepped(&program, &events);
        assert_eq!(difference(&exhibit.form, &expected, &found), None);
        assert_eq!(said & 3, 0, "refused or full");
        let said = ran(&mut std::process::Command::new(exhibit.built(
            compiler,
            &["-O2"],
            "example/main.c",
        )));
        assert_eq!(SelfTest::of(&said).differs, 0, "{said}");
    }
    let output = exhibit.form.outputs.iter();
    let place = output
        .map(|of| &*of.name)
        .position(|name| name == "why_trusted.plate2");
    let reasons = expected
        .iter()
        .map(|row| f64::from_bits(row[place.unwrap()]));
    let ticks = |reason: f64| reasons.clone().filter(|&of| of == reason).count();
    let (agrees, contradicts, recovering) = (ticks(0.0), ticks(1.0), ticks(2.0));
    assert!(
        contradicts > 400 && recovering > 20,
        "{agrees} {contradicts} {recovering}"
    );
    assert!(agrees > 6_000, "{agrees}");
}
