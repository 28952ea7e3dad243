//! Which messages the broker may forget: those whose samples are safe, in the order in which they came.

use std::collections::VecDeque;

/// Messages that wait for their acknowledgement, in the order of their arrival.
#[derive(Debug, Default)]
pub struct Acknowledgements {
    /// Each with how many samples of the source are given once it is.
    waiting: VecDeque<(u64, u16)>,
}

impl Acknowledgements {
    /// A message has been given to the engine, and so many samples of the source with it.
    pub fn given(&mut self, samples: u64, packet: u16) {
        self.waiting.push_back((samples, packet));
    }

    /// Whether any message waits for its acknowledgement.
    pub fn are_due(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// So many samples are safe: sends what may be acknowledged, until the sender takes no more.
    pub fn send(&mut self, safe: u64, mut send: impl FnMut(u16) -> bool) {
        while let Some(&(samples, packet)) = self.waiting.front() {
            if samples > safe || !send(packet) {
                return;
            }
            self.waiting.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn behaviour_13_what_is_safe_is_acknowledged_in_order_of_arrival_and_nothing_else() {
        let mut all = Acknowledgements::default();
        // A message without a usable value is acknowledged with those before it.
        for (samples, packet) in [(2, 9), (2, 4), (5, 7), (6, 1)] {
            all.given(samples, packet);
        }
        let mut sent = Vec::new();
        for safe in [0, 1, 2, 4, 5] {
            all.send(safe, |packet| {
                sent.push((safe, packet));
                true
            });
        }
        assert_eq!(sent, [(2, 9), (2, 4), (5, 7)]);
    }

    #[test]
    fn what_cannot_be_sent_now_is_sent_later() {
        let mut all = Acknowledgements::default();
        all.given(1, 1);
        all.given(2, 2);
        let (mut room, mut sent) = (1, Vec::new());
        for _ in 0..3 {
            all.send(9, |packet| {
                if room > 0 {
                    sent.push(packet);
                }
                room -= 1;
                room >= 0
            });
            room = 1;
        }
        assert_eq!(sent, [1, 2]);
    }
}
