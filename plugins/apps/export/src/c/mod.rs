//! Writes a lowered plan as C99: the runtime as it is, the tables of the graph, its self test, an example and how all is built.

mod example;
mod flash;
mod tables;

use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::Path;
use std::process::Command;

use athermal_features::slope::kernel::{FEWEST_ROWS, MOST_ROWS};
pub use flash::{Flash, flash};
use thiserror::Error;

use crate::error::ExportError;
use crate::form::{Form, Port, Record, each_once};
use crate::ticks::Ticks;

/// The runtime, written by hand.
pub const RUNTIME_HEADER: &str = include_str!("../../c/athermal_rt.h");
/// Its functions.
pub const RUNTIME: &str = include_str!("../../c/athermal_rt.c");

/// A file of what is exported.
#[derive(Debug, Clone)]
pub struct File {
    /// Its path within the folder.
    pub path: String,
    /// Its text.
    pub text: String,
}

/// All files of a graph in C.
#[must_use]
pub fn files(form: &Form, ticks: &Ticks, float: bool) -> Vec<File> {
    let name = &form.name;
    let file = |path: &str, text: String| File {
        path: path.to_owned(),
        text,
    };
    vec![
        file("athermal_rt.h", RUNTIME_HEADER.to_owned()),
        file("athermal_rt.c", RUNTIME.to_owned()),
        file(&format!("{name}.h"), header(form)),
        file(&format!("{name}.c"), source(form, ticks)),
        file("Makefile", example::makefile(form, float)),
        file("CMakeLists.txt", example::cmake(form, float)),
        file("README.md", example::readme(form)),
        file("example/main.c", example::main(form)),
    ]
}

/// Writes files into a folder, which is made.
///
/// # Errors
/// When one cannot be written.
pub fn write(files: &[File], folder: &Path) -> Result<(), ExportError> {
    for file in files {
        write_bytes(folder, &file.path, file.text.as_bytes())?;
    }
    Ok(())
}

/// Writes a file into a folder, which is made.
pub(crate) fn write_bytes(folder: &Path, path: &str, bytes: &[u8]) -> Result<(), ExportError> {
    let path = folder.join(path);
    let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    let written = made.and_then(|()| std::fs::write(&path, bytes));
    written.map_err(|source| ExportError::Write { path, source })
}

/// Why the error of single precision is not known, or is no small one.
#[derive(Debug, Error)]
pub enum SinglePrecisionError {
    /// There is no compiler.
    #[error(
        "there is no C compiler (`{0}`), so the error of single precision is not known: the example prints it"
    )]
    NoCompiler(String),
    /// The compiler does not compile it.
    #[error("`{0}` does not compile it in single precision:\n{1}")]
    Compiler(String, String),
    /// The example does not end as it should.
    #[error("the self test of single precision did not run to its end: {0}")]
    Example(String),
    /// Some output is not what it should be.
    #[error(
        "in single precision the self test fails at tick {tick}: an output is absent where it should not be, or off by more than 0.01 of \
         its largest size; the largest error is at least {error:e}"
    )]
    SelfTest {
        /// The first tick that differs, from 1.
        tick: u64,
        /// The largest error, at least.
        error: f64,
    },
}

/// What the error of single precision is less than in the self test of an exported folder, in units of the largest size of the output;
/// the example counts whole millionths.
///
/// # Errors
/// Without the compiler, where it compiles nothing, and where the self test fails.
pub fn single_precision_error(
    compiler: &str,
    folder: &Path,
    form: &Form,
) -> Result<f64, SinglePrecisionError> {
    let program = folder.join("single_precision_error");
    let built = Command::new(compiler)
        .args(["-std=c99", "-O2", "-ffp-contract=off", "-DATHERMAL_FLOAT"])
        .arg("-I")
        .arg(folder)
        .args([
            folder.join("athermal_rt.c"),
            folder.join(format!("{}.c", form.name)),
            folder.join("example/main.c"),
        ])
        .arg("-lm")
        .arg("-o")
        .arg(&program)
        .output();
    let complaint = match built {
        Ok(built) if built.status.success() => None,
        Ok(built) => Some(String::from_utf8_lossy(&built.stderr).trim().to_owned()),
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return Err(SinglePrecisionError::NoCompiler(compiler.to_owned()));
        }
        Err(error) => Some(error.to_string()),
    };
    if let Some(complaint) = complaint {
        let compiler = compiler.to_owned();
        return Err(SinglePrecisionError::Compiler(compiler, complaint));
    }
    let ran = std::path::absolute(&program).and_then(|program| Command::new(program).output());
    let _ = std::fs::remove_file(&program);
    let ran = ran.map_err(|error| SinglePrecisionError::Example(error.to_string()))?;
    let said = String::from_utf8_lossy(&ran.stdout);
    let number = |after: &str| {
        let rest = said.split_once(after)?.1;
        let end = rest.find(|c: char| !c.is_ascii_digit());
        rest[..end.unwrap_or(rest.len())].parse::<u64>().ok()
    };
    match (number("self test "), number(", error ")) {
        (Some(0), Some(millionths)) if ran.status.success() => Ok((millionths + 1) as f64 / 1e6),
        (Some(tick), Some(millionths)) if tick > 0 => Err(SinglePrecisionError::SelfTest {
            tick,
            error: millionths as f64 / 1e6,
        }),
        _ => Err(SinglePrecisionError::Example(ran.status.to_string())),
    }
}

