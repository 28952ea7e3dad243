//! Graphs from text with fits that are made up, C compilers, and programs that step exported graphs. Decides nothing that is expected.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use athermal_core::compile::{Plan, Wanted, compile};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{self, Disk};
use athermal_core::engine::{Engine, Fitted};
use athermal_core::node::Predictor;
use athermal_core::prng::Prng;
use athermal_core::time::Instant;
use athermal_export::c::{bits, write};
use athermal_export::{Exported, Form};
use serde_json::json;

// A plugin that no code names is left out by the linker.
use athermal_combiners as _;
use athermal_control as _;
use athermal_estimators as _;
use athermal_features as _;
use athermal_simulation as _;

/// The folder of the project.
pub fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..")
}

/// A graph that has to be right.
pub fn plan(text: &str) -> Arc<Plan> {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let name = project().join("graphs/text.toml");
    let graph = document::load_text(name, text, &Disk, &mut sources, &mut diagnostics)
        .and_then(|read| document::declare(read, &mut diagnostics));
    let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
    Arc::new(plan.unwrap_or_else(|| {
        panic!("{}\n{text}", diagnostics.render(&sources, false, 200));
    }))
}

/// A fit for every estimator that needs one: some of its regressors, with coefficients of any size, and most with the edge of their rows.
pub fn made_up(plan: &Plan, random: &mut Prng) -> Fitted {
    let mut fitted = BTreeMap::new();
    for node in &plan.nodes {
        let Some(rows) = node.rows() else { continue };
        let names = rows.fit.regressors.iter().map(|of| of.name.clone());
        if node.kind.name == "cross_check" {
            let present = rows.fit.regressors.iter().filter(|of| of.lag.is_zero());
            let predictor = going_together(names.collect(), present.count(), random);
            fitted.insert(node.instance(), Arc::from(predictor));
            continue;
        }
        let mut used: Vec<String> = names.filter(|_| random.between(0.0, 1.0) < 0.8).collect();
        if used.is_empty() {
            let Some(first) = rows.fit.regressors.first() else {
                continue;
            };
            used.push(first.name.clone());
        }
        let mut all =
            |scale: f64| -> Vec<f64> { used.iter().map(|_| scale * random.normal()).collect() };
        let (coefficients, means) = (all(3.0), all(10.0));
        let scales: Vec<f64> = all(5.0).iter().map(|scale| scale.abs() + 0.1).collect();
        let directions = used.len().min(3);
        let parts: Vec<f64> = (0..directions).flat_map(|_| all(0.4)).collect();
        if node.kind.name == "rls" {
            let predictor = going_on(used, random);
            fitted.insert(node.instance(), Arc::from(predictor));
            continue;
        }
        let mut written = json!({
            "type": "linear",
            "regressors": used,
            "coefficients": coefficients,
            "intercept": random.normal(),
        });
        if random.between(0.0, 1.0) < 0.7 {
            written["novelty"] = json!({
                "edge": random.between(0.1, 0.9),
                "means": means,
                "scales": scales,
                "directions": parts,
            });
        }
        if random.between(0.0, 1.0) < 0.8 {
            let width = used.len();
            let mut parts = (0..width * (width + 1) / 2).map(|_| 0.05 * random.normal());
            written["variance"] = json!({
                "root": parts.by_ref().collect::<Vec<f64>>(),
                "centre": means,
                "rows": 70,
                "noise": random.between(0.0, 4.0).exp(),
            });
        }
        let predictor: Box<dyn Predictor> = serde_json::from_value(written).unwrap();
        assert!(predictor.mistakes().is_empty());
        fitted.insert(node.instance(), Arc::from(predictor));
    }
    fitted
}

/// What goes on learning, made up: with information and a range of any size.
fn going_on(uses: Vec<String>, random: &mut Prng) -> Box<dyn Predictor> {
    let width = uses.len();
    // One that predicts next to nothing may err less than what it learns.
    let size = if random.between(0.0, 1.0) < 0.3 {
        30.0
    } else {
        0.01
    };
    let mut all = |scale: f64, count: usize| -> Vec<f64> {
        (0..count).map(|_| scale * random.normal()).collect()
    };
    let (means, theta) = (all(10.0, width), all(size, width + 1));
    let scales: Vec<f64> = all(5.0, width).iter().map(|of| of.abs() + 0.1).collect();
    let directions = [all(0.3, width + 1), all(0.1, width + 1)];
    let information: Vec<f64> = (0..=width)
        .flat_map(|i| (0..=i).map(move |j| (i, j)))
        .map(|(i, j)| {
            let along = directions.iter().map(|of| of[i] * of[j]).sum::<f64>();
            60.0 * along + if i == j { 20.0 } else { 0.0 }
        })
        .collect();
    let parts = all(0.4, 2 * width);
    let (wide, noise) = (random.between(2.0, 60.0), random.between(1.0, 6.0).exp());
    let end = |by: f64| -> Vec<f64> {
        let ends = means.iter().zip(&scales);
        ends.map(|(mean, scale)| mean + by * scale).collect()
    };
    let written = json!({
        "type": "online_linear",
        "coefficients": theta[..width],
        "intercept": theta[width],
        "frame": { "regressors": uses, "means": means, "scales": scales, "level": random.normal() },
        "recursion": { "rls": {
            "rls": {
                "memory_s": random.between(20.0, 2000.0),
                "share": 0.1,
                "coefficients": theta,
                "information": information,
                "rows": random.between(20.0, 200.0),
                "variance": noise * noise,
            },
            "little": random.between(0.0, 0.1),
        } },
        "range": { "lowest": end(-wide), "highest": end(wide) },
        "novelty": {
            "edge": random.between(0.1, 0.9),
            "means": means,
            "scales": scales,
            "directions": parts,
        },
    });
    let predictor: Box<dyn Predictor> = serde_json::from_value(written).unwrap();
    assert!(predictor.mistakes().is_empty());
    predictor
}

