//! Standard input as something that can be waited for no longer than until the end is asked for.

use std::io::{self, Read};
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use athermal_serve::bell::Bell;
use athermal_serve::connector::Stop;

/// How many pieces of how many bytes wait; beyond, whoever writes into the pipe waits.
const PIECES: (usize, usize) = (16, 1 << 14);

/// Wakes whoever waits for a piece.
static READER: Mutex<Option<Bell>> = Mutex::new(None);

/// Standard input, read by a thread of its own, which nothing can wake while nothing comes. It lives as long as the program.
pub(crate) struct Pipe {
    stop: Stop,
    piece: Vec<u8>,
    read: usize,
}

impl Pipe {
    pub(crate) fn new(stop: &Stop) -> Self {
        let bell = Bell::here();
        stop.wakes(&bell);
        *reader() = Some(bell);
        Self {
            stop: stop.clone(),
            piece: Vec::new(),
            read: 0,
        }
    }
}

fn reader() -> MutexGuard<'static, Option<Bell>> {
    READER.lock().unwrap_or_else(PoisonError::into_inner)
}

fn pieces() -> &'static Mutex<Receiver<io::Result<Vec<u8>>>> {
    static PIECES_READ: OnceLock<Mutex<Receiver<io::Result<Vec<u8>>>>> = OnceLock::new();
    PIECES_READ.get_or_init(|| {
        let (give, take) = sync_channel(PIECES.0);
        std::thread::spawn(move || {
            let mut input = io::stdin();
            loop {
                let mut piece = vec![0; PIECES.1];
                let read = input.read(&mut piece).map(|read| {
                    piece.truncate(read);
                    piece
                });
                let is_over = read.as_ref().map_or(true, Vec::is_empty);
                let is_given = give.send(read).is_ok();
                if let Some(bell) = &*reader() {
                    bell.ring();
                }
                if is_over || !is_given {
                    return;
                }
            }
        });
        Mutex::new(take)
    })
}

impl Read for Pipe {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        while self.read == self.piece.len() {
            let pieces = pieces().lock().unwrap_or_else(PoisonError::into_inner);
            match pieces.try_recv() {
                Ok(piece) => (self.piece, self.read) = (piece?, 0),
                Err(TryRecvError::Empty) if !self.stop.is_asked() => {
                    drop(pieces);
                    std::thread::park();
                    continue;
                }
                Err(_) => return Ok(0),
            }
            if self.piece.is_empty() {
                return Ok(0);
            }
        }
        let left = &self.piece[self.read..];
        let count = left.len().min(into.len());
        into[..count].copy_from_slice(&left[..count]);
        self.read += count;
        Ok(count)
    }
}
