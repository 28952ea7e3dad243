//! The command: which graph is exported, how often samples come, and what it takes.

use std::path::{Path, PathBuf};

use athermal_command::{Answer, Command, Failure, Format, Group, Terminal, println};
use athermal_core::compile::Rates;
use athermal_core::engine::Engine;
use athermal_core::time::Duration;
use athermal_run::model::Model;
use clap::{Args, ValueEnum};
use serde_json::{Map, Value, json};

use crate::{ExportError, Exported, Form, Options, c, export_c, fmu, lower, onnx, st, state};

/// What a graph is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Target {
    /// C99 with a runtime, a self test and recipes
    C,
    /// A functional mock-up unit for co-simulation (FMI 3.0), with its sources
    Fmu,
    /// ONNX, of the linear parts alone
    Onnx,
    /// Structured Text (IEC 61131-3) with a runtime and a self test
    St,
}

/// Write a fitted graph for a controller
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal export c model.json --dry-run
  athermal export c model.json -o c
  athermal export c model.json -o c --rate 1s --rate position=10s --frozen
  athermal export c model.json -o c --fast
  athermal export fmu model.json -o fmu
  athermal export onnx model.json -o onnx
  athermal export st model.json -o st")]
pub(crate) struct Export {
    /// As what
    target: Target,
    /// A fitted model
    model: PathBuf,
    /// The folder that is written
    #[arg(long, short, value_name = "DIR", required_unless_present = "dry_run")]
    output: Option<PathBuf>,
    /// Write nothing: report all that stands in the way, or what it would take
    #[arg(long)]
    dry_run: bool,
    /// The time between two samples, of all signals or of one: 1s, position=10s. By default as in the data of the fit
    #[arg(long, value_name = "[SIGNAL=]TIME")]
    rate: Vec<String>,
    /// The name of files and functions; that of the graph by default
    #[arg(long)]
    name: Option<String>,
    /// Export what goes on learning as it was fitted
    #[arg(long)]
    frozen: bool,
    /// Keep sums of slopes from tick to tick: a tick takes less time, and the state more room
    #[arg(long)]
    fast: bool,
    /// Build in single precision, and measure its error where there is a C compiler
    #[arg(long)]
    float: bool,
    /// The state of a run (`athermal run --state`) to go on from: written as DIR/NAME.state
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,
    /// What NAME_save wrote, as a state for `athermal run --state`: written as DIR/run.state
    #[arg(long, value_name = "FILE")]
    state_back: Option<PathBuf>,
}

athermal_command::register_command!(Export, "export");

impl Command for Export {
    const GROUP: Group = Group::Make;
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        self.for_target()?;
        let model = Model::load(&self.model)?;
        let mut engine = model.engine()?;
        let options = Options {
            rates: self.rates(terminal, &model)?,
            frozen: self.frozen,
            fast: self.fast,
            name: self.name.clone(),
        };
        if self.dry_run {
            let form = self.lowered(&engine, &options)?;
            self.foresee(terminal, &form);
            return Ok(Answer::Fine);
        }
        if self.target == Target::Onnx {
            return self.onnx(&engine, &options);
        }
        if self.target == Target::St {
            return self.st(&engine, &options);
        }
        let exported = export_c(&engine, &options, self.float).map_err(failure)?;
        if self.target == Target::Fmu {
            return self.fmu(terminal, &exported);
        }
        c::write(&exported.files, self.folder()).map_err(failure)?;
        self.carry(&mut engine, &exported)?;
        self.report(terminal, &exported);
        Ok(Answer::Fine)
    }
}

fn failure(error: ExportError) -> Failure {
    match error {
        ExportError::Write { .. } | ExportError::Compiler { .. } => {
            Failure::Outside(error.to_string())
        }
        _ => Failure::Request(error.to_string()),
    }
}

/// For which samples there is room: `a sample of each signal every 10s`, or by signal.
fn rates_of(form: &Form) -> String {
    let rates = form.rates();
    let each = |ns: i64| Duration::from_ns(ns).to_string();
    match rates.values().next() {
        Some(&first) if rates.values().all(|&rate| rate == first) => {
            format!("a sample each {}", each(first))
        }
        _ => {
            let all = rates
                .iter()
                .map(|(of, &rate)| format!("{of} each {}", each(rate)));
            format!("samples of {}", all.collect::<Vec<_>>().join(", "))
        }
    }
}

