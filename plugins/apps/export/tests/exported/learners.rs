//! What goes on learning, exported as it was fitted: the same bits as an engine in which learning is frozen, its novelty among them.

use std::sync::Arc;

use athermal_core::engine::Engine;
use athermal_core::prng::Prng;
use athermal_core::registry::find;
use athermal_export::{ExportError, Options, Rates, export_c, lower};
use athermal_run::fit::{FitOptions, fit};
use athermal_trial::machine::{KnownMachine, Setup, Simulated};

use crate::random::events;
use crate::shipped::second;
use crate::support::{Exhibit, Scratch, compilers, difference, plan, stepped};

/// The die tester with another estimator in place of its linear forms, fitted on a day.
fn fitted(estimator: &str) -> Engine {
    let plan = plan(&format!(
        r#"schema = 1
extends = "die-tester.toml"
name = "learners"
nodes.thermal = false
nodes.both = false
nodes.vote = {{ inputs.voters = ["learner.{{axis}}", "motion.{{axis}}"] }}
[nodes.learner]
each = "axis"
inputs.features = "gradients"
inputs.truth = "drift.{{axis}}"
ahead = "5min"
{estimator}
[outputs]
learner = "learner"
novelty = "learner:novelty"
of_vote = "vote:novelty"
"#
    ));
    let setup = Setup {
        days: 1.0,
        ..Setup::default()
    };
    let recording = Simulated::new(find::<KnownMachine>("die-tester").unwrap().machine, setup);
    let (fitted, _) = fit(&plan, &recording, &FitOptions::default(), &mut |_| {}).unwrap();
    Engine::new(Arc::clone(&plan), &fitted).unwrap()
}

fn options() -> Options {
    Options {
        rates: Rates::every(second(0.2)),
        frozen: true,
        ..Options::default()
    }
}

#[test]
fn recursive_least_squares_as_they_were_fitted_give_the_bits_of_the_engine() {
    let scratch = Scratch::new("learners");
    let Some(compiler) = compilers().into_iter().next() else {
        return;
    };
    for (name, learn) in [
        ("frozen", "learn = true\noutside = \"shrink\""),
        ("still", "learn = false"),
    ] {
        let mut engine = fitted(&format!("type = \"rls\"\n{learn}"));
        let exported = export_c(&engine, &options(), false).unwrap();
        let exhibit = Exhibit::new(&exported, &scratch.path(name));
        engine.freeze(true);
        let events = events(&mut Prng::stream(9, name), engine.plan(), 4_000);
        let expected = stepped(&mut engine, &events);
        let program = exhibit.built(compiler, &["-O2"], "driver.c");
        let (found, _) = exhibit.stepped(&program, &events);
        assert_eq!(difference(&exhibit.form, &expected, &found), None, "{name}");
        let outputs = engine.plan().outputs.iter();
        let novelties = outputs
            .enumerate()
            .filter(|(_, of)| of.name.starts_with("novelty"));
        let outside = novelties
            .flat_map(|(nth, _)| expected.iter().map(move |row| f64::from_bits(row[nth])))
            .filter(|novelty| *novelty > 1.0);
        assert!(outside.count() > 100, "{name}: some ticks lie outside");
    }
}

#[test]
fn estimators_that_are_no_linear_form_are_refused_by_name() {
    for kind in ["kalman", "state_space"] {
        let engine = fitted(&format!("type = \"{kind}\""));
        let error = lower(&engine, &options()).unwrap_err();
        let ExportError::Nodes(refusals) = &error else {
            panic!("{error}");
        };
        assert_eq!(refusals[0].node, "learner");
        let why = format!("what `{kind}` is fitted to is no linear form");
        assert!(error.to_string().contains(&why), "{error}");
    }
}
