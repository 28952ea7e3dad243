//! The rows of a machine as batches of Arrow, one after the other: as Spark, Dask and data frames hand them over.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use athermal_core::watch::{Kept, Watch};
use athermal_files::{FileError, Options, Reader, Report, layout};
use athermal_run::fit::{FitError, FitOptions};
use athermal_run::model::Model;
use athermal_run::recording::{Event, Samples, Source, SourceError};

use crate::job::Fitted;
use crate::machine::{MachineError, MachineFit, fit_machine};
use crate::once::Once;
use crate::worker::{options, whole};

/// Reads batches of a schema as the rows of a graph; `name` stands for them in messages.
///
/// # Errors
/// When a column of the graph is not among them, or cannot be what the graph says.
pub fn rows_of(
    graph: &Model,
    name: &str,
    schema: SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, ArrowError>> + Send + 'static,
) -> Result<Reader, FileError> {
    let options = Options {
        joins: true,
        ..Options::default()
    };
    let file = athermal_arrow::batches(schema, Box::new(batches));
    Reader::from_typed(Path::new(name), file, layout(&graph.plan), options)
}

/// What was met in what was read, once it has been.
type Found = Arc<Mutex<Vec<(String, Report)>>>;

/// A reader, of which it stays known what it left out once it has been read.
struct Reported {
    reader: Reader,
    name: String,
    found: Found,
}

impl Source for Reported {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let next = Source::next(&mut self.reader, samples)?;
        if next.is_none() {
            let report = (self.name.clone(), self.reader.report().clone());
            *self.found.lock().unwrap_or_else(PoisonError::into_inner) = vec![report];
        }
        Ok(next)
    }
}

/// The rows of batches that come once, as a recording of this graph, and what was left out of them, once they have been read. Batches that were read are let go; who reads them again gets them
/// from what was kept of them: in memory up to so many bytes, beyond that in a file without a name.
///
/// # Errors
/// As of [`rows_of`].
pub fn once(
    graph: &Model,
    name: &str,
    schema: SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, ArrowError>> + Send + 'static,
    memory: usize,
) -> Result<(Once<'static>, Found), MachineError> {
    let rows = rows_of(graph, name, schema, batches);
    let reader = rows.map_err(|error| MachineError::Fit(FitError::Recording(error.into())))?;
    let (name, found) = (name.to_owned(), Arc::default());
    let rows = Reported {
        reader,
        name,
        found: Arc::clone(&found),
    };
    Ok((Once::new(Box::new(rows), memory), found))
}

/// A machine fitted on batches that come once, with all that the manifest of a fleet says of it: for whoever spreads machines over processes,
/// each of which works on one at a time. So the fit has one thread.
///
/// # Errors
/// As of [`rows_of`] and [`fit_machine`].
pub fn fitted(
    graph: &Model,
    name: &str,
    schema: SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, ArrowError>> + Send + 'static,
    memory: usize,
    created: Option<String>,
) -> Result<Fitted, MachineError> {
    let (rows, found) = once(graph, name, schema, batches, memory)?;
    let mut fit = fit_machine(graph, &rows, &options(memory), created, &Kept::default())?;
    fit.outcome.files = std::mem::take(&mut found.lock().unwrap_or_else(PoisonError::into_inner));
    whole(fit)
}

