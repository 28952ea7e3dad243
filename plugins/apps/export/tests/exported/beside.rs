//! Beside m2cgen, which writes a linear model as one expression: bytes, instructions on emulated boards, errors, and bits. Holds the page's
//! figures of it.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use athermal_core::prng::Prng;
use athermal_export::Form;
use athermal_export::c::RUNTIME;

use crate::onnx::python;
use crate::processors::{fitted, page};
use crate::support::{Scratch, has, project, ran};

const ROWS: usize = 500;

/// What m2cgen makes of a linear model; it looks at the name of a class alone.
const SCRIPT: &str = r#"
import json, sys, m2cgen, numpy
class LinearRegression: pass
LinearRegression.__module__ = "sklearn.linear_model._base"
model, given = LinearRegression(), json.load(sys.stdin)
model.intercept_, model.coef_ = given[0], numpy.array(given[1:])
sys.stdout.write(m2cgen.export_to_c(model))
"#;

/// Steps both over the rows, counts instructions with the timer of the core where there is one, and prints the bits of both.
const HARNESS: &str = r#"
#include "athermal_rt.c"
#include "model.h"
#include <inttypes.h>
#include <stdio.h>
double score(double *input);
double ours(const double *row);
double ours(const double *row) { return at_form(constant, coefficients, row, WIDTH); }
#ifdef COUNTED
static volatile uint32_t *const timer = (volatile uint32_t *)0xE000E010u;
static unsigned long counted(double (*of)(const double *))
{
    static volatile double to;
    uint32_t before;
    int nth;
    timer[1] = 0xffffffu;
    timer[2] = 0;
    timer[0] = 5;
    before = timer[2];
    for (nth = 0; nth < ROWS; nth++) {
        to = of(rows[nth]);
    }
    return (unsigned long)(40u * ((before - timer[2]) & 0xffffffu)) / ROWS;
}
static double nothing(const double *row) { return row[0]; }
static double theirs(const double *row) { return score((double *)row); }
#endif
int main(void)
{
#ifdef COUNTED
    const unsigned long none = counted(nothing);
    printf("%lu %lu\n", counted(theirs) - none, counted(ours) - none);
#else
    int nth;
    for (nth = 0; nth < ROWS; nth++) {
        printf("%" PRIu64 " %" PRIu64 "\n", at_bits(score(rows[nth])), at_bits(ours(rows[nth])));
    }
#endif
    return 0;
}
"#;

/// The estimator with most regressors, as it was fitted: its constant and coefficients.
fn model(form: &Form) -> (&str, f64, Vec<f64>) {
    let linear = form.nodes.iter().filter(|node| node.kind == "linear");
    let node = linear.max_by_key(|node| (node.place_of("width"), node.node.ends_with(".Z1")));
    let node = node.unwrap();
    let coefficients = node.reals_of("coefficients").to_vec();
    (&node.node, node.real_of("constant"), coefficients)
}

/// A sum of products to twice the digits (Ogita, Rump and Oishi 2005, Dot2), and of the magnitudes.
fn exact(constant: f64, b: &[f64], x: &[f64]) -> (f64, f64) {
    let (mut sum, mut rest, mut size) = (constant, 0.0, constant.abs());
    for (b, x) in b.iter().zip(x) {
        let product = b * x;
        let total = sum + product;
        let part = total - sum;
        rest += (sum - (total - part)) + (product - part) + b.mul_add(*x, -product);
        sum = total;
        size += product.abs();
    }
    (sum + rest, size)
}

fn bytes_of(object: &Path, symbol: Option<&str>) -> usize {
    let said = match symbol {
        Some(_) => ran(Command::new("arm-none-eabi-nm")
            .args(["-S", "--radix=d"])
            .arg(object)),
        None => ran(Command::new("arm-none-eabi-size").arg(object)),
    };
    let line = match symbol {
        Some(symbol) => said.lines().find(|line| line.ends_with(symbol)),
        None => said.lines().nth(1),
    };
    let nth = usize::from(symbol.is_some());
    line.unwrap()
        .split_whitespace()
        .nth(nth)
        .unwrap()
        .parse()
        .unwrap()
}

