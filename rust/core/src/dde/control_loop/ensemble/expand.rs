//! The output of sampled loops on one part of a sample of each, from the states at the sample.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::simd::{Outlined, Real, Simd};

use super::loops::{Plants, Runs};
use super::piece::Piece;
use super::trace::{Trace, of};
use super::transition::row;
use super::window::shared;

/// See [`super::walk::Run::piece`].
pub(super) struct Expand<'a, S: Simd, const P: usize> {
    pub(super) runs: &'a Runs<S>,
    pub(super) plants: &'a Plants<S, P>,
    pub(super) trace: &'a Trace<S>,
    pub(super) parts: Real<S>,
    pub(super) piece: &'a mut Piece<S>,
}

impl<S: Simd, const P: usize> Expand<'_, S, P> {
    /// The states and commands, and the numbers of the parts within their samples.
    #[inline(always)]
    fn gather(&self, x: &mut [Real<S>; P], [before, after, numbers]: [&mut Real<S>; 3]) {
        let trace = self.trace;
        for (lane, &part) in self.parts.numbers().iter().enumerate() {
            if part < 0.0 {
                continue;
            }
            let (sample, number) = trace.split(part as usize);
            let states = trace.states.get(sample * P..(sample + 1) * P);
            let states = states.unwrap_or_default();
            for (x, state) in x.iter_mut().zip(states) {
                x.numbers_mut()[lane] = of(state, lane);
            }
            if let Some([earlier, later]) = trace.commands.get(sample..sample + 2) {
                before.numbers_mut()[lane] = of(earlier, lane);
                after.numbers_mut()[lane] = of(later, lane);
            }
            numbers.numbers_mut()[lane] = number as f64;
        }
    }
}

impl<S: Simd, const P: usize> Outlined for Expand<'_, S, P> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (runs, plants, trace) = (self.runs, self.plants, self.trace);
        let zero = runs.zero;
        let wanted = self.parts.ge(0.0);
        let (mut x, mut before, mut after, mut numbers) = ([zero; P], zero, zero, zero);
        // Neighbours often have the same part.
        if let Some(part) = shared(self.parts, wanted) {
            let (sample, number) = trace.split(part as usize);
            let states = trace.states.get(sample * P..(sample + 1) * P);
            if let (Some(states), Some(&[earlier, later])) =
                (states, trace.commands.get(sample..sample + 2))
            {
                x.copy_from_slice(states);
                (before, after) = (earlier, later);
            }
            numbers = zero.constant(number as f64);
        } else {
            self.gather(&mut x, [&mut before, &mut after, &mut numbers]);
        }
        let sample = x;
        let (mut w, mut h) = (before, zero);
        for (number, (part, start)) in runs.parts.iter().zip(&plants.starts).enumerate() {
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
        let piece = self.piece;
        piece.terms[0] = row(&plants.c, &x, runs.d * w);
        let mut v = x;
        for i in 0..P {
            v[i] = row(&plants.a[i], &x, plants.b[i].mul_add(w, plants.e[i])) * h;
        }
        piece.terms[1] = plants.seen(&v);
        for j in 2..=piece.degree {
            let factor = h * (1.0 / j as f64);
            let old = v;
            for i in 0..P {
                v[i] = row(&plants.a[i], &old, zero) * factor;
            }
            piece.terms[j] = plants.seen(&v);
        }
    }
}
