//! The models of a service: those that ran, in `models` of its state folder, and those that were proposed, in `proposals`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use athermal_run::live::store::write_whole;
use athermal_run::model::Model;
use athermal_serve::folder::StatePaths;

/// How many proposals are kept, beside the first.
const KEPT: usize = 5;

/// A model of a service.
#[derive(Debug)]
pub struct Shelved {
    /// Its file.
    pub path: PathBuf,
    /// Its revision.
    pub revision: String,
    /// The model.
    pub model: Model,
    /// Whether it was proposed by a fit of the service's own.
    pub is_proposal: bool,
}

fn proposals(state: &Path) -> PathBuf {
    state.join("proposals")
}

/// All models that can be read, by when they were fitted, the oldest first.
pub fn all(state: &Path) -> Vec<Shelved> {
    let folders = [
        (StatePaths::new(state).models(), false),
        (proposals(state), true),
    ];
    let mut all: Vec<Shelved> = Vec::new();
    for (folder, is_proposal) in folders {
        for path in files(&folder) {
            let Ok(model) = Model::load(&path) else {
                continue;
            };
            let Some(revision) = model.revision() else {
                continue;
            };
            // One that was proposed and took over is in both.
            if all.iter().all(|of| of.revision != revision) {
                all.push(Shelved {
                    path,
                    revision,
                    model,
                    is_proposal,
                });
            }
        }
    }
    let created = |of: &Shelved| of.model.card.as_ref().and_then(|card| card.created.clone());
    all.sort_by_key(created);
    all
}

/// Keeps a proposal under a name, and removes the oldest beyond those that are kept; the first stays.
///
/// # Errors
/// When it cannot be written.
pub fn keep(state: &Path, name: &str, model: &Model) -> io::Result<PathBuf> {
    let folder = proposals(state);
    fs::create_dir_all(&folder)?;
    let path = folder.join(format!("{name}.json"));
    let text = model.to_text().map_err(io::Error::other)?;
    write_whole(&path, text.as_bytes())?;
    let old = files(&folder);
    let spare = old.len().saturating_sub(KEPT + 1);
    for path in old.iter().skip(1).take(spare) {
        // One that stays does no harm.
        let _ = fs::remove_file(path);
    }
    Ok(path)
}

/// The models of a folder, by name.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    let mut models: Vec<_> = paths
        .filter(|path| path.extension().is_some_and(|of| of == "json"))
        .collect();
    models.sort();
    models
}
