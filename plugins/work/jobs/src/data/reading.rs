//! How recorded files are read: the options that every job on data has.

use std::path::{Path, PathBuf};

use athermal_core::time::Duration;
use athermal_files::{Bound, Options, Stretch};
use clap::Args;
use schemars::JsonSchema;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How files are read.
#[derive(Debug, Clone, Default, PartialEq, Eq, Args, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    /// Take cells and rows that cannot be read as missing, and count them
    #[arg(long)]
    #[serde(default)]
    pub lenient: bool,
    /// How several make one recording.
    #[command(flatten)]
    #[serde(flatten)]
    pub joining: Joining,
    /// Which rows are taken.
    #[command(flatten)]
    #[serde(flatten)]
    pub times: Times,
}

/// How several files are read as one recording.
#[derive(Debug, Clone, Default, PartialEq, Eq, Args, Serialize, Deserialize, JsonSchema)]
pub struct Joining {
    /// Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it
    #[arg(long)]
    #[serde(default)]
    pub segments: bool,
    /// Merge files of different columns by time although their times are no dates: all of them count from one instant
    #[arg(long, conflicts_with = "segments")]
    #[serde(default)]
    pub merge: bool,
    /// Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose` estimates it
    #[arg(long = "offset", value_name = "FILE=TIME", value_parser = offset)]
    #[serde(
        default,
        rename = "offset",
        deserialize_with = "offsets",
        serialize_with = "texts"
    )]
    #[schemars(with = "Vec<String>")]
    pub offsets: Vec<(PathBuf, Duration)>,
}

/// Which rows of data are taken, by their times.
#[derive(Debug, Clone, Default, PartialEq, Eq, Args, Serialize, Deserialize, JsonSchema)]
pub struct Times {
    /// Read rows from this time on alone: an instant (`2026-03-01T06:00:00Z`), a date, or what stands in the log's column of time, such as
    /// seconds. Without an offset from UTC it goes by the `zone` of `[time]`
    #[arg(long, value_name = "TIME", allow_negative_numbers = true)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// Read rows before this time alone
    #[arg(long, value_name = "TIME", allow_negative_numbers = true)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
}

impl Times {
    /// The same for the reader.
    #[must_use]
    pub fn stretch(&self) -> Stretch {
        let bound = |text: &Option<String>| text.clone().map(Bound::Text);
        Stretch {
            from: bound(&self.from),
            to: bound(&self.to),
        }
    }
}

impl Joining {
    /// Whether the name in an offset stands for a file: it is its path, or its name in any folder.
    #[must_use]
    pub fn is_of(name: &Path, file: &Path) -> bool {
        file == name || file.file_name().is_some_and(|of| of == name.as_os_str())
    }
}

impl Reading {
    /// The same for the reader of some files.
    #[must_use]
    pub fn options(&self, files: &[PathBuf]) -> Options {
        let offsets = self.joining.offsets.iter().flat_map(|(name, by)| {
            let files = files.iter().filter(|file| Joining::is_of(name, file));
            files.map(|file| (file.clone(), by.as_ns()))
        });
        Options {
            lenient: self.lenient,
            segments: self.joining.segments,
            merge: self.joining.merge,
            offsets: offsets.collect(),
            stretch: self.times.stretch(),
            ..Options::default()
        }
    }
}

/// Reads a file and what is added to its times.
fn offset(text: &str) -> Result<(PathBuf, Duration), String> {
    let (file, by) = text
        .rsplit_once('=')
        .ok_or("expected a file and a time, such as `positions.csv=1.5s`")?;
    let (sign, length) = match by.strip_prefix(['-', '−']) {
        Some(length) => (-1, length),
        None => (1, by.strip_prefix('+').unwrap_or(by)),
    };
    let length: Duration = length.parse().map_err(|error| format!("{error}"))?;
    Ok((file.into(), Duration::from_ns(sign * length.as_ns())))
}

/// The same of several.
fn offsets<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<(PathBuf, Duration)>, D::Error> {
    let texts = Vec::<String>::deserialize(from)?.into_iter();
    texts
        .map(|text| offset(&text).map_err(D::Error::custom))
        .collect()
}

fn texts<S: Serializer>(offsets: &[(PathBuf, Duration)], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(offsets.iter().map(in_words))
}

/// An offset as it is given.
pub(super) fn in_words((file, by): &(PathBuf, Duration)) -> String {
    format!("{}={by}", file.display())
}
