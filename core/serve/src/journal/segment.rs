//! One file of the journal: its header, its records, its end.
//!
//! ```text
//! header   magic 8 · version 4 · crc 4 · hash of the feed 8 · first record 8
//! record   length of the body 4 · crc 4 · kind 1 · body      the crc covers the record's number, kind and body
//! end      zeros, or the end of the file
//! ```

use std::fs;
use std::path::{Path, PathBuf};

use super::record::{decode, encode};
use super::{Begin, Damage, DamageKind, JournalError, Record};

pub(super) const VERSION: u32 = 1;
const MAGIC: &[u8; 8] = b"athermJ\n";
const HEADER: usize = 32;
/// Length, crc and kind.
const FRAME: usize = 9;

const BEGIN: u8 = 1;
const SYNC: u8 = 13;
/// The number of what is no record: a crc that is right wherever it stands.
const UNNUMBERED: u64 = u64::MAX;

/// The name of a file by its first record.
pub(super) fn name(event: u64) -> String {
    format!("journal-{event:020}.log")
}

/// The first record of a file by its name; none of any other file.
pub(super) fn first_event(name: &str) -> Option<u64> {
    let digits = name.strip_prefix("journal-")?.strip_suffix(".log")?;
    digits.parse().ok().filter(|_| digits.len() == 20)
}

/// The first bytes of a file.
pub(super) fn header(begin: &Begin) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(begin.feed.hash().to_le_bytes());
    bytes.extend(begin.event.to_le_bytes());
    let crc = header_checksum(&bytes);
    bytes[12..16].copy_from_slice(&crc.to_le_bytes());
    let body =
        rmp_serde::to_vec_named(begin).expect("names and numbers are data that serde can write");
    frame(&mut bytes, UNNUMBERED, |bytes| {
        bytes.extend(&body);
        BEGIN
    });
    bytes
}

/// Appends a record of a number.
pub(super) fn append(bytes: &mut Vec<u8>, event: u64, record: &Record) {
    frame(bytes, event, |bytes| encode(record, bytes));
}

/// Appends that all before a place in the file has been synced.
pub(super) fn append_synced(bytes: &mut Vec<u8>, offset: u64) {
    frame(bytes, UNNUMBERED, |bytes| {
        bytes.extend(offset.to_le_bytes());
        SYNC
    });
}

fn frame(bytes: &mut Vec<u8>, number: u64, write: impl FnOnce(&mut Vec<u8>) -> u8) {
    let start = bytes.len();
    bytes.extend([0; FRAME]);
    let kind = write(bytes);
    let length = u32::try_from(bytes.len() - start - FRAME).unwrap_or(u32::MAX);
    bytes[start..start + 4].copy_from_slice(&length.to_le_bytes());
    bytes[start + 8] = kind;
    let crc = checksum(number, &bytes[start + 8..]);
    bytes[start + 4..start + 8].copy_from_slice(&crc.to_le_bytes());
}

fn checksum(number: u64, kind_and_body: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&number.to_le_bytes());
    hasher.update(kind_and_body);
    hasher.finalize()
}

/// Of all but the checksum itself.
fn header_checksum(bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytes[..12]);
    hasher.update(&bytes[16..HEADER]);
    hasher.finalize()
}

/// A file that is read.
#[derive(Debug)]
pub(super) struct Segment {
    path: PathBuf,
    bytes: Vec<u8>,
    at: usize,
    event: u64,
    pub(super) begin: Begin,
}

