//! Workers, each a process of its own: one that runs out of memory or dies takes no other with it. Not what they do.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use crate::job::{Job, Reply, Setup};

/// How often a job is tried whose worker dies.
const TRIES: u32 = 2;

static PROGRAM: OnceLock<Vec<OsString>> = OnceLock::new();

/// Says how this program is started once more, for its workers: an executable, and what stands before the words of a command, as in
/// `python -m athermal`. Else it is the executable of this process.
pub fn started_by(words: Vec<OsString>) {
    // A process is one program; whoever says it twice says the same.
    let _ = PROGRAM.set(words);
}

fn program() -> io::Result<Command> {
    let Some((executable, words)) = PROGRAM.get().and_then(|words| words.split_first()) else {
        return std::env::current_exe().map(Command::new);
    };
    let mut command = Command::new(executable);
    command.args(words);
    Ok(command)
}

/// What the pool reports.
#[derive(Debug)]
pub enum Event {
    /// Nothing happened for a second.
    Waiting,
    /// A worker died of a job, which is given to another.
    Died {
        /// The machine.
        machine: String,
        /// How it ended.
        how: String,
    },
    /// A job is done.
    Done {
        /// The job.
        job: Job,
        /// What came of it.
        reply: Reply,
    },
}

/// Has jobs done by so many workers at a time. `look` sees each as it ends, in any order; where it fails nothing more is begun.
///
/// # Errors
/// What `look` gave, or that no worker could be started.
pub fn run<E: From<io::Error>>(
    setup: &Setup,
    workers: usize,
    jobs: Vec<Job>,
    mut look: impl FnMut(Event) -> Result<(), E>,
) -> Result<(), E> {
    let workers = workers.clamp(1, jobs.len().max(1));
    let first = serde_json::to_string(setup).map_err(io::Error::from)? + "\n";
    let queue = Mutex::new(VecDeque::from(jobs));
    let (sender, events) = channel();
    std::thread::scope(|scope| {
        for _ in 0..workers {
            let (sender, queue, first) = (sender.clone(), &queue, &*first);
            scope.spawn(move || {
                Slot {
                    first,
                    worker: None,
                }
                .work(queue, &sender)
            });
        }
        drop(sender);
        let mut failed = None;
        loop {
            let event = match events.recv_timeout(Duration::from_secs(1)) {
                Ok(event) => event,
                Err(RecvTimeoutError::Timeout) => Ok(Event::Waiting),
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let looked = match event {
                Ok(_) if failed.is_some() => Ok(()),
                Ok(event) => look(event),
                Err(error) => Err(error.into()),
            };
            if let Err(error) = looked {
                lock(&queue).clear();
                failed.get_or_insert(error);
            }
        }
        failed.map_or(Ok(()), Err)
    })
}

fn lock(queue: &Mutex<VecDeque<Job>>) -> MutexGuard<'_, VecDeque<Job>> {
    queue.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A place for a worker.
struct Slot<'a> {
    first: &'a str,
    worker: Option<Worker>,
}

struct Worker {
    child: Child,
    jobs: ChildStdin,
    replies: BufReader<ChildStdout>,
}

impl Slot<'_> {
    fn work(mut self, queue: &Mutex<VecDeque<Job>>, events: &Sender<io::Result<Event>>) {
        loop {
            let job = lock(queue).pop_front();
            let Some(job) = job else {
                break;
            };
            let event = self.done(job, events);
            if events.send(event).is_err() {
                break;
            }
        }
        if let Some(worker) = self.worker.take() {
            let _ = worker.end();
        }
    }

    fn done(&mut self, job: Job, events: &Sender<io::Result<Event>>) -> io::Result<Event> {
        let line = serde_json::to_string(&job)? + "\n";
        let mut nth = 1;
        loop {
            let worker = match self.worker.take() {
                Some(worker) => worker,
                None => Worker::start(self.first)?,
            };
            match worker.answer(&line) {
                Ok((reply, worker)) => {
                    self.worker = Some(worker);
                    return Ok(Event::Done { job, reply });
                }
                Err(how) if nth == TRIES => {
                    let error = format!(
                        "its worker {how}, {TRIES} times: is memory short? `--jobs` and `--memory` bound what is used"
                    );
                    let reply = Reply::Failed { error };
                    return Ok(Event::Done { job, reply });
                }
                Err(how) => {
                    let machine = job.machine.clone();
                    let _ = events.send(Ok(Event::Died { machine, how }));
                    nth += 1;
                }
            }
        }
    }
}

impl Worker {
    fn start(first: &str) -> io::Result<Self> {
        let mut child = program()?
            .args(["fleet", "worker"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let pipes = child.stdin.take().zip(child.stdout.take());
        let (mut jobs, replies) = pipes.ok_or_else(|| io::Error::other("a worker has no pipes"))?;
        // One that has died already says so when it is asked.
        let _ = jobs.write_all(first.as_bytes());
        Ok(Self {
            child,
            jobs,
            replies: BufReader::new(replies),
        })
    }

    /// What it answers; how it ended where it did not.
    fn answer(mut self, line: &str) -> Result<(Reply, Self), String> {
        let asked = self.jobs.write_all(line.as_bytes());
        let asked = asked.and_then(|()| self.jobs.flush());
        let mut reply = String::new();
        let read = asked.and_then(|()| self.replies.read_line(&mut reply));
        match (read, serde_json::from_str(&reply)) {
            (Ok(_), Ok(reply)) => Ok((reply, self)),
            _ => Err(self.end().map_or_else(|error| error.to_string(), how)),
        }
    }

    /// Waits for its end, which comes once there are no more jobs.
    fn end(self) -> io::Result<ExitStatus> {
        let Self {
            mut child,
            jobs,
            replies,
        } = self;
        drop((jobs, replies));
        child.wait()
    }
}

/// How a process ended, in words.
fn how(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return format!("was killed by signal {signal}");
    }
    match status.code() {
        Some(code) => format!("ended with status {code}"),
        None => "was killed".to_owned(),
    }
}
