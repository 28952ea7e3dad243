//! Decides the error of a network over a batch of sequences, and its gradient, by back-propagation through time (Werbos 1990).
//!
//! All sequences of a batch go through the network side by side, so that each step is one product of matrices.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use crate::activation::tanh;
use crate::network::{Network, open};

/// Sequences with the truths that belong to them, one after the other.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Batch<'a> {
    /// The values of all sequences: of each the oldest step first, all channels of a step side by side.
    pub(crate) sequences: &'a [f64],
    /// What the network is to answer.
    pub(crate) truths: &'a [f64],
}

impl Batch<'_> {
    /// Those of these numbers.
    pub(crate) fn part(&self, from: usize, to: usize) -> Self {
        let width = self.sequences.len() / self.truths.len().max(1);
        Self {
            sequences: &self.sequences[from * width..to * width],
            truths: &self.truths[from..to],
        }
    }
}

/// The room that a batch takes on its way through a network and back. Columns are sequences, the blocks of steps lie one after
/// the other.
#[derive(Debug)]
pub(crate) struct Passage {
    steps: usize,
    /// Of each step `z = (x_t, h_(t−1), 1)`, and after the last its `h`.
    entering: Vec<f64>,
    /// Of each step `i`, `f`, `g` and `o`.
    gates: Vec<f64>,
    /// Of each step `c`, before the first too.
    cells: Vec<f64>,
    /// Of each step `tanh(c)`.
    shown: Vec<f64>,
    /// The gradients of all gates, and of what entered a step and its cells.
    of_gates: Vec<f64>,
    of_entering: Vec<f64>,
    of_cells: Vec<f64>,
    errors: Vec<f64>,
}

/// The numbers of a network and batch.
#[derive(Debug, Clone, Copy)]
struct Size {
    channels: usize,
    units: usize,
    /// The gates of all units.
    rows: usize,
    /// What enters a step.
    wide: usize,
    /// The sequences.
    count: usize,
}

impl Size {
    fn of(network: &Network, count: usize) -> Self {
        let (channels, units) = (network.channels(), network.units());
        Self {
            channels,
            units,
            rows: 4 * units,
            wide: channels + units + 1,
            count,
        }
    }
}

impl Passage {
    /// For batches of at most so many sequences of so many steps.
    pub(crate) fn new(network: &Network, steps: usize, batch: usize) -> Self {
        let Size {
            units, rows, wide, ..
        } = Size::of(network, batch);
        let room = |steps: usize, rows: usize| vec![0.0; steps * rows * batch];
        Self {
            steps,
            entering: room(steps + 1, wide),
            gates: room(steps, rows),
            cells: room(steps + 1, units),
            shown: room(steps, units),
            of_gates: room(steps, rows),
            of_entering: room(1, wide),
            of_cells: room(1, units),
            errors: vec![0.0; batch],
        }
    }

    /// The sum of the squared errors of a batch.
    pub(crate) fn error(&mut self, network: &Network, batch: Batch<'_>) -> f64 {
        self.forward(network, batch);
        let errors = &self.errors[..batch.truths.len()];
        errors.iter().map(|error| error * error).sum()
    }

