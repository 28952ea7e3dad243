//! Files that are no text: their kinds, which other crates bring, and their rows as cells. Not how such a file is read.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;

use athermal_core::registry::{Registered, Sort, all, find};

use crate::cells::{Cells, Numbers};
use crate::columns::{self, Columns};
use crate::ledger::Ledger;
use crate::lent::Tables;
use crate::{FileError, Layout, Place, TimeForm};

/// A kind of file that is no text, made known with [`register_file_kind!`](crate::register_file_kind).
#[derive(Debug)]
pub struct FileKind {
    /// How names of such files end, in small letters and without the dot.
    pub endings: &'static [&'static str],
    /// The first bytes of such a file.
    pub mark: &'static [u8],
    /// Opens a file that is there; the error says why it is none.
    pub open: fn(&Path) -> Result<Box<dyn TypedFile>, String>,
    /// Begins to write rows with a column of this name for the time, and these; nothing where the kind is only read.
    #[allow(clippy::type_complexity)] // it is this once
    pub create: Option<fn(File, &str, &[String]) -> Box<dyn TypedSink>>,
}

impl Sort for FileKind {
    const ONE: &'static str = "kind of file";
    const MANY: &'static str = "kinds of files";
}

/// Makes a kind of file known: its name and a [`FileKind`](crate::FileKind).
#[macro_export]
macro_rules! register_file_kind {
    ($name:literal, $kind:expr) => {
        $crate::__private::list!($crate::FileKind, $name, $crate::__private::no_schema, $kind);
    };
}

/// A file whose columns are known, and no row yet.
pub trait TypedFile: Send {
    /// The names of all columns.
    fn names(&self) -> Vec<String>;
    /// The rows from the first on, of some columns.
    ///
    /// # Errors
    /// Why a column cannot be what is wanted of it.
    fn select(self: Box<Self>, wanted: Selection) -> Result<Box<dyn TypedRows>, String>;
}

/// Which columns are read, by their places among the names, and as what.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Selection {
    /// The columns of the time.
    pub time: Vec<usize>,
    /// The columns of numbers; none where a column is not there.
    pub values: Vec<Option<usize>>,
    /// The columns of texts; the same.
    pub texts: Vec<Option<usize>>,
    /// The stretch of time that is asked for: rows outside may be passed over, and need not be. All where there is none.
    pub within: Option<Within>,
}

/// A stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Within {
    /// Its first and its last instant, in ns.
    pub ends: (i64, i64),
    /// Of times that are numbers how many ns one is, and how far before 1970 they begin, in ns.
    pub unit: Option<(i64, i128)>,
}

/// What a cell of the time is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TypedTime<'a> {
    /// An instant in ns since 1970, by UTC or by a clock of which is not said where it stands.
    At {
        /// The instant in ns.
        ns: i64,
        /// Whether it is one of UTC.
        is_utc: bool,
        /// The same as RFC 3339 has it, without the `Z` where it is not known to be one of UTC.
        text: &'a str,
    },
    /// A number or a text, written out; empty where there is none.
    Text(&'a [u8]),
}

/// The rows of a file, one after the other.
pub trait TypedRows: Send {
    /// Goes to the next row; false at the end.
    ///
    /// # Errors
    /// Why there is no more to be read.
    fn advance(&mut self) -> Result<bool, String>;
    /// A cell of the time, by its place in the [`Selection`].
    fn time(&self, index: usize) -> TypedTime<'_>;
    /// The numbers of the row, `NaN` where there is none.
    fn values(&self) -> &[f64];
    /// The numbers that are texts which are none, by their places among the values.
    fn no_numbers(&self) -> &[(usize, String)];
    /// A cell as a text, by its place in the [`Selection`]; empty where there is none.
    fn text(&self, index: usize) -> &[u8];
    /// How many rows of the file were passed over before the one that is given as the `nth`, from 1 on.
    fn passed_over(&self, _nth: u64) -> u64 {
        0
    }
}

/// Takes rows to a file.
pub trait TypedSink: Send {
    /// Writes a row: its instant in ns, its numbers, and where the last column is one of texts that.
    ///
    /// # Errors
    /// The file cannot be written.
    fn write(&mut self, time_ns: i64, values: &[f64], label: Option<&str>) -> io::Result<()>;
    /// Ends the file. Nothing is written behind that; doing it twice does nothing.
    ///
    /// # Errors
    /// The file cannot be written.
    fn finish(&mut self) -> io::Result<()>;
}

/// The kind that the ending of a name says.
pub(crate) fn kind_by_name(path: &Path) -> Option<&'static Registered<FileKind>> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    all::<FileKind>().find(|kind| kind.endings.contains(&ending.as_str()))
}

/// The kind of a file that is there, by its name, else by its first bytes.
fn kind_of(path: &Path) -> Option<&'static Registered<FileKind>> {
    if path == Path::new("-") || crate::Format::of_text(path).is_some() {
        return None;
    }
    kind_by_name(path).or_else(|| {
        let mut kinds = all::<FileKind>().peekable();
        kinds.peek().filter(|_| path.is_file())?;
        let mut first = Vec::new();
        let file = File::open(path).ok()?;
        file.take(16).read_to_end(&mut first).ok()?;
        kinds.find(|kind| first.starts_with(kind.mark))
    })
}

