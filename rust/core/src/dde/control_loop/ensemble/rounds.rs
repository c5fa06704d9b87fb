//! Metrics of the loops of two vectors, from the traces of their runs.
//!
//! The extremes of the chunks of a trace show in which of them something may happen that counts
//! (`spots`). What it is, and when, is then found in stages: a corner, an extremum inside a part, or a
//! crossing of a level. Polynomials are needed for the last two alone.

use crate::simd::{Simd, outlined};

use super::measured::Measured;
use super::search::Search;
use super::spots::Spots;
use super::view::View;

/// Measure a trace.
pub(super) fn measure<S: Simd>(view: &View<'_, S>, measured: &mut Measured<S>) {
    let zero = view.loops.zero;
    let mut spots = outlined(
        zero.simd(),
        #[inline(always)]
        || Spots::new(view.trace, measured),
    );
    measured.counts = measured.counts & spots.parts.gt(0.0);
    let mut search = Search {
        view,
        spots: &mut spots,
        pieces: &mut None,
        measured,
    };
    outlined(
        zero.simd(),
        #[inline(always)]
        || search.whole(),
    );
}

impl<S: Simd> Search<'_, S> {
    #[inline(always)]
    fn whole(&mut self) {
        self.corners();
        if self.view.loops.is_curved {
            self.extremes();
        }
        self.rise(false);
        self.rise(true);
        if self.view.loops.is_curved {
            self.dips();
        }
        self.entry();
    }
}
