//! `athermal run`: rows in, the graph's outputs out.

use std::path::PathBuf;

use athermal::Instant;
use athermal::core::compile::Wanted;
use athermal::core::document::TimeBase;
use athermal::files::{Flush, Options, Reader, Row, Writer, layout};
use clap::Args;

use super::data;
use super::evaluate::load_fitted;
use crate::terminal::{Answer, Failure, Terminal};

/// Run a model: rows in, predictions out
///
/// Reads rows of measurements and writes one row per tick with the graph's outputs, as soon as it is read. Columns are the
/// time as in the input, then the outputs; a cell is empty where the node did not run or gave nothing at the tick.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal run model.json --input test.csv --output predicted.csv\n  \
                        tail -f log.csv | athermal run model.json --input - --output -"
)]
pub struct Run {
    /// The model, or a graph in which nothing needs fitting
    model: PathBuf,
    /// CSV or JSON lines; `-` is standard input
    #[arg(long, short, value_name = "FILE")]
    input: PathBuf,
    /// CSV or JSON lines by its ending; `-` is standard output, as CSV
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    /// Take cells and rows that cannot be read as missing, and count them
    #[arg(long)]
    lenient: bool,
}

impl Run {
    /// Runs until the input ends.
    ///
    /// # Errors
    /// When the model or the input cannot be used, or the output not written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let model = load_fitted(&self.model, Wanted::default())?;
        let mut engine = model.engine()?;
        let plan = std::sync::Arc::clone(engine.plan());
        let options = Options {
            lenient: self.lenient,
            ..Options::default()
        };
        let mut reader = Reader::open(&self.input, layout(&plan), options)?;
        let TimeBase::Column { column, .. } = &plan.time;
        let columns: Vec<String> = plan
            .outputs
            .iter()
            .map(|output| output.name.clone())
            .collect();
        let flush = if self.input.as_os_str() == "-" {
            Flush::EachRow
        } else {
            Flush::Buffered
        };
        let mut writer = Writer::create(&self.output, column, &columns, flush)?;
        let mut row = Row::default();
        while reader.next_into(&mut row)? {
            match engine.step(Instant::from_ns(row.time_ns), &row.values) {
                Ok(outputs) => writer.write_row(&row.time_text, row.time_ns, outputs)?,
                Err(athermal::EngineError::NotAfter { .. }) => {}
                Err(error) => return Err(Failure::Request(error.to_string())),
            }
        }
        writer.finish()?;
        let reports = [(self.input.display().to_string(), reader.report().clone())];
        let counted = plan
            .sources
            .iter()
            .zip(engine.rejected())
            .filter(|&(_, &count)| count > 0);
        let rejected: Vec<_> = counted
            .map(|(source, &count)| (source.name.clone(), count))
            .collect();
        data::tell(terminal, &reports, engine.refused(), &rejected);
        Ok(Answer::Fine)
    }
}