/// How so many sensors go together, now and a lag ago, made up; in some fits nothing was learned, or a channel had no value at first. What
/// is behind them is only predicted from.
fn going_together(mut uses: Vec<String>, count: usize, random: &mut Prng) -> Box<dyn Predictor> {
    let mut order = 2 * count;
    let predicts = uses.len() > order;
    if random.between(0.0, 1.0) < 0.3 {
        uses.remove(0);
        order -= 1;
    }
    let mut parts =
        |scale: f64| -> Vec<f64> { (0..order).map(|_| scale * random.normal()).collect() };
    let directions = [parts(0.5), parts(0.5), parts(0.1)];
    let means: Vec<f64> = parts(2.0).iter().map(|mean| 20.0 + mean).collect();
    let scales: Vec<f64> = parts(3.0).iter().map(|scale| scale.abs() + 1.0).collect();
    let lower = (0..order).flat_map(|i| (0..=i).map(move |j| (i, j)));
    let product = |(i, j): (usize, usize)| {
        let along = directions.iter().map(|of| of[i] * of[j]).sum::<f64>();
        along + if i == j { 0.01 } else { 0.0 }
    };
    let mut written = json!({ "type": "cross_check", "uses": uses });
    if predicts {
        let answer = |without: Option<usize>, random: &mut Prng| {
            let mut coefficients: Vec<f64> = uses.iter().map(|_| 30.0 * random.normal()).collect();
            if let Some(column) = without {
                coefficients[column] = 0.0;
            }
            let constant = random.normal();
            json!({ "without": without, "constant": constant, "coefficients": coefficients })
        };
        let each = std::iter::once(None).chain((0..count).map(Some));
        written["answers"] = each.map(|without| answer(without, random)).collect();
    }
    if random.between(0.0, 1.0) < 0.9 {
        written["agreement"] = json!({
            "means": means,
            "scales": scales,
            "matrix": lower.map(product).collect::<Vec<_>>(),
            "usual": random.between(-2.0, 2.0).exp(),
        });
    }
    let predictor: Box<dyn Predictor> = serde_json::from_value(written).unwrap();
    assert!(predictor.mistakes().is_empty());
    predictor
}

/// Something that happens to a running graph.
#[derive(Debug, Clone)]
pub enum Event {
    /// A tick with its samples.
    Tick(i64, Vec<f64>),
    /// A segment ends.
    Break,
}

/// What came out: the bits of each output of each tick.
pub fn stepped(engine: &mut Engine, events: &[Event]) -> Vec<Vec<u64>> {
    let mut all = Vec::new();
    for event in events {
        match event {
            Event::Break => engine.segment(),
            Event::Tick(time, samples) => {
                let out = engine.step(Instant::from_ns(*time), samples).unwrap();
                all.push(out.iter().map(|&value| bits(value)).collect());
            }
        }
    }
    all
}

/// A folder that is gone with the test.
pub struct Scratch(PathBuf);

impl Scratch {
    pub fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("athermal-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Whether something is installed, as a command that ends well shows; a test that needs it says that it was skipped, or fails where it
/// must not be.
pub fn installed(what: &str, shown_by: &mut Command) -> bool {
    let there = shown_by
        .output()
        .is_ok_and(|output| output.status.success());
    if !there {
        assert!(
            std::env::var("ATHERMAL_REQUIRE_SERVERS").as_deref() != Ok("1"),
            "{what} is not installed, and ATHERMAL_REQUIRE_SERVERS is set"
        );
        eprintln!("skipped: {what} is not installed");
    }
    there
}

/// Whether a program is there.
pub fn has(program: &str) -> bool {
    installed(
        &format!("`{program}`"),
        Command::new(program).arg("--version"),
    )
}

/// What an example says of its self test.
#[derive(Debug, PartialEq)]
pub struct SelfTest {
    /// The first tick that differs; 0 where none does.
    pub differs: u64,
    /// The hash over all outputs.
    pub hash: String,
    /// The largest error.
    pub millionths: u64,
}

impl SelfTest {
    pub fn of(said: &str) -> Self {
        let word = |after: &str| {
            let rest = said.split_once(after).unwrap_or_else(|| panic!("{said}")).1;
            rest.split([',', ' ']).next().unwrap()
        };
        Self {
            differs: word("self test ").parse().unwrap(),
            hash: word("hash ").to_owned(),
            millionths: word("error ").parse().unwrap(),
        }
    }
}

/// The C compilers that there are.
pub fn compilers() -> Vec<&'static str> {
    ["gcc", "clang"].into_iter().filter(|cc| has(cc)).collect()
}

pub const LEVELS: [&str; 4] = ["-O0", "-O1", "-O2", "-O3"];

/// Runs a program that has to end well; what it wrote.
pub fn ran(command: &mut Command) -> String {
    let output = command
        .output()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}\n{text}{complaint}");
    text
}

