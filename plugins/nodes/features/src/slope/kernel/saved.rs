//! The written form of a kernel: its samples, and where they were cut. The sums are computed anew, in the order in which
//! they had been, so that they come out with the same bits.

use serde::{Deserialize, Serialize};

use super::{Coverage, LIMIT, MOST_ROWS, NoValue, RollingSlope};

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
    /// Per channel, what is subtracted from its samples, and when that is chosen anew.
    origins: Vec<f64>,
    rebases: [u64; 2],
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
        let (rows, blocks) = (&kernel.rows, &kernel.blocks);
        let (channels, oldest) = (kernel.channels, blocks.oldest());
        Saved {
            windows_ns: kernel.windows.iter().map(|w| w.width_ns).collect(),
            coverage: kernel.coverage,
            no_value: [kernel.no_value.absent, kernel.no_value.cold].map(f64::to_bits),
            squares: kernel.squares,
            times_ns: (oldest..rows.next()).map(|row| rows.time(row)).collect(),
            samples: (oldest..rows.next())
                .flat_map(|row| rows.samples(row))
                .map(|&y| (!y.is_nan()).then_some(y))
                .collect(),
            cuts: blocks.starts()[1..]
                .iter()
                .map(|start| start - oldest)
                .collect(),
            origins: blocks.origins().as_flattened()[..channels].to_vec(),
            rebases: blocks.rebases(),
            first_ns: rows.first().to_vec(),
            newest_ns: (0..channels).map(|channel| rows.newest(channel)).collect(),
        }
    }
}

impl TryFrom<Saved> for RollingSlope {
    type Error = Broken;

    fn try_from(saved: Saved) -> Result<RollingSlope, Broken> {
        let channels = saved.first_ns.len();
        let rows = saved.times_ns.len();
        if saved.newest_ns.len() != channels
            || saved.origins.len() != channels
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
        for (row, &t_ns) in saved.times_ns.iter().enumerate() {
            let samples = &saved.samples[row * channels..(row + 1) * channels];
            let samples: Vec<f64> = samples.iter().map(|y| y.unwrap_or(f64::NAN)).collect();
            kernel.rows.reserve(0);
            kernel.rows.append(t_ns, &samples, LIMIT, 0);
        }
        kernel.rows.make_room(MOST_ROWS);
        let rows = &mut kernel.rows;
        rows.set_first_and_newest(&saved.first_ns, &saved.newest_ns);
        let (cuts, origins) = (&saved.cuts, &saved.origins);
        let blocks = &mut kernel.blocks;
        blocks.restore(&kernel.rows, cuts, origins, saved.rebases);
        if let Some(t_ns) = kernel.rows.last_time() {
            for window in &mut kernel.windows {
                window.begin(kernel.rows.time(0));
            }
            kernel.advance(t_ns);
        }
        Ok(kernel)
    }
}
