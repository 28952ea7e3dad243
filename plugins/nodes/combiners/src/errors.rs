//! Decides which errors of voters are remembered, and how a combiner that goes by them gets truths; what follows from them
//! is the combiner's rule.

use std::collections::VecDeque;

use athermal_core::node::{Combine, Evidence, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

use crate::memory::Memory;
use crate::share::trust;

/// The largest square of an error; a larger one counts as that, so that of so many as there may be in a memory the sum is a number.
const LARGEST: f64 = 1e290;

/// A combiner that goes by the recent errors of its voters.
pub(crate) struct ByErrors<R> {
    rule: R,
    errors: Errors,
}

/// What a combiner makes of votes and the recent errors of their voters.
pub(crate) trait Rule: Send {
    fn combine(&self, errors: &Errors, votes: Votes<'_>) -> f64;

    fn weights(&self, errors: &Errors, votes: Votes<'_>, weights: &mut [f64]);

    fn reason(&self, _errors: &Errors, _votes: Votes<'_>) -> f64 {
        f64::NAN
    }

    fn observe(&self, errors: &mut Errors, votes: Votes<'_>, truth: f64, arrived: Instant) {
        errors.observe(votes, truth, arrived);
    }

    /// How many errors of a voter it takes for the rule to go by them.
    fn needed(&self) -> f64 {
        1.0
    }
}

impl<R: Rule> ByErrors<R> {
    pub(crate) fn new(rule: R, voters: usize, memory: Memory) -> Self {
        let errors = Errors::new(voters, memory);
        Self { rule, errors }
    }
}

impl<R: Rule> Combine for ByErrors<R> {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        self.rule.combine(&self.errors, votes)
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        self.rule.weights(&self.errors, votes, weights);
    }

    fn reason(&self, votes: Votes<'_>) -> f64 {
        self.rule.reason(&self.errors, votes)
    }

    fn heed(&mut self, novelty: &[f64]) {
        self.errors.heed(novelty);
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        self.rule.observe(&mut self.errors, votes, truth, arrived);
    }

    fn advance(&mut self, newest: Instant) {
        self.errors.advance(newest);
    }

    fn segment(&mut self, shift: Duration) {
        self.errors.shift(shift);
    }

    fn evidence(&self) -> Option<Evidence> {
        Some(Evidence {
            truths: self.errors.most(),
            needed: self.rule.needed(),
            remedy: "a longer `memory`",
        })
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.errors.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        self.errors.restore(state)
    }
}

/// The recent squared errors of several voters, oldest first.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(into = "ByVoter", from = "ByVoter")]
pub(crate) struct Errors {
    memory: Memory,
    /// When truths arrived, and for each the squares of the errors of all voters, NaN where one has none in memory; of a memory that fades
    /// the last one of each voter.
    arrivals: VecDeque<Instant>,
    squares: Vec<f64>,
    /// For each voter how many there are, and their sum, oldest first, so that one more is only added.
    lens: Vec<usize>,
    sums: Vec<f64>,
    /// For each voter the mean of what is in memory.
    means: Vec<Option<f64>>,
    /// For each voter how many errors a memory that fades comes to.
    counts: Vec<f64>,
    /// How often the means have changed, so that what follows from them is worked out only then.
    changes: u64,
    /// What each voter counts by how far it is outside of its fit at present: 1 inside; empty where that is not known of any.
    trust: Vec<f64>,
    /// Up to when truths have been let through.
    newest: Instant,
    /// Up to when nothing in memory is to be forgotten.
    kept_until: Instant,
}

/// Errors as they are written.
#[derive(Serialize, Deserialize)]
struct ByVoter {
    memory: Memory,
    /// For each voter the arrival and square of its errors.
    squares: Vec<Vec<(Instant, f64)>>,
    means: Vec<Option<f64>>,
    #[serde(default)]
    counts: Vec<f64>,
}

impl From<Errors> for ByVoter {
    fn from(errors: Errors) -> Self {
        let voters = 0..errors.means.len();
        Self {
            memory: errors.memory,
            squares: voters.map(|voter| errors.of(voter).collect()).collect(),
            means: errors.means,
            counts: errors.counts,
        }
    }
}

impl From<ByVoter> for Errors {
    fn from(written: ByVoter) -> Self {
        let mut errors = Self::new(written.squares.len(), written.memory);
        let all = written.squares.into_iter().enumerate();
        let mut all: Vec<_> = all
            .flat_map(|(voter, of)| of.into_iter().map(move |(at, square)| (at, voter, square)))
            .filter(|(.., square)| !square.is_nan())
            .collect();
        all.sort_by_key(|(at, ..)| *at);
        for (arrived, voter, square) in all {
            errors.put(voter, arrived, square);
        }
        (errors.means, errors.counts) = (written.means, written.counts);
        errors
    }
}

fn long_ago() -> Instant {
    Instant::MIN
}

impl Errors {
    pub(crate) fn new(voters: usize, memory: Memory) -> Self {
        Self {
            memory,
            arrivals: VecDeque::new(),
            squares: Vec::new(),
            lens: vec![0; voters],
            sums: vec![0.0; voters],
            means: vec![None; voters],
            counts: vec![0.0; voters],
            changes: 0,
            trust: Vec::with_capacity(voters),
            newest: long_ago(),
            kept_until: long_ago(),
        }
    }

    /// The mean square error of each voter; none where nothing is in memory.
    pub(crate) fn means(&self) -> &[Option<f64>] {
        &self.means
    }

    /// What each voter counts by how far it is outside of its fit: 1 inside; nothing while all are.
    pub(crate) fn trust(&self) -> Option<&[f64]> {
        let outside = self.trust.iter().any(|&trust| trust != 1.0);
        outside.then_some(&*self.trust)
    }

    fn heed(&mut self, novelty: &[f64]) {
        let all = || novelty.iter().map(|&novelty| trust(novelty));
        if !all().eq(self.trust.iter().copied()) {
            self.trust.clear();
            self.trust.extend(all());
            self.changes += 1;
        }
    }

    /// A number that is another one once the means are, or what voters count by their novelty.
    pub(crate) fn changes(&self) -> u64 {
        self.changes
    }

    /// How many errors of a voter are in memory.
    pub(crate) fn count(&self, voter: usize) -> f64 {
        match self.memory {
            Memory::HalfLife(fading) => {
                let last = self.of(voter).next().map(|(arrived, _)| arrived);
                let idle = last.map_or(Duration::ZERO, |last| {
                    (self.newest - last).max(Duration::ZERO)
                });
                self.counts[voter] * fading.left(idle)
            }
            Memory::Time(_) | Memory::Truths(_) => self.lens[voter] as f64,
        }
    }

    /// How many errors are in memory of the voter that has the most.
    fn most(&self) -> f64 {
        let known = (0..self.means.len()).filter(|&voter| self.means[voter].is_some());
        known.map(|voter| self.count(voter)).fold(0.0, f64::max)
    }

    /// Takes the errors of votes whose truth has arrived.
    pub(crate) fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        for (voter, vote) in votes.present() {
            self.observe_one(voter, vote, truth, arrived);
        }
    }

    /// Takes the error of one vote whose truth has arrived.
    pub(crate) fn observe_one(&mut self, voter: usize, vote: f64, truth: f64, arrived: Instant) {
        let square = (vote - truth) * (vote - truth);
        // A truth beyond all sizes says nothing of who was nearer to it; a vote beyond them was wrong.
        let counts = truth * truth <= LARGEST;
        if counts && !square.is_nan() {
            self.remember(voter, arrived, square.min(LARGEST));
        }
    }

    /// The arrival and square of each error of a voter.
    fn of(&self, voter: usize) -> impl Iterator<Item = (Instant, f64)> {
        let all = self.arrivals.iter().copied().zip(self.squares_of(voter));
        all.filter(|(_, square)| !square.is_nan())
    }

    /// By truth the square of the error of a voter, NaN where it has none.
    fn squares_of(&self, voter: usize) -> impl Iterator<Item = f64> {
        let from_first = self.squares.get(voter..).unwrap_or_default();
        let voters = self.lens.len().max(1);
        from_first.iter().copied().step_by(voters)
    }

    /// Adds an error. Those of several voters that arrived together stand together.
    fn put(&mut self, voter: usize, arrived: Instant, square: f64) {
        let voters = self.lens.len();
        let last = self.squares.len().checked_sub(voters);
        let is_free = last.is_some_and(|last| self.squares[last + voter].is_nan());
        if !is_free || self.arrivals.back() != Some(&arrived) {
            if self.arrivals.len() == self.arrivals.capacity() {
                let more = (self.arrivals.len() / 16).max(4);
                self.arrivals.reserve_exact(more);
                self.squares.reserve_exact(more * voters);
            }
            self.arrivals.push_back(arrived);
            self.squares.extend(std::iter::repeat_n(f64::NAN, voters));
        }
        let last = self.squares.len() - voters + voter;
        self.squares[last] = square;
        self.lens[voter] += 1;
    }

    /// Forgets the oldest error of a voter, and gives when it arrived.
    fn forget_oldest(&mut self, voter: usize) -> Option<Instant> {
        let voters = self.lens.len();
        let mut places = (voter..self.squares.len()).step_by(voters);
        let place = places.find(|&place| !self.squares[place].is_nan())?;
        let arrived = self.arrivals[place / voters];
        self.squares[place] = f64::NAN;
        self.lens[voter] -= 1;
        let truth = place - voter..place - voter + voters;
        if self.squares[truth.clone()].iter().all(|of| of.is_nan()) {
            self.squares.drain(truth);
            self.arrivals.remove(place / voters);
        }
        Some(arrived)
    }

    fn remember(&mut self, voter: usize, arrived: Instant, square: f64) {
        self.changes += 1;
        self.kept_until = self.kept_until.min(arrived + self.memory.longest());
        match self.memory {
            Memory::Truths(last) if self.lens[voter] >= last.truths => {
                self.forget_oldest(voter);
                self.put(voter, arrived, square);
                self.refresh(voter);
            }
            Memory::Time(_) | Memory::Truths(_) => {
                self.put(voter, arrived, square);
                self.sums[voter] += square;
                self.means[voter] = Some(self.sums[voter] / self.lens[voter] as f64);
            }
            Memory::HalfLife(fading) => {
                let last = self.forget_oldest(voter);
                self.put(voter, arrived, square);
                let left = last.map_or(0.0, |last| fading.left(arrived - last));
                let count = &mut self.counts[voter];
                *count = *count * left + 1.0;
                let mean = self.means[voter].unwrap_or(square);
                self.means[voter] = Some(mean + (square - mean) / *count);
            }
        }
    }

    /// Forgets what arrived longer than the memory before `newest`.
    pub(crate) fn advance(&mut self, newest: Instant) {
        self.newest = newest;
        if newest < self.kept_until || matches!(self.memory, Memory::Truths(_)) {
            return;
        }
        let forgotten = newest - self.memory.longest();
        for voter in 0..self.lens.len() {
            let before = self.lens[voter];
            while self
                .of(voter)
                .next()
                .is_some_and(|(arrived, _)| arrived <= forgotten)
            {
                self.forget_oldest(voter);
            }
            if self.lens[voter] < before {
                self.refresh(voter);
            }
        }
        let oldest = self.arrivals.front();
        self.kept_until = oldest.map_or(Instant::MAX, |oldest| *oldest + self.memory.longest());
    }

    /// Moves what is remembered to the clock of another segment.
    pub(crate) fn shift(&mut self, shift: Duration) {
        for arrived in &mut self.arrivals {
            *arrived = *arrived + shift;
        }
        self.newest = long_ago();
        self.kept_until = long_ago();
    }

    /// Goes on from what was remembered of the same voters, maybe for another time.
    pub(crate) fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let known = match state.known::<Self>() {
            Ok(known) => known,
            Err(cold) => return cold,
        };
        let voters = self.lens.len();
        self.changes += 1;
        self.kept_until = long_ago();
        if known.lens.len() != voters || known.means.len() != voters {
            return Restored::cold("the number of voters differs");
        }
        match (known.memory, self.memory) {
            (Memory::HalfLife(_), Memory::HalfLife(_)) => {
                self.take(&known);
                (self.means, self.counts) = (known.means, known.counts);
                self.counts.resize(voters, 0.0);
            }
            (Memory::HalfLife(_), _) => {
                return Restored::cold("of errors that fade only the sum is known, not each");
            }
            (_, Memory::HalfLife(_)) => {
                *self = Self {
                    changes: self.changes,
                    ..Self::new(voters, self.memory)
                };
                for voter in 0..voters {
                    for (arrived, square) in known.of(voter) {
                        self.remember(voter, arrived, square);
                    }
                }
            }
            (_, memory) => {
                self.take(&known);
                for voter in 0..voters {
                    if let Memory::Truths(last) = memory {
                        while self.lens[voter] > last.truths {
                            self.forget_oldest(voter);
                        }
                    }
                    self.refresh(voter);
                }
            }
        }
        Restored::Accepted
    }

    /// Takes the errors of others.
    fn take(&mut self, known: &Self) {
        self.arrivals.clone_from(&known.arrivals);
        self.squares.clone_from(&known.squares);
        self.lens.clone_from(&known.lens);
        // Whoever steps from here on must not have to make room.
        let more = self.arrivals.len().max(32);
        self.arrivals.reserve(more);
        self.squares.reserve(more * self.lens.len());
    }

    /// Takes the mean of what is in memory afresh, so that an error of 10⁹ leaves no trace once it is forgotten.
    fn refresh(&mut self, voter: usize) {
        self.changes += 1;
        let squares = self.squares_of(voter).filter(|square| !square.is_nan());
        let sum: f64 = squares.sum();
        self.sums[voter] = sum;
        let len = self.lens[voter];
        self.means[voter] = (len > 0).then(|| sum / len as f64);
        self.counts[voter] = 0.0;
    }
}