/// Opens what stands at a path, or goes by it in memory, where it is no text.
pub(crate) fn opened(
    path: &Path,
    tables: &Tables,
) -> Option<Result<Box<dyn TypedFile>, FileError>> {
    let unreadable = |reason| failed(path.display().to_string().into(), 0, reason);
    if let Some(table) = tables.open(path) {
        return Some(table.map_err(unreadable));
    }
    let kind = kind_of(path)?;
    if let Err(twice) = find::<FileKind>(kind.name) {
        return Some(Err(FileError::unfit(path, twice.to_string())));
    }
    // What cannot be opened at all says so as every file does.
    let there = File::open(path).map_err(|source| FileError::cannot_open(path, source));
    Some(there.and_then(|_| (kind.open)(path).map_err(unreadable)))
}

fn failed(file: Arc<str>, line: u64, reason: String) -> FileError {
    FileError::Read {
        place: Place { file, line },
        source: Arc::new(io::Error::other(reason)),
    }
}

/// The rows of a file that is no text, as cells.
pub(crate) struct TypedCells {
    file: Arc<str>,
    names: Vec<String>,
    columns: Columns,
    /// How many channels are numbers; those behind them are texts.
    numbers: usize,
    rows: Box<dyn TypedRows>,
    row: u64,
}

impl TypedCells {
    /// Looks the columns of a layout up; those behind the first `numbers` channels are texts. Rows outside of a stretch of time may be
    /// passed over.
    pub fn new(
        path: &Path,
        file: Box<dyn TypedFile>,
        layout: &Layout,
        numbers: usize,
        within: Option<(i64, i64)>,
    ) -> Result<Self, FileError> {
        let unit = match layout.time.form {
            TimeForm::Numbers { ns_per_unit } => Some((ns_per_unit, 0)),
            TimeForm::Samples { step_ns } => Some((step_ns, 0)),
            TimeForm::Since {
                ns_per_unit,
                origin_ns,
            } => Some((ns_per_unit, origin_ns)),
            _ => None,
        };
        let place = Place {
            file: path.display().to_string().into(),
            line: 0,
        };
        let names = columns::numbered(file.names());
        let columns = Columns::of(layout, &names);
        let lacking = columns.lacking(layout);
        if !lacking.is_empty() {
            let ambiguous = columns::ambiguous(place.clone(), &lacking, &names);
            return Err(ambiguous.unwrap_or_else(|| columns::missing(place, lacking, &names, "")));
        }
        let mut channels = layout.channels.iter().zip(&columns.channels);
        if let Some((of, _)) = channels.find(|(of, at)| of.is_instant && at.is_some()) {
            let reason = format!(
                "`{}`: when a plan applies is read from CSV and JSON lines alone",
                of.column
            );
            return Err(FileError::unfit(path, reason));
        }
        let within = within.map(|ends| Within { ends, unit });
        Self::of(path, file, names, columns, numbers, within)
    }

    /// All columns as texts.
    pub fn of_texts(path: &Path, file: Box<dyn TypedFile>) -> Result<Self, FileError> {
        let names = columns::numbered(file.names());
        let columns = Columns {
            time: Vec::new(),
            channels: (0..names.len()).map(Some).collect(),
        };
        Self::of(path, file, names, columns, 0, None)
    }

    fn of(
        path: &Path,
        file: Box<dyn TypedFile>,
        names: Vec<String>,
        columns: Columns,
        numbers: usize,
        within: Option<Within>,
    ) -> Result<Self, FileError> {
        let (values, texts) = columns.channels.split_at(numbers);
        let wanted = Selection {
            time: columns.time.iter().flatten().copied().collect(),
            values: values.to_vec(),
            texts: texts.to_vec(),
            within,
        };
        let rows = file.select(wanted);
        Ok(Self {
            file: path.display().to_string().into(),
            names,
            columns,
            numbers,
            rows: rows.map_err(|reason| FileError::unfit(path, reason))?,
            row: 0,
        })
    }

    /// Which channels have a column.
    pub fn present(&self) -> Vec<bool> {
        let channels = self.columns.channels.iter();
        channels.map(Option::is_some).collect()
    }

    /// The names of the columns.
    pub fn names(&self) -> &[String] {
        &self.names
    }
}

impl Cells for TypedCells {
    fn advance(&mut self, _ledger: &mut Ledger) -> Result<bool, FileError> {
        let is_there = self.rows.advance();
        let is_there = is_there.map_err(|reason| failed(self.file.clone(), self.row, reason))?;
        self.row += u64::from(is_there);
        Ok(is_there)
    }

    fn time(&self, column: usize) -> &[u8] {
        match self.rows.time(column) {
            TypedTime::Text(text) => text,
            TypedTime::At { text, .. } => text.as_bytes(),
        }
    }

    fn channel(&self, index: usize) -> &[u8] {
        match index.checked_sub(self.numbers) {
            Some(index) => self.rows.text(index),
            None => &[],
        }
    }

    fn place(&self) -> Place {
        Place {
            file: self.file.clone(),
            line: self.row + self.rows.passed_over(self.row),
        }
    }

    fn instant(&self) -> Option<(i64, bool, &str)> {
        match self.rows.time(0) {
            TypedTime::At { ns, is_utc, text } if self.columns.time.len() == 1 => {
                Some((ns, is_utc, text))
            }
            _ => None,
        }
    }

    fn numbers(&self) -> Option<Numbers<'_>> {
        (self.numbers > 0).then(|| (self.rows.values(), self.rows.no_numbers()))
    }
}
