//! `athermal simulate`: the recording of a simulated machine, as a file.

use std::fs::File;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::{Path, PathBuf};

use athermal::core::registry::all;
use athermal::core::watch::Watch;
use athermal::diagnosis::text::grouped;
use athermal::files::{Flush, Format as FileFormat, Writer};
use athermal::trial::machine::{KnownMachine, Machine, Simulated, facts};
use athermal_analysis::figures::counted;
use athermal_jobs::path::{check_ending, written};
use athermal_jobs::simulate::{self as job, started};
use athermal_simulation::{write_set_points, write_table};
use clap::Args;
use serde_json::{Value, json};

use super::aside::{check_apart, not_written, write_aside, written_aside};
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Write the recording of a simulated machine, or list the machines
///
/// The same machine, days, seed, schedule and faults give the same bytes everywhere. A schedule is a CSV file such as
/// `time_h,chuck_degC` with rows `0,20`, `4,50` and, to start again, `8,repeat`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal simulate
  athermal simulate die-tester -o train.csv
  athermal simulate die-tester -o test.csv --days 2 --seed 2 --truth
  athermal simulate linear-axis -o - --days 0.1 | head
  athermal simulate die-tester -o machine7.csv --spread 30% --machine-seed 7
  athermal simulate die-tester -o faulty.csv \\
      --fault temperature.plate1=stuck,from=6h,for=12h \\
      --fault \"temperature.room=drift,size=0.5 K/h\"

  athermal simulate linear-axis -o changed.csv --change expansion=30%@2d

Faults: missing, stuck, offset, spike, drift, noise; `from`, `for` and `size` may be left out.")]
pub struct Simulate {
    #[command(flatten)]
    job: job::Simulate,
    /// CSV, JSON lines or what else is written, by its ending, CSV without one; `-` is standard output, as CSV
    #[arg(long, short, value_name = "FILE", requires = "machine", value_parser = written())]
    output: Option<PathBuf>,
    /// Write what the schedule plans too: a row half an hour before each set point applies
    #[arg(long, value_name = "FILE", requires = "output")]
    set_points: Option<PathBuf>,
}

impl Simulate {
    /// Simulates and writes.
    ///
    /// # Errors
    /// When there is no such machine, the schedule or a fault does not fit it, or the file cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let job = &self.job;
        let Some(name) = &job.machine else {
            list(terminal);
            return Ok(Answer::Fine);
        };
        let machine = job.machine()?;
        if self.output.is_none() && io::stdout().is_terminal() {
            return Err(Failure::Request(format!(
                "a recording is long; name a file for it: athermal simulate {name} -o {name}.csv"
            )));
        }
        let output = self.output.as_deref().unwrap_or(Path::new("-"));
        check_ending(output)?;
        let read = || job.compensate.iter().chain(&job.schedule);
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
            let plan = write_set_points(&*machine, &job.setup(&*machine)?);
            write_aside(path, plan)?;
        }
        let rows = self.write(&*machine, output, terminal)?;
        if output.as_os_str() == "-" {
            return Ok(Answer::Fine);
        }
        if terminal.format == Format::Json {
            let facts = json!({
                "output": output,
                "rows": rows,
                "machine": name,
                "days": job.days,
                "seed": job.seed,
                "spread": job.spread.share(),
                "machine_seed": job.machine_seed,
            });
            println!("{facts:#}");
        } else {
            let (rows, days) = (counted(rows, "row"), counted(job.days, "day"));
            let (file, seed) = (output.display(), job.seed);
            let one = if job.spread.share() > 0.0 {
                format!(", machine {} of spread {}", job.machine_seed, job.spread)
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
        let format = FileFormat::from_path(output);
        let is_text = !matches!(format, Some(FileFormat::JsonLines | FileFormat::Typed));
        written_aside(output, |output| {
            if self.job.compensate.is_none() && is_text {
                let recording = self.job.recording(machine)?;
                return write_recording(&recording, machine, self.job.truth, output, host);
            }
            let columns = self.job.columns(machine);
            let mut writer = Writer::create(output, "time_s", &columns, Flush::Buffered)?;
            let mut rows = 0;
            self.job.rows(machine, host, &mut |time_ns, values| {
                rows += 1;
                Ok(writer.write_row("", time_ns, values)?)
            })?;
            writer.finish()?;
            Ok(rows)
        })
    }
}

/// Writes a simulated recording to a file or standard output as CSV, and gives the number of rows.
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
    let mut simulation = started(recording, host)?;
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
    for change in &recording.setup().changes {
        writeln!(out, "# change: {change}").map_err(failed)?;
    }
    let rows =
        write_table(machine.channels(), &mut *simulation, truth, &mut out).map_err(failed)?;
    out.flush().map_err(failed)?;
    Ok(rows)
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