    /// The gradient of half the mean squared error of a batch.
    pub(crate) fn gradient(&mut self, network: &Network, batch: Batch<'_>, gradient: &mut [f64]) {
        self.forward(network, batch);
        let size = Size::of(network, batch.truths.len());
        let Size {
            channels,
            units,
            rows,
            wide,
            count,
        } = size;
        gradient.fill(0.0);
        let (of_weights, of_readout) = gradient.split_at_mut(network.gates());
        let (weights, readout) = network.weights().split_at(network.gates());
        let weights = MatRef::from_column_major_slice(weights, rows, wide);
        let share = 1.0 / count as f64;
        self.of_cells[..units * count].fill(0.0);
        // What the readout hands back to the last hidden state.
        let last = self.entering[self.steps * wide * count..].chunks_exact(wide);
        let handed = self.of_entering.chunks_exact_mut(wide);
        for ((hidden, handed), error) in last.zip(handed).zip(&self.errors[..count]) {
            let error = share * error;
            for unit in 0..units {
                of_readout[unit] += error * hidden[channels + unit];
                handed[channels + unit] = error * readout[unit];
            }
            of_readout[units] += error;
        }
        for step in (0..self.steps).rev() {
            self.back_through_gates(size, step);
            if step > 0 {
                let of_gates = &self.of_gates[step * rows * count..(step + 1) * rows * count];
                let of_gates = MatRef::from_column_major_slice(of_gates, rows, count);
                let to = &mut self.of_entering[..wide * count];
                let to = MatMut::from_column_major_slice_mut(to, wide, count);
                let weights = weights.transpose();
                matmul(to, Accum::Replace, weights, of_gates, 1.0, Par::Seq);
            }
        }
        let columns = self.steps * count;
        let of_gates = &self.of_gates[..rows * columns];
        let of_gates = MatRef::from_column_major_slice(of_gates, rows, columns);
        let entered = &self.entering[..wide * columns];
        let entered = MatRef::from_column_major_slice(entered, wide, columns).transpose();
        let to = MatMut::from_column_major_slice_mut(of_weights, rows, wide);
        matmul(to, Accum::Replace, of_gates, entered, 1.0, Par::Seq);
    }

    fn forward(&mut self, network: &Network, batch: Batch<'_>) {
        let size = Size::of(network, batch.truths.len());
        let Size {
            channels,
            units,
            rows,
            wide,
            count,
        } = size;
        let steps = self.steps;
        for (sequence, values) in batch.sequences.chunks_exact(steps * channels).enumerate() {
            for (step, values) in values.chunks_exact(channels).enumerate() {
                let column = (step * count + sequence) * wide;
                let entering = &mut self.entering[column..column + wide];
                entering[..channels].copy_from_slice(values);
                entering[wide - 1] = 1.0;
                if step == 0 {
                    entering[channels..wide - 1].fill(0.0);
                }
            }
        }
        self.cells[..units * count].fill(0.0);
        let (weights, readout) = network.weights().split_at(network.gates());
        let weights = MatRef::from_column_major_slice(weights, rows, wide);
        for step in 0..steps {
            let (before, after) = self.entering.split_at_mut((step + 1) * wide * count);
            let entering = &before[step * wide * count..];
            let entering = MatRef::from_column_major_slice(entering, wide, count);
            let gates = &mut self.gates[step * rows * count..(step + 1) * rows * count];
            let to = MatMut::from_column_major_slice_mut(gates, rows, count);
            matmul(to, Accum::Replace, weights, entering, 1.0, Par::Seq);
            let (known, new) = self.cells.split_at_mut((step + 1) * units * count);
            let known = known[step * units * count..].chunks_exact(units);
            let new = &mut new[..units * count];
            for ((gates, known), new) in gates
                .chunks_exact_mut(rows)
                .zip(known)
                .zip(new.chunks_exact_mut(units))
            {
                open(gates, units);
                for unit in 0..units {
                    let [input, forget, candidate] =
                        [0, 1, 2].map(|gate| gates[gate * units + unit]);
                    new[unit] = forget * known[unit] + input * candidate;
                }
            }
            let shown = &mut self.shown[step * units * count..(step + 1) * units * count];
            shown.copy_from_slice(new);
            tanh(shown);
            let hidden = after.chunks_exact_mut(wide).zip(shown.chunks_exact(units));
            for ((hidden, shown), gates) in hidden.zip(gates.chunks_exact(rows)) {
                let hidden = hidden[channels..channels + units].iter_mut();
                for ((hidden, shown), output) in hidden.zip(shown).zip(&gates[3 * units..]) {
                    *hidden = output * shown;
                }
            }
        }
        let hidden = self.entering[steps * wide * count..].chunks_exact(wide);
        for ((error, hidden), truth) in self.errors.iter_mut().zip(hidden).zip(batch.truths) {
            let shown = &hidden[channels..channels + units];
            let weighted = readout.iter().zip(shown).map(|(v, h)| v * h);
            *error = weighted.sum::<f64>() + readout[units] - truth;
        }
    }

