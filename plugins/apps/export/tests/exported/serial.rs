//! The example that reads a serial line, over a pseudo terminal: what it answers is what the engine gives, to the bit, over a restart and words
//! that are none.

use std::fmt::Write as _;
use std::process::Command;

use athermal_core::engine::Engine;
use athermal_core::prng::Prng;
use athermal_core::time::Instant;
use athermal_export::export_c;

use crate::random::{events, graph, options};
use crate::support::{Event, Exhibit, Scratch, has, made_up, plan, project, ran};

/// Sends lines to the program over a pseudo terminal, begins it anew in the middle, and writes its answers.
const PEER: &str = r#"
import os, pty, subprocess, sys, tty
program, lines, state = sys.argv[1:]
master, slave = pty.openpty()
tty.setraw(slave)
begin = lambda: subprocess.Popen([program, os.ttyname(slave), "115200", state])
running, unread = begin(), b""
lines = open(lines, "rb").read().splitlines()
for nth, line in enumerate(lines):
    if nth == len(lines) // 2:
        running.terminate()
        assert running.wait(20) == 0
        running = begin()
    os.write(master, line + b"\n")
    while b"\n" not in unread:
        unread += os.read(master, 65536)
    answer, unread = unread.split(b"\n", 1)
    sys.stdout.write(answer.decode() + "\n")
running.terminate()
assert running.wait(20) == 0
"#;

#[test]
fn the_loop_on_a_serial_line_answers_what_the_engine_gives_to_the_bit_over_a_restart() {
    if !["gcc", "make", "python3"].iter().all(|of| has(of)) {
        return;
    }
    let scratch = Scratch::new("serial");
    let mut random = Prng::stream(3, "an exported graph");
    let plan = plan(&graph(&mut random));
    let fitted = made_up(&plan, &mut random);
    let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
    let exported = export_c(&engine, &options(), false).unwrap();
    let exhibit = Exhibit::new(&exported, &scratch.path("c"));
    let program = exhibit.folder.join("loop");
    ran(Command::new("make")
        .arg("-C")
        .arg(project().join("examples/serial-line"))
        .arg(format!("EXPORT={}", exhibit.folder.display()))
        .arg(format!("NAME={}", exhibit.form.name))
        .arg(format!("OUT={}", program.display())));
    let names: Vec<&str> = exhibit.form.outputs.iter().map(|of| &*of.name).collect();
    let (mut lines, mut expected) = (String::new(), Vec::new());
    for event in events(&mut random, &plan, 400) {
        let Event::Tick(time, samples) = event else {
            continue;
        };
        let _ = write!(lines, "t={time}");
        for (sample, source) in samples.iter().zip(&exhibit.form.sources) {
            if !sample.is_nan() {
                let _ = write!(lines, " {}={sample:e}", source.name);
            }
        }
        let nth = expected.len();
        lines.push_str(["\n", " nonsense x=1 temperature.t0=abc\n"][usize::from(nth % 50 == 49)]);
        let out = engine.step(Instant::from_ns(time), &samples);
        let out = out.map(<[f64]>::to_vec).unwrap_or_default();
        expected.push((nth % 50 == 49, out));
    }
    // What is longer than any line is none.
    let long = format!("{}\nnothing at all\n", "temperature.t0=20.5 ".repeat(2_000));
    let path = scratch.path("lines");
    std::fs::write(&path, lines + &long).unwrap();
    let said = ran(Command::new("python3").args(["-c", PEER]).args([
        &program,
        &path,
        &scratch.path("machine.state"),
    ]));
    let answers: Vec<&str> = said.lines().collect();
    assert_eq!(answers.len(), expected.len() + 2);
    assert_eq!(answers[expected.len()..], ["skipped=1", "skipped=3"]);
    let mut values = 0;
    for (nth, (answer, (is_wrong, expected))) in answers.iter().zip(&expected).enumerate() {
        assert_eq!(answer.contains(" skipped=3"), *is_wrong, "{nth}: {answer}");
        let value = |name: &str| {
            let mut words = answer.split(' ').filter_map(|word| word.split_once('='));
            let found = words.find(|(of, _)| *of == name);
            found.map(|(_, value)| value.parse::<f64>().unwrap())
        };
        for (name, expected) in names.iter().zip(expected) {
            let found = value(name).unwrap_or(f64::NAN);
            let same = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
            assert!(same, "{nth}, {name}: {found} instead of {expected}");
            values += usize::from(!expected.is_nan());
        }
    }
    println!("{values} values over a serial line");
    assert!(values > 5_000, "{values}");
}
