//! The columns that a file has against those that are wanted: where each stands, missing and doubled names. Not their cells.

use std::collections::{HashMap, HashSet};

use csv::{ByteRecord, ReaderBuilder};

use crate::cell::{self, trim};
use crate::error::excerpt;
use crate::{FileError, Layout, MissingColumn, Place};

/// How alike two names must be for one to be suggested for the other (Jaro–Winkler, 0 to 1).
const ALIKE: f64 = 0.8;

/// How many missing columns are compared with those found. A file that lacks more is another file.
const COMPARED: usize = 50;

/// The names in a header, between these separators.
pub(crate) fn names_in(header: &[u8], separator: u8) -> Vec<String> {
    let line = header.strip_suffix(b"\n").unwrap_or(header);
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    // Most need no reader, which costs far more.
    if !line.is_empty() && !line.iter().any(|byte| matches!(byte, b'"' | b'\r' | b'\n')) {
        return line.split(|byte| *byte == separator).map(name).collect();
    }
    let mut record = ByteRecord::new();
    let read = ReaderBuilder::new()
        .has_headers(false)
        .delimiter(separator)
        .from_reader(header)
        .read_byte_record(&mut record);
    match read {
        Ok(true) => record.iter().map(name).collect(),
        _ => Vec::new(),
    }
}

/// The name that a header cell gives.
pub(crate) fn name(cell: &[u8]) -> String {
    cell::text(trim(cell)).into_owned()
}

/// Where the wanted columns stand.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Columns {
    /// Each column of the time, if it is there.
    pub time: Vec<Option<usize>>,
    /// The column of each channel, if it is there.
    pub channels: Vec<Option<usize>>,
}

impl Columns {
    /// Looks them up among names.
    pub fn of(layout: &Layout, names: &[String]) -> Self {
        let places = names.iter().enumerate().rev();
        let places: HashMap<&str, usize> = places.map(|(at, name)| (name.as_str(), at)).collect();
        let place = |name: &str| places.get(name).copied();
        let time = layout.time.columns.names().iter();
        let channels = layout.channels.iter();
        Self {
            time: time.map(|name| place(name)).collect(),
            channels: channels.map(|channel| place(&channel.column)).collect(),
        }
    }

    /// Whether the time is there, with all its columns.
    pub fn have_time(&self) -> bool {
        self.time.iter().all(Option::is_some)
    }

    /// Whether so many of them are there that it is no chance: the time, or half of the channels and at least two.
    pub fn are_named(&self, layout: &Layout) -> bool {
        let channels = self.channels.iter().flatten().count();
        self.have_time() || channels >= 2 && 2 * channels >= layout.channels.len()
    }

    /// Whether those that are there in both stand at the same places.
    pub fn agree_with(&self, other: &Self) -> bool {
        let all = |columns: &Self| {
            let columns = columns.time.iter().chain(&columns.channels);
            columns.copied().collect::<Vec<_>>()
        };
        let mut pairs = all(self).into_iter().zip(all(other));
        pairs.all(|pair| !matches!(pair, (Some(a), Some(b)) if a != b))
    }

    /// The names of those that must be there and are not.
    pub fn lacking<'a>(&self, layout: &'a Layout) -> Vec<&'a str> {
        let time = layout.time.columns.names().iter().zip(&self.time);
        let time = time.filter(|(_, at)| at.is_none());
        let time = time.map(|(name, _)| name.as_str());
        let channels = layout.channels.iter().zip(&self.channels);
        let channels = channels.filter(|(channel, at)| at.is_none() && !channel.optional);
        let channels = channels.map(|(channel, _)| channel.column.as_str());
        time.chain(channels).collect()
    }
}

/// Names of which each stands once: one that stands at several columns has the number of its place among them, `Temp[1]`,
/// `Temp[2]`. Columns without a name may be many.
pub(crate) fn numbered(mut names: Vec<String>) -> Vec<String> {
    let mut places: HashMap<&str, Vec<usize>> = HashMap::new();
    for (at, name) in names
        .iter()
        .enumerate()
        .filter(|(_, name)| !name.is_empty())
    {
        places.entry(name).or_default().push(at);
    }
    if places.values().all(|at| at.len() == 1) {
        return names;
    }
    let known: HashSet<&str> = places.keys().copied().collect();
    let mut others = Vec::new();
    for (name, places) in places.iter().filter(|(_, places)| places.len() > 1) {
        let free = (1..).map(|number| format!("{name}[{number}]"));
        let free = free.filter(|name| !known.contains(name.as_str()));
        others.extend(places.iter().copied().zip(free));
    }
    for (at, name) in others {
        names[at] = name;
    }
    names
}

