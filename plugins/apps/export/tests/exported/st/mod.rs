//! Structured Text: what is written is within the subset and gives what the engine gives, as an interpreter of our own runs it.

mod compiler;
mod declarations;
mod lexer;
mod machine;
mod parser;
mod plcopen;
mod task;

use std::process::Command;

use athermal_core::engine::Engine;
use athermal_core::prng::Prng;
use athermal_core::time::Instant;
use athermal_export::{Exported, Form, Options, Rates, st};
use declarations::{Instance, Program};

use crate::onnx::python;
use crate::random::{events, graph, leaping, options};
use crate::shipped::{GRAPHS, second, shipped};
use crate::support::{Event, Scratch, made_up, plan, ran};

/// What is promised: an error of so much of the largest size of an output.
pub const TOLERANCE: f64 = 1e-9;

fn program(exported: &Exported) -> Program {
    // To the interpreter a program is a block that is called.
    let text = |text: &str| text.replace("PROGRAM PRG_", "FUNCTION_BLOCK PRG_");
    let texts: Vec<String> = (exported.files.iter())
        .map(|file| text(&file.text).replace("END_PROGRAM", "END_FUNCTION_BLOCK"))
        .collect();
    let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
    Program::new(&texts).unwrap_or_else(|mistake| panic!("{mistake}"))
}

/// One call of the function block of a graph; none where there is no value.
fn stepped(
    program: &mut Program,
    graph: Instance,
    form: &Form,
    time: i64,
    samples: &[f64],
) -> Vec<Option<f64>> {
    program.set(graph, "t_ns", 0, time as u64);
    for (nth, sample) in samples.iter().enumerate() {
        let is_new = !sample.is_nan();
        program.set(graph, "is_new", nth, u64::from(is_new));
        let sample = if is_new { *sample } else { 0.0 };
        program.set(graph, "in", nth, sample.to_bits());
    }
    program
        .call(graph)
        .unwrap_or_else(|fault| panic!("{fault}"));
    let outputs = 0..form.outputs.len();
    outputs
        .map(|nth| {
            (program.get(graph, "has_value", nth) != 0)
                .then(|| f64::from_bits(program.get(graph, "out", nth)))
        })
        .collect()
}

/// Steps a graph and the engine over the same events, begins both anew at some of them, and compares all: the largest error of an output
/// in units of its largest size, and how many values there were.
pub fn compared(
    exported: &Exported,
    engine: &Engine,
    events: &[Event],
    resets: &[usize],
) -> (f64, usize) {
    let form = &exported.form;
    let mut program = program(exported);
    let graph = program.instance(&st::block(form)).unwrap();
    let fresh = || Engine::new(engine.plan().clone(), engine.fitted()).unwrap();
    let mut engine = fresh();
    let mut errors = vec![0.0_f64; form.outputs.len()];
    let mut sizes = vec![0.0_f64; form.outputs.len()];
    let mut values = 0;
    let mut is_broken = false;
    for (nth, event) in events.iter().enumerate() {
        let Event::Tick(time, samples) = event else {
            engine.segment();
            is_broken = true;
            continue;
        };
        let is_reset = resets.contains(&nth);
        if is_reset {
            engine = fresh();
        }
        program.set(graph, "reset", 0, u64::from(is_reset));
        program.set(
            graph,
            "segment",
            0,
            u64::from(std::mem::take(&mut is_broken)),
        );
        let found = stepped(&mut program, graph, form, *time, samples);
        assert_eq!(
            program.get(graph, "said", 0) & 3,
            0,
            "refused or full at {nth}"
        );
        let expected = engine.step(Instant::from_ns(*time), samples).unwrap();
        for (place, (expected, found)) in expected.iter().zip(found).enumerate() {
            let name = &form.outputs[place].name;
            assert_eq!(
                found.is_some(),
                !expected.is_nan(),
                "event {nth}, {name}: {found:?} instead of {expected}"
            );
            let Some(found) = found else { continue };
            values += 1;
            errors[place] = errors[place].max((found - expected).abs());
            sizes[place] = sizes[place].max(expected.abs());
        }
    }
    let relative = errors
        .iter()
        .zip(&sizes)
        .map(|(&error, &size)| if error > 0.0 { error / size } else { 0.0 });
    (relative.fold(0.0, f64::max), values)
}

