//! Puts what was found by window, for all channels of a group, where it belongs: by channel, window after window.

use pulp::Simd;

use super::lanes::{LANES, Lanes};
use super::parts::ABREAST;

/// Puts results of the channels of a group, of which there are as many as `out` has room for, in all windows.
#[inline(always)]
pub(super) fn put<S: Simd>(simd: S, results: &[Lanes], out: &mut [f64]) {
    let wide = results.len();
    let last = (LANES - 1) * wide;
    let (abreast, others) = match S::F64_LANES == ABREAST && out.len() == LANES * wide {
        true => results.as_chunks::<ABREAST>(),
        false => (&[][..], results),
    };
    let mut first = 0;
    for results in abreast {
        // One comparison for all places. Four vectors of four numbers are deinterleaved by transposing them; that this is so
        // on a processor, the test of equal bits in `vectors.rs` sees.
        let out = &mut out[first..first + last + ABREAST];
        for part in 0..LANES / ABREAST {
            let [a, b, c, d] = results;
            let by_window = [a, b, c, d].map(|of_channels| S::as_simd_f64s(of_channels).0[part]);
            let by_channel = simd.deinterleave_shfl_f64s(by_window);
            for (i, of_windows) in by_channel.into_iter().enumerate() {
                let place = (ABREAST * part + i) * wide;
                S::as_mut_simd_f64s(&mut out[place..place + ABREAST]).0[0] = of_windows;
            }
        }
        first += ABREAST;
    }
    for result in others {
        for (out, value) in out[first..].iter_mut().step_by(wide).zip(result) {
            *out = *value;
        }
        first += 1;
    }
}
