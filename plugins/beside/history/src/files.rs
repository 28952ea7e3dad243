//! How what is kept stands beside the journal: a file of rows each time it is written, and files of stretches that grow.
//!
//! A file begins with what it is and its channels, as JSON; then come blocks, each with a sum of its bytes. What is behind a damaged block
//! was not written whole, and is left.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal_core::engine::fnv_1a;
use serde::{Deserialize, Serialize};

use crate::columns::Columns;
use crate::store::{Part, Rows, Store};

/// What each file begins with.
const MAGIC: &[u8; 20] = b"athermal history 01\n";
/// How many files of rows are kept, one a minute.
const ROWS: usize = 16;
/// How many files of stretches, and how large one grows.
const STRETCHES: (usize, u64) = (1_000, 1 << 20);
/// How large the channels of a file may be, as JSON.
const HEAD: usize = 16 << 20;

#[derive(Serialize, Deserialize)]
struct Head {
    is_rows: bool,
    columns: Columns,
}

/// The files of a service.
#[derive(Debug)]
pub(crate) struct Files {
    folder: PathBuf,
    /// How many bytes they may take.
    limit: u64,
    /// The number of the next file.
    next: u64,
    /// The file of stretches that grows.
    growing: Option<(File, Arc<Columns>, u64)>,
}

impl Files {
    /// Those of a folder, and what is in them: up to how many ticks, beats, breaks and freezes it goes.
    pub(crate) fn open(folder: PathBuf, limit: u64) -> (Self, Store, u64) {
        let mut store = Store::default();
        let mut happenings = 0;
        let all = numbered(&folder);
        for is_rows in [false, true] {
            for (_, path) in all.iter().filter(|(_, path)| of_rows(path) == is_rows) {
                happenings = read(path, &mut store).unwrap_or_default().max(happenings);
            }
        }
        let files = Self {
            folder,
            limit,
            next: all.last().map_or(0, |(number, _)| number + 1),
            growing: None,
        };
        (files, store, happenings)
    }

    /// Writes what has not been written, up to so many ticks, beats, breaks and freezes. `has_ended`: nothing comes behind it.
    ///
    /// # Errors
    /// When it cannot be; what was not written is tried again.
    pub(crate) fn write(
        &mut self,
        store: &mut Store,
        happenings: u64,
        has_ended: bool,
    ) -> io::Result<u64> {
        fs::create_dir_all(&self.folder)?;
        let parts = store.parts.len();
        for (nth, part) in store.parts.iter_mut().enumerate() {
            let closed = part.closed(has_ended || nth + 1 < parts);
            if !closed.is_empty() {
                let bytes = block(&part.stretches, closed.clone(), happenings, Some(part));
                self.grow(&part.columns, &bytes)?;
                part.unwritten.1 -= closed.len();
            }
            let count = part.rows.len();
            if part.unwritten.0 > 0 {
                let each = 8 * (part.columns.width() + 1);
                let fits = (self.limit / 2) as usize / each;
                let begin = count - part.unwritten.0.min(fits.max(1));
                let bytes = block(&part.rows, begin..count, happenings, None);
                self.whole(&part.columns, &bytes)?;
                part.unwritten.0 = 0;
            }
        }
        self.retire()
    }

    fn path(&mut self, what: &str) -> PathBuf {
        self.next += 1;
        self.folder.join(format!("{:010}.{what}", self.next - 1))
    }

    /// A file of rows, which is there whole or not at all.
    fn whole(&mut self, columns: &Columns, bytes: &[u8]) -> io::Result<()> {
        let path = self.path("rows");
        let aside = path.with_extension("new");
        let head = head(true, columns);
        fs::write(&aside, [&head, bytes].concat())?;
        fs::rename(aside, path)
    }

    fn grow(&mut self, columns: &Arc<Columns>, bytes: &[u8]) -> io::Result<()> {
        let goes_on = self.growing.as_ref();
        let goes_on = goes_on.is_some_and(|(_, of, size)| of == columns && *size < STRETCHES.1);
        if !goes_on {
            let path = self.path("stretches");
            let mut file = File::options().create_new(true).append(true).open(path)?;
            file.write_all(&head(false, columns))?;
            self.growing = Some((file, Arc::clone(columns), 0));
        }
        let Some((file, _, size)) = &mut self.growing else {
            return Ok(());
        };
        *size += bytes.len() as u64;
        let written = file.write_all(bytes);
        if written.is_err() {
            // What stands behind half of a block is not read.
            self.growing = None;
        }
        written
    }