#[test]
fn random_graphs_give_in_structured_text_what_the_engine_gives_within_1e9th() {
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let (seeds, ticks) = if is_long { (20, 3_000) } else { (3, 500) };
    let (mut values, mut largest) = (0, 0.0_f64);
    for seed in 0..seeds {
        let mut random = Prng::stream(seed, "an exported graph");
        let text = graph(&mut random);
        let plan = plan(&text);
        let fitted = made_up(&plan, &mut random);
        let engine = Engine::new(plan.clone(), &fitted).unwrap();
        let exported = st::export(&engine, &options()).unwrap();
        let mut events = events(&mut random, &plan, ticks);
        // Segments end, and one begins at another time.
        events.insert(ticks / 3, Event::Break);
        events.insert(ticks / 2, Event::Break);
        for event in &mut events[ticks / 2..] {
            if let Event::Tick(time, _) = event {
                *time -= 3_000_000_000_000;
            }
        }
        for events in [leaping(&events, &plan, seed), events] {
            let (error, count) = compared(&exported, &engine, &events, &[ticks * 3 / 4]);
            largest = largest.max(error);
            values += count;
        }
    }
    println!("Structured Text: {values} values, off by {largest:.1e} of the largest size at most");
    assert!(values > 20_000, "{values}");
    assert!(largest <= TOLERANCE, "{largest}");
}

#[test]
fn the_graphs_of_the_die_tester_pass_their_self_test_in_structured_text_and_give_what_the_engine_gives()
 {
    for name in GRAPHS {
        let (engine, _) = shipped(name, Rates::every(second(10.0)));
        let options = Options {
            rates: Rates::every(second(2.0)),
            ..Options::default()
        };
        let exported = st::export(&engine, &options).unwrap();
        let mut events = events(&mut Prng::stream(5, name), engine.plan(), 500);
        for event in &mut events {
            // Windows are long: ten times slower, they fill.
            if let Event::Tick(time, _) = event {
                *time = 10 * (*time - 1_700_000_000_000_000_000);
            }
        }
        let (error, values) = compared(&exported, &engine, &events, &[]);
        assert!(
            error <= TOLERANCE && values > 200,
            "{name}: {error}, {values}"
        );
        let (differs, exported) = self_tested(&engine, &|text| text);
        assert_eq!(differs, 0, "{name}");
        let text = &exported.files[1].text;
        let test: usize = text
            .lines()
            .skip_while(|line| !line.contains("_TEST_"))
            .take_while(|line| *line != "END_VAR")
            .map(str::len)
            .sum();
        println!(
            "{name}, all at 10 s: {} bytes of state, text {} kB and {} kB self test; {values} values, off by {error:.1e}",
            st::state_bytes(&exported.form),
            (text.len() - test) / 1000,
            test / 1000
        );
    }
    let rates = Rates::every(second(1.0)).with("position", second(10.0));
    let (_, exported) = shipped("die-tester-compensate.toml", rates);
    println!(
        "die-tester-compensate.toml at 1 s, positions each 10 s: {} bytes of state",
        st::state_bytes(&exported.form)
    );
}

