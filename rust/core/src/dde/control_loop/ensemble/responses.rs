//! Outputs of all loops of two vectors at given times.

use crate::simd::Simd;

use super::loops::Runs;
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

    fn done(found: &Self::Found) -> impl Iterator<Item = bool> {
        found.iter().map(Option::is_some)
    }

    #[inline(always)]
    fn found<S: Simd>(
        &self,
        loops: &Runs<S>,
        run: &mut dyn Run<S>,
        members: &[usize],
        trace: &mut Trace<S>,
        found: &mut Vec<Self::Found>,
    ) {
        let zero = loops.zero;
        let mut outputs: Vec<Vec<f64>> = members
            .iter()
            .map(|_| Vec::with_capacity(self.times.len()))
            .collect();
        run.begin(trace);
        let mut piece = Piece::new(zero);
        let mut runs = true;
        while runs {
            runs = run.advance(trace);
            let view = View { loops, run, trace };
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
                let values = view.outputs((parts, sigma), parts.ge(0.0), &mut piece);
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