/// [`fit_machine`] on batches that come once.
///
/// # Errors
/// As of [`rows_of`] and [`fit_machine`].
pub fn fit_batches(
    graph: &Model,
    name: &str,
    schema: SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, ArrowError>> + Send + 'static,
    options: &FitOptions,
    created: Option<String>,
    host: &dyn Watch,
) -> Result<MachineFit, MachineError> {
    let (once, _) = once(graph, name, schema, batches, options.memory)?;
    fit_machine(graph, &once, options, created, host)
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use arrow_array::Float64Array;
    use arrow_schema::{DataType, Field, Schema};
    use athermal_core::compile::Wanted;
    use athermal_core::diagnostic::{Diagnostics, Sources};
    use athermal_core::prng::Prng;
    use athermal_files::Dataset;

    // A plugin that no code names is left out by the linker.
    use athermal_estimators as _;
    use athermal_features as _;

    use super::*;
    use crate::doubts::Doubt;

    const GRAPH: &str = r#"
schema = 1
[time]
column = "t"
[signals.plate]
unit = "Cel"
channels = ["a", "b"]
column = "{channel}"
max_age = "1min"
[signals.position]
unit = "nm"
channels = ["z"]
column = "{channel}"
max_age = "1min"
[nodes.slope]
type = "slope"
inputs.signal = "plate"
windows = ["30s"]
unit = "K/min"
[nodes.linear]
type = "linear"
inputs.features = "slope"
inputs.truth = "position.z"
ahead = "0s"
[outputs]
z = "linear"
"#;

    /// Rows of a time and three values, of which the last is there every third time.
    fn rows() -> Vec<[f64; 4]> {
        let mut random = Prng::stream(5, "rows of a machine");
        let mut at = [20.0, 20.0];
        let row = |nth: u32| {
            at = at.map(|of| of + 0.1 * random.normal());
            let z = if nth.is_multiple_of(3) {
                40.0 * (at[0] - at[1]) + random.normal()
            } else {
                f64::NAN
            };
            [f64::from(nth) * 0.7, at[0], at[1], z]
        };
        (0..900).map(row).collect()
    }

    fn batches_of(
        rows: &[[f64; 4]],
        length: usize,
    ) -> (SchemaRef, Vec<Result<RecordBatch, ArrowError>>) {
        let fields = ["t", "a", "b", "z"].map(|name| Field::new(name, DataType::Float64, true));
        let schema: SchemaRef = Arc::new(Schema::new(fields.to_vec()));
        let batch = |rows: &[[f64; 4]]| {
            let column = |nth: usize| -> arrow_array::ArrayRef {
                let cells = rows
                    .iter()
                    .map(|row| Some(row[nth]).filter(|value| !value.is_nan()));
                Arc::new(cells.collect::<Float64Array>())
            };
            RecordBatch::try_new(Arc::clone(&schema), (0..4).map(column).collect())
        };
        (
            Arc::clone(&schema),
            rows.chunks(length).map(batch).collect(),
        )
    }

    #[test]
    fn what_is_left_out_of_batches_is_a_doubt_of_the_machine() {
        let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
        let file = tempfile::NamedTempFile::with_suffix(".toml").unwrap();
        std::fs::write(file.path(), GRAPH).unwrap();
        let graph = Model::load_to_fit(file.path(), Wanted::default(), &mut sources, &mut doubts);
        let graph = graph.unwrap();
        let mut rows = rows();
        let found = |rows: &[[f64; 4]]| {
            let (schema, batches) = batches_of(rows, 100);
            fitted(&graph, "m", schema, batches.into_iter(), 1 << 20, None)
                .unwrap()
                .doubts
        };
        let is_reported = |all: &[Doubt]| all.iter().any(|of| of.fault == "time_before");
        assert!(!is_reported(&found(&rows)));
        rows.swap(300, 320);
        assert!(is_reported(&found(&rows)), "{:?}", found(&rows));
    }

    #[test]
    fn the_same_rows_give_the_same_bytes_from_csv_and_from_batches_of_any_length() {
        let folder =
            std::env::temp_dir().join(format!("athermal-fleet-{}-batches", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (graph, log) = (folder.join("graph.toml"), folder.join("log.csv"));
        std::fs::write(&graph, GRAPH).unwrap();
        let rows = rows();
        let mut text = "t,a,b,z\n".to_owned();
        for [t, a, b, z] in &rows {
            let z = if z.is_nan() {
                String::new()
            } else {
                z.to_string()
            };
            writeln!(text, "{t},{a},{b},{z}").unwrap();
        }
        std::fs::write(&log, text).unwrap();
        let graph = Model::load_to_fit(
            &graph,
            Wanted::default(),
            &mut Sources::new(),
            &mut Diagnostics::new(),
        );
        let graph = graph.unwrap();
        let date = || Some("2026-01-31T12:00:00Z".to_owned());
        let csv = Dataset::new(vec![log], Options::default());
        let options = FitOptions::default();
        let of_csv = fit_machine(&graph, &csv, &options, date(), &Kept::default()).unwrap();
        assert_eq!(of_csv.rows.rows, 900);
        // Without memory for rows the fit reads them again.
        for (length, memory) in [(1, 64 << 20), (7, 64 << 20), (900, 0), (64, 0)] {
            let (schema, batches) = batches_of(&rows, length);
            let options = FitOptions {
                memory,
                ..FitOptions::default()
            };
            let fit = fit_batches(
                &graph,
                "m",
                schema,
                batches.into_iter(),
                &options,
                date(),
                &Kept::default(),
            );
            let fit = fit.unwrap();
            // What rows that are read again leave out of a model they leave out of either.
            let of_csv = fit_machine(&graph, &csv, &options, date(), &Kept::default()).unwrap();
            assert_eq!(fit.rows, of_csv.rows);
            let text = |fit: &MachineFit| String::from_utf8(fit.bytes().unwrap()).unwrap();
            let behind_card = |text: &str| text[text.find("\n  \"graph\"").unwrap()..].to_owned();
            assert_eq!(behind_card(&text(&fit)), behind_card(&text(&of_csv)));
            if memory > 0 {
                assert_eq!(text(&fit), text(&of_csv));
            }
        }
        let (schema, mut batches) = batches_of(&rows, 10);
        batches.truncate(80);
        let other = fit_batches(
            &graph,
            "m",
            schema,
            batches.into_iter(),
            &options,
            date(),
            &Kept::default(),
        )
        .unwrap();
        assert_ne!(other.rows.hash, of_csv.rows.hash);
        assert_ne!(other.bytes().unwrap(), of_csv.bytes().unwrap());
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn batches_without_a_column_of_the_graph_are_refused_with_the_words_that_a_file_gets() {
        let folder =
            std::env::temp_dir().join(format!("athermal-fleet-{}-lacks", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("graph.toml");
        std::fs::write(
            &path,
            GRAPH.replace("channels = [\"a\", \"b\"]", "channels = [\"a\", \"c\"]"),
        )
        .unwrap();
        let graph = Model::load_to_fit(
            &path,
            Wanted::default(),
            &mut Sources::new(),
            &mut Diagnostics::new(),
        );
        let (schema, batches) = batches_of(&rows(), 100);
        let error = rows_of(&graph.unwrap(), "m17", schema, batches.into_iter())
            .err()
            .unwrap();
        let words = error.to_string();
        assert!(words.contains("m17") && words.contains("`c`"), "{words}");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
