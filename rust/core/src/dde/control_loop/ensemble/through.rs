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

    /// For each set whether it has a result, or has to run alone.
    fn done(found: &Self::Found) -> impl Iterator<Item = bool>;

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
    blocks: &'a [Members<'a>],
    span: f64,
    job: &'a J,
    found: &'a mut Vec<J::Found>,
}

/// Do `job` with all members of `blocks` for `span` seconds of each output, and append the results
/// in their order.
pub(super) fn through<J: Job>(
    sets: &Sets<'_>,
    blocks: &[Members<'_>],
    (span, job): (f64, &J),
    found: &mut Vec<J::Found>,
) {
    Instructions::chosen().run_widest(Through {
        sets,
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
                match self.sets.states() {
                    1 => lanes.run::<1>(&mut trace, found),
                    2 => lanes.run::<2>(&mut trace, found),
                    3 => lanes.run::<3>(&mut trace, found),
                    _ => lanes.run::<4>(&mut trace, found),
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
    fn run<const N: usize>(&self, trace: &mut Trace<S>, found: &mut Vec<J::Found>) {
        if self.block.shape.is_continuous {
            let loops: Delayed<S, N> = outlined(
                self.simd,
                #[inline(always)]
                || Delayed::new(self.simd, self.block, self.pair, self.span),
            );
            self.process(&loops.runs, &mut Steps::new(&loops), trace, found);
        } else {
            let loops: Loops<S, N> = outlined(
                self.simd,
                #[inline(always)]
                || Loops::new(self.simd, self.block, self.pair, self.span),
            );
            self.process(&loops.runs, &mut Walk::new(&loops), trace, found);
        }
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
