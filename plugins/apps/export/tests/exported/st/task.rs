//! The program that is written beside a graph in Structured Text, called as a task calls it.

use athermal_core::prng::Prng;
use athermal_core::time::Instant;
use athermal_export::{Options, Rates, st};

use super::{TOLERANCE, program};
use crate::random::events;
use crate::shipped::{second, shipped};
use crate::support::Event;

#[test]
fn the_program_that_is_written_beside_tests_the_graph_and_then_gives_what_the_engine_gives() {
    let name = "die-tester-compensate.toml";
    let (mut engine, _) = shipped(name, Rates::every(second(10.0)));
    let options = Options {
        rates: Rates::every(second(10.0)),
        ..Options::default()
    };
    let exported = st::export(&engine, &options).unwrap();
    let form = &exported.form;
    let mut program = program(&exported);
    let main = program.instance("PRG_die_tester_compensate").unwrap();
    let variable =
        |what: &str, name: &str| format!("{what}_{}", name.replace(['.', '-'], "_").to_lowercase());
    let all = events(&mut Prng::stream(5, name), engine.plan(), 200).into_iter();
    let rows = all.filter_map(|event| match event {
        Event::Tick(_, samples) => Some(samples),
        Event::Break => None,
    });
    let (mut cycles, mut values, mut t_ns) = (0, 0, 0);
    for samples in rows {
        cycles += 1;
        for (source, sample) in form.sources.iter().zip(&samples) {
            let own = variable("in", &source.name);
            program.set(
                main,
                &format!("{own}_is_new"),
                0,
                u64::from(!sample.is_nan()),
            );
            let sample = if sample.is_nan() { 0.0 } else { *sample };
            program.set(main, &own, 0, sample.to_bits());
        }
        program.call(main).unwrap_or_else(|fault| panic!("{fault}"));
        let ready = program.get(main, "ready", 0) != 0;
        assert_eq!(ready, cycles >= 20, "ten ticks of the test in a cycle");
        if !ready {
            continue;
        }
        t_ns += 10_000_000_000;
        let expected = engine.step(Instant::from_ns(t_ns), &samples).unwrap();
        assert_eq!(program.get(main, "said", 0) & 3, 0, "cycle {cycles}");
        for (output, expected) in form.outputs.iter().zip(expected) {
            let own = variable("out", &output.name);
            let has = program.get(main, &format!("{own}_has_value"), 0) != 0;
            assert_eq!(has, !expected.is_nan(), "cycle {cycles}, {own}");
            let found = f64::from_bits(program.get(main, &own, 0));
            let size = expected.abs().max(1.0);
            assert!(
                !has || (found - expected).abs() <= TOLERANCE * size,
                "{own}: {found} {expected}"
            );
            values += usize::from(has);
        }
    }
    assert!(values > 1_000, "{values}");
}
