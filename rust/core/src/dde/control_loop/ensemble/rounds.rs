//! Metrics of the loops of two vectors, from the traces of their runs.
//!
//! The extremes of the chunks of a trace show in which of them something may happen that counts
//! (`spots`). What it is, and when, is then found in stages: a corner, an extremum inside a part, or a
//! crossing of a level. Polynomials are needed for the last two alone.

use crate::simd::{Outlined, Simd, outlined};

use super::measured::Measured;
use super::search::Search;
use super::spots::spots;
use super::view::View;
use super::window::Window;

/// Measure a trace.
pub(super) fn measure<S: Simd>(view: &View<'_, S>, measured: &mut Measured<S>) {
    let zero = view.loops.zero;
    let mut spots = spots(view, measured);
    measured.counts = measured.counts & spots.parts.gt(0.0);
    let mut search = Search {
        view,
        spots: &mut spots,
        window: &mut Window::new(zero),
        pieces: &mut None,
        measured,
    };
    outlined(zero.simd(), Whole(&mut search));
}

/// See [`measure`].
struct Whole<'a, 'b, S: Simd>(&'a mut Search<'b, S>);

impl<S: Simd> Outlined for Whole<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let search = self.0;
        search.corners();
        if search.view.loops.is_curved {
            search.extremes();
        }
        search.rise(false);
        search.rise(true);
        if search.view.loops.is_curved {
            search.dips();
        }
        search.entry();
    }
}
