//! What goes on learning: in C the same bits as in the engine while both learn, its novelty and deviation among them, the same state, and the
//! same bits as an engine in which learning is frozen where it is exported as it was fitted.

use std::path::Path;
use std::sync::Arc;

use athermal_core::engine::{Engine, EngineState};
use athermal_core::prng::Prng;
use athermal_core::registry::find;
use athermal_core::time::Duration;
use athermal_export::{ExportError, Options, Rates, export_c, lower, state};
use athermal_files::Dataset;
use athermal_run::fit::{FitOptions, fit};
use athermal_run::recording::{self, Recording as _, Samples};
use athermal_starter::{Request, starter};
use athermal_trial::machine::{KnownMachine, Setup, Simulated};

use crate::processors::page;
use crate::random::events;
use crate::shipped::second;
use crate::support::{Event, Exhibit, Scratch, compilers, difference, made_up, plan, stepped};

/// The die tester with another estimator in place of its linear forms, fitted on a day.
fn fitted(estimator: &str, more: &str) -> Engine {
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
{more}"#
    ));
    let (fitted, _) = fit(&plan, &day(), &FitOptions::default(), &mut |_| {}).unwrap();
    Engine::new(Arc::clone(&plan), &fitted).unwrap()
}

fn day() -> Simulated<'static> {
    let setup = Setup {
        days: 1.0,
        ..Setup::default()
    };
    Simulated::new(find::<KnownMachine>("die-tester").unwrap().machine, setup)
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
        let mut engine = fitted(&format!("type = \"rls\"\n{learn}"), "");
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
fn what_learns_learns_the_same_in_c_and_its_state_goes_to_the_engine_and_back() {
    let scratch = Scratch::new("learning");
    let Some(compiler) = compilers().into_iter().next() else {
        return;
    };
    let more =
        "became = \"learner:learning\"\nunsure = \"learner:std_dev\"\nof_both = \"vote:std_dev\"\n";
    let mut engine = fitted("type = \"rls\"\noutside = \"shrink\"", more);
    let (plan, fits) = (engine.plan().clone(), engine.fitted().clone());
    let options = Options {
        frozen: false,
        ..options()
    };
    let exported = export_c(&engine, &options, false).unwrap();
    let exhibit = Exhibit::new(&exported, &scratch.path("c"));
    let frozen = Options {
        rates: Rates::every(second(10.0)),
        frozen: true,
        ..Options::default()
    };
    let learning = Options {
        frozen: false,
        ..frozen.clone()
    };
    let bytes = |options| {
        let bytes = lower(&engine, options).unwrap().layout.bytes(8);
        format!("{},{:03}", bytes / 1000, bytes % 1000)
    };
    let figures = format!(
        "take {} bytes of state at 10 s where {} do as they were fitted",
        bytes(&learning),
        bytes(&frozen)
    );
    let page = page("export-c.md").replace('\n', " ");
    assert!(
        page.contains(&figures),
        "six learners of 42 regressors {figures}"
    );
    // A day of the machine, which it learns from as it comes.
    let recorded = day();
    let mut source = recorded.open(&plan).unwrap();
    let (mut samples, mut all) = (Samples::default(), Vec::new());
    while let Some(recording::Event::Row(time)) = source.next(&mut samples).unwrap() {
        if all.len() == 2_500 {
            all.push(Event::Break);
        }
        all.push(Event::Tick(time.as_ns(), samples.values.clone()));
    }
    let (before, after) = all[..5_000].split_at(2_100);
    stepped(&mut engine, before);
    let program = exhibit.built(compiler, &["-O2"], "driver.c");
    let paths = ["begin", "end"].map(|name| exhibit.folder.join(name));
    let saved = state::to_c(&engine, &exhibit.form).unwrap();
    std::fs::write(&paths[0], &saved).unwrap();
    exhibit.stepped_from(&program, &[], Some(&paths[0]), Some(&paths[1]));
    assert!(
        std::fs::read(&paths[1]).unwrap() == saved,
        "what C loads it saves"
    );
    let mut other = Engine::new(plan.clone(), &fits).unwrap();
    state::from_c(&mut other, &exhibit.form, &saved).unwrap();
    assert!(
        state::to_c(&other, &exhibit.form).unwrap() == saved,
        "what the engine takes it gives"
    );
    let expected = stepped(&mut engine, after);
    assert_eq!(
        difference(&exhibit.form, &expected, &stepped(&mut other, after)),
        None,
        "from C to the engine"
    );
    let (found, said) = exhibit.stepped_from(&program, after, Some(&paths[0]), Some(&paths[1]));
    assert_eq!(difference(&exhibit.form, &expected, &found), None);
    assert_eq!(said & 3, 0, "refused or full");
    // And what C has learned is what the engine has.
    let mut third = Engine::new(plan.clone(), &fits).unwrap();
    state::from_c(
        &mut third,
        &exhibit.form,
        &std::fs::read(&paths[1]).unwrap(),
    )
    .unwrap();
    let (known, learned) = (third.state(), engine.state());
    let learners = known.nodes.keys().filter(|of| of.starts_with("learner"));
    assert_eq!(learners.clone().count(), 6);
    for learner in learners {
        let own = |of: &EngineState| of.nodes[learner].own.clone().unwrap();
        assert!(own(&known) == own(&learned), "{learner}");
    }
    let saved = state::to_c(&third, &exhibit.form).unwrap();
    state::from_c(&mut other, &exhibit.form, &saved).unwrap();
    assert!(other.snapshot() == third.snapshot(), "there and back");
    let became = plan.outputs.iter().enumerate();
    let became = became.filter(|(_, of)| of.name.starts_with("became"));
    let learned = became
        .flat_map(|(nth, _)| expected.iter().map(move |row| f64::from_bits(row[nth])))
        .filter(|became| *became == 0.0);
    assert!(learned.count() > 500, "most truths were learned from");
}

