//! Responses of a loop, sampled or in continuous time, after a check of the start.

use super::linear_loop::{LinearLoop, Start};
use super::reference::Reference;
use super::requested_output::{RequestedOutput, Trajectory};
use super::{continuous, sampled};
use crate::dde::limits::finite;
use crate::dde::scalar::Scalar;
use crate::{Error, Task};

impl<S: Scalar> LinearLoop<S> {
    /// y at `output_times` and the limited command at `input_times` (both increasing, ≥ 0, s).
    pub fn simulate(
        &self,
        start: &Start<S>,
        reference: &Reference,
        output_times: &[f64],
        input_times: &[f64],
        task: &Task,
    ) -> Result<Trajectory<S>, Error> {
        let requested = RequestedOutput::new(output_times, input_times, S::default())?;
        self.serve(start, reference, requested, task)
    }

    /// Run until all requested values are stored.
    ///
    /// # Errors
    /// As `serve_increasing`; [`Error::Argument`] also where times are not finite, negative or out of order.
    pub(crate) fn serve(
        &self,
        start: &Start<S>,
        reference: &Reference,
        requested: RequestedOutput<'_, S>,
        task: &Task,
    ) -> Result<Trajectory<S>, Error> {
        let [output_times, input_times] = requested.times();
        let both = [output_times, input_times];
        let is_one = std::ptr::eq(output_times, input_times);
        for times in &both[usize::from(is_one)..] {
            finite("time", times)?;
            if let Some(&first) = times.first()
                && first < 0.0
            {
                refuse!("time {first} is before the start of the run: leave it out");
            }
            let is_sorted = times
                .windows(2)
                .fold(true, |all, pair| all & (pair[1] >= pair[0]));
            if !is_sorted && let Some(pair) = times.windows(2).find(|pair| pair[1] < pair[0]) {
                refuse!("time {} follows {}: sort the times", pair[1], pair[0]);
            }
        }
        self.serve_increasing(start, reference, requested, task)
    }

    /// [`Self::serve`] for times that are known to be finite, in order and not before the start.
    pub(super) fn serve_increasing(
        &self,
        start: &Start<S>,
        reference: &Reference,
        requested: RequestedOutput<'_, S>,
        task: &Task,
    ) -> Result<Trajectory<S>, Error> {
        self.check_start(start)?;
        match self.sample_time() {
            Some(ts) => sampled::run(self, ts, start, reference, requested, task),
            None => continuous::run(self, start, reference, requested, task),
        }
    }

    fn check_start(&self, start: &Start<S>) -> Result<(), Error> {
        let n = self.equations().states();
        refuse_if!(
            start.state.len() != n,
            "the initial state has {} elements, but the loop has {n} states",
            start.state.len()
        );
        finite("initial state", &start.state)?;
        finite("command before the start", &[start.command])?;
        finite("command_history", &start.command_history)?;
        match self.sample_time() {
            Some(ts) if !(0.0..ts.value()).contains(&start.sample_phase) => {
                refuse!(
                    "sample_phase={}: give a time from 0 to below {} s",
                    start.sample_phase,
                    ts.value()
                )
            }
            None if !start.command_history.is_empty() || start.sample_phase != 0.0 => {
                Err(Error::argument(
                    "command_history and sample_phase apply only to sampled loops: give the loop \
                     a sample_time or leave them out",
                ))
            }
            _ => Ok(()),
        }
    }
}
