//! `athermal simulate`: the recording of a simulated machine, as a file.

use athermal_core::watch::{Progress, Watch};
use schemars::JsonSchema;
use serde::Deserialize;
use std::fs::File;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::{Path, PathBuf};

use athermal::core::compile::Wanted;
use athermal::core::document::{NO_FILE, lasts};
use athermal::core::registry::{all, find};
use athermal::diagnosis::text::grouped;
use athermal::files::{Flush, Format as FileFormat, Writer};
use athermal::trial::fault::FaultSpec;
use athermal::trial::machine::{
    ClosedLoop, Individual, KnownMachine, Machine, Row, Schedule, Setup, Simulated, Simulation,
    Spread, facts,
};
use athermal_simulation::{Disturbance, disturbed, table_columns, write_set_points, write_table};
use clap::Args;
use serde_json::{Value, json};

use super::aside::{check_apart, not_written, write_aside, written_aside};
use super::asked::{all_by_text, by_text};
use super::data;
use super::model::load_fitted;
use super::numbers;
use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_analysis::figures::counted;

/// Write the recording of a simulated machine, or list the machines
///
/// The same machine, days, seed, schedule and faults give the same bytes everywhere. A schedule is a CSV file such as
/// `time_h,chuck_degC` with rows `0,20`, `4,50` and, to start again, `8,repeat`.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[command(after_help = "Examples:
  athermal simulate
  athermal simulate die-tester -o train.csv
  athermal simulate die-tester -o test.csv --days 2 --seed 2 --truth
  athermal simulate linear-axis -o - --days 0.1 | head
  athermal simulate die-tester -o machine7.csv --spread 30% --machine-seed 7
  athermal simulate die-tester -o faulty.csv \\
      --fault temperature.plate1=stuck,from=6h,for=12h \\
      --fault \"temperature.room=drift,size=0.5 K/h\"

Faults: missing, stuck, offset, spike, drift, noise; `from`, `for` and `size` may be left out.")]
pub struct Simulate {
    /// The machine; all are listed when none is named
    machine: Option<String>,
    /// CSV, JSON lines or what else is written, by its ending, CSV without one; `-` is standard output, as CSV
    #[arg(long, short, value_name = "FILE", requires = "machine", value_parser = crate::meant::written())]
    #[serde(skip)]
    output: Option<PathBuf>,
    /// Length of the recording in days
    #[arg(
        long,
        default_value_t = a_week(),
        allow_negative_numbers = true,
        requires = "machine",
        value_parser = numbers::read::<f64>("a number of days, such as 0.5")
    )]
    #[serde(default = "a_week")]
    days: f64,
    /// Another seed is another week of weather, motions and noise
    #[arg(
        long,
        default_value_t = first(),
        allow_negative_numbers = true,
        requires = "machine",
        value_parser = numbers::read::<u64>("a whole number, 0 or more and below 2^64")
    )]
    #[serde(default = "first")]
    seed: u64,
    /// One machine of a fleet: its parameters lie around those of the design, by so much
    ///
    /// Expansion, conductivity and heat capacity of each body, its skin, joints and views, the time constant of the chuck, the power of
    /// motors and creep are each multiplied with exp(SPREAD n), `n` standard normal: a log-normal distribution. Sensors of temperature
    /// have offsets of SPREAD times 0.5 K. Measures are those of the drawing. 0% is the design.
    #[arg(long, default_value = "0%", requires = "machine")]
    #[serde(default = "of_design", deserialize_with = "by_text")]
    #[schemars(with = "String")]
    spread: Spread,
    /// Which machine of the fleet it is; weather, motions and noise follow `--seed`
    #[arg(
        long,
        default_value_t = first(),
        allow_negative_numbers = true,
        requires = "spread",
        value_parser = numbers::read::<u64>("a whole number, 0 or more and below 2^64")
    )]
    #[serde(default = "first")]
    machine_seed: u64,
    /// Add the true drift of each axis as a column
    #[arg(long, requires = "machine")]
    #[serde(default)]
    truth: bool,
    /// Set points over time; the machine has a schedule of its own
    #[arg(long, value_name = "FILE", requires = "machine")]
    #[serde(default)]
    schedule: Option<PathBuf>,
    /// Write what the schedule plans too: a row half an hour before each set point applies
    #[arg(long, value_name = "FILE", requires = "output")]
    #[serde(skip)]
    set_points: Option<PathBuf>,
    /// Let a fitted graph correct the axes; what they applied is recorded as {axis}_applied_nm
    #[arg(long, value_name = "MODEL", requires = "machine")]
    #[serde(default)]
    compensate: Option<PathBuf>,
    /// A fault of a sensor, or of each of a signal: CHANNEL=KIND[,from=…][,for=…][,size=…]
    #[arg(long = "fault", value_name = "SPEC", requires = "machine")]
    #[serde(default, rename = "fault", deserialize_with = "all_by_text")]
    #[schemars(with = "Vec<String>")]
    faults: Vec<FaultSpec>,
    /// The world changes: `door,from=8h,for=3h,size=3`, `lamp,size=0.6 mK/s` or `loose=SENSOR,size=0.5`
    ///
    /// While a door stands open, the air couples to all bodies so many times as strongly. A lamp heats all of a stage. A loose sensor reads
    /// so much of the room instead of its body.
    #[arg(long = "disturb", value_name = "SPEC", requires = "machine")]
    #[serde(default, rename = "disturb", deserialize_with = "all_by_text")]
    #[schemars(with = "Vec<String>")]
    disturbances: Vec<Disturbance>,
}