/// What the self test of a graph finds when the text of its tables is changed.
fn self_tested(engine: &Engine, change: &dyn Fn(String) -> String) -> (i64, Exported) {
    let options = Options {
        rates: Rates::every(second(10.0)),
        ..Options::default()
    };
    let mut exported = st::export(engine, &options).unwrap();
    let text = std::mem::take(&mut exported.files[1].text);
    exported.files[1].text = change(text);
    let mut program = program(&exported);
    let test = st::self_test_block(&exported.form);
    let test = program.instance(&test).unwrap();
    let mut calls = 0;
    while program.get(test, "done", 0) == 0 {
        program.call(test).unwrap_or_else(|fault| panic!("{fault}"));
        calls += 1;
        assert!(calls <= 20, "ten ticks in a call, and 200 in all");
    }
    let differs = program.get(test, "differs", 0) as i64;
    (differs, exported)
}

#[test]
fn the_self_test_sees_that_a_constant_is_another() {
    let (engine, _) = shipped("die-tester-compensate.toml", Rates::every(second(10.0)));
    let table = "_LINEARS : ";
    let (differs, _) = self_tested(&engine, &|text| {
        let (before, after) = text.split_once(table).unwrap();
        let (head, tail) = after.split_once("intercept := ").unwrap();
        let end = tail.find(',').unwrap();
        let value: f64 = tail[..end].parse().unwrap();
        format!(
            "{before}{table}{head}intercept := {:.16E}{}",
            value + 1e-3,
            &tail[end..]
        )
    });
    assert!(differs > 0, "{differs}");
}

#[test]
fn a_time_that_is_not_after_the_last_one_is_refused_and_a_sample_out_of_its_range_is_rejected() {
    let (engine, _) = shipped("die-tester-sensor.toml", Rates::every(second(10.0)));
    let exported = st::export(&engine, &Options::default()).unwrap();
    let form = &exported.form;
    let mut program = program(&exported);
    let graph = program.instance(&st::block(form)).unwrap();
    let mut samples = vec![f64::NAN; form.sources.len()];
    for (time, sample, said) in [
        (5, 20.0, 0),
        (5, 21.0, 1),
        (4, 21.0, 1),
        (6, 1e300, 4),
        (7, f64::INFINITY, 4),
        (8, 20.5, 0),
    ] {
        samples[0] = sample;
        let found = stepped(&mut program, graph, form, time * 1_000_000_000, &samples);
        assert_eq!(program.get(graph, "said", 0), said, "at {time}");
        // What had a value at the tick before has none at one that is refused.
        assert!(said != 1 || found.iter().all(Option::is_none), "at {time}");
    }
}

#[test]
fn after_a_restart_a_clock_that_begins_at_0_begins_a_segment_in_structured_text() {
    let mut random = Prng::stream(3, "an exported graph");
    let plan = plan(&graph(&mut random));
    let fitted = made_up(&plan, &mut random);
    let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
    let exported = st::export(&engine, &options()).unwrap();
    let form = &exported.form;
    let mut program = program(&exported);
    let graph = program.instance(&st::block(form)).unwrap();
    let all: Vec<Event> = (events(&mut random, &plan, 300).into_iter())
        .filter(|event| matches!(event, Event::Tick(..)))
        .collect();
    let (mut values, mut had) = (0, false);
    for (nth, event) in all.iter().enumerate() {
        let Event::Tick(_, samples) = event else {
            continue;
        };
        // From the restart on a clock from boot.
        let begins = if nth < 200 { 1_700_000_000 } else { -200 };
        let time = (begins + nth as i64) * 1_000_000_000;
        if nth == 200 {
            let found = stepped(&mut program, graph, form, time, samples);
            assert_eq!(program.get(graph, "said", 0), 1);
            assert!(had && found.iter().all(Option::is_none));
            engine.segment();
        }
        program.set(graph, "restart", 0, u64::from(nth == 200));
        let found = stepped(&mut program, graph, form, time, samples);
        let said = program.get(graph, "said", 0);
        assert_eq!(said & 8 != 0, nth == 200, "at {nth}");
        let expected = engine.step(Instant::from_ns(time), samples).unwrap();
        had = found.iter().any(Option::is_some);
        for (place, (expected, found)) in expected.iter().zip(found).enumerate() {
            let name = &form.outputs[place].name;
            assert_eq!(found.is_some(), !expected.is_nan(), "{nth}, {name}");
            let Some(found) = found else { continue };
            values += usize::from(nth > 200);
            let off = (found - expected).abs();
            assert!(
                off <= 1e-9 * expected.abs().max(1.0),
                "{nth}, {name}: {off}"
            );
        }
    }
    assert!(values > 500, "{values}");
}