athermal_core::state!(Errors, "recent_errors/1");

#[cfg(test)]
mod tests {
    use athermal_core::node::{Combine, Combiner, Votes};
    use athermal_core::time::{Duration, Instant};

    use crate::auto_weighted::AutoWeighted;
    use crate::choose::Best;
    use crate::guard::Guard;
    use crate::memory::Memory;

    #[test]
    fn a_voter_that_says_what_has_no_square_is_not_taken_for_the_one_that_it_was() {
        let memory = Memory::Time(Duration::from_ns(900_000_000_000));
        let mut guard = Guard {
            memory,
            min_truths: 2,
            most_novel: 3.0,
        }
        .build(1);
        let weighted: AutoWeighted = serde_json::from_str(r#"{ "memory": "15min" }"#).unwrap();
        let mut choosing = [Best { memory }.build(2), weighted.build(2)];
        for nth in 0..40 {
            let at = Instant::from_ns(60_000_000_000 * nth);
            let said = if nth < 20 { 1.0 } else { 1e200 };
            let of = |node: &mut Box<dyn Combine>, votes: &[f64]| {
                node.observe(Votes(votes), 1.0, at);
                node.advance(at);
            };
            of(&mut guard, &[said]);
            choosing.iter_mut().for_each(|node| of(node, &[said, 1.5]));
        }
        assert_eq!(guard.combine(Votes(&[1e200])), 0.0);
        for node in choosing {
            assert_eq!(node.combine(Votes(&[1e200, 1.5])), 1.5);
        }
    }
}