/// The error for a wanted name that stands at several columns, where one does.
pub(crate) fn ambiguous(place: Place, wanted: &[&str], names: &[String]) -> Option<FileError> {
    let numbers = |column: &str, name: &str| {
        let number = name
            .strip_prefix(column)?
            .strip_prefix('[')?
            .strip_suffix(']')?;
        number.parse::<usize>().ok()
    };
    wanted.iter().find_map(|column| {
        let places = names.iter().enumerate();
        let places = places.filter(|(_, name)| numbers(column, name).is_some());
        let mut places = places.map(|(at, _)| at + 1);
        Some(FileError::DuplicateColumn {
            place: place.clone(),
            column: excerpt(column.as_bytes()),
            positions: [places.next()?, places.next()?],
        })
    })
}

/// Columns that are not among the names found, each with the one that is most like it.
pub(crate) fn nearest<'a>(
    columns: impl IntoIterator<Item = &'a str>,
    found: &[String],
) -> Vec<MissingColumn> {
    let lower: Vec<_> = found.iter().map(|name| name.to_lowercase()).collect();
    let nearest = |column: &str| {
        let wanted = column.to_lowercase();
        let named = lower.iter().zip(found).filter(|(_, name)| !name.is_empty());
        named
            .map(|(lower, name)| (strsim::jaro_winkler(&wanted, lower), name))
            .filter(|(alike, _)| *alike >= ALIKE)
            .max_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, name)| name.clone())
    };
    let mut missing: Vec<MissingColumn> = Vec::new();
    let mut named = HashSet::new();
    // Two channels may have one column.
    for column in columns.into_iter().filter(|column| named.insert(*column)) {
        missing.push(MissingColumn {
            name: column.to_owned(),
            nearest: (missing.len() < COMPARED)
                .then(|| nearest(column))
                .flatten(),
        });
    }
    missing
}

/// The error for columns that are not among the names found, with what may be why.
pub(crate) fn missing<'a>(
    place: Place,
    columns: impl IntoIterator<Item = &'a str>,
    found: &[String],
    note: &'static str,
) -> FileError {
    FileError::MissingColumns {
        place,
        missing: nearest(columns, found),
        found: found.iter().map(|name| excerpt(name.as_bytes())).collect(),
        note,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_suggested_and_a_distant_one_is_not() {
        let found = [
            "time_s".to_owned(),
            "room_degC".to_owned(),
            "chuck_degC".to_owned(),
        ];
        let place = Place {
            file: "a".into(),
            line: 1,
        };
        let nearest = |wanted: &str| match missing(place.clone(), [wanted], &found, "") {
            FileError::MissingColumns { missing, .. } => missing[0].nearest.clone(),
            other => panic!("{other}"),
        };
        assert_eq!(nearest("Room_degc").as_deref(), Some("room_degC"));
        assert_eq!(nearest("chuk_degC").as_deref(), Some("chuck_degC"));
        assert_eq!(nearest("pressure"), None);
    }

    #[test]
    fn a_doubled_name_is_numbered_and_refused_where_it_is_read_without_its_number() {
        let names = numbered(["a", "b", "", "", "a", "a[1]"].map(str::to_owned).to_vec());
        assert_eq!(names, ["a[2]", "b", "", "", "a[3]", "a[1]"]);
        let names = numbered(["a", "b", "", "", "a"].map(str::to_owned).to_vec());
        assert_eq!(names, ["a[1]", "b", "", "", "a[2]"]);
        let place = Place {
            file: "f".into(),
            line: 1,
        };
        let error = ambiguous(place.clone(), &["b", "a"], &names).unwrap();
        assert_eq!(
            error.to_string(),
            "f:1: the name `a` stands at columns 1 and 5; write `a[1]` or `a[2]` for one of them, by its place among these"
        );
        assert!(ambiguous(place, &["b", "c"], &names).is_none());
    }
}
