//! Blocks of loops, one after the other, and in each one pair of vectors after the other.

use pulp::WithSimd;

use crate::simd::{Instructions, Real, Simd, outlined};

use super::block::{Block, Members};
use super::delayed::{Delayed, Steps};
use super::loops::{Loops, Runs};
use super::sets::{SETS, Sets};
use super::trace::Trace;
use super::walk::{Run, Walk};

/// What is done with the loops of two vectors.
pub(super) trait Job: Sync {
    /// The results of some sets.
    type Found: Send;

    /// For how many sets there are results.
    fn done(found: &Self::Found) -> usize;

    /// Append the results of the lanes of `members`.
    fn found<S: Simd>(
        &self,
        loops: &Runs<S>,
        run: &mut dyn Run<S>,
        members: &[usize],
        trace: &mut Trace<S>,
        found: &mut Vec<Self::Found>,
    );
}

struct Through<'a, J: Job> {
    sets: &'a Sets<'a>,
    plant: usize,
    blocks: &'a [Members<'a>],
    span: f64,
    job: &'a J,
    found: &'a mut Vec<J::Found>,
}

/// Do `job` with all members of `blocks` for `span` seconds of each output, and append the results
/// in their order. The output depends on the first `plant` states alone.
pub(super) fn through<J: Job>(
    sets: &Sets<'_>,
    plant: usize,
    blocks: &[Members<'_>],
    (span, job): (f64, &J),
    found: &mut Vec<J::Found>,
) {
    Instructions::chosen().run_widest(Through {
        sets,
        plant,
        blocks,
        span,
        job,
        found,
    });
}

impl<J: Job> WithSimd for Through<'_, J> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let zero = Real::splat(simd, 0.0);
        let mut trace = Trace::new(zero);
        let found = self.found;
        let pairs = SETS / (2 * S::F64_LANES);
        found.reserve(self.blocks.len() * pairs);
        for &(shape, members) in self.blocks {
            let Some(block) = Block::new(self.sets, (shape, members)) else {
                continue;
            };
            for (pair, members) in members.chunks(2 * S::F64_LANES).enumerate() {
                let lanes = Pair {
                    simd,
                    block: &block,
                    pair,
                    members,
                    span: self.span,
                    job: self.job,
                };
                if block.shape.is_continuous {
                    match self.sets.states() {
                        1 => lanes.step::<1>(&mut trace, found),
                        2 => lanes.step::<2>(&mut trace, found),
                        3 => lanes.step::<3>(&mut trace, found),
                        _ => lanes.step::<4>(&mut trace, found),
                    }
                    continue;
                }
                match (self.sets.states(), self.plant) {
                    (1, _) => lanes.run::<1, 1>(&mut trace, found),
                    (2, 1) => lanes.run::<2, 1>(&mut trace, found),
                    (2, _) => lanes.run::<2, 2>(&mut trace, found),
                    (3, 1) => lanes.run::<3, 1>(&mut trace, found),
                    (3, 2) => lanes.run::<3, 2>(&mut trace, found),
                    (3, _) => lanes.run::<3, 3>(&mut trace, found),
                    (_, 1) => lanes.run::<4, 1>(&mut trace, found),
                    (_, 2) => lanes.run::<4, 2>(&mut trace, found),
                    (_, 3) => lanes.run::<4, 3>(&mut trace, found),
                    _ => lanes.run::<4, 4>(&mut trace, found),
                }
            }
        }
    }
}

/// The loops of two vectors.
struct Pair<'a, S, J> {
    simd: S,
    block: &'a Block,
    pair: usize,
    members: &'a [usize],
    span: f64,
    job: &'a J,
}

impl<S: Simd, J: Job> Pair<'_, S, J> {
    /// Sampled loops.
    fn run<const N: usize, const P: usize>(&self, trace: &mut Trace<S>, found: &mut Vec<J::Found>) {
        let loops: Loops<S, N, P> = outlined(
            self.simd,
            #[inline(always)]
            || Loops::new(self.simd, self.block, self.pair, self.span),
        );
        self.process(&loops.runs, &mut Walk::new(&loops), trace, found);
    }

    /// Continuous loops.
    fn step<const N: usize>(&self, trace: &mut Trace<S>, found: &mut Vec<J::Found>) {
        let loops: Delayed<S, N> = outlined(
            self.simd,
            #[inline(always)]
            || Delayed::new(self.simd, self.block, self.pair, self.span),
        );
        self.process(&loops.runs, &mut Steps::new(&loops), trace, found);
    }

    fn process(
        &self,
        loops: &Runs<S>,
        run: &mut dyn Run<S>,
        trace: &mut Trace<S>,
        found: &mut Vec<J::Found>,
    ) {
        outlined(
            self.simd,
            #[inline(always)]
            || self.job.found(loops, run, self.members, trace, found),
        );
    }
}
