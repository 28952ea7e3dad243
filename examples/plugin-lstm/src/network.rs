//! Decides what a network is, and what it makes of one sequence. Nothing is allocated here once it is there.

use athermal_core::node::Mistake;
use athermal_core::prng::Prng;
use serde::{Deserialize, Serialize};

use crate::activation::{sigmoid, tanh};

/// The most units of a network.
pub(crate) const MOST_UNITS: usize = 64;

/// A layer of long short-term memory with a linear readout of its last step (Hochreiter and Schmidhuber 1997, with the forget
/// gate of Gers, Schmidhuber and Cummins 2000).
///
/// With `z = (x_t, h_(t−1), 1)`: `i, f, o = σ(W z)`, `g = tanh(W z)`, `c_t = f c_(t−1) + i g`, `h_t = o tanh(c_t)`; the answer
/// is `v·h_T + d`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    channels: usize,
    units: usize,
    /// `W`, its columns one after the other, each with the rows of `i`, `f`, `g` and `o`; then `v`, then `d`.
    weights: Vec<f64>,
}

/// The memory of a network: `h` and `c`.
#[derive(Debug, Clone)]
pub(crate) struct Memory {
    hidden: [f64; MOST_UNITS],
    cell: [f64; MOST_UNITS],
}

impl Network {
    /// A network with small random weights, and forget gates that begin open.
    pub(crate) fn random(channels: usize, units: usize, seed: u64) -> Self {
        let mut network = Self {
            channels,
            units,
            weights: Vec::new(),
        };
        let mut random = Prng::stream(seed, "weights");
        let most = 1.0 / (units as f64).sqrt();
        let count = network.gates() + units + 1;
        network.weights = (0..count).map(|_| random.between(-most, most)).collect();
        let bias = 4 * units * (channels + units);
        for forget in &mut network.weights[bias + units..bias + 2 * units] {
            *forget += 1.0;
        }
        network
    }

    /// How many channels a step has.
    pub(crate) fn channels(&self) -> usize {
        self.channels
    }

    /// How many units there are.
    pub(crate) fn units(&self) -> usize {
        self.units
    }

    /// The number of weights of the gates, which come first.
    pub(crate) fn gates(&self) -> usize {
        4 * self.units * (self.channels + self.units + 1)
    }

    pub(crate) fn weights(&self) -> &[f64] {
        &self.weights
    }

    pub(crate) fn weights_mut(&mut self) -> &mut [f64] {
        &mut self.weights
    }

    /// What of it does not fit together, or so many channels.
    pub(crate) fn mistakes(&self, channels: usize) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        if !(1..=MOST_UNITS).contains(&self.units) {
            let message = format!("`units` is {} and must be 1 to {MOST_UNITS}", self.units);
            mistakes.push(Mistake::at("network.units", message));
        }
        if self.channels != channels {
            let message = format!("`channels` is {} and must be {channels}", self.channels);
            mistakes.push(Mistake::at("network.channels", message));
        }
        if mistakes.is_empty() {
            let needed = self.gates() + self.units + 1;
            mistakes = Mistake::of_lengths(needed, &[("weights", self.weights.len())]);
        }
        mistakes
    }

    /// The readout.
    pub(crate) fn read_out(&self, memory: &Memory) -> f64 {
        let readout = &self.weights[self.gates()..];
        let weighted = readout.iter().zip(&memory.hidden[..self.units]);
        weighted.map(|(v, h)| v * h).sum::<f64>() + readout[self.units]
    }

    /// Takes in the next step of a sequence.
    pub(crate) fn step(&self, inputs: &[f64], memory: &mut Memory) {
        let (units, rows) = (self.units, 4 * self.units);
        let mut gates = [0.0; 4 * MOST_UNITS];
        let gates = &mut gates[..rows];
        let hidden = &memory.hidden[..units];
        let one = std::iter::once(&1.0);
        let inputs = inputs.iter().chain(hidden).chain(one);
        for (column, input) in self.weights.chunks_exact(rows).zip(inputs) {
            for (gate, weight) in gates.iter_mut().zip(column) {
                *gate += weight * input;
            }
        }
        open(gates, units);
        for unit in 0..units {
            let [input, forget, new, output] = [0, 1, 2, 3].map(|gate| gates[gate * units + unit]);
            memory.cell[unit] = forget * memory.cell[unit] + input * new;
            memory.hidden[unit] = memory.cell[unit];
            gates[unit] = output;
        }
        let hidden = &mut memory.hidden[..units];
        tanh(hidden);
        for (hidden, output) in hidden.iter_mut().zip(gates) {
            *hidden *= *output;
        }
    }
}

impl Memory {
    /// Of nothing: before the first step.
    pub(crate) fn empty() -> Self {
        Self {
            hidden: [0.0; MOST_UNITS],
            cell: [0.0; MOST_UNITS],
        }
    }

    /// What each of so many units shows, between −1 and 1.
    pub(crate) fn hidden(&self, units: usize) -> &[f64] {
        &self.hidden[..units]
    }
}

/// Makes of `W z` the gates `i`, `f`, `g` and `o`.
pub(crate) fn open(gates: &mut [f64], units: usize) {
    sigmoid(&mut gates[..2 * units]);
    tanh(&mut gates[2 * units..3 * units]);
    sigmoid(&mut gates[3 * units..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_unit_does_what_the_formula_says() {
        let network = Network {
            channels: 1,
            units: 1,
            weights: vec![
                0.5, -0.3, 0.8, 0.2, // x
                0.1, 0.4, -0.6, 0.7, // h
                0.05, 1.0, -0.1, 0.3, // 1
                2.0, -0.25, // v and d
            ],
        };
        assert!(network.mistakes(1).is_empty());
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let (mut h, mut c) = (0.0_f64, 0.0_f64);
        for x in [1.5, -0.7] {
            let input = sigmoid(0.5 * x + 0.1 * h + 0.05);
            let forget = sigmoid(-0.3 * x + 0.4 * h + 1.0);
            let new = (0.8 * x - 0.6 * h - 0.1).tanh();
            let output = sigmoid(0.2 * x + 0.7 * h + 0.3);
            c = forget * c + input * new;
            h = output * c.tanh();
        }
        let mut memory = Memory::empty();
        network.step(&[1.5], &mut memory);
        network.step(&[-0.7], &mut memory);
        assert!((memory.hidden(1)[0] - h).abs() < 1e-15);
        assert!((network.read_out(&memory) - (2.0 * h - 0.25)).abs() < 1e-15);
    }

    #[test]
    fn the_same_seed_gives_the_same_weights_and_another_seed_others() {
        let network = |seed| Network::random(3, 5, seed);
        assert_eq!(network(1), network(1));
        assert_ne!(network(1), network(2));
        assert!(network(1).mistakes(3).is_empty());
    }
}