impl Export {
    /// How often samples come: as it is given, else as in the data of the fit.
    fn rates(&self, terminal: &Terminal, model: &Model) -> Result<Rates, Failure> {
        let (rates, is_guessed) =
            (model.rates(&self.rate)).map_err(|error| Failure::Request(error.to_string()))?;
        if is_guessed {
            terminal.note(
                "the model does not say how often samples come: room is made for one a second, where `--rate` says nothing else",
            );
        }
        Ok(rates)
    }

    /// The graph, lowered; ONNX has no place for what goes on learning.
    fn lowered(&self, engine: &Engine, options: &Options) -> Result<Form, Failure> {
        let form = lower(engine, options).map_err(failure)?;
        let mut nodes = form.nodes.iter();
        match nodes.find(|of| self.target == Target::Onnx && of.struct_of("learner").is_some()) {
            None => Ok(form),
            Some(of) => Err(Failure::Request(format!(
                "`{}`: it goes on learning while it runs, which ONNX has no place for; `--frozen` exports it as it was fitted",
                of.node
            ))),
        }
    }

    fn folder(&self) -> &Path {
        self.output.as_deref().unwrap_or(Path::new("."))
    }

    /// What it takes, before anything is written.
    fn foresee(&self, terminal: &Terminal, form: &Form) {
        if terminal.format == Format::Json {
            println!("{:#}", self.facts(form));
            return;
        }
        let (inputs, outputs) = (form.sources.len(), form.outputs.len());
        println!(
            "{}: {inputs} inputs and {outputs} outputs, nothing is written",
            form.name
        );
        if self.target == Target::Onnx {
            let count = onnx::estimators(form).count();
            println!("{count} linear estimators, whose rows the caller makes");
            return;
        }
        let (state, rates) = (self.state_bytes(form), rates_of(form));
        println!("state: {state} bytes{} with {rates}", self.kept(form));
        println!("a tick: about {} operations at worst", c::operations(form));
        if self.target != Target::St {
            let c::Flash {
                runtime,
                tables,
                self_test,
            } = c::flash(form);
            println!(
                "flash: about {} bytes on a Cortex-M4: {runtime} of the runtime, {tables} of tables, {self_test} of the self test",
                runtime + tables + self_test
            );
        }
    }

    /// What of the state `--fast` takes.
    fn kept(&self, form: &Form) -> String {
        match form.layout.kept * if self.float { 4 } else { 8 } {
            0 => String::new(),
            kept => format!(", {kept} of them sums that are kept,"),
        }
    }

    fn state_bytes(&self, form: &Form) -> usize {
        match self.target {
            Target::St => st::state_bytes(form),
            _ => form.layout.bytes(if self.float { 4 } else { 8 }),
        }
    }

    /// What programs read of it.
    fn facts(&self, form: &Form) -> Value {
        let c::Flash {
            runtime,
            tables,
            self_test,
        } = c::flash(form);
        let seconds = |(signal, ns): (&str, i64)| (signal.to_owned(), json!(ns as f64 / 1e9));
        let rates: Map<String, Value> = form.rates().into_iter().map(seconds).collect();
        json!({
            "name": form.name,
            "revision": form.revision,
            "inputs": form.sources.len(),
            "outputs": form.outputs.len(),
            "state_bytes": self.state_bytes(form),
            "kept_bytes": form.layout.kept * if self.float { 4 } else { 8 },
            "flash_bytes": (self.target != Target::St)
                .then(|| json!({ "runtime": runtime, "tables": tables, "self_test": self_test })),
            "operations": c::operations(form),
            "rates": rates,
        })
    }

    /// Refuses what only C has a place for.
    fn for_target(&self) -> Result<(), Failure> {
        let given = [
            ("--state", self.state.is_some()),
            ("--state-back", self.state_back.is_some()),
            ("--float", self.float),
            ("--fast", self.fast && self.target != Target::Fmu),
        ];
        let refused = given.iter().find(|(_, is_given)| *is_given);
        match (self.target, refused) {
            (Target::C, _) | (_, None) => Ok(()),
            (target, Some((option, _))) => Err(Failure::Request(format!(
                "`{option}` is for `export c`, and {} have no place for it: leave it out, or export to C",
                match target {
                    Target::Onnx => "ONNX models",
                    Target::St => "programs in Structured Text",
                    _ => "units for co-simulation",
                }
            ))),
        }
    }

