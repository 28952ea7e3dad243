//! How much the clocks of several loggers differ, in words and as JSON.

use athermal_analysis::diagnosis::offset::{Offset, offset};
use athermal_core::time::Duration;
use athermal_core::watch::Watch;
use athermal_files::Dataset;
use athermal_run::model::Model;
use serde_json::{Value, json};

use athermal_analysis::figures::length;
use athermal_core::failure::Failure;

/// What is to be added to the times of a file, beside what is added already.
pub struct OfFile {
    file: String,
    added: Duration,
    found: Offset,
}

/// The offset of each logger but the first named.
///
/// # Errors
/// When the data cannot be read.
pub fn offsets(model: &Model, dataset: &Dataset, host: &dyn Watch) -> Result<Vec<OfFile>, Failure> {
    let mut all = Vec::new();
    for files in dataset.loggers(&model.plan)?.into_iter().skip(1) {
        let mut bar = None;
        let mut progress = |done: u64, total: u64| {
            bar.get_or_insert_with(|| host.progress_to("comparing clocks", total))
                .set(done);
        };
        let shifted = |by| dataset.shifted(&files, by);
        let found = offset(model, &shifted, &mut progress)?;
        drop(bar);
        let added = |file| Duration::from_ns(dataset.added_to(file));
        all.extend(files.iter().zip(found).map(|(file, found)| OfFile {
            file: file.display().to_string(),
            added: added(file),
            found,
        }));
    }
    Ok(all)
}

impl OfFile {
    /// For programs.
    pub fn facts(&self) -> Value {
        json!({
            "file": self.file,
            "offset_s": self.added.secs() + self.found.offset_s,
            "error_s": self.found.error_s,
            "from_s": self.added.secs() + self.found.from_s,
            "to_s": self.added.secs() + self.found.to_s,
            "is_significant": self.found.is_significant,
        })
    }

    /// For people.
    pub fn sentence(&self) -> String {
        let (file, found) = (&self.file, self.found);
        let in_words = |seconds: f64| {
            let of = Duration::from_secs_f64(seconds.abs()).unwrap_or(Duration::ZERO);
            let sign = if seconds < 0.0 { "-" } else { "" };
            format!("{sign}{}", length(of))
        };
        let Some(error) = found.error_s else {
            return format!("clock of {file}: fits hardly change with it\n");
        };
        let (found_s, error_in_words) = (in_words(found.offset_s), in_words(error));
        let [from, to] = [found.from_s, found.to_s].map(in_words);
        let total = |seconds| in_words(self.added.secs() + seconds);
        // What lies within the standard error is not said twice.
        match (
            found.is_significant,
            found.to_s - found.from_s > 4.0 * error,
        ) {
            (true, false) => format!(
                "clock of {file}: fits are best with {found_s} ± {error_in_words} added to its times: --offset {file}={}\n",
                total(found.offset_s)
            ),
            (true, true) => {
                let least = match found.from_s > 0.0 {
                    true => found.from_s,
                    false => found.to_s,
                };
                format!(
                    "clock of {file}: any shift from {from} to {to} added to its times explains as well, and none does not: --offset \
                     {file}={} at least; what is more the graph's slopes and lags can express\n",
                    total(least)
                )
            }
            (false, true) => format!(
                "clock of {file}: as that of the others, or any shift from {from} to {to} added to its times, which explains as well\n"
            ),
            (false, false) => {
                format!("clock of {file}: as that of the others ({found_s} ± {error_in_words})\n")
            }
        }
    }
}