/// What a tick takes at worst, in operations on numbers, additions, products and the like: with full windows in which every channel
/// lacks a sample, and votes of which each lets errors go. What lines take is left out whose samples all but coincide: these are taken
/// over the samples once more.
#[must_use]
pub fn operations(form: &Form) -> usize {
    let of_node = |node: &Record| match node.kind {
        "slope" => {
            let (rows, channels) = (node.place_of("room"), node.place_of("channels"));
            let (blocks, windows) = (node.place_of("blocks"), node.place_of("windows"));
            // A window that begins within the current block is summed by itself, over as many rows as the smallest blocks have.
            let short = windows * FEWEST_ROWS as usize;
            // Of sums that are kept those of one block are made, and fewer than a block's fewest rows added for each window.
            let rows = match node.int_of("kept") {
                0.. => MOST_ROWS as usize + 2 * short,
                _ => rows + short,
            };
            rows * (4 + 7 * channels) + blocks * (12 + 14 * channels) + windows * channels * 50
        }
        "linear" => {
            let width = node.place_of("width");
            let novelty = node.struct_of("novelty");
            let novelty = novelty.map_or(0, |of| width * (4 + 2 * of.place_of("directions")));
            let has = |part| usize::from(node.struct_of(part).is_some());
            // Of a covariance the triangle is gone through for each variance; its root is found anew for a row that is learned.
            let squares = has("variance") + 3 * has("spread") + (width + 10) * has("learner");
            2 * width + novelty + squares * (width + 1) * (width + 1)
        }
        "health" => node.place_of("channels") * 60,
        // The memory of every voter is summed anew, and each weight is a power or an exponential.
        "vote" => form.voters(node).1 * (2 * node.place_of("errors") + 80) + 40,
        // Of every column that is not there the form is made anew.
        "cross_check" => {
            let columns = node.place_of("columns");
            columns * columns * (2 * columns + 4) + 8 * node.place_of("predicting")
        }
        _ => 40,
    };
    form.nodes.iter().map(of_node).sum()
}

/// A name as a constant of C.
fn constant(name: &str) -> String {
    let word = |c: char| match c.is_ascii_alphanumeric() {
        true => c.to_ascii_uppercase(),
        false => '_',
    };
    name.chars().map(word).collect()
}

/// Names of channels as constants, each once.
fn constants(ports: &[Port]) -> Vec<String> {
    each_once(ports.iter().map(|port| constant(&port.name)))
}

/// Text within a comment or a string of C.
fn plain(text: &str) -> String {
    let word = |c: char| match c {
        '"' | '\\' => '\'',
        '*' | '/' => c,
        c if c.is_ascii_graphic() || c == ' ' => c,
        _ => '?',
    };
    let text: String = text.chars().map(word).collect();
    text.replace("*/", "* /").replace("/*", "/ *")
}

/// How many ticks the longest window holds.
fn window_ticks(form: &Form) -> i64 {
    let slopes = form.nodes.iter().filter(|node| node.kind == "slope");
    let widths = slopes.flat_map(|node| node.longs_of("width"));
    let longest = widths.copied().max().unwrap_or(0);
    longest / form.period_ns.max(1) + 1
}

