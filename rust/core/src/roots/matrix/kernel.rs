//! Sums of rows, compiled for every instruction set.
//!
//! Rows are processed in blocks of [`BLOCK`] numbers, and no operation crosses lanes, so that the
//! bits do not depend on the instruction set. The loops count and index: methods of iterators and of
//! complex numbers are not inlined into functions compiled for another instruction set.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use pulp::{Simd, WithSimd};

use super::system::Entry;
use crate::linear_algebra::rows::{BLOCK, Rows};
use crate::simd::Instructions;

/// The sums of `slope` and of `value` times rows of `from`, over entries. The values are left out
/// without `with_values`.
pub(super) fn combine(entries: &[Entry], with_values: bool, from: &Rows, to: [&mut Rows; 2]) {
    Instructions::chosen().run(Combination {
        entries,
        with_values,
        from,
        to,
    });
}

struct Combination<'a> {
    entries: &'a [Entry],
    with_values: bool,
    from: &'a Rows,
    to: [&'a mut Rows; 2],
}

impl WithSimd for Combination<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            entries,
            with_values,
            from,
            to: [slopes, values],
        } = self;
        let stride = from.blocks();
        let (re, im) = from.parts();
        let (slope_re, slope_im) = slopes.blocks_mut();
        let (value_re, value_im) = values.blocks_mut();
        for c in 0..stride {
            let (mut sr, mut si) = ([0.0; BLOCK], [0.0; BLOCK]);
            let (mut vr, mut vi) = ([0.0; BLOCK], [0.0; BLOCK]);
            for k in 0..entries.len() {
                let Entry {
                    column,
                    slope,
                    value,
                } = entries[k];
                let (from_re, from_im) = (&re[column * stride + c], &im[column * stride + c]);
                if slope != 0.0 {
                    for l in 0..BLOCK {
                        sr[l] += slope * from_re[l];
                        si[l] += slope * from_im[l];
                    }
                }
                if with_values && value != 0.0 {
                    for l in 0..BLOCK {
                        vr[l] += value * from_re[l];
                        vi[l] += value * from_im[l];
                    }
                }
            }
            (slope_re[c], slope_im[c]) = (sr, si);
            (value_re[c], value_im[c]) = (vr, vi);
        }
    }
}
