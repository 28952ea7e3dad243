//! The written form of a kernel: its samples, and where they were cut. The sums are computed anew, in the order in which
//! they had been, so that they come out with the same bits.

use serde::{Deserialize, Serialize};

use super::rows::all_present;
use super::{CURRENT, Coverage, NoValue, RollingSlope};

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Saved {
    windows_ns: Vec<i64>,
    coverage: Coverage,
    /// The bits of the two NaNs, absent and cold.
    no_value: [u64; 2],
    squares: bool,
    times_ns: Vec<i64>,
    /// Row by row, nothing where a channel is absent.
    samples: Vec<Option<f64>>,
    /// Rows with which a new block begins.
    cuts: Vec<u64>,
    /// Per window, the block of its turning point.
    turns: Vec<u64>,
    /// Per channel, times of its first and newest sample.
    first_ns: Vec<Option<i64>>,
    newest_ns: Vec<Option<i64>>,
}

/// Why a written state cannot be one of this kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Broken {
    Lengths,
    Times,
    Cuts,
}

impl std::fmt::Display for Broken {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Broken::Lengths => {
                "the state of a slope kernel has lists whose lengths do not fit each other"
            }
            Broken::Times => "the state of a slope kernel has times that do not increase",
            Broken::Cuts => "the state of a slope kernel has cuts that do not increase",
        })
    }
}

impl From<RollingSlope> for Saved {
    fn from(kernel: RollingSlope) -> Saved {
        let rows = &kernel.rows;
        let current = rows.current_block();
        let heads = kernel.windows.iter();
        let (oldest, block) = heads
            .map(|window| (window.head(), window.head_block()))
            .min()
            .unwrap_or((rows.start(current), current));
        Saved {
            windows_ns: kernel.windows.iter().map(|w| w.width_ns()).collect(),
            coverage: kernel.coverage,
            no_value: [kernel.no_value.absent, kernel.no_value.cold].map(f64::to_bits),
            squares: kernel.squares,
            times_ns: (oldest..rows.next()).map(|row| rows.time(row)).collect(),
            samples: (oldest..rows.next())
                .flat_map(|row| &rows.samples(row).as_flattened()[..kernel.channels])
                .map(|&y| (!y.is_nan()).then_some(y))
                .collect(),
            cuts: (block + 1..=current)
                .map(|block| rows.start(block) - oldest)
                .collect(),
            turns: kernel
                .windows
                .iter()
                .map(|window| window.turn().saturating_sub(block))
                .collect(),
            first_ns: kernel.first.clone(),
            newest_ns: (0..kernel.channels).map(|c| kernel.newest_ns(c)).collect(),
        }
    }
}

impl TryFrom<Saved> for RollingSlope {
    type Error = Broken;

    fn try_from(saved: Saved) -> Result<RollingSlope, Broken> {
        let channels = saved.first_ns.len();
        let rows = saved.times_ns.len();
        if saved.newest_ns.len() != channels
            || saved.turns.len() != saved.windows_ns.len()
            || saved.samples.len() != rows * channels
        {
            return Err(Broken::Lengths);
        }
        if !saved.times_ns.is_sorted_by(|a, b| a < b) {
            return Err(Broken::Times);
        }
        let in_range = |&cut: &u64| 0 < cut && cut < rows as u64;
        if !saved.cuts.is_sorted_by(|a, b| a < b) || !saved.cuts.iter().all(in_range) {
            return Err(Broken::Cuts);
        }
        let [absent, cold] = saved.no_value.map(f64::from_bits);
        let mut kernel = RollingSlope::new(
            &saved.windows_ns,
            channels,
            saved.coverage,
            NoValue { absent, cold },
            saved.squares,
        );
        kernel.first = saved.first_ns;
        kernel.newest = saved.newest_ns;
        let mut cuts = saved.cuts.iter().peekable();
        for (row, &t_ns) in saved.times_ns.iter().enumerate() {
            if cuts.next_if(|&&cut| cut == row as u64).is_some() {
                kernel.rows.close_block();
                kernel.current.clear(CURRENT);
            }
            let samples = &saved.samples[row * channels..(row + 1) * channels];
            let samples = samples.iter().map(|y| y.unwrap_or(f64::NAN));
            kernel.rows.append(t_ns, samples, 0);
            let samples = kernel.rows.samples(row as u64);
            let all_present = all_present(samples);
            kernel.current.add(CURRENT, t_ns, samples, all_present);
        }
        // Steps to come must not have to make room.
        kernel.rows.make_room(0);
        if let Some(t_ns) = kernel.last_time() {
            for (window, &turn) in kernel.windows.iter_mut().zip(&saved.turns) {
                window.rebuild(&kernel.rows, t_ns, turn);
            }
        }
        kernel.summarise_times();
        kernel.spread();
        Ok(kernel)
    }
}
