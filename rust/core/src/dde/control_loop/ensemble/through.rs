//! A pass through all lanes of a block, one pair of vectors after the other.

use pulp::WithSimd;

use crate::simd::{Instructions, Real, Simd};

use super::block::{Block, SETS};
use super::walk::{Sink, load, walk};

/// A pass through all lanes of a block.
struct Through<'a, T> {
    block: &'a Block,
    /// Time after the start at which the pass ends.
    span: f64,
    visitor: T,
}

/// Creates a sink for each pair of vectors, and receives it back together with the lanes that
/// diverged.
pub(super) trait Visitor {
    type Kept;

    type Sink<S: Simd>: Sink<S>;

    fn begin<S: Simd>(&mut self, simd: S, pair: usize, end: Real<S>) -> Self::Sink<S>;

    fn finish<S: Simd>(&mut self, pair: usize, sink: Self::Sink<S>, lost: Real<S>);

    fn kept(self) -> Self::Kept;
}

impl<T: Visitor> WithSimd for Through<'_, T> {
    type Output = T::Kept;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> T::Kept {
        for pair in 0..SETS / (2 * S::F64_LANES) {
            let end = load(simd, &self.block.ahead, pair) + self.span;
            let mut sink = self.visitor.begin(simd, pair, end);
            let lost = match self.block.states {
                1 => walk::<S, 1>(simd, self.block, pair, end, &mut sink),
                2 => walk::<S, 2>(simd, self.block, pair, end, &mut sink),
                3 => walk::<S, 3>(simd, self.block, pair, end, &mut sink),
                _ => walk::<S, 4>(simd, self.block, pair, end, &mut sink),
            };
            let lost = lost.select(1.0, Real::splat(simd, 0.0));
            self.visitor.finish(pair, sink, lost);
        }
        self.visitor.kept()
    }
}

/// Run all lanes with `visitor`, for `span` seconds from the start of each output.
pub(super) fn through<T: Visitor>(block: &Block, span: f64, visitor: T) -> T::Kept {
    Instructions::chosen().run(Through {
        block,
        span,
        visitor,
    })
}