#[test]
fn figures_beside_m2cgen_are_those_of_a_fit_of_the_shipped_data() {
    let needed = ["gcc", "make", "arm-none-eabi-gcc", "qemu-system-arm"];
    if !needed.iter().all(|program| has(program)) {
        return;
    }
    let Some(python) = python("m2cgen, numpy") else {
        return;
    };
    let Some((_, [exported, _])) = fitted("die-tester-compensate.toml") else {
        return;
    };
    let (name, constant, b) = model(&exported.form);
    let scratch = Scratch::new("beside");
    let path = |name: &str| scratch.path(name);
    std::fs::create_dir_all(path("")).unwrap();
    let mut random = Prng::stream(1, "rows of gradients");
    // Gradients of a machine that warms up: some mK/min.
    let rows: Vec<Vec<f64>> = (0..ROWS)
        .map(|_| b.iter().map(|_| 5.0 * random.normal()).collect())
        .collect();
    let given = serde_json::to_string(&[&[constant], &b[..]].concat()).unwrap();
    std::fs::write(path("given"), given).unwrap();
    let mut writes = Command::new(python);
    writes
        .args(["-c", SCRIPT])
        .stdin(std::fs::File::open(path("given")).unwrap());
    std::fs::write(path("theirs.c"), ran(&mut writes)).unwrap();
    let list = |of: &[f64]| {
        of.iter()
            .map(|of| format!("{of:e}"))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let mut header = format!(
        "#define WIDTH {}\n#define ROWS {ROWS}\nstatic const double constant = {constant:e};\nstatic const double coefficients[WIDTH] = {{ {} }};\nstatic double rows[ROWS][WIDTH] = {{\n",
        b.len(),
        list(&b)
    );
    for row in &rows {
        let _ = writeln!(header, "{{ {} }},", list(row));
    }
    std::fs::write(path("model.h"), header + "};\n").unwrap();
    std::fs::write(path("harness.c"), HARNESS).unwrap();
    std::fs::write(path("athermal_rt.c"), RUNTIME).unwrap();
    std::fs::write(path("athermal_rt.h"), athermal_export::c::RUNTIME_HEADER).unwrap();
    let flags = ["-std=c99", "-ffp-contract=off", "-Os", "-DAT_USES=8u", "-I"];
    ran(Command::new("gcc")
        .args(flags)
        .arg(path(""))
        .args([path("harness.c"), path("theirs.c")])
        .args(["-lm", "-o"])
        .arg(path("host")));
    let said = ran(&mut Command::new(path("host")));
    let (mut others, mut errors) = (0, [0.0_f64; 2]);
    for (line, row) in said.lines().zip(&rows) {
        let bits: Vec<u64> = line.split(' ').map(|bits| bits.parse().unwrap()).collect();
        let of_engine = athermal_core::node::LinearForm {
            constant,
            coefficients: &b,
        }
        .at(row);
        assert_eq!(bits[1], of_engine.to_bits(), "here to the bit");
        others += usize::from(bits[0] != of_engine.to_bits());
        let (exact, size) = exact(constant, &b, row);
        for (error, bits) in errors.iter_mut().zip(bits) {
            *error = error.max((f64::from_bits(bits) - exact).abs() / size);
        }
    }
    let mut rows_of_page = Vec::new();
    rows_of_page.push(format!(
        "| rows with other bits than the engine | {others} of {ROWS} | none |"
    ));
    rows_of_page.push(format!(
        "| largest error, of the sum of magnitudes | {:.1e} | {:.1e} |",
        errors[0], errors[1]
    ));
    let boards = project().join("examples/cortex-m");
    for (cpu, board, of_cpu, named) in [
        (
            "m7",
            "mps2-an500",
            &["-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard"][..],
            "instructions of a prediction, Cortex-M7",
        ),
        (
            "m3",
            "mps2-an385",
            &["-mcpu=cortex-m3"],
            "the same, Cortex-M3",
        ),
    ] {
        let build = |source: &Path, more: &[&str], to: &Path| {
            let mut gcc = Command::new("arm-none-eabi-gcc");
            gcc.args(of_cpu)
                .arg("-mthumb")
                .args(flags)
                .arg(path(""))
                .args(more);
            ran(gcc.arg("-c").arg(source).arg("-o").arg(to));
        };
        let (own, other) = (
            path(&format!("{cpu}-own.o")),
            path(&format!("{cpu}-other.o")),
        );
        build(&path("harness.c"), &["-DCOUNTED"], &own);
        build(&path("theirs.c"), &[], &other);
        build(&boards.join("start.c"), &[], &path("start.o"));
        if cpu == "m7" {
            rows_of_page.push(format!(
                "| code and constants, Cortex-M7 `-Os` | {} B for each model | {} B for all models, {} B each |",
                bytes_of(&other, None),
                bytes_of(&own, Some("at_form")),
                8 * (b.len() + 1),
            ));
        }
        let elf = path(&format!("{cpu}.elf"));
        let mut link = Command::new("arm-none-eabi-gcc");
        link.args(of_cpu)
            .args(["-mthumb", "--specs=rdimon.specs", "-nostartfiles", "-T"]);
        link.arg(boards.join("mps2.ld"))
            .args([&own, &other, &path("start.o")]);
        ran(link.args(["-lm", "-o"]).arg(&elf));
        let said = ran(Command::new("qemu-system-arm")
            .args([
                "-M",
                board,
                "-icount",
                "shift=0",
                "-nographic",
                "-monitor",
                "none",
                "-serial",
                "none",
            ])
            .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
            .arg(&elf));
        let (theirs, ours) = said.trim().split_once(' ').unwrap();
        rows_of_page.push(format!("| {named} | {theirs} | {ours} |"));
    }
    let page = page("export-c.md");
    let is_there = |row: &&String| {
        let label = row.split_inclusive('|').take(2).collect::<String>();
        let found = page.lines().find(|line| line.contains(&label));
        let (own, of_page) = (numbers(row), numbers(found.unwrap_or_default()));
        let near = |(own, of_page): (&f64, &f64)| (own / of_page - 1.0).abs() < 0.1;
        own.len() == of_page.len() && own.iter().zip(&of_page).all(near)
    };
    let lacks: Vec<&String> = rows_of_page.iter().filter(|row| !is_there(row)).collect();
    assert!(lacks.is_empty(), "the page lacks\n{lacks:#?}");
    let model = format!(
        "`{name}` of `die-tester-compensate` with {} regressors",
        b.len()
    );
    assert!(page.contains(&model), "{model}");
}

#[test]
fn the_whole_runtime_takes_the_bytes_of_the_page() {
    if !has("arm-none-eabi-gcc") {
        return;
    }
    let scratch = Scratch::new("whole");
    let object = scratch.path("athermal_rt.o");
    let bytes = CPUS.map(|flags| {
        let mut gcc = Command::new("arm-none-eabi-gcc");
        gcc.args(flags)
            .args(["-mthumb", "-std=c99", "-ffp-contract=off", "-Os", "-c"]);
        ran(gcc
            .arg(project().join("plugins/apps/export/c/athermal_rt.c"))
            .arg("-o")
            .arg(&object));
        bytes_of(&object, None) as f64
    });
    let page = page("export-c.md").replace('\n', " ");
    let (_, of_page) = page.split_once("All of it takes ").unwrap();
    let of_page: Vec<f64> = numbers(of_page).into_iter().take(3).collect();
    println!("all of the runtime: {bytes:?}");
    assert!(
        bytes
            .iter()
            .zip(&of_page)
            .all(|(own, of_page)| (own / of_page - 1.0).abs() < 0.02),
        "{bytes:?} {of_page:?}"
    );
}

/// Flags of processors, in the order of the page.
const CPUS: [&[&str]; 3] = [
    &["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"],
    &["-mcpu=cortex-m3"],
    &["-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard"],
];

/// The numbers among the words of a row.
fn numbers(row: &str) -> Vec<f64> {
    let words = row.split_whitespace().map(|word| word.replace(',', ""));
    words.filter_map(|word| word.parse().ok()).collect()
}