fn a_week() -> f64 {
    7.0
}

fn first() -> u64 {
    1
}

fn of_design() -> Spread {
    Spread::default()
}

impl Simulate {
    /// Simulates and writes.
    ///
    /// # Errors
    /// When there is no such machine, the schedule or a fault does not fit it, or the file cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let Some(name) = &self.machine else {
            list(terminal);
            return Ok(Answer::Fine);
        };
        let known = find::<KnownMachine>(name)
            .map_err(|error| refused(format!("{error} (`athermal simulate` lists them all)")))?;
        if self.output.is_none() && io::stdout().is_terminal() {
            return Err(Failure::Request(format!(
                "a recording is long; name a file for it: athermal simulate {name} -o {name}.csv"
            )));
        }
        let output = self.output.as_deref().unwrap_or(Path::new("-"));
        data::check_ending(output)?;
        let read = || self.compensate.iter().chain(&self.schedule);
        check_apart("--output", output, read().map(|path| &**path))?;
        if let Some(path) = &self.set_points {
            let others = read().map(|path| &**path).chain([output]);
            check_apart("--set-points", path, others)?;
            if path.extension().is_some() && FileFormat::from_path(path) != Some(FileFormat::Csv) {
                return Err(Failure::Request(format!(
                    "--set-points {}: what is planned is written as CSV; name a file that ends on `.csv`",
                    path.display()
                )));
            }
            let plan = write_set_points(known.machine, &self.setup(known.machine)?);
            write_aside(path, plan)?;
        }
        let rows = self.write(known.machine, output, terminal)?;
        if output.as_os_str() == "-" {
            return Ok(Answer::Fine);
        }
        if terminal.format == Format::Json {
            let facts = json!({
                "output": output,
                "rows": rows,
                "machine": name,
                "days": self.days,
                "seed": self.seed,
                "spread": self.spread.share(),
                "machine_seed": self.machine_seed,
            });
            println!("{facts:#}");
        } else {
            let (rows, days) = (counted(rows, "row"), counted(self.days, "day"));
            let (file, seed) = (output.display(), self.seed);
            let one = if self.spread.share() > 0.0 {
                format!(", machine {} of spread {}", self.machine_seed, self.spread)
            } else {
                String::new()
            };
            terminal.note(format_args!(
                "wrote {file}: {rows}, {days} of `{name}`{one}, seed {seed}"
            ));
        }
        Ok(Answer::Fine)
    }

    fn write(
        &self,
        machine: &dyn Machine,
        output: &Path,
        host: &dyn Watch,
    ) -> Result<u64, Failure> {
        let disturbed = disturbed(machine.name(), &self.disturbances).map_err(refused)?;
        let machine = disturbed.as_deref().unwrap_or(machine);
        let recording = self.recording(machine)?;
        written_aside(output, |output| match &self.compensate {
            None => write_recording(&recording, machine, self.truth, output, host),
            Some(model) => self.write_corrected(model, &recording, machine, output, host),
        })
    }

    fn recording<'a>(&self, machine: &'a dyn Machine) -> Result<Simulated<'a>, Failure> {
        let setup = self.setup(machine)?;
        Ok(Simulated::new(machine, setup).with_faults(self.faults.clone()))
    }

    /// Simulates a machine by its own: each row with its time in ns goes to `put`. Gives the names of the columns behind the time.
    ///
    /// # Errors
    /// When there is no such machine, or the schedule or a fault does not fit it.
    pub fn rows(
        &self,
        host: &dyn Watch,
        put: &mut dyn FnMut(i64, &[f64]),
    ) -> Result<Vec<String>, Failure> {
        let name = self.machine.as_deref().unwrap_or_default();
        let machine = find::<KnownMachine>(name).map_err(refused)?.machine;
        let disturbed = disturbed(machine.name(), &self.disturbances).map_err(refused)?;
        let machine = disturbed.as_deref().unwrap_or(machine);
        let mut simulation = Watched::start(&self.recording(machine)?, host)?;
        let channels = machine.channels();
        let (mut row, mut values) = (Row::empty(channels), Vec::new());
        while simulation.next(&mut row) {
            values.clear();
            take(&row, self.truth, &mut values);
            put(row.time_ns, &values);
        }
        Ok(table_columns(channels, self.truth))
    }

    /// Writes a recording of the machine under the correction of a graph.
    fn write_corrected(
        &self,
        model: &Path,
        recording: &Simulated,
        machine: &dyn Machine,
        output: &Path,
        host: &dyn Watch,
    ) -> Result<u64, Failure> {
        let engine = load_fitted(model, Wanted::default(), host)?.engine()?;
        let simulation = Box::new(Watched::start(recording, host)?);
        let setup = recording.setup();
        let mut simulation =
            ClosedLoop::new(machine, setup, simulation, engine).map_err(refused)?;
        let channels = machine.channels();
        let axes = channels.iter().filter(|channel| channel.is_axis());
        let mut columns = table_columns(channels, self.truth);
        columns.extend(axes.map(|axis| format!("{}_applied_nm", axis.name)));
        let mut row = Row::empty(channels);
        write_rows(output, &columns, |values| {
            let more = simulation.next(&mut row);
            take(&row, self.truth, values);
            values.extend_from_slice(simulation.applied());
            more.then_some(row.time_ns)
        })
    }

    fn setup(&self, machine: &dyn Machine) -> Result<Setup, Failure> {
        Ok(Setup {
            days: self.days,
            seed: self.seed,
            schedule: self.schedule(machine)?,
            individual: Individual {
                spread: self.spread,
                seed: self.machine_seed,
            },
        })
    }

    fn schedule(&self, machine: &dyn Machine) -> Result<Option<Schedule>, Failure> {
        let Some(path) = &self.schedule else {
            return Ok(None);
        };
        // What a shell has opened for this command, as `<(…)`, comes to an end.
        let is_open = path.starts_with("/dev/fd");
        if !(is_open || lasts(path)) {
            let message = format!("--schedule {}: {NO_FILE}", path.display());
            return Err(Failure::Request(message));
        }
        let text = std::fs::read_to_string(path).map_err(|error| {
            Failure::Outside(format!("cannot read {}: {error}", path.display()))
        })?;
        let schedule = Schedule::parse(&text, machine.set_points());
        schedule.map(Some).map_err(|errors| {
            let lines = errors
                .iter()
                .map(|error| format!("{}: {error}", path.display()));
            Failure::Request(lines.collect::<Vec<_>>().join("\n  "))
        })
    }
}

