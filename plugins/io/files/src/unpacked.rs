//! What packs a text: gzip is unpacked as it is read, and what holds no text is named for what it is. Not how a text is written.

use std::error::Error;
use std::fmt;
use std::io::{self, Cursor, Read};

use flate2::read::MultiGzDecoder;

type Input = Box<dyn Read + Send>;

/// The first bytes of gzip.
const GZIP: &[u8] = &[0x1f, 0x8b];

/// The first bytes of what is no text, with what it is and what to do.
const KINDS: [(&[u8], &str); 10] = [
    (
        &[0x28, 0xb5, 0x2f, 0xfd],
        "is compressed with zstd, which is not read; unpack it with `zstd -d`, or pack it with gzip",
    ),
    (
        b"PAR1\x15",
        "is Parquet, which is not read as text; build with `--features parquet`, which reads it from a file, or export it as CSV, in pandas by `read_parquet(…).to_csv(…)`",
    ),
    (
        &[0x50, 0x4b, 3, 4],
        "is a zip archive, as spreadsheets save themselves (.xlsx, .ods); unpack it, or export the sheet as CSV",
    ),
    (
        &[0x89, 0x48, 0x44, 0x46],
        "is HDF5, which is not read; export its table as CSV",
    ),
    (
        &[0xd0, 0xcf, 0x11, 0xe0],
        "is a spreadsheet of the old kind (.xls); export the sheet as CSV",
    ),
    (
        b"SQLite format 3",
        "is a database of SQLite; export its table as CSV, as `sqlite3 -header -csv` does",
    ),
    (
        b"TDSm",
        "is TDMS of LabVIEW, which is not read; export it as CSV or .lvm",
    ),
    (
        b"MATLAB 5.0 MAT-file",
        "is a file of MATLAB, which is not read; export it as CSV, as `writetimetable` does",
    ),
    (
        &[0xfd, 0x37, 0x7a, 0x58, 0x5a],
        "is compressed with xz, which is not read; unpack it with `xz -d`, or pack it with gzip",
    ),
    (
        b"BZh",
        "is compressed with bzip2, which is not read; unpack it with `bunzip2`, or pack it with gzip",
    ),
];

/// What a file is that holds no table of text.
#[derive(Debug)]
pub(crate) struct NoText(pub &'static str);

impl fmt::Display for NoText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

impl Error for NoText {}

/// A stream as text, unpacked where it is packed.
pub(crate) enum Unpacked {
    /// Nothing was read of it yet.
    New(Input),
    /// What it is was found by its first bytes.
    Found(Input),
}

impl Unpacked {
    fn found(mut input: Input) -> io::Result<Input> {
        let mut first: Vec<u8> = Vec::new();
        let known = || KINDS.iter().map(|(mark, _)| *mark).chain([GZIP]);
        let mut byte = [0];
        // Of text no more is waited for than what differs from all marks.
        while known().any(|mark| first.len() < mark.len() && mark.starts_with(&first)) {
            match input.read(&mut byte) {
                Ok(0) => break,
                Ok(_) => first.extend(byte),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        if let Some((_, what)) = KINDS.iter().find(|(mark, _)| first.starts_with(mark)) {
            return Err(io::Error::other(NoText(what)));
        }
        let is_packed = first.starts_with(GZIP);
        let whole = Cursor::new(first).chain(input);
        Ok(match is_packed {
            true => Box::new(MultiGzDecoder::new(whole)),
            false => Box::new(whole),
        })
    }
}

impl Read for Unpacked {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if let Self::New(input) = self {
            let input = std::mem::replace(input, Box::new(io::empty()));
            *self = Self::Found(Self::found(input)?);
        }
        match self {
            Self::New(input) | Self::Found(input) => input.read(buffer),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

    fn read(bytes: &[u8]) -> io::Result<Vec<u8>> {
        let mut all = Vec::new();
        Unpacked::New(Box::new(Cursor::new(bytes.to_vec()))).read_to_end(&mut all)?;
        Ok(all)
    }

    #[test]
    fn gzip_is_unpacked_piece_by_piece_and_text_is_left_alone() {
        let packed = |text: &[u8]| {
            let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
            packer.write_all(text).unwrap();
            packer.finish().unwrap()
        };
        let two = [packed(b"t,a\n0,1\n"), packed(b"1,2\n")].concat();
        assert_eq!(read(&two).unwrap(), b"t,a\n0,1\n1,2\n");
        for text in [
            &b""[..],
            b"t,a\n",
            b"P",
            b"PAR1,x",
            b"BZ,x",
            b"SQLite,x",
            b"(\xb5",
        ] {
            assert_eq!(read(text).unwrap(), text);
        }
        assert!(read(&two[..20]).is_err());
    }

    #[test]
    fn what_is_no_text_is_named() {
        for (bytes, name) in [
            (&b"PAR1\x15\x04"[..], "Parquet"),
            (&[0x28, 0xb5, 0x2f, 0xfd, 0, 1], "zstd"),
            (&[0x50, 0x4b, 3, 4], "zip"),
            (&[0xd0, 0xcf, 0x11, 0xe0], "spreadsheet"),
        ] {
            let error = read(bytes).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}