impl Segment {
    /// Reads a file into memory, and what it begins with.
    pub(super) fn open(path: &Path) -> Result<Self, JournalError> {
        let path = path.to_owned();
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => return Err(JournalError::Unreadable { path, error }),
        };
        let broken = |path: &PathBuf, offset, kind| {
            JournalError::Damaged(Damage {
                path: path.clone(),
                offset,
                event: path
                    .file_name()
                    .and_then(|name| first_event(name.to_str()?))
                    .unwrap_or(0),
                kind,
            })
        };
        let number = |at: usize| bytes.get(at..at + 4)?.try_into().ok();
        let number = |at| number(at).map(u32::from_le_bytes);
        let is_whole = bytes.starts_with(MAGIC)
            && bytes.len() >= HEADER
            && number(12) == Some(header_checksum(&bytes));
        let version = number(8).filter(|_| is_whole);
        let Some(version) = version else {
            return Err(broken(&path, 0, DamageKind::Header));
        };
        if version != VERSION {
            return Err(JournalError::Later { path, version });
        }
        let (kind, body, end) = match framed(&bytes, HEADER) {
            Ok(Some(frame)) => frame,
            Ok(None) => return Err(broken(&path, HEADER as u64, DamageKind::Content)),
            Err(kind) => return Err(broken(&path, HEADER as u64, kind)),
        };
        if !is_right(&bytes, HEADER, end, UNNUMBERED) {
            return Err(broken(&path, HEADER as u64, DamageKind::Checksum));
        }
        let begin = (kind == BEGIN)
            .then(|| rmp_serde::from_slice::<Begin>(body).ok())
            .flatten();
        let is_of_header = |begin: &Begin| {
            bytes[16..24] == begin.feed.hash().to_le_bytes()
                && bytes[24..32] == begin.event.to_le_bytes()
        };
        let Some(begin) = begin.filter(is_of_header) else {
            return Err(broken(&path, HEADER as u64, DamageKind::Content));
        };
        Ok(Self {
            at: end,
            event: begin.event,
            path,
            bytes,
            begin,
        })
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The number of the next record.
    pub(super) fn event(&self) -> u64 {
        self.event
    }

    /// The byte at which the next record begins, or would.
    pub(super) fn at(&self) -> u64 {
        self.at as u64
    }

    /// The next record; none at the end.
    pub(super) fn next(&mut self) -> Result<Option<Record>, Damage> {
        loop {
            let damage = |kind| Damage {
                path: self.path.clone(),
                offset: self.at as u64,
                event: self.event,
                kind,
            };
            let Some((kind, body, end)) = framed(&self.bytes, self.at).map_err(damage)? else {
                return Ok(None);
            };
            if kind == SYNC && is_right(&self.bytes, self.at, end, UNNUMBERED) {
                self.at = end;
                continue;
            }
            if !is_right(&self.bytes, self.at, end, self.event) {
                return Err(damage(DamageKind::Checksum));
            }
            let record = decode(kind, body).ok_or(damage(DamageKind::Content))?;
            (self.at, self.event) = (end, self.event + 1);
            return Ok(Some(record));
        }
    }

    /// Whether something behind the present place proves that it had been synced. Then damage is no torn end.
    pub(super) fn was_synced_beyond(&self) -> bool {
        let last = self.bytes.len().saturating_sub(FRAME + 8);
        (self.at..=last).any(|at| {
            let frame = &self.bytes[at..at + FRAME + 8];
            frame[..4] == 8_u32.to_le_bytes()
                && frame[8] == SYNC
                && is_right(&self.bytes, at, at + FRAME + 8, UNNUMBERED)
                && frame[FRAME..]
                    .try_into()
                    .is_ok_and(|offset| u64::from_le_bytes(offset) > self.at as u64)
        })
    }
}

/// Kind, body and end of a record.
type Frame<'a> = (u8, &'a [u8], usize);

/// What stands at a place; none where only zeros follow, or nothing.
fn framed(bytes: &[u8], at: usize) -> Result<Option<Frame<'_>>, DamageKind> {
    let rest = &bytes[at..];
    if let Some(frame) = rest.get(..FRAME)
        && frame != [0; FRAME]
    {
        let length = u32::from_le_bytes([frame[0], frame[1], frame[2], frame[3]]) as usize;
        let end = FRAME + length;
        let body = rest.get(FRAME..end).ok_or(DamageKind::Length)?;
        return Ok(Some((frame[8], body, at + end)));
    }
    if rest.iter().all(|byte| *byte == 0) {
        return Ok(None);
    }
    Err(DamageKind::Content)
}

/// Whether the record between two places has the right checksum.
fn is_right(bytes: &[u8], at: usize, end: usize, number: u64) -> bool {
    bytes[at + 4..at + 8] == checksum(number, &bytes[at + 8..end]).to_le_bytes()
}
