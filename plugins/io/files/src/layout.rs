//! What is wanted from a recording: which columns give time, and which channels. Not where they stand in a file.

use std::path::Path;

use athermal_core::document::{TableBase, TableFormat};
use athermal_core::time::{TimeColumns, TimeFormat, Zone};

/// The columns to read, by name; a column that is not named here is skipped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// What gives the instant of each row.
    pub time: TimeColumn,
    /// The columns that give values, in the order of [`Row::values`](crate::Row::values).
    pub channels: Vec<ChannelColumn>,
    /// How the text is laid out, as far as that is declared.
    pub table: TableBase,
}

/// What gives the instant of each row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TimeColumn {
    /// The column (CSV) or key (JSON lines), or several whose cells are put together.
    pub columns: TimeColumns,
    /// How the text of a time is written.
    pub form: TimeForm,
    /// Whose clock dates and times are read from that have no offset from UTC; none for UTC itself.
    pub zone: Option<Zone>,
}

impl TimeColumn {
    /// How what was written from such rows gives their instants: their whole text in one column.
    #[must_use]
    pub fn written(&self) -> Self {
        Self {
            columns: TimeColumns::one(self.columns.title()),
            form: self.form.clone(),
            zone: self.zone.clone(),
        }
    }
}

/// How an instant is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TimeForm {
    /// Decimal numbers of a unit, read exactly and rounded to the nearest nanosecond: `0.3`, `1e3`.
    Numbers {
        /// Nanoseconds in one unit: 1,000,000,000 for seconds, 1,000,000 for milliseconds.
        ns_per_unit: i64,
    },
    /// RFC 3339 text such as `2013-07-04T00:00:00Z`, or without an offset: `2013-07-04 00:00:00`, `2013-07-04`.
    /// Nanoseconds then count from 1970-01-01T00:00:00Z.
    Rfc3339,
    /// Dates and times in another form, such as `04.07.2013 00:00:00`.
    Format(TimeFormat),
    /// Hours, minutes and seconds since a beginning, with days before them or without: `29:59:00`, `1.05:59:00`, `1 day, 5:59:00`.
    Elapsed,
    /// Decimal numbers of a unit that count from another origin than 1970, as Julian days do.
    Since {
        /// Nanoseconds in one unit.
        ns_per_unit: i64,
        /// How far before 1970 the origin lies, in ns.
        origin_ns: i128,
    },
    /// Whole sample numbers, a fixed time apart.
    Samples {
        /// Nanoseconds from one sample to the next.
        step_ns: i64,
    },
}

impl TimeForm {
    /// Decimal numbers of seconds.
    pub const SECONDS: Self = Self::Numbers {
        ns_per_unit: 1_000_000_000,
    };
}

/// A column that gives the values of one channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelColumn {
    /// The name of the column (CSV) or key (JSON lines).
    pub column: String,
    /// Whether the data may lack the column; the channel is then absent throughout.
    pub optional: bool,
    /// Whether its cells are instants, written as the times of rows are; the values are seconds.
    pub is_instant: bool,
}

impl Layout {
    /// A layout with one column of time, in which every channel column must be there.
    pub fn new<C: Into<String>>(
        time: impl Into<String>,
        form: TimeForm,
        channels: impl IntoIterator<Item = C>,
    ) -> Self {
        let channels = channels
            .into_iter()
            .map(|column| ChannelColumn {
                column: column.into(),
                optional: false,
                is_instant: false,
            })
            .collect();
        Self {
            time: TimeColumn {
                columns: TimeColumns::one(time),
                form,
                zone: None,
            },
            channels,
            table: TableBase::default(),
        }
    }

    /// What is declared of a file.
    #[must_use]
    pub fn table_of(&self, path: &Path) -> &TableFormat {
        let name = path.file_name().unwrap_or_default();
        self.table.of(&name.to_string_lossy())
    }

    /// The same by the names that columns have in a file.
    pub(crate) fn in_file(&self, table: &TableFormat) -> Self {
        let mut own = self.clone();
        if !table.rename.is_empty() {
            for channel in &mut own.channels {
                channel.column = table.in_file(&channel.column).into_owned();
            }
            let times = own.time.columns;
            own.time.columns = times.renamed(|name| table.in_file(name).into_owned());
        }
        own
    }

    /// Leaves out the columns that are declared for segments and machines.
    pub(crate) fn without_segments(&mut self) {
        let files = self.table.files.iter_mut().map(|(_, table)| table);
        for table in files.chain([&mut self.table.base]) {
            (table.segment, table.machine, table.only) = (None, None, None);
        }
    }

    /// The names of all columns wanted, time first.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> + Clone {
        let time = self.time.columns.names().iter().map(String::as_str);
        time.chain(self.channels.iter().map(|c| c.column.as_str()))
    }
}
