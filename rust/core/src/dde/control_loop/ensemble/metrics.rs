//! The metrics of all loops of two vectors.

use crate::dde::control_loop::metrics::{Criteria, Levels, Pace, TIME_CONSTANTS};
use crate::simd::Simd;

use super::loops::Runs;
use super::measured::Measured;
use super::rounds::measure;
use super::sets::{Measures, Outcome, SETS, UNKNOWN, of as number};
use super::through::Job;
use super::trace::{Trace, of};
use super::view::View;
use super::walk::Run;

/// Measure every response between its start and `span` seconds later.
pub(super) struct MetricsJob<'a> {
    /// The steady state of each set, NaN where its last output is to count as that.
    pub(super) steady: &'a [f64],
    /// Slowest time constant of plant and controller of each set.
    pub(super) slowest: &'a [f64],
    pub(super) span: f64,
    pub(super) criteria: Criteria,
}

impl Job for MetricsJob<'_> {
    type Found = Measures;

    fn done(found: &Measures) -> impl Iterator<Item = bool> {
        let outcomes = found.outcomes.iter().take(found.count);
        outcomes.map(Option::is_some)
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
        let mut steady = zero;
        for (lane, place) in steady.numbers_mut().iter_mut().enumerate() {
            *place = members
                .get(lane)
                .map_or(0.0, |&set| number(self.steady, set));
        }
        run.begin(trace);
        let mut runs = advance(loops, run, trace);
        let is_known = steady.eq(steady);
        if (!is_known).any() {
            let mut last = trace.last(zero);
            let mut is_longer = false;
            while advance(loops, run, trace) {
                last = trace.last(last);
                is_longer = true;
            }
            if is_longer {
                run.begin(trace);
                runs = advance(loops, run, trace);
            }
            steady = is_known.select(steady, last);
        }
        let first = loops.first_output;
        let levels: [Levels; SETS] = std::array::from_fn(|lane| {
            let lane = lane.min(zero.numbers().len() - 1);
            Levels::new(of(&first, lane), of(&steady, lane), &self.criteria)
        });
        let mut measured = Measured::new(&levels, first, members.len());
        while runs {
            measure(&View { loops, run, trace }, &mut measured);
            runs = advance(loops, run, trace);
        }
        let lost = run.lost().select(1.0, zero);
        let unfit = run.unfit().select(1.0, zero);
        let limited = run.limited_until();
        let mut measures = Measures::NONE;
        let mut radius = zero;
        let mut is_doubtful = false;
        for (lane, (&set, levels)) in members.iter().zip(&levels).enumerate() {
            if of(&unfit, lane) > 0.0 {
                measures.push(UNKNOWN, None);
                continue;
            }
            if of(&lost, lane) > 0.0 {
                measures.push(UNKNOWN, Some(Outcome::Diverged));
                continue;
            }
            let ahead = of(&loops.ahead, lane);
            let mut record = measured.record(lane);
            for time in [&mut record.top.1, &mut record.bottom.1] {
                *time = (*time - ahead).max(0.0);
            }
            record.risen = (since(record.risen.0, ahead), since(record.risen.1, ahead));
            record.inside_since = since(record.inside_since, ahead);
            record.unsettled_until -= ahead;
            record.limited_until = of(&limited, lane);
            let outcome = Outcome::from(record.verdict(&Pace {
                span: self.span,
                wait: of(&loops.wait, lane),
                slowest: number(self.slowest, set),
            }));
            let inside = record.time_inside(self.span);
            if outcome == Outcome::Doubtful && inside > 0.0 {
                is_doubtful = true;
                let sample_time = of(&loops.sample_time, lane);
                radius.numbers_mut()[lane] = libm::exp(-TIME_CONSTANTS * sample_time / inside);
            }
            let found = (record.metrics(levels), record.limited_until);
            measures.push(found, Some(outcome));
        }
        if is_doubtful {
            let decay = run.decay(radius);
            let (yes, no) = (decay.yes.select(1.0, zero), decay.no.select(1.0, zero));
            for (lane, outcome) in measures.outcomes.iter_mut().enumerate() {
                if *outcome != Some(Outcome::Doubtful) || of(&radius, lane) <= 0.0 {
                    continue;
                }
                if of(&yes, lane) > 0.0 {
                    *outcome = Some(Outcome::Ok);
                } else if of(&no, lane) > 0.0 {
                    *outcome = Some(Outcome::Unsettled);
                }
            }
        }
        found.push(measures);
    }
}

/// A time since the start of the output.
fn since(time: f64, ahead: f64) -> f64 {
    if time > ahead {
        time - ahead
    } else {
        // NaN remains.
        0.0 * time
    }
}

/// Run on, and store the outputs at the ends of runs that end inside a part.
#[inline(always)]
fn advance<S: Simd>(loops: &Runs<S>, run: &mut dyn Run<S>, trace: &mut Trace<S>) -> bool {
    let runs = run.advance(trace);
    if runs && trace.is_cut.any() {
        let output = View { loops, run, trace }.cut();
        for lane in trace.is_cut.lanes() {
            trace.set_last(lane, of(&output, lane));
        }
    }
    runs
}