#[test]
fn two_graphs_go_into_one_project_with_one_runtime() {
    let options = Options {
        rates: Rates::every(second(10.0)),
        ..Options::default()
    };
    let export = |name| {
        let (engine, _) = shipped(name, Rates::every(second(10.0)));
        st::export(&engine, &options).unwrap()
    };
    let [one, other] = ["die-tester-sensor.toml", "die-tester-compensate.toml"].map(export);
    assert_eq!(one.files[0].text, other.files[0].text);
    let texts = [&one.files[0].text, &one.files[1].text, &other.files[1].text];
    let mut program = Program::new(&texts.map(|text| &**text)).unwrap();
    for graph in [&one, &other] {
        let test = program.instance(&st::self_test_block(&graph.form)).unwrap();
        while program.get(test, "done", 0) == 0 {
            program.call(test).unwrap_or_else(|fault| panic!("{fault}"));
        }
        assert_eq!(program.get(test, "differs", 0), 0);
    }
}

#[test]
fn names_that_structured_text_does_not_have_become_names_that_it_has() {
    let (engine, _) = shipped("die-tester-sensor.toml", Rates::every(second(10.0)));
    for (name, block) in [
        ("while", "FB_while"),
        ("a__b_", "FB_a_b"),
        ("self test", "FB_self_test"),
        ("1st", "FB_g_1st"),
    ] {
        let options = Options {
            rates: Rates::every(second(10.0)),
            name: Some(name.to_owned()),
            ..Options::default()
        };
        let exported = st::export(&engine, &options).unwrap();
        assert_eq!(st::block(&exported.form), block);
        program(&exported).instance(block).unwrap();
    }
}

#[test]
fn iecst_parses_every_function_block_and_type() {
    let (engine, _) = shipped("die-tester-compensate.toml", Rates::every(second(10.0)));
    let exported = st::export(&engine, &Options::default()).unwrap();
    let text: String = exported.files.iter().map(|file| &*file.text).collect();
    // It knows neither `output => variable` nor a label of a case that is a name: it reads an input and a number there. Nor does it know
    // a list that a variable begins with, so the tables are none of it.
    let is_label = |line: &str| line.starts_with("    AT_DO_") && line.ends_with(':');
    let text: String = text
        .lines()
        .map(|line| if is_label(line) { "    0:" } else { line })
        .flat_map(|line| [line, "\n"])
        .collect();
    let text = text.replace(" => ", " := ");
    let mut declarations = 0;
    for (begin, end) in [
        ("FUNCTION ", "END_FUNCTION"),
        ("FUNCTION_BLOCK ", "END_FUNCTION_BLOCK"),
        ("TYPE ", "END_TYPE"),
        ("PROGRAM ", "END_PROGRAM"),
    ] {
        let mut rest = &*text;
        while let Some(at) = rest.find(&format!("\n{begin}")) {
            let length = rest[at..].find(&format!("\n{end}\n")).unwrap();
            let body = &rest[at + 1..at + length];
            let whole = format!("{body}\n{end}");
            let parsed = match begin {
                "TYPE " => iecst::parse_type_block(&whole).map(drop),
                _ => iecst::parse_pou(&whole).map(drop),
            };
            parsed
                .unwrap_or_else(|mistake| panic!("{mistake:?}: {}", &body[..body.len().min(500)]));
            declarations += 1;
            rest = &rest[at + length..];
        }
    }
    assert!(declarations > 130, "{declarations}");
    assert!(iecst::parse_pou("FUNCTION f : BOOL\nf := ;\nEND_FUNCTION").is_err());
}

