//! Writes a lowered plan as Structured Text (IEC 61131-3): the runtime as it is, the tables of the graph, its function block and its self
//! test, and a program that calls it. Promised are results within 1e-9 of the largest size of an output, not their bits: compilers may fuse products with sums.

mod plcopen;
mod runtime;
mod tables;

use std::fmt::Write as _;

use athermal_core::engine::Engine;

use crate::c::File;
use crate::error::ExportError;
use crate::form::{Form, Port, each_once};
use crate::ticks::{TICKS, Ticks, self_test};
use crate::{Exported, Options, lower};
pub use plcopen::plcopen;
use runtime::Parts;
use tables::{list, long, plain, real};

/// A graph in Structured Text.
///
/// # Errors
/// As [`lower()`].
pub fn export(engine: &Engine, options: &Options) -> Result<Exported, ExportError> {
    let form = lower(engine, options)?;
    let ticks = self_test(engine, &form, options.frozen)?;
    let file = |path: &str, text: String| File {
        path: path.to_owned(),
        text,
    };
    let parts = Parts::new();
    let own = source(&form, &ticks, &parts);
    let files = vec![
        file("athermal_rt.st", parts.shared),
        file(&format!("{}.st", form.name), own),
        file(&format!("{}_main.st", form.name), program(&form)),
    ];
    Ok(Exported { form, ticks, files })
}

/// The name of the function block of a graph.
#[must_use]
pub fn block(form: &Form) -> String {
    format!("FB_{}", word(&form.name))
}

/// The name of the function block of its self test.
#[must_use]
pub fn self_test_block(form: &Form) -> String {
    format!("FB_SelfTest_{}", word(&form.name))
}

/// Bytes of the state on a controller: of each number it is kept whether there is one.
#[must_use]
pub fn state_bytes(form: &Form) -> usize {
    8 * form.layout.ints + 9 * (form.layout.reals + tables::TOTALS)
}

/// The part of an identifier behind its first: letters, digits and single underscores.
fn word(name: &str) -> String {
    let parts = name.split(|c: char| !c.is_ascii_alphanumeric());
    let parts: Vec<&str> = parts.filter(|part| !part.is_empty()).collect();
    parts.join("_")
}

/// Constants that name channels, each once.
fn constants(prefix: &str, ports: &[Port]) -> Vec<String> {
    let name = |port: &Port| format!("{prefix}_{}", word(&port.name).to_uppercase());
    each_once(ports.iter().map(name))
}

fn source(form: &Form, ticks: &Ticks, parts: &Parts) -> String {
    let graph = word(&form.name);
    let head = format!(
        "(* The graph `{}`, revision {}, as `athermal export st` wrote it: not to be changed by hand. It goes with athermal_rt.st.\n\n\
         \x20  Nanoseconds between two ticks at least: {}. Bytes of the state: {}.\n\
         \x20  Windows and lags are full after {} s. A tick takes about {} operations on numbers at worst. *)\n\n",
        plain(&form.title),
        plain(&form.revision),
        form.period_ns,
        state_bytes(form),
        form.warm_up_ns / 1_000_000_000 + 1,
        crate::c::operations(form),
    );
    let mut text = "VAR_GLOBAL CONSTANT\n".to_owned();
    text.push_str("    (* The places of channels and outputs. *)\n");
    for (what, ports) in [("IN", &form.sources), ("OUT", &form.outputs)] {
        let prefix = format!("{graph}_{what}");
        for (nth, (name, port)) in constants(&prefix, ports).iter().zip(ports).enumerate() {
            let (own, unit) = (plain(&port.name), plain(&port.unit));
            let _ = writeln!(text, "    {name} : DINT := {nth}; (* {own}, in {unit} *)");
        }
    }
    tables::write(form, &mut text);
    test(form, ticks, &mut text);
    text.push_str("END_VAR\n\n");
    text.push_str(&parts.own);
    let blocks = include_str!("blocks.st.in").replace("@block@", &block(form));
    text.push_str(&blocks.replace("@test@", &self_test_block(form)));
    head + &parts.named(&text, &graph)
}

/// A program that calls the block in a task.
fn program(form: &Form) -> String {
    let graph = word(&form.name);
    // Constants of channels, and variables of the program that have their names.
    let named = |what: &str, ports: &[Port]| -> Vec<(String, String, String)> {
        let prefix = format!("{graph}_{what}");
        let own = |(constant, port): (String, &Port)| {
            let variable = constant[graph.len() + 1..].to_lowercase();
            let remark = format!("{}, in {}", plain(&port.name), plain(&port.unit));
            (constant, variable, remark)
        };
        let constants = constants(&prefix, ports).into_iter();
        constants.zip(ports).map(own).collect()
    };
    let (inputs, outputs) = (named("IN", &form.sources), named("OUT", &form.outputs));
    let lines = |of: &[(String, String, String)], line: &dyn Fn(&str, &str, &str) -> String| {
        let lines = of
            .iter()
            .map(|(constant, own, remark)| line(constant, own, remark));
        lines.collect::<Vec<_>>().join("\n")
    };
    let declared = |own: &str, remark: &str, flag: &str| {
        format!("    {own} : LREAL; (* {remark} *)\n    {own}_{flag} : BOOL;")
    };
    let period = athermal_core::time::Duration::from_ns(form.period_ns);
    let text = include_str!("program.st.in");
    let text = text
        .replace("@inputs@", &lines(&inputs, &|_, own, remark| declared(own, remark, "is_new")))
        .replace("@outputs@", &lines(&outputs, &|_, own, remark| declared(own, remark, "has_value")))
        .replace("@take@", &lines(&inputs, &|at, own, _| {
            format!("    samples[{at}] := {own};\n    is_new[{at}] := {own}_is_new;")
        }))
        .replace("@give@", &lines(&outputs, &|at, own, _| {
            format!("    {own}_has_value := graph.has_value[{at}];\n    IF {own}_has_value THEN\n        {own} := graph.out[{at}];\n    END_IF;")
        }));
    text.replace("@graph@", &graph)
        .replace("@block@", &block(form))
        .replace("@test@", &self_test_block(form))
        .replace("@period_ns@", &form.period_ns.to_string())
        .replace("@period@", &period.to_string())
}

/// What the self test compares with.
fn test(form: &Form, ticks: &Ticks, text: &mut String) {
    text.push_str("\n    (* The self test: instants, samples, what the engine gave, and the largest size of each output. *)\n");
    let _ = writeln!(text, "    AT_TEST_TICKS : DINT := {TICKS};");
    list(text, "AT_TEST_TIMES", "LINT", &ticks.times, |&time| {
        long(time)
    });
    let flag = |value: &f64| if value.is_finite() { "TRUE" } else { "FALSE" }.to_owned();
    for (values, flags, rows) in [
        ("AT_TEST_IN", "AT_TEST_IS_NEW", &ticks.inputs),
        ("AT_TEST_OUT", "AT_TEST_HAS", &ticks.outputs),
    ] {
        let all: Vec<f64> = rows.iter().flatten().copied().collect();
        list(text, values, "LREAL", &all, |&value| real(value));
        list(text, flags, "BOOL", &all, flag);
    }
    let sizes: Vec<f64> = (0..form.outputs.len()).map(|nth| ticks.size(nth)).collect();
    list(text, "AT_TEST_SIZES", "LREAL", &sizes, |&size| real(size));
}