/// Writes a simulated recording to a file or standard output, and gives the number of rows.
///
/// # Errors
/// When the simulation cannot start or the file cannot be written.
pub fn write_recording(
    recording: &Simulated,
    machine: &dyn Machine,
    truth: bool,
    output: &Path,
    host: &dyn Watch,
) -> Result<u64, Failure> {
    let mut simulation = Watched::start(recording, host)?;
    let channels = machine.channels();
    let format = FileFormat::from_path(output);
    if matches!(format, Some(FileFormat::JsonLines | FileFormat::Typed)) {
        let mut row = Row::empty(channels);
        return write_rows(output, &table_columns(channels, truth), |values| {
            let more = simulation.next(&mut row);
            take(&row, truth, values);
            more.then_some(row.time_ns)
        });
    }
    let failed = |error: io::Error| {
        if error.kind() == io::ErrorKind::BrokenPipe {
            // Whoever read our output has seen enough.
            return Failure::Exit(0);
        }
        Failure::Outside(not_written(output, &error))
    };
    let out: Box<dyn Write> = if output.as_os_str() == "-" {
        Box::new(io::stdout().lock())
    } else {
        Box::new(File::create(output).map_err(failed)?)
    };
    let mut out = BufWriter::with_capacity(1 << 16, out);
    let rows = write_table(channels, &mut simulation, truth, &mut out).map_err(failed)?;
    out.flush().map_err(failed)?;
    Ok(rows)
}