const SCRIPT: &str = r#"
import multiprocessing, re, sys
import blark.parse
def parsed(text):
    result = blark.parse.parse_source_code(text)
    # It does not raise.
    return len(result.tree.children) if result.exception is None else str(result.exception)
with multiprocessing.get_context("fork").Pool() as pool:
    for path in sys.argv[1:]:
        # Declarations, some at a time: it is slow, and takes gigabytes for all at once.
        parts = re.split(r"(?m)^(?=FUNCTION |FUNCTION_BLOCK |TYPE |VAR_GLOBAL )", open(path).read())
        parts = ["".join(parts[nth:nth + 8]) for nth in range(0, len(parts), 8)]
        found = pool.map(parsed, parts, chunksize=1)
        for problem in found:
            if isinstance(problem, str):
                raise SystemExit(f"{path}: {problem}")
        print(sum(found))
"#;

/// Tables of which each list has its first two lines and its last: a list of a thousand numbers takes blark minutes and gigabytes.
fn shortened(tables: &str) -> String {
    let (lists, blocks) = tables.split_once("END_VAR").unwrap();
    let lines: Vec<&str> = lists.lines().collect();
    let is_within = |nth: usize| {
        lines
            .get(nth)
            .is_some_and(|line| line.starts_with("        "))
    };
    let is_kept =
        |nth: &usize| !(is_within(*nth) && is_within(nth + 1) && *nth > 1 && is_within(nth - 2));
    let kept: Vec<&str> = (0..lines.len())
        .filter(is_kept)
        .map(|nth| lines[nth])
        .collect();
    format!("{}\nEND_VAR{blocks}", kept.join("\n"))
}

#[test]
fn blark_parses_the_runtime_and_the_tables() {
    let Some(python) = python("blark") else {
        return;
    };
    let scratch = Scratch::new("st");
    let (engine, _) = shipped("die-tester-compensate.toml", Rates::every(second(10.0)));
    let options = Options {
        rates: Rates::every(second(10.0)),
        ..Options::default()
    };
    let mut exported = st::export(&engine, &options).unwrap();
    exported.files[1].text = shortened(&exported.files[1].text);
    assert!(exported.files[1].text.len() < 300_000);
    athermal_export::c::write(&exported.files, &scratch.path("")).unwrap();
    let paths = exported.files.iter().map(|file| scratch.path(&file.path));
    let said = ran(Command::new(&python).args(["-c", SCRIPT]).args(paths));
    let declarations: Vec<usize> = said.lines().map(|line| line.parse().unwrap()).collect();
    // Types and functions of numbers; then the tables, what reads them, and two blocks.
    assert!(declarations[0] > 20, "{said}");
    assert!(declarations[1] > 100, "{said}");
    // And it sees what is none.
    let broken = scratch.path("broken.st");
    std::fs::write(&broken, "FUNCTION f : BOOL\nf := ;\nEND_FUNCTION\n").unwrap();
    let output = Command::new(&python)
        .args(["-c", SCRIPT])
        .arg(&broken)
        .output()
        .unwrap();
    assert!(!output.status.success());
}

/// A program of one function block with an output, and what its body makes of it.
fn result(declared: &str, body: &str) -> Result<u64, String> {
    let text = format!(
        "{declared}\nFUNCTION_BLOCK fb\nVAR_OUTPUT result : LINT; END_VAR\nVAR a : ARRAY[1..3] OF LREAL; nth : DINT; x : LREAL; is : BOOL; END_VAR\n{body}\nEND_FUNCTION_BLOCK"
    );
    let mut program = Program::new(&[&text])?;
    let block = program.instance("fb")?;
    program.call(block)?;
    Ok(program.get(block, "result", 0))
}