    /// From the gradients of a step's hidden state and cells to those of its gates, and of the cells before it.
    fn back_through_gates(&mut self, size: Size, step: usize) {
        let Size {
            channels,
            units,
            rows,
            wide,
            count,
        } = size;
        let block = |rows: usize| step * rows * count..(step + 1) * rows * count;
        let gates = self.gates[block(rows)].chunks_exact(rows);
        let cells = self.cells[block(units)].chunks_exact(units);
        let cells = cells.zip(self.shown[block(units)].chunks_exact(units));
        let of_cells = self.of_cells.chunks_exact_mut(units);
        let of_gates = self.of_gates[block(rows)].chunks_exact_mut(rows);
        let of_hidden = self.of_entering.chunks_exact(wide);
        let gradients = of_cells.zip(of_gates).zip(of_hidden);
        for ((gates, (before, shown)), ((of_cells, of_gates), of_hidden)) in
            gates.zip(cells).zip(gradients)
        {
            for unit in 0..units {
                let [input, forget, candidate, output] =
                    [0, 1, 2, 3].map(|gate| gate * units + unit);
                let (i, f, g, o) = (gates[input], gates[forget], gates[candidate], gates[output]);
                let shown = shown[unit];
                let of_hidden = of_hidden[channels + unit];
                let of_cell = of_cells[unit] + of_hidden * o * (1.0 - shown * shown);
                of_gates[input] = of_cell * g * i * (1.0 - i);
                of_gates[forget] = of_cell * before[unit] * f * (1.0 - f);
                of_gates[candidate] = of_cell * i * (1.0 - g * g);
                of_gates[output] = of_hidden * shown * o * (1.0 - o);
                of_cells[unit] = of_cell * f;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::prng::Prng;

    use super::*;

    const STEPS: usize = 5;

    fn batch(count: usize, channels: usize) -> (Vec<f64>, Vec<f64>) {
        let mut random = Prng::stream(3, "batch");
        let mut some = |count: usize| (0..count).map(|_| random.normal()).collect();
        (some(count * STEPS * channels), some(count))
    }

    /// Every weight is moved a little either way.
    #[test]
    fn the_gradient_is_that_of_finite_differences() {
        let mut network = Network::random(3, 4, 7);
        let (sequences, truths) = batch(6, 3);
        let batch = Batch {
            sequences: &sequences,
            truths: &truths,
        };
        // Room for more than come, as after the last whole batch.
        let mut passage = Passage::new(&network, STEPS, 9);
        let mut gradient = vec![0.0; network.weights().len()];
        passage.gradient(&network, batch, &mut gradient);
        let (small, half_mean) = (1e-5, 0.5 / truths.len() as f64);
        let mut largest = 0.0_f64;
        for (nth, &found) in gradient.iter().enumerate() {
            let weight = network.weights()[nth];
            let mut at = |value: f64| {
                network.weights_mut()[nth] = value;
                half_mean * passage.error(&network, batch)
            };
            let expected = (at(weight + small) - at(weight - small)) / (2.0 * small);
            network.weights_mut()[nth] = weight;
            assert!(
                (found - expected).abs() < 1e-8,
                "weight {nth}: {found} and {expected}"
            );
            largest = largest.max(found.abs());
        }
        assert!(
            largest > 0.01,
            "a gradient of nothing proves nothing: {largest}"
        );
    }

    #[test]
    fn side_by_side_sequences_give_the_answers_that_each_gives_alone() {
        let network = Network::random(2, 3, 1);
        let (sequences, truths) = batch(4, 2);
        let mut passage = Passage::new(&network, STEPS, 4);
        let batch = Batch {
            sequences: &sequences,
            truths: &truths,
        };
        let alone = |(sequence, truth): (&[f64], &f64)| {
            let mut memory = crate::network::Memory::empty();
            for step in sequence.chunks_exact(2) {
                network.step(step, &mut memory);
            }
            (network.read_out(&memory) - truth).powi(2)
        };
        let alone: f64 = sequences
            .chunks_exact(STEPS * 2)
            .zip(&truths)
            .map(alone)
            .sum();
        assert!((passage.error(&network, batch) - alone).abs() < 1e-12);
    }
}
