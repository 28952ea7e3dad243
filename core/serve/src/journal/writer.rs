//! The journal thread: encodes, writes, begins the next file, and starts again after a failure.

use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration as Wait, Instant as Clock};

use rtrb::Consumer;

use super::begin::kept;
use super::log::files;
use super::recorder::{Message, Resume};
use super::sync::{Mark, Syncer};
use super::{Begin, JournalError, JournalOptions, Progress, Record, segment};
use crate::folder::may_pass;
use crate::sequencer::Timeline;
use crate::time::Instant;

/// How many bytes are written at once at most, so that a long queue is not kept back.
const BATCH: usize = 256 << 10;
/// How long the thread sleeps at most where nothing is due and nobody wakes it.
const IDLE: Wait = Wait::from_secs(10);
static ZEROS: [u8; 64 << 10] = [0; 64 << 10];

/// What prepares the folder.
pub(super) type Prepare = Box<dyn FnMut() -> io::Result<()> + Send>;

/// Writes the journal.
pub(super) struct Writer {
    /// What is to be done before the first file is made, and the files that were there then; none once it is made.
    before: Option<(Prepare, Vec<(u64, PathBuf)>)>,
    folder: PathBuf,
    options: JournalOptions,
    messages: Consumer<Message>,
    progress: Arc<Progress>,
    /// None after a failure, until the log is taken up again.
    file: Option<Open>,
    /// What the next file begins with.
    begin: Begin,
    timeline: Timeline,
    syncer: Syncer,
    asked: Clock,
    failed: Clock,
    bytes: Vec<u8>,
}

/// The file that is written.
#[derive(Debug)]
struct Open {
    file: File,
    /// Its number in this run.
    number: u64,
    at: u64,
    /// Up to where it has been filled with zeros.
    filled: u64,
    /// All records below this number have been asked to be synced.
    asked: u64,
}