    /// Writes Structured Text.
    fn st(&self, engine: &Engine, options: &Options) -> Result<Answer, Failure> {
        let mut exported = st::export(engine, options).map_err(failure)?;
        exported.files.push(st::plcopen(&exported));
        c::write(&exported.files, self.folder()).map_err(failure)?;
        let form = &exported.form;
        println!(
            "wrote {}: {} with {} inputs and {} outputs, {} bytes of state with {}",
            self.folder().display(),
            st::block(form),
            form.sources.len(),
            form.outputs.len(),
            self.state_bytes(form),
            rates_of(form),
        );
        Ok(Answer::Fine)
    }

    /// Writes the linear parts.
    fn onnx(&self, engine: &Engine, options: &Options) -> Result<Answer, Failure> {
        let form = self.lowered(engine, options)?;
        let path = format!("{}.onnx", form.name);
        let count = onnx::estimators(&form).count();
        let bytes = onnx::model(&form);
        c::write_bytes(self.folder(), &path, &bytes).map_err(failure)?;
        println!(
            "wrote {}: {count} linear estimators, whose rows the caller makes",
            self.folder().join(path).display()
        );
        Ok(Answer::Fine)
    }

    /// Writes a unit for co-simulation.
    fn fmu(&self, terminal: &Terminal, exported: &Exported) -> Result<Answer, Failure> {
        let form = &exported.form;
        let path = self.folder().join(format!("{}.fmu", form.name));
        let binary = fmu::write(exported, &path, "cc").map_err(failure)?;
        let (inputs, outputs) = (form.sources.len(), form.outputs.len());
        let with = match binary {
            fmu::Binary::Built(platform) => format!("its sources and a binary for {platform}"),
            fmu::Binary::Without(why) => {
                terminal.note(format!(
                    "{why}: the unit has its sources alone, which a simulator can build"
                ));
                "its sources".to_owned()
            }
        };
        println!(
            "wrote {}: {inputs} inputs and {outputs} outputs, with {with} and room for {}",
            path.display(),
            rates_of(form)
        );
        Ok(Answer::Fine)
    }

    /// Writes states that go over between the engine and C.
    fn carry(&self, engine: &mut Engine, exported: &Exported) -> Result<(), Failure> {
        let request = |path: &Path, error: &dyn std::fmt::Display| {
            Failure::Request(format!("{}: {error}", path.display()))
        };
        let read = |path: &Path| {
            std::fs::read(path)
                .map_err(|error| Failure::Outside(format!("{}: {error}", path.display())))
        };
        let write = |name: &str, bytes: &[u8]| {
            let path = self.folder().join(name);
            std::fs::write(&path, bytes)
                .map_err(|error| Failure::Outside(format!("{}: {error}", path.display())))
        };
        if let Some(path) = &self.state_back {
            state::from_c(engine, &exported.form, &read(path)?)
                .map_err(|error| request(path, &error))?;
            write("run.state", &engine.snapshot())?;
        }
        if let Some(path) = &self.state {
            engine
                .restore(&read(path)?)
                .map_err(|error| request(path, &error))?;
            let bytes =
                state::to_c(engine, &exported.form).map_err(|error| request(path, &error))?;
            write(&format!("{}.state", exported.form.name), &bytes)?;
        }
        Ok(())
    }

    fn report(&self, terminal: &Terminal, exported: &Exported) {
        let form = &exported.form;
        let operations = c::operations(form);
        let single_precision = self
            .float
            .then(|| c::single_precision_error("cc", self.folder(), form));
        if terminal.format == Format::Json {
            let mut facts = self.facts(form);
            facts["single_precision_error"] =
                json!(single_precision.as_ref().and_then(|of| of.as_ref().ok()));
            facts["single_precision_problem"] = json!(
                single_precision
                    .as_ref()
                    .and_then(|of| Some(of.as_ref().err()?.to_string()))
            );
            println!("{facts:#}");
            return;
        }
        println!(
            "wrote {}: {} with {} inputs and {} outputs, {} bytes of state{} with {}, about {operations} operations a tick",
            self.folder().display(),
            form.name,
            form.sources.len(),
            form.outputs.len(),
            self.state_bytes(form),
            self.kept(form),
            rates_of(form),
        );
        match single_precision {
            Some(Ok(error)) => println!(
                "single precision is off by less than {error:e} of the largest size of an output, in {} ticks",
                crate::TICKS
            ),
            Some(Err(none @ c::SinglePrecisionError::NoCompiler(_))) => {
                terminal.note(none.to_string());
            }
            Some(Err(problem)) => terminal.warning(problem.to_string()),
            None => {}
        }
        terminal.note(format!("next: make -C {} test", self.folder().display()));
    }
}
