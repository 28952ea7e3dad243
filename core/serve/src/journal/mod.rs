//! The journal: every decision, in files that survive the program, and the power cut but for the last moments.
//!
//! ```text
//!  engine thread                 journal thread                    folder
//!  ┌──────────┐  bounded ring   ┌──────────────────────┐  write   ┌──────────────────────────────┐
//!  │ Recorder │ ──────────────▶ │ encode, write, roll   │ ───────▶ │ journal-…0.log  journal-…7.log │
//!  └──────────┘                 └──────────┬───────────┘           └──────────────────────────────┘
//!       ▲ Progress: written, synced        └▶ sync thread: fdatasync each `sync`
//! ```
//!
//! A [`Record`] is a decision of the sequencer. A [`Log`] reads all files of a folder in order. Each file begins with a [`Begin`]: the
//! channels, what waits and what has been stepped. So reading can begin with any file, and old ones can go.
//!
//! A damaged end is cut off and reported where nothing proves that it had been synced; any other damage is refused with its place.

mod begin;
mod error;
mod log;
mod progress;
mod record;
mod recorder;
mod recording;
mod retention;
mod segment;
mod sync;
mod writer;

pub use athermal_run::live::{Record, output_hash};
pub use begin::{Begin, FeedNames};
pub use error::{Damage, DamageKind, JournalError};
pub use log::{Entry, Gap, Log, Torn};
pub use progress::{JournalStatus, Progress};
pub use recorder::{JournalOptions, Recorder};
pub use recording::JournalRecording;
pub use retention::{Keep, oldest, retire};
pub use writer::sync_folder;
