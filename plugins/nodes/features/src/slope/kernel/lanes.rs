//! Channels lie in groups of eight, so that the loops over them become vector instructions; the last group is filled up
//! with channels that are always present.

/// Channels in a group.
pub(super) const LANES: usize = 8;

/// One value for each channel of a group.
pub(super) type Lanes = [f64; LANES];

/// How many groups there are.
pub(super) fn group_count(channels: usize) -> usize {
    channels.div_ceil(LANES)
}

/// Makes a list so long, with no more room than that: windows hold about as many rows at all times.
pub(super) fn lengthen<T: Clone>(list: &mut Vec<T>, len: usize, with: T) {
    list.reserve_exact(len.saturating_sub(list.len()));
    list.resize(len, with);
}