    /// Removes the oldest files until the others have room: how many bytes they take.
    fn retire(&self) -> io::Result<u64> {
        let all = numbered(&self.folder);
        let mut total = 0;
        for (is_rows, most) in [(true, ROWS), (false, STRETCHES.0)] {
            let own = all
                .iter()
                .rev()
                .filter(|(_, path)| of_rows(path) == is_rows);
            let mut taken = 0;
            for (nth, (_, path)) in own.enumerate() {
                let size = fs::metadata(path).map_or(0, |of| of.len());
                taken += size;
                if nth > 0 && (nth >= most || taken > self.limit / 2) {
                    fs::remove_file(path)?;
                } else {
                    total += size;
                }
            }
        }
        Ok(total)
    }
}

/// The files of a folder by their numbers.
fn numbered(folder: &Path) -> Vec<(u64, PathBuf)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let number = |path: PathBuf| {
        let is_own = of_rows(&path) || path.extension()? == "stretches";
        let number = path.file_stem()?.to_str()?.parse().ok()?;
        is_own.then_some((number, path))
    };
    let mut all: Vec<_> = entries.filter_map(|of| number(of.path())).collect();
    all.sort();
    all
}

fn of_rows(path: &Path) -> bool {
    path.extension().is_some_and(|of| of == "rows")
}

fn head(is_rows: bool, columns: &Columns) -> Vec<u8> {
    let columns = columns.clone();
    let json = serde_json::to_vec(&Head { is_rows, columns }).unwrap_or_default();
    let length = (json.len() as u32).to_le_bytes();
    [&MAGIC[..], &length, &json].concat()
}

/// Rows from one to another, with their instants; of stretches their numbers too.
fn block(
    rows: &Rows,
    which: std::ops::Range<usize>,
    happenings: u64,
    part: Option<&Part>,
) -> Vec<u8> {
    let mut bytes = (which.len() as u32).to_le_bytes().to_vec();
    bytes.extend(happenings.to_le_bytes());
    for row in which {
        bytes.extend(rows.times[row].to_le_bytes());
        if let Some(part) = part {
            bytes.extend(part.buckets[row].to_le_bytes());
        }
        rows.row(row)
            .for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    let sum = fnv_1a(&bytes);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// Reads a file, as far as it is whole: up to how many happenings it goes.
fn read(path: &Path, store: &mut Store) -> Option<u64> {
    let bytes = fs::read(path).ok()?;
    let rest = bytes.strip_prefix(&MAGIC[..])?;
    let (length, rest) = rest.split_first_chunk()?;
    let length = u32::from_le_bytes(*length) as usize;
    let (json, mut rest) = rest.split_at_checked(length.min(HEAD))?;
    let Head { is_rows, columns } = serde_json::from_slice(json).ok()?;
    let columns = Arc::new(columns);
    let width = columns.width();
    let each = match is_rows {
        true => 1 + width,
        false => 2 + 3 * width,
    };
    let mut happenings = 0;
    while let Some((count, _)) = rest.split_first_chunk() {
        let count = u32::from_le_bytes(*count) as usize;
        let length = count.checked_mul(8 * each)?.checked_add(12)?;
        let Some((block, after)) = rest.split_at_checked(length) else {
            break;
        };
        let Some((sum, after)) = after.split_first_chunk() else {
            break;
        };
        if u64::from_le_bytes(*sum) != fnv_1a(block) {
            break;
        }
        rest = after;
        let (words, _) = block[4..].as_chunks::<8>();
        let (seen, words) = words.split_first()?;
        happenings = u64::from_le_bytes(*seen).max(happenings);
        for row in words.chunks_exact(each) {
            let at = i64::from_le_bytes(row[0]);
            let numbers = |from: usize| -> Vec<f64> {
                row[from..]
                    .iter()
                    .map(|of| f64::from_le_bytes(*of))
                    .collect()
            };
            match is_rows {
                true => store.row(&columns, at, &numbers(1)),
                false => store.stretch(&columns, i64::from_le_bytes(row[1]), at, &numbers(2)),
            }
        }
    }
    Some(happenings)
}