impl Writer {
    pub(super) fn begin(
        prepare: Prepare,
        folder: &Path,
        begin: Begin,
        options: JournalOptions,
        messages: Consumer<Message>,
        progress: Arc<Progress>,
    ) -> Result<Self, JournalError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |error| JournalError::NotWritten { path, error }
        };
        let path = folder.join(segment::name(begin.event));
        let mut writer = Self {
            before: Some((prepare, files(folder).unwrap_or_default())),
            folder: folder.to_owned(),
            options,
            messages,
            progress,
            timeline: begin.timeline(),
            file: None,
            begin,
            syncer: Syncer::start().map_err(failed(folder))?,
            asked: Clock::now(),
            failed: Clock::now(),
            bytes: Vec::with_capacity(2 * BATCH),
        };
        match writer.create() {
            Err(error) if may_pass(&error) => writer.fail(&error),
            created => created.map_err(failed(&path))?,
        }
        Ok(writer)
    }

    /// Writes until the other end is gone and all of it has been written.
    pub(super) fn run(mut self) {
        let mut is_woken = false;
        loop {
            let is_abandoned = self.messages.is_abandoned();
            let is_idle = self.take() == 0;
            let written = self.write().and_then(|()| self.sync_now_and_then());
            if let Err(error) = written {
                self.fail(&error);
            }
            if self.progress.failed() && self.failed.elapsed() >= self.options.retry {
                self.progress.try_again();
            }
            if is_idle && is_abandoned {
                break;
            }
            // Whose samples were written before may know so only now.
            if !is_idle || is_woken {
                self.progress.ring();
            }
            is_woken = is_idle;
            if is_idle {
                std::thread::park_timeout(self.due());
            }
        }
        if let Err(error) = self.seal() {
            self.progress.fail(&error);
        }
        self.progress.ring();
    }

    /// How long until something is due.
    fn due(&self) -> Wait {
        let left = |whole: Wait, since: Clock| whole.saturating_sub(since.elapsed());
        let is_unsynced = |of: &Open| of.asked < self.begin.event;
        let syncs = self.file.as_ref().is_some_and(is_unsynced) && !self.syncer.is_busy();
        let sync = syncs.then(|| left(self.options.sync, self.asked));
        let failed = self.progress.failed();
        let retry = failed.then(|| left(self.options.retry, self.failed));
        sync.into_iter().chain(retry).fold(IDLE, Wait::min)
    }

    /// Takes what has come, and encodes it. Returns how many messages there were.
    fn take(&mut self) -> usize {
        let mut taken = 0;
        let room = |of: &Open| (self.options.file.saturating_sub(of.at) as usize).min(BATCH);
        let room = self.file.as_ref().map_or(BATCH, room);
        while self.bytes.len() < room.max(1)
            && let Ok(message) = self.messages.pop()
        {
            taken += 1;
            match message {
                Message::Record(event, record) if self.file.is_some() => {
                    segment::append(&mut self.bytes, event, &record);
                    self.apply(event, &record);
                }
                // Nothing follows on what was lost, until the log is taken up again.
                Message::Record(..) => self.progress.lose(1),
                Message::Resume(resume) => self.resume(resume),
                Message::Stamp(channel, stamp) => {
                    if let Some(of) = self.begin.stamps.get_mut(channel as usize) {
                        *of = stamp;
                    }
                }
                Message::Offset(source, offset) => {
                    if let Some(of) = self.begin.offsets.get_mut(source as usize) {
                        *of = Some(offset.as_ns());
                    }
                }
                Message::Lag(source, least) => {
                    if let Some(of) = self.begin.lags.get_mut(source as usize) {
                        *of = Some(least.as_ns());
                    }
                }
                Message::Pending(of) => self.begin.pending.push(kept(&of)),
                Message::Waiting(of) => self.begin.waiting.push(kept(&of)),
                Message::Resumed => self.resumed(),
            }
        }
        taken
    }

    /// Does to what the next file begins with what a record did to the log.
    fn apply(&mut self, event: u64, record: &Record) {
        self.begin.event = event + 1;
        self.begin.happenings += u64::from(record.is_happening());
        match record {
            Record::Freeze(frozen) => self.begin.frozen = *frozen,
            Record::Swap { revision } => self.begin.revision = format!("{revision:016x}"),
            _ => {}
        }
        record.apply(&mut self.timeline);
    }

    /// Writes what has been encoded, into the next file where this one is full.
    fn write(&mut self) -> io::Result<()> {
        if self.bytes.is_empty() {
            return Ok(());
        }
        let Some(open) = &mut self.file else {
            self.bytes.clear();
            return Ok(());
        };
        open.append(&self.bytes, self.options.ahead)?;
        self.bytes.clear();
        let is_full = open.at >= self.options.file;
        self.progress.set_written(self.begin.event);
        if is_full {
            self.progress.ring();
            self.seal()?;
            self.begin.after_failure = false;
            self.open_next()?;
        }
        Ok(())
    }

    fn sync_now_and_then(&mut self) -> io::Result<()> {
        if let Some((mark, result)) = self.syncer.result()
            && self.file.as_ref().is_some_and(|of| of.number == mark.file)
        {
            result?;
            self.progress.set_synced(mark.event, mark.happenings);
            segment::append_synced(&mut self.bytes, mark.offset);
            self.write()?;
        }
        let event = self.begin.event;
        if let Some(open) = &mut self.file
            && open.asked < event
            && self.asked.elapsed() >= self.options.sync * 9 / 10
        {
            let mark = Mark {
                file: open.number,
                offset: open.at,
                event,
                happenings: self.begin.happenings,
            };
            if self.syncer.ask(&open.file, mark)? {
                open.asked = event;
                self.asked = Clock::now();
            }
        }
        Ok(())
    }

    /// Cuts the file to what is written, and syncs it, which stands behind it: what is damaged later is no torn end.
    fn seal(&mut self) -> io::Result<()> {
        if let Some(mut open) = self.file.take() {
            open.file.set_len(open.at)?;
            open.file.sync_all()?;
            let mut mark = Vec::new();
            segment::append_synced(&mut mark, open.at);
            open.file.write_all(&mark)?;
            self.progress
                .set_synced(self.begin.event, self.begin.happenings);
        }
        Ok(())
    }

    fn open_next(&mut self) -> io::Result<()> {
        self.begin.set(&self.timeline);
        self.create()
    }

    fn create(&mut self) -> io::Result<()> {
        static NUMBER: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(1);
        if let Some((prepare, known)) = &mut self.before {
            prepare()?;
            fs::create_dir_all(&self.folder)?;
            remove_unfinished(&self.folder)?;
            let there = files(&self.folder).map_err(io::Error::other)?;
            if there.iter().any(|of| !known.contains(of)) {
                let words = "it holds a journal that was not there when the service started: start it again";
                return Err(io::Error::other(words));
            }
        }
        let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.file = Some(Open::create(&self.folder, &self.begin, number)?);
        self.before = None;
        Ok(())
    }

    /// Gives the file up: what was not written of it is lost, and a sync that failed is not tried again.
    fn fail(&mut self, error: &io::Error) {
        if self.file.take().is_some() {
            let unwritten = self.begin.event - self.progress.written();
            self.progress.lose(unwritten);
        }
        self.bytes.clear();
        self.failed = Clock::now();
        self.progress.fail(error);
    }

    fn resume(&mut self, resume: Resume) {
        if let Err(error) = self.write().and_then(|()| self.seal()) {
            self.fail(&error);
        }
        let begin = &mut self.begin;
        begin.event = resume.event;
        begin.happenings = resume.happenings;
        begin.frozen = resume.frozen;
        begin.last = resume.last;
        begin.stamps.fill(Instant::MIN);
        begin.stamps.resize(begin.feed.channels.len(), Instant::MIN);
        begin.offsets.fill(None);
        begin.offsets.resize(begin.feed.sources.len(), None);
        begin.lags.fill(None);
        begin.lags.resize(begin.feed.sources.len(), None);
        begin.pending.clear();
        begin.waiting.clear();
    }

    /// Goes on in another file. The one before stays as it is.
    fn resumed(&mut self) {
        self.begin.after_failure = true;
        self.timeline = self.begin.timeline();
        match self.create() {
            Ok(()) => self.progress.set_written(self.begin.event),
            Err(error) => self.fail(&error),
        }
    }
}

