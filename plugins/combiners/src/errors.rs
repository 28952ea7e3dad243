//! Decides which errors of voters are remembered; what follows from them is the combiner's.

use std::collections::VecDeque;

use athermal_core::node::{Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

/// The recent squared errors of several voters, oldest first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Errors {
    memory: Duration,
    /// For each voter the arrival and square of its errors.
    squares: Vec<VecDeque<(Instant, f64)>>,
    /// For each voter the mean of what is in memory.
    means: Vec<Option<f64>>,
}

impl Errors {
    pub(crate) fn new(voters: usize, memory: Duration) -> Self {
        Self {
            memory,
            squares: vec![VecDeque::new(); voters],
            means: vec![None; voters],
        }
    }

    /// The mean square error of each voter; none where nothing is in memory.
    pub(crate) fn means(&self) -> &[Option<f64>] {
        &self.means
    }

    /// How many errors of a voter are in memory.
    pub(crate) fn count(&self, voter: usize) -> usize {
        self.squares[voter].len()
    }

    /// Takes the errors of votes whose truth has arrived.
    pub(crate) fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        for (voter, vote) in votes.present() {
            self.observe_one(voter, vote, truth, arrived);
        }
    }

    /// Takes the error of one vote whose truth has arrived.
    pub(crate) fn observe_one(&mut self, voter: usize, vote: f64, truth: f64, arrived: Instant) {
        self.squares[voter].push_back((arrived, (vote - truth) * (vote - truth)));
        self.refresh(voter);
    }

    /// Forgets what arrived longer than the memory before `newest`.
    pub(crate) fn advance(&mut self, newest: Instant) {
        let forgotten = newest - self.memory;
        for voter in 0..self.squares.len() {
            let squares = &mut self.squares[voter];
            let before = squares.len();
            while squares
                .front()
                .is_some_and(|&(arrived, _)| arrived <= forgotten)
            {
                squares.pop_front();
            }
            if squares.len() < before {
                self.refresh(voter);
            }
        }
    }

    /// Moves what is remembered to the clock of another segment.
    pub(crate) fn shift(&mut self, shift: Duration) {
        for (arrived, _) in self.squares.iter_mut().flatten() {
            *arrived = *arrived + shift;
        }
    }

    /// Goes on from what was remembered of the same voters, maybe for another time.
    pub(crate) fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let known = match state.known::<Self>() {
            Ok(known) => known,
            Err(cold) => return cold,
        };
        if known.squares.len() != self.squares.len() {
            return Restored::cold("the number of voters differs");
        }
        self.squares = known.squares;
        for squares in &mut self.squares {
            // Whoever steps from here on must not have to make room.
            squares.reserve(squares.len().max(32));
        }
        (0..self.squares.len()).for_each(|voter| self.refresh(voter));
        Restored::Accepted
    }

    /// Takes the mean of what is in memory afresh, so that an error of 10⁹ leaves no trace once it is forgotten.
    fn refresh(&mut self, voter: usize) {
        let squares = &self.squares[voter];
        let sum: f64 = squares.iter().map(|(_, square)| square).sum();
        self.means[voter] = (!squares.is_empty()).then(|| sum / squares.len() as f64);
    }
}

athermal_core::state!(Errors, "recent_errors/1");
