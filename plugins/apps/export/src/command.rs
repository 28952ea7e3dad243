//! The command: which graph is exported, how often samples come, and what it takes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use athermal_command::{Answer, Command, Failure, Format, Group, Terminal, println};
use athermal_core::engine::Engine;
use athermal_core::time::Duration;
use athermal_run::model::Model;
use clap::{Args, ValueEnum};

use crate::lower::Rates;
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
  athermal export c model.json -o c
  athermal export c model.json -o c --rate 1s --rate position=10s --frozen
  athermal export fmu model.json -o fmu
  athermal export onnx model.json -o onnx
  athermal export st model.json -o st")]
pub(crate) struct Export {
    /// As what
    target: Target,
    /// A fitted model
    model: PathBuf,
    /// The folder that is written
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// The time between two samples, of all signals or of one: 1s, position=10s. By default as in the data of the fit
    #[arg(long, value_name = "[SIGNAL=]TIME")]
    rate: Vec<String>,
    /// The name of files and functions; that of the graph by default
    #[arg(long)]
    name: Option<String>,
    /// Export what goes on learning as it was fitted
    #[arg(long)]
    frozen: bool,
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
            name: self.name.clone(),
        };
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
        c::write(&exported.files, &self.output).map_err(failure)?;
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
        let signals: BTreeSet<&str> = (model.plan.sources.iter())
            .filter_map(|source| source.name.split('.').next())
            .collect();
        let mut usual = model
            .card
            .as_ref()
            .map_or_else(BTreeMap::new, |card| card.rates.clone());
        usual.retain(|signal, _| signals.contains(&**signal));
        let of_data = Rates::of_data(&usual);
        let of_all = self.rate.iter().any(|rate| !rate.contains('='));
        if of_data.is_none() && !of_all {
            terminal.note(
                "the model does not say how often samples come: room is made for one a second, where `--rate` says nothing else",
            );
        }
        let mut rates = of_data.filter(|_| !of_all).unwrap_or_default();
        for rate in &self.rate {
            let (signal, time) = match rate.split_once('=') {
                Some((signal, time)) => (Some(signal), time),
                None => (None, &**rate),
            };
            let time: Duration = time
                .parse()
                .map_err(|error| Failure::Request(format!("--rate {rate}: {error}")))?;
            match signal {
                Some(signal) => drop(rates.signals.insert(signal.to_owned(), time)),
                None => rates.period = time,
            }
        }
        Ok(rates)
    }

    /// Refuses what only C has a place for.
    fn for_target(&self) -> Result<(), Failure> {
        let given = [
            ("--state", self.state.is_some()),
            ("--state-back", self.state_back.is_some()),
            ("--float", self.float),
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
        let exported = st::export(engine, options).map_err(failure)?;
        c::write(&exported.files, &self.output).map_err(failure)?;
        let form = &exported.form;
        println!(
            "wrote {}: {} with {} inputs and {} outputs, {} bytes of state with {}",
            self.output.display(),
            st::block(form),
            form.sources.len(),
            form.outputs.len(),
            st::state_bytes(form),
            rates_of(form),
        );
        Ok(Answer::Fine)
    }

    /// Writes the linear parts.
    fn onnx(&self, engine: &Engine, options: &Options) -> Result<Answer, Failure> {
        let form = lower(engine, options).map_err(failure)?;
        let path = format!("{}.onnx", form.name);
        let count = onnx::estimators(&form).count();
        let bytes = onnx::model(&form);
        c::write_bytes(&self.output, &path, &bytes).map_err(failure)?;
        println!(
            "wrote {}: {count} linear estimators, whose rows the caller makes",
            self.output.join(path).display()
        );
        Ok(Answer::Fine)
    }

    /// Writes a unit for co-simulation.
    fn fmu(&self, terminal: &Terminal, exported: &Exported) -> Result<Answer, Failure> {
        let form = &exported.form;
        let path = self.output.join(format!("{}.fmu", form.name));
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
            let path = self.output.join(name);
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
        let (double, single) = (form.layout.bytes(8), form.layout.bytes(4));
        let operations = c::operations(form);
        let single_precision = self
            .float
            .then(|| c::single_precision_error("cc", &self.output, form));
        if terminal.format == Format::Json {
            let facts = serde_json::json!({
                "name": form.name,
                "revision": form.revision,
                "state_bytes": if self.float { single } else { double },
                "operations": operations,
                "rates": form.rates().iter().map(|(signal, ns)| (*signal, *ns as f64 / 1e9)).collect::<BTreeMap<_, _>>(),
                "single_precision_error": single_precision.as_ref().and_then(|of| of.as_ref().ok()),
                "single_precision_problem":
                    single_precision.as_ref().and_then(|of| Some(of.as_ref().err()?.to_string())),
            });
            println!("{facts:#}");
            return;
        }
        println!(
            "wrote {}: {} with {} inputs and {} outputs, {} bytes of state with {}, about {operations} operations a tick",
            self.output.display(),
            form.name,
            form.sources.len(),
            form.outputs.len(),
            if self.float { single } else { double },
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
        terminal.note(format!("next: make -C {} test", self.output.display()));
    }
}
