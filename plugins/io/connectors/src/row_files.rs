//! The files that a sink writes rows to: one that is appended to, and those before it. Which file a row stands in, how many there are,
//! and what has become of a file that others moved or truncated; not what a row looks like, nor when a file is full.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use athermal_core::engine::fnv_1a;
use athermal_core::time::Instant;
use athermal_files::{Format, TimeColumn, begun_until};
use athermal_serve::connector::Place;
use athermal_serve::journal::sync_folder;

/// So many bytes are read at once.
const PIECE: usize = 1 << 16;

/// What all files of a sink have in common.
#[derive(Debug)]
pub(crate) struct Layout {
    pub(crate) format: Format,
    pub(crate) time: TimeColumn,
    /// The columns but that of the time.
    pub(crate) columns: Vec<String>,
    /// What a file begins with: the names of the columns, or nothing.
    pub(crate) header: Vec<u8>,
}

impl Layout {
    /// Whether a file holds anything but what is left of its first line.
    fn is_begun(&self, file: &mut File) -> io::Result<bool> {
        let mut start = Vec::new();
        file.seek(SeekFrom::Start(0))?;
        file.take(PIECE as u64).read_to_end(&mut start)?;
        if start.first() == Some(&0) {
            return Err(io::Error::other(
                "it begins with NUL bytes, as where it was truncated under a program that does not append: move it away, or name another file",
            ));
        }
        let is_first = match self.format {
            Format::JsonLines => start.starts_with(b"{\"") && start.len() < PIECE,
            _ => self.header.starts_with(&start),
        };
        let is_torn = is_first && !start.contains(&b'\n');
        Ok(!is_torn && !start.is_empty())
    }

    /// The rows of a file, and where they begin.
    fn rows(&self, path: &Path) -> io::Result<(BufReader<File>, u64)> {
        let mut file = BufReader::with_capacity(PIECE, File::open(path)?);
        let begin = match self.header.is_empty() {
            true => 0,
            false => file.skip_until(b'\n')?,
        };
        Ok((file, begin as u64))
    }
}

/// The files of a sink, of which the last is written.
#[derive(Debug)]
pub(crate) struct RowFiles {
    path: PathBuf,
    layout: Layout,
    /// None until it is opened, and after it was full.
    open: Option<OpenFile>,
    /// The number of the file that is written: files that were full have theirs in their names.
    number: u32,
    /// Whether the names in the folder last.
    is_named: bool,
}

/// The file that is written.
#[derive(Debug)]
struct OpenFile {
    file: File,
    /// Where whole rows end, and how many there are.
    end: u64,
    rows: u64,
    /// What tells its first row from that of any other file; 0 without one.
    first: u32,
    /// Whether behind the end stands what could not be cut off.
    is_torn: bool,
}

impl RowFiles {
    pub(crate) fn new(path: PathBuf, layout: Layout) -> Self {
        Self {
            path,
            layout,
            open: None,
            number: 0,
            is_named: true,
        }
    }

    /// The file that is written.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// How many bytes it has.
    pub(crate) fn length(&self) -> u64 {
        self.open.as_ref().map_or(0, |of| of.end)
    }

    /// Opens the file at the path, unless it is open and as it was left: others may have moved or truncated it. Gives the instant of its
    /// last row where it was opened.
    pub(crate) fn ready(&mut self) -> io::Result<Option<Instant>> {
        if let Some(open) = &mut self.open {
            let at_path = fs::metadata(&self.path).ok();
            let own = open.file.metadata()?;
            if at_path.is_some_and(|of| is_same(&of, &own)) {
                if std::mem::take(&mut open.is_torn)
                    && let Err(error) = open.file.set_len(open.end)
                {
                    open.is_torn = true;
                    return Err(error);
                }
                if own.len() == open.end || open.file.metadata()?.len() == open.end {
                    return Ok(None);
                }
            }
            // What was written to it stays where it is.
            if open.is_torn {
                open.file.set_len(open.end)?;
            }
            open.file.sync_data()?;
            self.open = None;
        }
        let (layout, number) = (&self.layout, self.full()?.last().map_or(0, |of| of.0));
        self.number = self.number.max(number + 1);
        let mut options = OpenOptions::new();
        let mut file = options
            .read(true)
            .append(true)
            .create(true)
            .open(&self.path)?;
        let (mut last, mut end) = (None, layout.header.len() as u64);
        if layout.is_begun(&mut file)? {
            let known = begun_until(&self.path, layout.format, &layout.time, &layout.columns);
            last = known.map_err(io::Error::other)?;
            end = whole_lines(&mut file)?;
        } else {
            file.set_len(0)?;
            if let Err(error) = file.write_all(&layout.header) {
                let _ = file.set_len(0);
                return Err(error);
            }
            self.is_named = false;
        }
        let (rows, first) = self.count(&self.path)?;
        self.open = Some(OpenFile {
            file,
            end,
            rows,
            first,
            is_torn: false,
        });
        Ok(last)
    }

