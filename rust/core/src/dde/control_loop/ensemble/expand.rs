//! The output of sampled loops on one part of a sample of each, from the states at the sample.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::simd::{Real, Simd};

use super::loops::{Plants, Runs};
use super::piece::Piece;
use super::trace::{Trace, of};
use super::transition::row;

impl<S: Simd> Trace<S> {
    /// The states and commands of parts, and the numbers of these within their samples.
    #[inline(always)]
    fn gather<const N: usize>(
        &self,
        parts: Real<S>,
        x: &mut [Real<S>; N],
        [before, after, numbers]: [&mut Real<S>; 3],
    ) {
        for (lane, &part) in parts.numbers().iter().enumerate() {
            if part < 0.0 {
                continue;
            }
            let (sample, number) = self.split(part as usize);
            let states = self.states.get(sample * N..(sample + 1) * N);
            let states = states.unwrap_or_default();
            for (x, state) in x.iter_mut().zip(states) {
                x.numbers_mut()[lane] = of(state, lane);
            }
            if let Some([earlier, later]) = self.commands.get(sample..sample + 2) {
                before.numbers_mut()[lane] = of(earlier, lane);
                after.numbers_mut()[lane] = of(later, lane);
            }
            numbers.numbers_mut()[lane] = number as f64;
        }
    }
}

impl<S: Simd, const N: usize> Plants<S, N> {
    /// See [`super::walk::Run::piece`].
    #[inline(always)]
    pub(super) fn expand(
        &self,
        runs: &Runs<S>,
        trace: &Trace<S>,
        parts: Real<S>,
        piece: &mut Piece<S>,
    ) {
        let zero = runs.zero;
        let (mut x, mut before, mut after, mut numbers) = ([zero; N], zero, zero, zero);
        trace.gather(parts, &mut x, [&mut before, &mut after, &mut numbers]);
        let sample = x;
        let (mut w, mut h) = (before, zero);
        for (number, (part, start)) in runs.parts.iter().zip(&self.starts).enumerate() {
            let here = numbers.eq(number as f64);
            if !here.any() {
                continue;
            }
            h = here.select(part.length, h);
            if part.is_after {
                w = here.select(after, w);
            }
            if number > 0 {
                let start = start.apply(&sample, before, after);
                for (x, start) in x.iter_mut().zip(start) {
                    *x = here.select(start, *x);
                }
            }
        }
        piece.terms[0] = row(&self.c, &x, runs.d * w);
        let mut v = x;
        for i in 0..N {
            v[i] = row(&self.a[i], &x, self.b[i].mul_add(w, self.e[i])) * h;
        }
        piece.terms[1] = row(&self.c, &v, zero);
        for j in 2..=piece.degree {
            let factor = h * (1.0 / j as f64);
            let old = v;
            for i in 0..N {
                v[i] = row(&self.a[i], &old, zero) * factor;
            }
            piece.terms[j] = row(&self.c, &v, zero);
        }
    }
}
