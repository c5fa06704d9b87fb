//! Metrics of the loops of a block, from the traces of their runs.
//!
//! The extremes of the chunks of a trace show in which of them something may happen that counts, in
//! all loops at once (`spots`). What it is, and when, is then found for each loop by itself: a
//! corner, an extremum inside a part, or a crossing of a level. Polynomials are needed for the last
//! two alone; those of all loops are made and solved together, one for each loop at a time.

use crate::simd::{Mask, Outlined, Real, Simd, outlined};

use super::block::SETS;
use super::measured::{Measured, Wanted};
use super::piece::{Extrema, Piece};
use super::search::{Found, One};
use super::spots::spots;
use super::view::View;

/// An extremum counts if it may exceed the one known by this share of the step: rounding errors of
/// a settled output are below it.
const ROUNDING: f64 = 1e-13;

/// Measure a trace. `lanes` holds one record for each lane.
pub(super) fn measure<S: Simd, const P: usize>(view: &View<'_, S, P>, lanes: &mut [Measured]) {
    let spots = spots(view, lanes, ROUNDING);
    let zero = view.loops.d.constant(0.0);
    for (lane, measured) in lanes.iter_mut().enumerate() {
        let one = One {
            view,
            spots: &spots,
            lane,
        };
        one.corners(measured);
    }
    let mut parts = [None; SETS];
    let mut wanted: [Option<Wanted>; SETS] = [None; SETS];
    let mut level = zero;
    loop {
        let (mut is_open, mut crosses) = (zero, zero);
        let mut high = zero.constant(1.0);
        let mut any = false;
        for (lane, measured) in lanes.iter_mut().enumerate() {
            let one = One {
                view,
                spots: &spots,
                lane,
            };
            let next = one.next(measured);
            parts[lane] = next.map(|(part, _)| part);
            wanted[lane] = next.map(|(_, wanted)| wanted);
            if let Some((part, found)) = next {
                any = true;
                is_open.numbers_mut()[lane] = 1.0;
                if let Wanted::Crossing(at) = found {
                    crosses.numbers_mut()[lane] = 1.0;
                    level.numbers_mut()[lane] = at;
                    high.numbers_mut()[lane] = one.until(part);
                }
            }
        }
        if !any {
            return;
        }
        let piece = view.piece(&parts[..lanes.len()]);
        let solve = Solve {
            piece: &piece,
            is_open,
            crosses,
            level,
            high,
        };
        let (extrema, sigma) = outlined(level.simd(), solve);
        let found = Found {
            piece: &piece,
            extrema: &extrema,
            sigma,
        };
        for (lane, measured) in lanes.iter_mut().enumerate() {
            if let (Some(part), Some(wanted)) = (parts[lane], wanted[lane]) {
                let one = One {
                    view,
                    spots: &spots,
                    lane,
                };
                one.accept(measured, part, wanted, &found);
            }
        }
    }
}

/// The extrema of the pieces of a round, and where they cross their levels.
struct Solve<'a, S: Simd> {
    piece: &'a Piece<S>,
    /// 1 where something is wanted, and where that is a crossing.
    is_open: Real<S>,
    crosses: Real<S>,
    level: Real<S>,
    /// Where the bracket ends.
    high: Real<S>,
}

impl<S: Simd> Outlined for Solve<'_, S> {
    type Output = (Extrema<S>, Real<S>);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let zero = self.level.constant(0.0);
        let extrema = self.piece.extrema(self.is_open.gt(0.0));
        let is_simple: Mask<S> = self.crosses.gt(0.0) & extrema.has_none;
        let mut sigma = zero.constant(f64::NAN);
        if is_simple.any() {
            let found = self.piece.zero(self.level, zero, self.high, is_simple);
            sigma = is_simple.select(found, sigma);
        }
        (extrema, sigma)
    }
}
