//! Standard input as something that can be waited for no longer than until the end is asked for.

use std::io::{self, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

use athermal_serve::connector::Stop;

/// How long nothing may come until it is looked whether it is to stop.
const PAUSE: Duration = Duration::from_millis(50);
/// How many pieces of how many bytes wait; beyond, whoever writes into the pipe waits.
const PIECES: (usize, usize) = (16, 1 << 14);

/// Standard input, read by a thread of its own, which nothing can wake while nothing comes. It lives as long as the program.
pub(crate) struct Pipe {
    stop: Stop,
    piece: Vec<u8>,
    read: usize,
}

impl Pipe {
    pub(crate) fn new(stop: &Stop) -> Self {
        Self {
            stop: stop.clone(),
            piece: Vec::new(),
            read: 0,
        }
    }
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
                if give.send(read).is_err() || is_over {
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
            match pieces.recv_timeout(PAUSE) {
                Ok(piece) => (self.piece, self.read) = (piece?, 0),
                Err(RecvTimeoutError::Timeout) if !self.stop.is_asked() => continue,
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
