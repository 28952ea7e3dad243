//! Signals: a run beside a machine ends as at the end of its input.

use std::io::{self, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Bytes read at a time, at most.
const PIECE: usize = 64 * 1024;
/// Pieces that may wait to be taken.
const WAITING: usize = 2;

/// Whether a signal to stop has come.
static STOPPED: AtomicBool = AtomicBool::new(false);

/// Whether a signal to stop has come.
pub fn is_stopped() -> bool {
    STOPPED.load(Ordering::Relaxed)
}

/// A piece of an input; an empty one is its end.
type Piece = io::Result<Vec<u8>>;

/// An input that may never end by itself: from here on SIGINT or SIGTERM ends it, after all that has been read of it until then, and a
/// second one ends the program at once. SIGHUP ends it as they do where it is not ignored, and no more than that: a session that closes
/// may send several. Where there are no signals it is as it was.
pub fn until_stopped(input: Box<dyn Read + Send>) -> Box<dyn Read + Send> {
    let (give, pieces) = sync_channel(WAITING);
    if !listen(give.clone(), true, || ()) {
        return input;
    }
    // The thread may wait for an input that gives nothing more, and goes with the program.
    std::thread::spawn(move || read(input, &give));
    Box::new(Pieces::new(pieces))
}

/// Notes SIGINT and SIGTERM, for whoever looks at [`is_stopped`], and wakes this thread. A second one ends the program at once.
pub fn listen_for_the_end() {
    let (thread, (give, _)) = (std::thread::current(), sync_channel(1));
    let _ = listen(give, false, move || thread.unpark());
}

/// Ends the input at the first signal; whether signals can be listened to.
#[cfg(unix)]
fn listen(give: SyncSender<Piece>, hangs_up: bool, wake: impl Fn() + Send + 'static) -> bool {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    let hangs_up = (hangs_up && ends_at_a_hangup()).then_some(SIGHUP);
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM].into_iter().chain(hangs_up)) else {
        return false;
    };
    std::thread::spawn(move || {
        for signal in signals.forever() {
            if STOPPED.swap(true, Ordering::Relaxed) && signal != SIGHUP {
                let _ = emulate_default_handler(signal);
            }
            wake();
            // There may be no room yet, and the second signal is listened to meanwhile.
            let give = give.clone();
            std::thread::spawn(move || give.send(Ok(Vec::new())));
        }
    });
    true
}

/// Whether SIGHUP is there to end the program, and not ignored as under `nohup`, which listening to it would undo. Where that cannot be
/// known, nobody listens.
#[cfg(unix)]
fn ends_at_a_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask >> (signal_hook::consts::SIGHUP - 1) & 1 == 0)
}

#[cfg(not(unix))]
fn listen(_give: SyncSender<Piece>, _hangs_up: bool, _wake: impl Fn()) -> bool {
    false
}

/// Reads an input piece by piece, to its end or until a signal to stop.
fn read(mut input: impl Read, give: &SyncSender<Piece>) {
    let mut piece = vec![0; PIECE];
    while !is_stopped() {
        let read = match input.read(&mut piece) {
            Ok(read) => Ok(piece[..read].to_vec()),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => Err(error),
        };
        let is_last = !read.as_ref().is_ok_and(|piece| !piece.is_empty());
        if give.send(read).is_err() || is_last {
            return;
        }
    }
}

/// The pieces of an input, one after the other.
struct Pieces {
    pieces: Receiver<Piece>,
    piece: Vec<u8>,
    taken: usize,
    /// Whether the end has been met, which is met again by whoever asks again.
    is_over: bool,
}

impl Pieces {
    fn new(pieces: Receiver<Piece>) -> Self {
        Self {
            pieces,
            piece: Vec::new(),
            taken: 0,
            is_over: false,
        }
    }
}

impl Read for Pieces {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.piece.len() && !self.is_over {
            // What gives pieces has gone where there is no more.
            self.piece = self.pieces.recv().unwrap_or(Ok(Vec::new()))?;
            self.taken = 0;
            self.is_over = self.piece.is_empty();
        }
        let read = (&self.piece[self.taken..]).read(into)?;
        self.taken += read;
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_the_same_in_pieces() {
        let (give, pieces) = sync_channel(WAITING);
        let bytes: Vec<u8> = (0..3 * PIECE + 7).map(|nth| nth as u8).collect();
        let input = io::Cursor::new(bytes.clone());
        std::thread::spawn(move || read(input, &give));
        let mut whole = Vec::new();
        let mut input = Pieces::new(pieces);
        input.read_to_end(&mut whole).unwrap();
        assert!(whole == bytes);
    }

    #[test]
    fn what_has_ended_is_not_waited_for_again() {
        let (give, pieces) = sync_channel(WAITING);
        let mut input = Pieces::new(pieces);
        give.send(Ok(vec![7])).unwrap();
        give.send(Ok(Vec::new())).unwrap();
        let mut read = || input.read(&mut [0; 4]).unwrap();
        assert_eq!([read(), read(), read()], [1, 0, 0]);
    }
}
