//! A recording of what can be read only once: its events are kept for those who read it again, in memory and beyond that in a file.

use std::cell::{OnceCell, RefCell};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek as _, Write};

use athermal_core::compile::Plan;
use athermal_core::time::Instant;
use athermal_run::recording::{Event, Recording, Samples, Source, SourceError};

/// What stands before a row and before a segment.
const ROW: u8 = 0;
const SEGMENT: u8 = 1;

/// What is read once, as a recording that is read as often as needed, of one graph.
///
/// The first reading is of the source itself; all that it gives is kept. Up to so many bytes are kept in memory; beyond that all go to a
/// file without a name, which is gone with the program.
pub struct Once<'a> {
    source: RefCell<Option<Box<dyn Source + 'a>>>,
    memory: usize,
    /// What was kept, once the source has been read to its end.
    kept: OnceCell<Kept>,
}

impl<'a> Once<'a> {
    /// Keeps up to so many bytes in memory.
    #[must_use]
    pub fn new(source: Box<dyn Source + 'a>, memory: usize) -> Self {
        Self {
            source: RefCell::new(Some(source)),
            memory,
            kept: OnceCell::new(),
        }
    }
}

impl Recording for Once<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        if let Some(source) = self.source.borrow_mut().take() {
            return Ok(Box::new(First {
                source,
                memory: self.memory,
                keeping: Kept::Memory(Vec::new()),
                kept: &self.kept,
            }));
        }
        let from: Box<dyn Read + '_> = match self.kept.get() {
            None => return Err("what can be read only once was not read to its end before".into()),
            Some(Kept::Memory(bytes)) => Box::new(bytes.as_slice()),
            Some(Kept::File(file)) => {
                // All readers share one place in the file; no two read at the same time.
                let mut file = file.get_ref().try_clone()?;
                file.rewind()?;
                Box::new(BufReader::with_capacity(1 << 16, file))
            }
        };
        let width = plan.sources.len();
        Ok(Box::new(Again { from, width }))
    }
}

enum Kept {
    Memory(Vec<u8>),
    File(BufWriter<File>),
}

impl Kept {
    fn keep(&mut self, event: Event, samples: &Samples, memory: usize) -> io::Result<()> {
        match self {
            Self::Memory(bytes) => {
                write(bytes, event, samples)?;
                if bytes.len() > memory {
                    let mut file = BufWriter::with_capacity(1 << 16, tempfile::tempfile()?);
                    file.write_all(bytes)?;
                    *self = Self::File(file);
                }
                Ok(())
            }
            Self::File(file) => write(file, event, samples),
        }
    }

    fn end(mut self) -> io::Result<Self> {
        if let Self::File(file) = &mut self {
            file.flush()?;
        }
        Ok(self)
    }
}

fn write(to: &mut impl Write, event: Event, samples: &Samples) -> io::Result<()> {
    match event {
        Event::Segment => to.write_all(&[SEGMENT]),
        Event::Row(time) => {
            to.write_all(&[ROW])?;
            to.write_all(&time.as_ns().to_le_bytes())?;
            let mut values = samples.values.iter();
            values.try_for_each(|value| to.write_all(&value.to_le_bytes()))
        }
    }
}

/// The reading of the source itself.
struct First<'a, 's> {
    source: Box<dyn Source + 's>,
    memory: usize,
    keeping: Kept,
    kept: &'a OnceCell<Kept>,
}

impl Source for First<'_, '_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let next = self.source.next(samples)?;
        match next {
            Some(event) => self.keeping.keep(event, samples, self.memory)?,
            None => {
                let keeping = std::mem::replace(&mut self.keeping, Kept::Memory(Vec::new()));
                // Asked once more at its end, a source has nothing new to keep.
                let _ = self.kept.set(keeping.end()?);
            }
        }
        Ok(next)
    }
}

/// The reading of what was kept.
struct Again<'a> {
    from: Box<dyn Read + 'a>,
    width: usize,
}

impl Source for Again<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let (mut mark, mut word) = ([0], [0; 8]);
        if self.from.read(&mut mark)? == 0 {
            return Ok(None);
        }
        if mark == [SEGMENT] {
            return Ok(Some(Event::Segment));
        }
        self.from.read_exact(&mut word)?;
        let time = Instant::from_ns(i64::from_le_bytes(word));
        samples.time_text.clear();
        samples.values.clear();
        for _ in 0..self.width {
            self.from.read_exact(&mut word)?;
            samples.values.push(f64::from_le_bytes(word));
        }
        Ok(Some(Event::Row(time)))
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::compile::{Wanted, compile};
    use athermal_core::diagnostic::{Diagnostics, Sources};
    use athermal_core::document::{self, Disk};
    use athermal_run::recording::Table;

    use super::*;

    fn plan() -> Plan {
        let text = "schema = 1\n[time]\ncolumn = \"t\"\n[signals.x]\nunit = \"1\"\nchannels = [\"a\", \"b\"]\n[outputs]\nof = \"x\"\n";
        let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
        let graph = document::load_text("x.toml", text, &Disk, &mut sources, &mut diagnostics)
            .and_then(|read| document::declare(read, &mut diagnostics));
        let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
        plan.unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 200)))
    }

    #[test]
    fn what_came_once_is_read_again_from_memory_and_from_a_file() {
        let plan = plan();
        let mut table = Table::default();
        for nth in 0..1000_i64 {
            if nth == 500 {
                table.segment();
            }
            let absent = if nth % 3 == 0 { f64::NAN } else { 0.5 };
            table.push(Instant::from_ns(nth), &[nth as f64, absent]);
        }
        let texts = |table: &Table| format!("{:?}", table.events());
        for memory in [1 << 20, 100] {
            let once = Once::new(table.open(&plan).unwrap(), memory);
            for _ in 0..3 {
                let read = Table::read(&once, &plan).unwrap();
                assert_eq!(texts(&read), texts(&table));
            }
            assert_eq!(
                matches!(once.kept.get(), Some(Kept::File(_))),
                memory == 100
            );
        }
    }

    #[test]
    fn what_was_not_read_to_its_end_cannot_be_read_again() {
        let plan = plan();
        let mut table = Table::default();
        table.push(Instant::from_ns(0), &[1.0, 2.0]);
        let once = Once::new(table.open(&plan).unwrap(), 100);
        drop(once.open(&plan).unwrap());
        assert!(once.open(&plan).is_err());
    }
}