impl Open {
    /// Makes a file with its beginning; it has its name once that is on the disk.
    fn create(folder: &Path, begin: &Begin, number: u64) -> io::Result<Self> {
        let path = folder.join(segment::name(begin.event));
        let aside = path.with_extension("part");
        let mut file = File::create(&aside)?;
        let header = segment::header(begin);
        file.write_all(&header)?;
        file.sync_all()?;
        fs::rename(&aside, &path)?;
        sync_folder(folder)?;
        let at = header.len() as u64;
        Ok(Self {
            file,
            number,
            at,
            filled: at,
            asked: begin.event,
        })
    }

    /// Writes behind what is there. The room is made before, so that a full disk is noticed between two records.
    fn append(&mut self, bytes: &[u8], ahead: u64) -> io::Result<()> {
        let end = self.at + bytes.len() as u64;
        if end > self.filled {
            let to = end + ahead;
            self.file.seek(SeekFrom::Start(self.filled))?;
            while self.filled < to {
                let piece = (to - self.filled).min(ZEROS.len() as u64);
                self.file.write_all(&ZEROS[..piece as usize])?;
                self.filled += piece;
            }
            self.file.seek(SeekFrom::Start(self.at))?;
        }
        self.file.write_all(bytes)?;
        self.at = end;
        Ok(())
    }
}

/// Removes what was to become a file when the program ended.
fn remove_unfinished(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path
            .extension()
            .is_some_and(|extension| extension == "part")
        {
            fs::remove_file(path)?;
        }
    }
    Ok(())
}

/// Makes the names in a folder last.
///
/// # Errors
/// When the folder cannot be opened or written.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}