fn header(form: &Form) -> String {
    let (name, upper) = (&form.name, form.name.to_uppercase());
    let mut text = String::new();
    let layout = form.layout;
    let _ = write!(
        text,
        "/* The graph `{}`, revision {}, as `athermal export c` wrote it: not to be changed by hand.\n\
         \x20*\n\
         \x20* Build it with -std=c99 -ffp-contract=off: {name}_self_test() says whether results are those of the engine, to the bit. */\n\
         #ifndef {upper}_H\n#define {upper}_H\n\n#include \"athermal_rt.h\"\n\n\
         #define {upper}_REVISION \"{}\"\n\
         #define {upper}_INPUTS {}\n#define {upper}_OUTPUTS {}\n\
         /* Bytes of the state. A tick takes about {} operations on numbers at worst. */\n\
         #define {upper}_STATE_BYTES ({}u + ({}u * sizeof(at_real)))\n\
         #define {upper}_SAVED_BYTES {}u\n\
         #define {upper}_TICKS {}\n\
         /* Nanoseconds between two ticks at least, and so many ticks to the longest window. */\n\
         #define {upper}_PERIOD_NS INT64_C({})\n#define {upper}_WINDOW_TICKS {}\n\n",
        plain(&form.title),
        form.revision,
        form.revision,
        form.sources.len(),
        form.outputs.len(),
        operations(form),
        8 * layout.ints,
        layout.reals,
        8 * (layout.ints + layout.saved() + 6),
        crate::ticks::TICKS,
        form.period_ns,
        window_ticks(form),
    );
    let used: Vec<String> = (tables::used(form).iter())
        .map(|part| format!("(1u << {part})"))
        .collect();
    let _ = write!(
        text,
        "/* What the graph uses of the runtime, for a program with this graph alone. */\n\
         #ifdef ATHERMAL_PLAN\n#define AT_USES ({})\n#endif\n\n",
        if used.is_empty() {
            "0u".to_owned()
        } else {
            used.join(" | ")
        }
    );
    for (what, ports) in [("IN", &form.sources), ("OUT", &form.outputs)] {
        let _ = writeln!(text, "enum {{");
        for (nth, (constant, port)) in constants(ports).iter().zip(ports).enumerate() {
            let comma = if nth + 1 < ports.len() { "," } else { "" };
            let _ = writeln!(
                text,
                "    {upper}_{what}_{constant} = {nth}{comma} /* {}, in {} */",
                plain(&port.name),
                plain(&port.unit)
            );
        }
        let _ = writeln!(text, "}};\n");
    }
    let _ = write!(
        text,
        "typedef struct {{\n    int64_t i[{}];\n    at_real r[{}];\n}} {name}_state;\n\n\
         extern const char *const {name}_input_names[{upper}_INPUTS];\n\
         extern const char *const {name}_input_units[{upper}_INPUTS];\n\
         extern const char *const {name}_output_names[{upper}_OUTPUTS];\n\
         extern const char *const {name}_output_units[{upper}_OUTPUTS];\n\n\
         /* Begins cold. */\nvoid {name}_init({name}_state *state);\n\n\
         /* One instant: samples in, NaN where there is no new value; outputs, NaN where there is none. 0, or AT_REFUSED, AT_FULL, AT_REJECTED, AT_RESTARTED. */\n\
         int {name}_step({name}_state *state, int64_t t_ns, const double in[], double out[]);\n\n\
         /* The next tick begins another segment: windows start afresh, what was learned stays. */\n\
         void {name}_segment({name}_state *state);\n\n\
         /* The state as {upper}_SAVED_BYTES bytes, the same on every processor; 0 where there is too little room. */\n\
         size_t {name}_save(const {name}_state *state, uint8_t bytes[], size_t room);\n\n\
         /* Goes on from them; 0, or 1 where they are damaged or of another graph. The next tick may have any time: where the clock began anew, so\n\
         \x20* that its time is not after that of the state, it begins another segment and says AT_RESTARTED. */\n\
         int {name}_load({name}_state *state, const uint8_t bytes[], size_t length);\n\n\
         /* Steps {} ticks and compares every output with that of the engine: 0, or the number of the first tick that differs, from 1. */\n\
         int {name}_self_test(void);\n\n\
         /* The same in a state that is given, which is cold afterwards. `error`, where it is not NULL, is the largest error in units of the\n\
         \x20* largest size of the output, and `hash` one over the bits of all outputs. In single precision an error up to 0.01 is none. */\n\
         int {name}_self_test_in({name}_state *state, double *error, uint64_t *hash);\n\n#endif\n",
        layout.ints,
        layout.reals.max(1),
        crate::ticks::TICKS,
    );
    text
}

