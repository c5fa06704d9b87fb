//! Blocks of loops, one after the other, and in each one pair of vectors after the other.

use pulp::WithSimd;

use crate::simd::{Instructions, Outlined, Real, Simd, outlined};

use super::block::Block;
use super::loops::{Loops, Plants};
use super::sets::Sets;
use super::shape::Shape;
use super::trace::Trace;
use super::walk::{Run, Walk};

/// A set in a block: its shape and its index.
pub(super) type Member = (Shape, usize);

/// What is done with the loops of two vectors.
pub(super) trait Job: Sync {
    type Found: Send;

    /// Append the results of the lanes of `members`.
    fn found<S: Simd, const P: usize>(
        &self,
        plants: &Plants<S, P>,
        run: &mut dyn Run<S>,
        members: &[Member],
        trace: &mut Trace<S>,
        found: &mut Vec<Self::Found>,
    );
}

struct Through<'a, J> {
    sets: &'a Sets<'a>,
    plant: usize,
    blocks: &'a [&'a [Member]],
    span: f64,
    job: &'a J,
}

/// Do `job` with all members of `blocks` for `span` seconds of each output, in their order. The
/// output depends on the first `plant` states alone.
pub(super) fn through<J: Job>(
    sets: &Sets<'_>,
    plant: usize,
    blocks: &[&[Member]],
    span: f64,
    job: &J,
) -> Vec<J::Found> {
    Instructions::chosen().run(Through {
        sets,
        plant,
        blocks,
        span,
        job,
    })
}

impl<J: Job> WithSimd for Through<'_, J> {
    type Output = Vec<J::Found>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let zero = Real::splat(simd, 0.0);
        let mut trace = Trace::new(zero);
        let mut found = Vec::with_capacity(self.blocks.iter().map(|block| block.len()).sum());
        for members in self.blocks {
            let Some(block) = Block::new(self.sets, members) else {
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
                match (self.sets.states(), self.plant) {
                    (1, _) => lanes.run::<1, 1>(&mut trace, &mut found),
                    (2, 1) => lanes.run::<2, 1>(&mut trace, &mut found),
                    (2, _) => lanes.run::<2, 2>(&mut trace, &mut found),
                    (3, 1) => lanes.run::<3, 1>(&mut trace, &mut found),
                    (3, 2) => lanes.run::<3, 2>(&mut trace, &mut found),
                    (3, _) => lanes.run::<3, 3>(&mut trace, &mut found),
                    (_, 1) => lanes.run::<4, 1>(&mut trace, &mut found),
                    (_, 2) => lanes.run::<4, 2>(&mut trace, &mut found),
                    (_, 3) => lanes.run::<4, 3>(&mut trace, &mut found),
                    _ => lanes.run::<4, 4>(&mut trace, &mut found),
                }
            }
        }
        found
    }
}

/// The loops of two vectors.
struct Pair<'a, S, J> {
    simd: S,
    block: &'a Block,
    pair: usize,
    members: &'a [Member],
    span: f64,
    job: &'a J,
}

impl<S: Simd, J: Job> Pair<'_, S, J> {
    fn run<const N: usize, const P: usize>(&self, trace: &mut Trace<S>, found: &mut Vec<J::Found>) {
        let made: Made<'_, S, N, P> = Made {
            simd: self.simd,
            block: self.block,
            pair: self.pair,
            span: self.span,
        };
        let loops = outlined(self.simd, made);
        let mut walk = Walk::new(&loops);
        let job = Done {
            job: self.job,
            plants: &loops.plants,
            run: &mut walk,
            members: self.members,
            trace,
            found,
        };
        outlined(self.simd, job);
    }
}

/// See [`Loops::new`].
struct Made<'a, S, const N: usize, const P: usize> {
    simd: S,
    block: &'a Block,
    pair: usize,
    span: f64,
}

impl<S: Simd, const N: usize, const P: usize> Outlined for Made<'_, S, N, P> {
    type Output = Loops<S, N, P>;

    #[inline(always)]
    fn run(self) -> Loops<S, N, P> {
        Loops::new(self.simd, self.block, self.pair, self.span)
    }
}

/// See [`Job::found`].
struct Done<'a, S: Simd, J: Job, const P: usize> {
    job: &'a J,
    plants: &'a Plants<S, P>,
    run: &'a mut dyn Run<S>,
    members: &'a [Member],
    trace: &'a mut Trace<S>,
    found: &'a mut Vec<J::Found>,
}

impl<S: Simd, J: Job, const P: usize> Outlined for Done<'_, S, J, P> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (members, trace) = (self.members, self.trace);
        self.job
            .found(self.plants, self.run, members, trace, self.found);
    }
}