#[test]
fn graphs_that_init_writes_for_logs_are_exported_with_a_learner_among_their_voters() {
    let Some(shared) = std::env::var_os("ATHERMAL_SHARED") else {
        return;
    };
    let Some(compiler) = compilers().into_iter().next() else {
        return;
    };
    let scratch = Scratch::new("init");
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let folders = std::fs::read_dir(Path::new(&shared).join("data")).unwrap();
    let files = folders.flat_map(|of| std::fs::read_dir(of.unwrap().path()).into_iter().flatten());
    let mut files: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    // The second log of a machine has the same columns, and takes as long.
    files.retain(|file| {
        file.extension().is_some_and(|of| of == "csv") && (is_long || !file.ends_with("test.csv"))
    });
    files.sort();
    let mut exported_graphs = 0;
    for file in files {
        let data = Dataset::new(vec![file.clone()], Default::default());
        let Ok(found) = starter(&data, &Request::default()) else {
            // Nothing in it drifts with something beside.
            continue;
        };
        let text = found.text;
        // Those of printers' probes hold less than a hundred windows, and get none.
        let is_short = file.components().any(|of| of.as_os_str() == "z-probe");
        assert_eq!(text.contains("type = \"rls\""), !is_short, "{text}");
        let name = file.file_stem().unwrap().to_str().unwrap();
        {
            let plan = plan(&text);
            let fitted = made_up(&plan, &mut Prng::stream(8, name));
            let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
            let mut source = data.open(&plan).unwrap();
            let (mut samples, mut events) = (Samples::default(), Vec::new());
            let (mut last, mut shortest) = (i64::MIN, i64::MAX);
            while let Some(event) = source.next(&mut samples).unwrap() {
                match event {
                    recording::Event::Row(time) => {
                        shortest = shortest.min(time.as_ns().saturating_sub(last));
                        last = time.as_ns();
                        events.push(Event::Tick(last, samples.values.clone()));
                    }
                    _ => {
                        last = i64::MIN;
                        events.push(Event::Break);
                    }
                }
                if events.len() == 2_000 {
                    break;
                }
            }
            let options = Options {
                rates: Rates::every(Duration::from_ns(shortest)),
                ..Options::default()
            };
            let exported = export_c(&engine, &options, false).unwrap();
            let exhibit = Exhibit::new(&exported, &scratch.path(name));
            let expected = stepped(&mut engine, &events);
            let program = exhibit.built(compiler, &["-O0"], "driver.c");
            let (found, said) = exhibit.stepped(&program, &events);
            assert_eq!(difference(&exhibit.form, &expected, &found), None, "{name}");
            assert_eq!(said & 3, 0, "{name}: refused or full");
            exported_graphs += 1;
        }
    }
    assert!(exported_graphs >= 10, "{exported_graphs}");
}

#[test]
fn estimators_that_are_no_linear_form_are_refused_by_name() {
    for kind in ["kalman", "state_space"] {
        let engine = fitted(&format!("type = \"{kind}\""), "");
        let error = lower(&engine, &options()).unwrap_err();
        let ExportError::Nodes(refusals) = &error else {
            panic!("{error}");
        };
        assert_eq!(refusals[0].node, "learner");
        let why = format!("what `{kind}` is fitted to is no linear form");
        assert!(error.to_string().contains(&why), "{error}");
    }
}