fn source(form: &Form, ticks: &Ticks) -> String {
    let (name, upper) = (&form.name, form.name.to_uppercase());
    let mut text = format!(
        "/* The tables of the graph `{}`; see {name}.h. */\n#include \"{name}.h\"\n\n",
        plain(&form.title)
    );
    for (what, ports, upper_what) in [
        ("input", &form.sources, "INPUTS"),
        ("output", &form.outputs, "OUTPUTS"),
    ] {
        let names: Vec<&str> = ports.iter().map(|port| &*port.name).collect();
        let units: Vec<&str> = ports.iter().map(|port| &*port.unit).collect();
        for (which, of_ports) in [("names", names), ("units", units)] {
            let _ = writeln!(
                text,
                "const char *const {name}_{what}_{which}[{upper}_{upper_what}] = {{"
            );
            for of_port in of_ports {
                let _ = writeln!(text, "    \"{}\",", plain(of_port));
            }
            text.push_str("};\n\n");
        }
    }
    tables::write(form, &mut text);
    let _ = write!(
        text,
        "\nstatic at_memory memory_of({name}_state *state)\n{{\n    at_memory m;\n    m.i = state->i;\n    m.r = state->r;\n    return m;\n}}\n\n\
         void {name}_init({name}_state *state)\n{{\n    at_init(&plan, memory_of(state));\n}}\n\n\
         int {name}_step({name}_state *state, int64_t t_ns, const double in[], double out[])\n{{\n    return (int)at_tick(&plan, memory_of(state), t_ns, in, out);\n}}\n\n\
         void {name}_segment({name}_state *state)\n{{\n    at_segment(&plan, memory_of(state));\n}}\n\n\
         size_t {name}_save(const {name}_state *state, uint8_t bytes[], size_t room)\n{{\n    return at_save(&plan, state->i, state->r, bytes, room);\n}}\n\n\
         int {name}_load({name}_state *state, const uint8_t bytes[], size_t length)\n{{\n    return at_load(&plan, memory_of(state), bytes, length);\n}}\n\n"
    );
    self_test(form, ticks, &mut text);
    text
}

fn self_test(form: &Form, ticks: &Ticks, text: &mut String) {
    let (name, upper) = (&form.name, form.name.to_uppercase());
    text.push_str("/* The self test: instants, samples, the bits of what the engine gave, and the largest size of each output. */\n");
    let _ = writeln!(text, "static const int64_t test_times[{upper}_TICKS] = {{");
    for time in &ticks.times {
        let _ = writeln!(text, "    INT64_C({time}),");
    }
    let _ = writeln!(
        text,
        "}};\n\nstatic const double test_in[{upper}_TICKS][{upper}_INPUTS] = {{"
    );
    for row in &ticks.inputs {
        let row: Vec<String> = row.iter().map(|&value| tables::hex(value)).collect();
        let _ = writeln!(text, "    {{ {} }},", row.join(", "));
    }
    let _ = writeln!(
        text,
        "}};\n\nstatic const uint64_t test_out[{upper}_TICKS][{upper}_OUTPUTS] = {{"
    );
    for row in &ticks.outputs {
        let row: Vec<String> = row
            .iter()
            .map(|&value| format!("UINT64_C({:#x})", bits(value)))
            .collect();
        let _ = writeln!(text, "    {{ {} }},", row.join(", "));
    }
    let largest: Vec<String> = (0..form.outputs.len())
        .map(|nth| tables::hex(ticks.size(nth)))
        .collect();
    let _ = write!(
        text,
        "}};\n\nstatic const double test_size[{upper}_OUTPUTS] = {{ {} }};\n\n",
        largest.join(", ")
    );
    let body = include_str!("self_test.c.in");
    let body = body.replace("@name@", name).replace("@NAME@", &upper);
    text.push_str(&body);
}

/// The bits of a number, all of what is absent the same.
#[must_use]
pub fn bits(value: f64) -> u64 {
    if value.is_nan() {
        0x7ff8_0000_0000_0000
    } else {
        value.to_bits()
    }
}
