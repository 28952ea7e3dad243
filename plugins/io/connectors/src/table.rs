//! Rows of a table into a source's outflow: what all sources that read tables share.

use std::io::Read;
use std::path::Path;

use athermal_core::time::Instant;
use athermal_files::{
    ChannelColumn, FileError, Format, Layout, Options, Reader, Report, Row, TimeColumn,
};
use athermal_serve::connector::{
    ConnectorError, LeftOut, Outflow, SourceWiring, Stop, WiredChannel,
};

/// What is read of a table: the columns that the channels have there.
pub(crate) fn layout(wiring: &SourceWiring) -> Layout {
    let column = |of: &WiredChannel| ChannelColumn {
        column: of.address.clone(),
        optional: of.channel.optional,
        is_instant: of.channel.is_instant,
    };
    Layout {
        time: TimeColumn::from(&wiring.time),
        channels: wiring.channels.iter().map(column).collect(),
        table: wiring.table.clone(),
    }
}

/// How a table is read that goes on while it is read: what cannot be read is left out, counted and reported once.
pub(crate) fn options(format: Option<Format>) -> Options {
    Options {
        format,
        lenient: true,
        goes_on: true,
        ..Options::default()
    }
}

/// A reader of what still grows, which goes on after the newest row that is known.
pub(crate) fn reader(
    name: &str,
    input: impl Read + Send + 'static,
    wiring: &SourceWiring,
    format: Option<Format>,
    known: Option<Instant>,
    out: &Outflow,
) -> Result<Reader, FileError> {
    let mut reader = Reader::from_read(name, input, layout(wiring), options(format))?;
    let remarks = out.remarks().clone();
    reader.report_first(move |first| {
        remarks.report(format_args!(
            "{}; others like it are counted",
            first.without_advice()
        ));
    });
    let stamps = wiring.channels.iter().map(|of| of.after);
    let known = known.or_else(|| stamps.max().filter(|of| *of > Instant::MIN));
    if let Some(known) = known {
        reader.begin_after(known, &known.to_string());
    }
    Ok(reader)
}

/// Hands all rows of a reader on. Gives the instant of the last one.
pub(crate) fn pass(
    reader: &mut Reader,
    out: &mut Outflow,
    stop: &Stop,
    mut before: impl FnMut(Instant) -> bool,
) -> Result<Option<Instant>, ConnectorError> {
    let (mut row, mut last) = (Row::default(), None);
    let mut counted = Counted::default();
    loop {
        let is_row = reader.next_into(&mut row);
        counted.count(reader.report(), out);
        if !is_row.map_err(ConnectorError::new)? {
            break;
        }
        if row.begins_segment {
            out.segment();
        }
        let at = Instant::from_ns(row.time_ns);
        if !before(at) || !out.row(at, &row.values, stop) {
            break;
        }
        last = Some(at);
    }
    Ok(last)
}

/// What a reader left out, as far as it has been counted.
#[derive(Default)]
struct Counted {
    /// Rows and cells.
    all: u64,
    rows: [u64; 3],
    cells: Vec<u64>,
}

impl Counted {
    fn count(&mut self, report: &Report, out: &Outflow) {
        let rows = [
            (&report.refused_rows, LeftOut::Unreadable),
            (&report.refused_time, LeftOut::OutOfOrder),
            (&report.repeated_time, LeftOut::Repeated),
        ];
        let all = report.bad_cells.count + rows.iter().map(|(of, _)| of.count).sum::<u64>();
        if std::mem::replace(&mut self.all, all) == all {
            return;
        }
        for (known, (of, reason)) in self.rows.iter_mut().zip(rows) {
            let new = of.count - std::mem::replace(known, of.count);
            out.left_out(None, reason, new);
        }
        self.cells.resize(report.bad_cells_of.len(), 0);
        let cells = self.cells.iter_mut().zip(&report.bad_cells_of);
        for (channel, (known, of)) in cells.enumerate() {
            let new = of.count - std::mem::replace(known, of.count);
            out.left_out(Some(channel), LeftOut::NoNumber, new);
        }
    }
}

/// A path as a machine file gives it, from the folder of that file.
pub(crate) fn in_folder(folder: &Path, path: &Path) -> std::path::PathBuf {
    folder.join(path)
}
