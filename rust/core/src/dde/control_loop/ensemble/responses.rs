//! Outputs of all loops of two vectors at given times.

use crate::simd::{Real, Simd};

use super::loops::Plants;
use super::piece::Piece;
use super::sets::Outcome;
use super::through::Job;
use super::trace::{Trace, of};
use super::view::View;
use super::walk::Run;

/// The outputs at `times` after the start of each.
pub(super) struct ResponsesJob<'a> {
    pub(super) times: &'a [f64],
}

impl Job for ResponsesJob<'_> {
    type Found = Vec<Option<(Vec<f64>, Outcome)>>;

    fn done(found: &Self::Found) -> usize {
        found.iter().flatten().count()
    }

    #[inline(always)]
    fn found<S: Simd, const P: usize>(
        &self,
        loops: &Plants<S, P>,
        run: &mut dyn Run<S>,
        members: &[usize],
        trace: &mut Trace<S>,
        found: &mut Vec<Self::Found>,
    ) {
        let zero = loops.d.constant(0.0);
        let mut outputs: Vec<Vec<f64>> = members
            .iter()
            .map(|_| Vec::with_capacity(self.times.len()))
            .collect();
        run.begin(trace, true);
        let mut piece = Piece::new(zero);
        let mut runs = true;
        while runs {
            runs = run.advance(trace);
            let view = View { loops, trace };
            loop {
                let (mut sigma, mut is_due) = (zero, false);
                let mut parts = zero.constant(-1.0);
                for (lane, done) in outputs.iter().enumerate() {
                    let Some(&time) = self.times.get(done.len()) else {
                        continue;
                    };
                    let time = time + of(&loops.ahead, lane);
                    if let Some((part, share)) = view.find(lane, time) {
                        is_due = true;
                        parts.numbers_mut()[lane] = part as f64;
                        sigma.numbers_mut()[lane] = share;
                    }
                }
                if !is_due {
                    break;
                }
                let values = self.values(&view, parts, sigma, &mut piece);
                for (lane, outputs) in outputs.iter_mut().enumerate() {
                    if of(&parts, lane) >= 0.0 {
                        outputs.push(of(&values, lane));
                    }
                }
            }
        }
        let lost = run.lost().select(1.0, zero);
        let unfit = run.unfit().select(1.0, zero);
        let outputs = outputs.into_iter().enumerate().map(|(lane, outputs)| {
            if of(&unfit, lane) > 0.0 {
                None
            } else if of(&lost, lane) > 0.0 {
                Some((Vec::new(), Outcome::Diverged))
            } else {
                Some((outputs, Outcome::Ok))
            }
        });
        found.push(outputs.collect());
    }
}

impl ResponsesJob<'_> {
    /// The outputs of each loop at `sigma` of a part.
    #[inline(always)]
    fn values<S: Simd, const P: usize>(
        &self,
        view: &View<'_, S, P>,
        parts: Real<S>,
        sigma: Real<S>,
        piece: &mut Piece<S>,
    ) -> Real<S> {
        if view.loops.is_curved {
            view.piece(parts, parts.ge(0.0), piece);
            return piece.at(sigma);
        }
        let (mut first, mut last) = (sigma, sigma);
        for (lane, &part) in parts.numbers().iter().enumerate() {
            if part < 0.0 {
                continue;
            }
            let part = part as usize;
            first.numbers_mut()[lane] = view.trace.output(lane, part);
            last.numbers_mut()[lane] = view.trace.output(lane, part + 1);
        }
        sigma
            .gt(0.0)
            .select((last - first).mul_add(sigma, first), first)
    }
}
