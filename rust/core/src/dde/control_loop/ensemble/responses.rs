//! Outputs of all loops of two vectors at given times.

use crate::simd::{Real, Simd};

use super::loops::Plants;
use super::sets::Outcome;
use super::through::{Job, Member};
use super::trace::{Trace, of};
use super::view::View;
use super::walk::Run;

/// The outputs at `times` after the start of each.
pub(super) struct ResponsesJob<'a> {
    pub(super) times: &'a [f64],
}

impl Job for ResponsesJob<'_> {
    type Found = (Vec<f64>, Outcome);

    #[inline(always)]
    fn found<S: Simd, const P: usize>(
        &self,
        loops: &Plants<S, P>,
        run: &mut dyn Run<S>,
        members: &[Member],
        trace: &mut Trace<S>,
        found: &mut Vec<Self::Found>,
    ) {
        let zero = loops.d.constant(0.0);
        let mut outputs: Vec<Vec<f64>> = members
            .iter()
            .map(|_| Vec::with_capacity(self.times.len()))
            .collect();
        run.begin(trace, true);
        let mut parts = vec![0_usize; zero.numbers().len()];
        let mut runs = true;
        while runs {
            runs = run.advance(trace);
            let view = View { loops, trace };
            loop {
                let (mut sigma, mut is_due) = (zero, false);
                let mut due = vec![false; outputs.len()];
                for (lane, done) in outputs.iter().enumerate() {
                    let Some(&time) = self.times.get(done.len()) else {
                        continue;
                    };
                    let time = time + of(&loops.ahead, lane);
                    if let Some((part, share)) = view.find(lane, time) {
                        (parts[lane], due[lane], is_due) = (part, true, true);
                        sigma.numbers_mut()[lane] = share;
                    }
                }
                if !is_due {
                    break;
                }
                let values = self.values(&view, &parts, sigma);
                for (lane, outputs) in outputs.iter_mut().enumerate() {
                    if due[lane] {
                        outputs.push(of(&values, lane));
                    }
                }
            }
        }
        let lost = run.lost().select(1.0, zero);
        found.extend(outputs.into_iter().enumerate().map(|(lane, outputs)| {
            if of(&lost, lane) > 0.0 {
                (Vec::new(), Outcome::Diverged)
            } else {
                (outputs, Outcome::Ok)
            }
        }));
    }
}

impl ResponsesJob<'_> {
    /// The outputs of each loop at `sigma` of a part.
    #[inline(always)]
    fn values<S: Simd, const P: usize>(
        &self,
        view: &View<'_, S, P>,
        parts: &[usize],
        sigma: Real<S>,
    ) -> Real<S> {
        if view.loops.is_curved {
            return view.piece(parts).at(sigma);
        }
        let (mut first, mut last) = (sigma, sigma);
        for (lane, &part) in parts.iter().enumerate() {
            first.numbers_mut()[lane] = view.trace.output(lane, part);
            last.numbers_mut()[lane] = view.trace.output(lane, part + 1);
        }
        sigma
            .gt(0.0)
            .select((last - first).mul_add(sigma, first), first)
    }
}
