//! Decides how a feature says which of its inputs an output channel is made of; what follows for leaks is decided when a
//! graph is compiled.

use crate::time::Duration;

/// Which input channels reach a channel of an output port, and how much later.
///
/// The search for leaks stands on it, so that a kind that says nothing is taken to mix everything.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Reach {
    /// Each of the port's channels may be made of all inputs as they are.
    #[default]
    All,
    /// Each is made of its own input channel. The port gives one channel, or the same number of them, for each channel of the
    /// first input port, in that order; of another input port with as many channels it reads its own there too, and of any
    /// other all.
    Own,
    /// Each is made of its own channel of the first input ports, so many, as with [`Own`](Reach::Own). The values of other ports reach none:
    /// they say when there is a value, or whether.
    First(usize),
    /// Each is made of its own input channel as with [`Own`](Reach::Own), and there is one for each of these delays.
    Delayed(Vec<Duration>),
}

impl Reach {
    /// What reaches the `nth` of `width` channels of an output port: channels of the input ports, each with its delay.
    pub fn parts(&self, inputs: &[Vec<usize>], nth: usize, width: usize) -> Vec<(usize, Duration)> {
        let owners = inputs.first().map_or(0, Vec::len);
        let each = width.checked_div(owners).unwrap_or(0);
        if *self == Self::All || each * owners != width || each == 0 {
            let all = inputs.iter().flatten();
            return all.map(|&slot| (slot, Duration::ZERO)).collect();
        }
        let delay = match self {
            Self::Delayed(delays) => delays.get(nth % each).copied().unwrap_or_default(),
            Self::All | Self::Own | Self::First(_) => Duration::ZERO,
        };
        let ports = self.ports(inputs.len());
        let own = inputs.iter().take(ports).flat_map(|port| {
            if port.len() == owners {
                &port[nth / each..=nth / each]
            } else {
                &port[..]
            }
        });
        own.map(|&slot| (slot, delay)).collect()
    }

    /// The values of how many of the input ports, the first, reach an output port.
    pub(crate) fn ports(&self, all: usize) -> usize {
        match self {
            Self::First(ports) => *ports,
            _ => all,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slots(reach: &Reach, inputs: &[Vec<usize>], nth: usize, width: usize) -> Vec<usize> {
        let parts = reach.parts(inputs, nth, width);
        parts.into_iter().map(|(slot, _)| slot).collect()
    }

    #[test]
    fn a_kind_that_says_nothing_mixes_as_many_outputs_as_it_has_inputs() {
        assert_eq!(slots(&Reach::default(), &[vec![3, 4]], 0, 2), [3, 4]);
        assert_eq!(slots(&Reach::Own, &[vec![3, 4]], 0, 2), [3]);
    }

    #[test]
    fn each_channel_of_the_first_port_has_its_group_and_a_lone_other_reaches_all() {
        let inputs = [vec![3, 4], vec![7, 8], vec![9]];
        assert_eq!(slots(&Reach::Own, &inputs, 1, 4), [3, 7, 9]);
        assert_eq!(slots(&Reach::Own, &inputs, 2, 4), [4, 8, 9]);
    }

    #[test]
    fn a_port_that_says_only_when_reaches_nothing() {
        let inputs = [vec![3, 4], vec![7, 8]];
        assert_eq!(slots(&Reach::First(1), &inputs, 1, 2), [4]);
    }

    #[test]
    fn a_port_whose_width_does_not_fit_what_its_kind_says_is_taken_to_mix() {
        assert_eq!(slots(&Reach::Own, &[vec![3, 4]], 2, 3), [3, 4]);
        assert_eq!(slots(&Reach::Own, &[vec![]], 0, 1), [0; 0]);
    }

    #[test]
    fn delays_come_round_for_each_input() {
        let [none, minute] = [0, 60].map(|s| Duration::from_ns(s * 1_000_000_000));
        let reach = Reach::Delayed(vec![none, minute]);
        let delays: Vec<_> = (0..4)
            .flat_map(|nth| reach.parts(&[vec![3, 4]], nth, 4))
            .collect();
        assert_eq!(delays, [(3, none), (3, minute), (4, none), (4, minute)]);
    }
}
