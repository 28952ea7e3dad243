//! What is added to the times of a file.

use std::path::PathBuf;

use athermal::Duration;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

/// Reads a file and what is added to its times.
pub(super) fn offset(text: &str) -> Result<(PathBuf, Duration), String> {
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
pub(super) fn offsets<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Vec<(PathBuf, Duration)>, D::Error> {
    let texts = Vec::<String>::deserialize(from)?.into_iter();
    texts
        .map(|text| offset(&text).map_err(D::Error::custom))
        .collect()
}
