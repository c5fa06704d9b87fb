//! The output of sampled loops on one part of a sample of each, from the states at the sample.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::simd::{Mask, Real, Simd};

use super::loops::{Plants, Runs};
use super::piece::Piece;
use super::trace::{Trace, of};
use super::transition::row;

impl<S: Simd> Trace<S> {
    /// The states and commands of parts, and the numbers of these within their samples.
    #[inline(always)]
    fn gather<const P: usize>(
        &self,
        parts: Real<S>,
        x: &mut [Real<S>; P],
        [before, after, numbers]: [&mut Real<S>; 3],
    ) {
        for (lane, &part) in parts.numbers().iter().enumerate() {
            if part < 0.0 {
                continue;
            }
            let (sample, number) = self.split(part as usize);
            let states = self.states.get(sample * P..(sample + 1) * P);
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

impl<S: Simd, const P: usize> Plants<S, P> {
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
        let wanted = parts.ge(0.0);
        let (mut x, mut before, mut after, mut numbers) = ([zero; P], zero, zero, zero);
        // Neighbours often have the same part.
        if let Some(part) = shared(parts, wanted) {
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
            trace.gather(parts, &mut x, [&mut before, &mut after, &mut numbers]);
        }
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
        for i in 0..P {
            v[i] = row(&self.a[i], &x, self.b[i].mul_add(w, self.e[i])) * h;
        }
        piece.terms[1] = self.seen(&v);
        for j in 2..=piece.degree {
            let factor = h * (1.0 / j as f64);
            let old = v;
            for i in 0..P {
                v[i] = row(&self.a[i], &old, zero) * factor;
            }
            piece.terms[j] = self.seen(&v);
        }
    }
}

/// The number that all lanes in `here` have in common.
#[inline(always)]
fn shared<S: Simd>(numbers: Real<S>, here: Mask<S>) -> Option<f64> {
    let lanes = here.select(numbers, numbers.constant(f64::NAN));
    let first = *lanes.numbers().iter().find(|number| !number.is_nan())?;
    let others = here & !numbers.eq(first);
    (!others.any()).then_some(first)
}