/// An exported graph in a folder, with a program that steps it over events.
pub struct Exhibit {
    pub folder: PathBuf,
    pub form: Form,
}

const WARNINGS: [&str; 7] = [
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wundef",
    "-Werror",
];

/// All of clang's, but for those that say no more than how a structure lies in memory, that numbers are compared, that a result is cast, and
/// that a variable is declared behind a statement, or not declared before.
const OF_CLANG: [&str; 7] = [
    "-Weverything",
    "-Wno-padded",
    "-Wno-float-equal",
    "-Wno-bad-function-cast",
    "-Wno-declaration-after-statement",
    "-Wno-unsafe-buffer-usage",
    "-Wno-unknown-warning-option",
];

impl Exhibit {
    pub fn new(exported: &Exported, folder: &Path) -> Self {
        write(&exported.files, folder).unwrap();
        let driver = include_str!("driver.c.in")
            .replace("@name@", &exported.form.name)
            .replace("@NAME@", &exported.form.name.to_uppercase());
        std::fs::write(folder.join("driver.c"), driver).unwrap();
        Self {
            folder: folder.to_owned(),
            form: exported.form.clone(),
        }
    }

    /// Builds a program of the graph from one more source.
    pub fn built(&self, compiler: &str, flags: &[&str], source: &str) -> PathBuf {
        let program = self.folder.join(format!(
            "{source}-{compiler}{}",
            flags.concat().replace('/', "_")
        ));
        ran(Command::new(compiler)
            .current_dir(&self.folder)
            .args(["-std=c99", "-ffp-contract=off"])
            .args(WARNINGS)
            .args(if compiler == "clang" {
                &OF_CLANG[..]
            } else {
                &[]
            })
            .args(flags)
            .arg("-I.")
            .args(["athermal_rt.c", &format!("{}.c", self.form.name), source])
            .arg("-lm")
            .arg("-o")
            .arg(&program));
        program
    }

    /// Steps the program over events: what came out, and what the steps said at all.
    pub fn stepped(&self, program: &Path, events: &[Event]) -> (Vec<Vec<u64>>, u64) {
        self.stepped_from(program, events, None, None)
    }

    /// The same from a saved state, and to one.
    pub fn stepped_from(
        &self,
        program: &Path,
        events: &[Event],
        begin: Option<&Path>,
        end: Option<&Path>,
    ) -> (Vec<Vec<u64>>, u64) {
        let mut bytes = Vec::new();
        for event in events {
            let (time, samples) = match event {
                Event::Break => (i64::MIN, vec![0.0; self.form.sources.len()]),
                Event::Tick(time, samples) => (*time, samples.clone()),
            };
            bytes.extend(time.to_le_bytes());
            samples
                .iter()
                .for_each(|sample| bytes.extend(sample.to_le_bytes()));
        }
        let (from, to) = (self.folder.join("events"), self.folder.join("outputs"));
        std::fs::write(&from, bytes).unwrap();
        let none = Path::new("-");
        let states = [begin.unwrap_or(none), end.unwrap_or(none)];
        let is_for_arm = program.to_string_lossy().contains("-arm-linux-");
        let mut command = match is_for_arm {
            true => Command::new("qemu-arm"),
            false => Command::new(program),
        };
        command.args(is_for_arm.then_some(program));
        ran(command.args([&from, &to]).args(states));
        let words = std::fs::read(&to).unwrap();
        let words: Vec<u64> = words
            .chunks_exact(8)
            .map(|word| u64::from_le_bytes(word.try_into().unwrap()))
            .collect();
        let rows = words.chunks_exact(1 + self.form.outputs.len());
        let said = rows.clone().fold(0, |said, row| said | row[0]);
        (rows.map(|row| row[1..].to_vec()).collect(), said)
    }
}

/// The first difference between what should have come out and what did.
pub fn difference(form: &Form, expected: &[Vec<u64>], found: &[Vec<u64>]) -> Option<String> {
    if expected.len() != found.len() {
        return Some(format!(
            "{} ticks instead of {}",
            found.len(),
            expected.len()
        ));
    }
    for (tick, (expected, found)) in expected.iter().zip(found).enumerate() {
        for (nth, (expected, found)) in expected.iter().zip(found).enumerate() {
            if expected != found {
                return Some(format!(
                    "tick {tick}, {}: {:?} instead of {:?}",
                    form.outputs[nth].name,
                    f64::from_bits(*found),
                    f64::from_bits(*expected)
                ));
            }
        }
    }
    None
}