    /// Appends whole rows; all of them, or none.
    pub(crate) fn append(&mut self, rows: &[u8]) -> io::Result<()> {
        self.ready()?;
        let Some(open) = self.open.as_mut().filter(|_| !rows.is_empty()) else {
            return Ok(());
        };
        if let Err(error) = open.file.write_all(rows) {
            // Half a row is none; where it cannot be cut off now, that is done before the next one.
            open.is_torn = open.file.set_len(open.end).is_err();
            return Err(error);
        }
        if open.rows == 0 {
            open.first = first_of(rows);
        }
        open.end += rows.len() as u64;
        open.rows += ends(rows);
        Ok(())
    }

    /// Gives the file the name of one that is full, with the day of its last row and its number; what follows goes to another.
    pub(crate) fn rotate(&mut self, last: Instant) -> io::Result<()> {
        self.ready()?;
        let Some(open) = self.open.as_ref().filter(|of| of.rows > 0) else {
            return Ok(());
        };
        open.file.sync_data()?;
        let at = jiff::Timestamp::from_nanosecond(last.as_ns().into()).map_err(io::Error::other)?;
        let name = format!("{}-{:06}", at.strftime("%Y-%m-%d"), self.number);
        fs::rename(&self.path, self.named(&name))?;
        (self.open, self.is_named) = (None, false);
        self.number += 1;
        Ok(())
    }

    /// Where the rows end, once they are on the disk.
    pub(crate) fn end(&mut self) -> io::Result<Place> {
        self.ready()?;
        if !self.is_named {
            let folder = self.path.parent().filter(|of| !of.as_os_str().is_empty());
            sync_folder(folder.unwrap_or(Path::new(".")))?;
            self.is_named = true;
        }
        let open = self.open.as_ref().ok_or(io::ErrorKind::NotFound)?;
        open.file.sync_data()?;
        Ok(Place {
            file: u64::from(self.number) << 32 | u64::from(open.first),
            rows: open.rows,
        })
    }

    /// How many rows stand behind a place, in whichever files; none where it has gone.
    pub(crate) fn rows_after(&mut self, place: Place) -> io::Result<Option<u64>> {
        let behind = self.behind(place)?;
        Ok(behind.map(|files| files.iter().map(|(_, before, rows)| rows - before).sum()))
    }

    /// Cuts back to so many rows behind a place.
    pub(crate) fn cut(&mut self, place: Place, mut rows: u64) -> io::Result<()> {
        for (path, before, all) in self.behind(place)?.unwrap_or_default() {
            let stays = (all - before).min(rows);
            rows -= stays;
            if before + stays == all {
                continue;
            }
            if before + stays == 0 && path != self.path {
                fs::remove_file(path)?;
                continue;
            }
            let (mut reader, mut end) = self.layout.rows(&path)?;
            let mut line = Vec::new();
            for _ in 0..before + stays {
                line.clear();
                end += reader.read_until(b'\n', &mut line)? as u64;
            }
            OpenOptions::new().write(true).open(&path)?.set_len(end)?;
        }
        self.open = None;
        self.ready().map(|_| ())
    }

    /// Removes full files from before a place but for the newest of all.
    pub(crate) fn forget(&self, place: Place, keep: usize) -> io::Result<()> {
        let full = self.full()?;
        let old = full.len().saturating_sub(keep);
        for (_, path) in full.iter().take(old).filter(|of| of.0 < number_of(place)) {
            fs::remove_file(path)?;
        }
        Ok(())
    }

    /// The files with rows behind a place, in order, each with how many of its rows are before it and how many there are.
    fn behind(&mut self, place: Place) -> io::Result<Option<Vec<(PathBuf, u64, u64)>>> {
        self.ready()?;
        let (number, first) = (number_of(place), place.file as u32);
        // Those that were full may have been taken away.
        self.number = self.number.max(number);
        let (mut files, open) = (Vec::new(), self.open.as_ref());
        let is_open = first != 0 && open.is_some_and(|of| of.first == first);
        let full = self
            .full()?
            .into_iter()
            .filter(|of| of.0 >= number && !is_open);
        for (of, path) in full {
            let (rows, found) = self.count(&path)?;
            files.push((path, of, rows, found));
        }
        let (rows, found) = open.map_or((0, 0), |of| (of.rows, of.first));
        files.push((self.path.clone(), self.number, rows, found));
        // A place in a file without rows is the beginning of that, whatever was written then.
        let is_its = |of: &(PathBuf, u32, u64, u32)| of.3 == first || first == 0 && of.1 >= number;
        let nth = match files.iter().position(is_its) {
            Some(nth) => nth,
            None => {
                let Some(moved) = self.moved(first)? else {
                    return Ok(None);
                };
                files.insert(0, moved);
                0
            }
        };
        let mut files: Vec<_> = files.drain(nth..).map(|of| (of.0, 0, of.2)).collect();
        files[0].1 = place.rows;
        Ok((place.rows <= files[0].2).then_some(files))
    }

