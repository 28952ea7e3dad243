//! How much memory a kernel comes to take, before it has seen a row.

use athermal_core::node::Kept;
use athermal_core::time::Duration;

use super::blocks::EACH;
use super::lanes::{LANES, Lanes, group_count};
use super::parts::{ABREAST, Weights};
use super::sums::{Common, Values};
use super::window::Window;
use super::{FEWEST_ROWS, MOST_ROWS};

/// What is kept where a row comes each `every`: the rows and the sums over blocks of them, which all windows share, are counted as those of
/// the longest.
pub fn keeps(windows: &[Duration], channels: usize, squares: bool, every: Duration) -> Vec<Kept> {
    let rows = |window: &Duration| Kept::rows(*window, every);
    let shortest = windows.iter().map(rows).min().unwrap_or(0);
    let longest = windows.iter().max();
    let block = shortest.clamp(FEWEST_ROWS, MOST_ROWS);
    let of_group = size_of::<Values>() + if squares { size_of::<Lanes>() } else { 0 };
    let run = (size_of::<Common>() + group_count(channels) * of_group) as u64;
    let of_window = size_of::<Window>() + size_of::<Weights>() / ABREAST + size_of::<Lanes>() + 8;
    let kept = windows.iter().map(|window| {
        let own = (EACH + (block - 1) / EACH + 1) * run + of_window as u64;
        let shared = (Some(window) == longest).then(|| {
            let ring = rows(window) + block;
            let room = ring + (ring / 128).max(8);
            let runs = 2 * (ring / block + 2) * 9 / 8;
            room * 8 * (channels as u64 + 1) + (LANES * 8) as u64 + runs * run
        });
        Kept {
            back: *window,
            rows: rows(window),
            bytes: own + shared.unwrap_or(0),
        }
    });
    kept.collect()
}
