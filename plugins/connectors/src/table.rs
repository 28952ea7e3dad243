//! Rows of a table into a source's outflow: what all sources that read tables share.

use std::io::Read;
use std::path::Path;

use athermal_core::time::Instant;
use athermal_files::{ChannelColumn, FileError, Format, Layout, Options, Reader, Row, TimeColumn};
use athermal_serve::connector::{ConnectorError, Outflow, SourceWiring, Stop, WiredChannel};

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
    while reader.next_into(&mut row).map_err(ConnectorError::new)? {
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

/// A path as a machine file gives it, from the folder of that file.
pub(crate) fn in_folder(folder: &Path, path: &Path) -> std::path::PathBuf {
    folder.join(path)
}