    /// The file with this first row that another program has moved, to another name that begins the same.
    fn moved(&self, first: u32) -> io::Result<Option<(PathBuf, u32, u64, u32)>> {
        let (folder, stem, _) = self.parts();
        for entry in fs::read_dir(folder)?.flatten() {
            let name = entry.file_name();
            let is_like = name.to_string_lossy().starts_with(&stem);
            if is_like && entry.path() != self.path && entry.path().is_file() {
                let (file, mut row) = (self.layout.rows(&entry.path())?.0, Vec::new());
                file.take(PIECE as u64).read_until(b'\n', &mut row)?;
                if row.ends_with(b"\n") && first_of(&row) == first {
                    let (rows, found) = self.count(&entry.path())?;
                    return Ok(Some((entry.path(), 0, rows, found)));
                }
            }
        }
        Ok(None)
    }

    /// The files that were full, by their numbers.
    fn full(&self) -> io::Result<Vec<(u32, PathBuf)>> {
        let (folder, stem, ending) = self.parts();
        let number = |name: &str| {
            let rest = name.strip_prefix(&stem)?.strip_prefix('-')?;
            let (day, number) = rest.strip_suffix(&ending)?.rsplit_once('-')?;
            day.parse::<jiff::civil::Date>().ok()?;
            number.parse().ok().filter(|_| number.len() >= 6)
        };
        let mut files = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let number = entry.file_name().to_str().and_then(number);
            files.extend(number.map(|number| (number, entry.path())));
        }
        files.sort_unstable();
        Ok(files)
    }

    /// The folder, and the name before and from its last point on.
    fn parts(&self) -> (&Path, String, String) {
        let folder = self.path.parent().filter(|of| !of.as_os_str().is_empty());
        let ending = match self.path.extension() {
            Some(of) => format!(".{}", of.to_string_lossy()),
            None => String::new(),
        };
        let stem = self.path.file_stem().unwrap_or_default();
        let stem = stem.to_string_lossy().into_owned();
        (folder.unwrap_or(Path::new(".")), stem, ending)
    }

    fn named(&self, name: &str) -> PathBuf {
        let (folder, stem, ending) = self.parts();
        folder.join(format!("{stem}-{name}{ending}"))
    }

    /// How many whole rows a file has, and what tells its first one from others.
    fn count(&self, path: &Path) -> io::Result<(u64, u32)> {
        let (mut file, mut row) = (self.layout.rows(path)?.0, Vec::new());
        file.read_until(b'\n', &mut row)?;
        if !row.ends_with(b"\n") {
            return Ok((0, 0));
        }
        let mut rows = 1;
        loop {
            let piece = file.fill_buf()?;
            if piece.is_empty() {
                return Ok((rows, first_of(&row)));
            }
            rows += ends(piece);
            let length = piece.len();
            file.consume(length);
        }
    }
}

fn number_of(place: Place) -> u32 {
    (place.file >> 32) as u32
}

fn ends(bytes: &[u8]) -> u64 {
    bytes.iter().filter(|byte| **byte == b'\n').count() as u64
}

/// What tells the first of these rows from others, and from none.
fn first_of(rows: &[u8]) -> u32 {
    let end = rows.iter().position(|byte| *byte == b'\n');
    let row = &rows[..end.unwrap_or(rows.len())];
    (fnv_1a(row) as u32).max(1)
}

#[cfg(unix)]
fn is_same(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

#[cfg(not(unix))]
fn is_same(_: &Metadata, _: &Metadata) -> bool {
    true
}

/// Cuts off what is left of a line, and gives where whole lines end.
fn whole_lines(file: &mut File) -> io::Result<u64> {
    let length = file.metadata()?.len();
    let mut end = length;
    let mut piece = vec![0; PIECE];
    while end > 0 {
        let from = end.saturating_sub(piece.len() as u64);
        let part = &mut piece[..(end - from) as usize];
        file.seek(SeekFrom::Start(from))?;
        file.read_exact(part)?;
        match part.iter().rposition(|byte| *byte == b'\n') {
            Some(place) => {
                end = from + place as u64 + 1;
                break;
            }
            None => end = from,
        }
    }
    if end < length {
        file.set_len(end)?;
    }
    Ok(end)
}
