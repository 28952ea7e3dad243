//! How samples that wait to be decided on are decided on, one after the other; what decides is `judge.rs`.

use super::timeline::WAITING;
use super::{Admission, Decision, Refusal, Sample, Sequencer};
use crate::live::Moment;
use crate::time::{Duration, Instant};

/// What is decided of samples that wait for that, of so many yet.
#[derive(Debug, Clone, Copy)]
pub(super) enum Turn {
    /// The last tick was of the future: what waits is stepped, and a segment begins at the time of this stamp.
    Back(Instant),
    /// They are judged anew.
    Again(usize),
    /// Those of a source are refused, whose clock is ahead by so much.
    WrongClock(usize, Duration, usize),
    /// Those that are after this sample of its channel are refused, which has returned to the old time.
    WrongStamps(Sample, usize),
}

impl Sequencer {
    pub(super) fn is_waiting_full(&self) -> bool {
        self.timeline.waiting().len() >= (self.rules.most / WAITING).max(1)
    }

    pub(super) fn wait(&mut self, sample: Sample) -> Admission {
        self.judge.waits(sample.channel as usize);
        self.timeline.wait(sample);
        Admission::Waits(sample)
    }

    /// All that waits is judged anew, where anything does.
    pub(super) fn again(&self) -> Option<Turn> {
        let waiting = self.timeline.waiting().len();
        (waiting > 0).then_some(Turn::Again(waiting))
    }

    /// Decides on the next of the samples that wait for that.
    pub(super) fn take_turn(&mut self, now: Moment) -> Option<Admission> {
        loop {
            let turn = self.turn.as_mut()?;
            let (Turn::Again(left) | Turn::WrongClock(.., left) | Turn::WrongStamps(_, left)) =
                turn
            else {
                return None;
            };
            let is_left = *left > 0;
            *left = left.saturating_sub(1);
            let turn = *turn;
            let next = is_left.then(|| self.timeline.next_waiting()).flatten();
            let Some(sample) = next else {
                self.turn = None;
                return None;
            };
            let channel = sample.channel as usize;
            self.judge.waited(channel);
            let (is_judged, ahead) = match turn {
                Turn::WrongClock(source, ahead, _) => {
                    let is_of = self.rules.channels[channel].source == source;
                    (is_of, Some(ahead))
                }
                Turn::WrongStamps(back, _) => {
                    let ahead = sample.stamp - back.stamp;
                    let is_after = ahead > Duration::ZERO;
                    (back.channel == sample.channel, is_after.then_some(ahead))
                }
                Turn::Back(_) | Turn::Again(_) => (true, None),
            };
            let admission = match ahead {
                _ if !is_judged => self.wait(sample),
                Some(ahead) => Admission::Refused(sample, Refusal::Future { ahead }),
                None => self.admit(sample, now, true),
            };
            // What waits still does so in the journal.
            if !matches!(admission, Admission::Waits(_)) {
                return Some(self.count(sample, admission));
            }
        }
    }

    /// Steps what is left of the time that was of the future, and begins a segment at the time of a stamp.
    pub(super) fn go_back(&mut self, to: Instant, now: Moment) -> Option<Decision<'_>> {
        if self.timeline.next(self.rules.join).is_some() {
            return self.cut(now);
        }
        let last = self.timeline.last();
        self.segment();
        self.judge.go_back(to, now);
        self.turn = self.again();
        Some(Decision::Back { last, to })
    }
}