/// Writes rows for as long as there is one, by its time in ns and its values, and gives their number.
fn write_rows(
    output: &Path,
    columns: &[String],
    mut next: impl FnMut(&mut Vec<f64>) -> Option<i64>,
) -> Result<u64, Failure> {
    let mut writer = Writer::create(output, "time_s", columns, Flush::Buffered)?;
    let (mut values, mut rows) = (Vec::new(), 0);
    while let Some(time_ns) = next(&mut values) {
        writer.write_row("", time_ns, &values)?;
        values.clear();
        rows += 1;
    }
    writer.finish()?;
    Ok(rows)
}

fn take(row: &Row, truth: bool, values: &mut Vec<f64>) {
    values.extend_from_slice(&row.values);
    values.extend(row.true_drift.iter().filter(|_| truth));
}

fn refused(error: impl ToString) -> Failure {
    Failure::Request(error.to_string())
}

/// A simulation that shows its progress.
struct Watched {
    simulation: Box<dyn Simulation>,
    progress: Box<dyn Progress>,
}

impl Watched {
    fn start(recording: &Simulated, host: &dyn Watch) -> Result<Self, Failure> {
        let simulation = recording.start().map_err(refused)?;
        let days = recording.setup().days;
        Ok(Self {
            simulation,
            // Days are counted in thousandths, since how many rows there will be is the machine's business.
            progress: host.progress_to("simulating", (days * 1000.0) as u64),
        })
    }
}

impl Simulation for Watched {
    fn next(&mut self, row: &mut Row) -> bool {
        let more = self.simulation.next(row);
        self.progress.set((row.time_ns as f64 / 86_400e6) as u64);
        more
    }

    fn correct(&mut self, asked: &[f64], applied: &mut [f64]) {
        self.simulation.correct(asked, applied);
    }
}

fn list(terminal: &Terminal) {
    if terminal.format == Format::Json {
        let all: Vec<Value> = all::<KnownMachine>().map(facts).collect();
        println!("{:#}", json!({ "machines": all }));
        return;
    }
    for known in all::<KnownMachine>() {
        let machine = known.machine;
        println!(
            "{} (from {} {})\n  {}",
            known.name,
            known.package,
            known.version,
            machine.summary()
        );
        for signal in grouped(machine.channels().iter(), |channel| channel.signal) {
            let names: Vec<&str> = signal.iter().map(|channel| channel.name).collect();
            println!("  {}: {}", signal[0].signal, names.join(", "));
        }
        let set_points = machine.set_points().iter().map(|what| {
            let [low, high] = what.range;
            format!("{} {low} to {high} °C", what.name)
        });
        let set_points: Vec<String> = set_points.collect();
        println!("  a schedule can set: {}\n", set_points.join(", "));
    }
    terminal.note("Next: athermal simulate die-tester -o train.csv");
}