#[test]
fn the_interpreter_refuses_what_is_not_of_the_subset_and_ends_where_a_controller_might() {
    let twice = "FUNCTION twice : LINT\nVAR_INPUT n : LINT; END_VAR\ntwice := 2 * n;\nEND_FUNCTION";
    assert_eq!(
        result(
            twice,
            "FOR nth := 1 TO 3 DO result := result + twice(twice(nth)); END_FOR;"
        ),
        Ok(24)
    );
    assert_eq!(
        result(
            "",
            "CASE nth OF 1: result := 1; 0: result := -7; result := result MOD 4; ELSE result := 9; END_CASE;"
        ),
        Ok(-3i64 as u64)
    );
    assert_eq!(
        result(
            "",
            "WHILE TRUE DO result := result + 1; IF result = 5 THEN EXIT; END_IF; END_WHILE;"
        ),
        Ok(5)
    );
    assert_eq!(
        result(
            "",
            "x := 1.5E1; IF x / 2.0 > 7.4 AND NOT (x = 2.0) OR FALSE THEN result := TRUNC(-x); END_IF;"
        ),
        Ok(-15i64 as u64)
    );
    for (body, complaint) in [
        ("result := nothing;", "no `nothing`"),
        ("result := x;", "is wanted"),
        ("nth := result;", "is wanted"),
        ("x := 1;", "is wanted"),
        ("x := nth + 1.0;", "+"),
        ("IF nth THEN END_IF;", "is wanted"),
        ("a[result] := 1.0;", "is wanted"),
        ("REPEAT nth := 1; UNTIL TRUE END_REPEAT", "expected"),
        ("nth := 16#FF;", "not of the subset"),
        ("nth := 3000000000;", "is wanted"),
        (
            "FOR nth := 1 TO 3 DO nth := 2; END_FOR;",
            "may not be written",
        ),
        ("twice(1);", "no function"),
        ("a[4] := 1.0;", "index 4 of 1..3"),
        ("a[nth] := 1.0;", "index 0 of 1..3"),
        (
            "IF nth > 0 AND a[nth] > 0.0 THEN x := 1.0; END_IF;",
            "index 0 of 1..3",
        ),
        ("x := 1.0 / x;", "division by zero"),
        ("result := 1 / nth;", "division by zero"),
        ("x := SQRT(-1.0);", "becomes none"),
        (
            "nth := 2147483647; nth := nth + 1;",
            "too large for its type",
        ),
        (
            "result := 9223372036854775807; result := result + 1;",
            "too large for its type",
        ),
        (
            "result := 4294967296; nth := LINT_TO_DINT(result);",
            "too large for its type",
        ),
    ] {
        let said = result("", body).expect_err(body);
        assert!(said.contains(complaint), "{body}: {said}");
    }
    for (declared, complaint) in [
        (
            "VAR_GLOBAL CONSTANT c : DINT := 1; C : DINT := 2; END_VAR",
            "twice",
        ),
        (
            "VAR_GLOBAL CONSTANT c : ARRAY[0..2] OF DINT := [1, 2]; END_VAR",
            "2 elements",
        ),
        ("VAR_GLOBAL CONSTANT at : DINT := 1; END_VAR", "expected"),
        (
            "VAR_GLOBAL CONSTANT a__b : DINT := 1; END_VAR",
            "no identifier",
        ),
        (
            "VAR_GLOBAL CONSTANT c : LREAL := 1.0E+400; END_VAR",
            "too large",
        ),
        (
            "FUNCTION g : BOOL\nVAR_INPUT what : BOOL; END_VAR\nwhat := TRUE;\nEND_FUNCTION",
            "may not be written",
        ),
        ("(* without an end", "does not end"),
    ] {
        let said = result(declared, "").expect_err(declared);
        assert!(said.contains(complaint), "{declared}: {said}");
    }
    let itself = "FUNCTION g : DINT\nVAR_INPUT n : DINT; END_VAR\ng := g(n);\nEND_FUNCTION";
    assert!(
        result(itself, "nth := g(1);")
            .unwrap_err()
            .contains("calls itself")
    );
}
