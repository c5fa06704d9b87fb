//! The response of a loop in the caller's clock.
//!
//! The run starts at the first of the times. Times and jumps of the reference that differ from a
//! sample only by rounding errors of that clock are moved onto the sample. Breaking points of
//! output and command are merged into one list, in which points that differ only by rounding errors
//! are one.

use std::borrow::Cow;

use crate::memory::{append, collected, copied};
use crate::{Error, Task};

use super::linear_loop::{LinearLoop, Start};
use super::reference::Reference;
use super::requested_output::RequestedOutput;
use crate::dde::limits::{RESPONSE, finite};

/// Rounding error of a time of the clock, relative to the time.
const CLOCK: f64 = 4.0 * f64::EPSILON;

/// Breaking points closer than this share of their time are merged.
const ONE_BREAK: f64 = 64.0 * f64::EPSILON;

/// A request, in the caller's clock.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Output times, increasing; the first is the start of the run.
    pub time: &'a [f64],
    /// How much earlier than its measurement the output is, s: the delay, where it sits there.
    pub output_lead: f64,
    /// The reference before its first jump.
    pub reference_before: f64,
    /// Times of its jumps, increasing.
    pub reference_time: &'a [f64],
    /// Its values from those times on.
    pub reference: &'a [f64],
}

/// The response at the requested times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Response {
    /// y.
    pub outputs: Vec<f64>,
    /// The command after the limit.
    pub inputs: Vec<f64>,
    /// Breaking points of each, since the start of the run.
    output_breaks: Vec<f64>,
    input_breaks: Vec<f64>,
    delay: f64,
}

impl LinearLoop {
    /// The response to `request` from `start`.
    pub fn respond(
        &self,
        start: &Start,
        request: &Request<'_>,
        task: &Task,
    ) -> Result<Response, Error> {
        increasing("time", request.time)?;
        let Some(&first) = request.time.first() else {
            refuse!("time is empty: give at least one output time");
        };
        let since = |times: &[f64], least: f64| {
            let sample = self.sample_time().map(|ts| (ts, start.sample_phase));
            let moved = times
                .iter()
                .map(|time| on_sample(time - first, first, sample).max(least));
            collected(RESPONSE, moved)
        };
        let jumps = since(request.reference_time, f64::NEG_INFINITY)?;
        let values = copied(RESPONSE, request.reference)?;
        let reference = Reference::new(request.reference_before, jumps, values)?;
        let input_times = if first == 0.0 && self.sample_time().is_none() {
            Cow::Borrowed(request.time)
        } else {
            Cow::Owned(since(request.time, 0.0)?)
        };
        let later: Vec<f64>;
        let output_times = if request.output_lead == 0.0 {
            &input_times[..]
        } else {
            later = collected(
                RESPONSE,
                input_times.iter().map(|t| t + request.output_lead),
            )?;
            &later[..]
        };
        let requested = RequestedOutput::new(output_times, &input_times, 0.0)?;
        // In order and from the start on, as the times are that were given.
        finite("time since the start", &[requested.last()])?;
        let found = self.serve_increasing(start, &reference, requested, task)?;
        Ok(Response {
            outputs: found.outputs,
            inputs: found.inputs,
            output_breaks: found.output_breaks,
            input_breaks: found.input_breaks,
            delay: self.delay(),
        })
    }
}

impl Response {
    /// Breaking points of output and command, in the clock of the caller of `request`.
    pub fn breaks(&self, request: &Request<'_>) -> Result<Vec<f64>, Error> {
        let earlier = self.output_breaks.iter().map(|t| t - request.output_lead);
        let mut breaks = collected(RESPONSE, earlier)?;
        append(RESPONSE, &mut breaks, &self.input_breaks)?;
        breaks.retain(|&t| t >= 0.0);
        breaks.sort_unstable_by(f64::total_cmp);
        let mut last = f64::NEG_INFINITY;
        breaks.retain(|&t| t - std::mem::replace(&mut last, t) > ONE_BREAK * (t + self.delay));
        let first = request.time.first().copied().unwrap_or_default();
        for t in &mut breaks {
            *t += first;
        }
        Ok(breaks)
    }
}

impl Request<'_> {
    /// r at the output times.
    pub fn reference_at_times(&self) -> Result<Vec<f64>, Error> {
        let mut jumps = self.reference_time.iter().zip(self.reference).peekable();
        let mut last = self.reference_before;
        let reference = self.time.iter().map(|t| {
            while let Some((_, value)) = jumps.next_if(|(jump, _)| *jump <= t) {
                last = *value;
            }
            last
        });
        collected(RESPONSE, reference)
    }
}

/// `since` the start of a run at `start` of the clock, moved onto a sample if it differs from it
/// only by rounding errors. `sample` holds the sample time and the time of the first sample.
pub fn on_sample(since: f64, start: f64, sample: Option<(f64, f64)>) -> f64 {
    let Some((sample_time, phase)) = sample else {
        return since;
    };
    let nearest = phase + ((since - phase) / sample_time).round_ties_even() * sample_time;
    if (since - nearest).abs() <= CLOCK * (start.abs() + since.abs()) {
        nearest
    } else {
        since
    }
}

/// Refuse times that are not finite or do not increase.
fn increasing(name: &str, times: &[f64]) -> Result<(), Error> {
    // First a test without a place, which takes a fraction of the time.
    let is_finite = times.iter().fold(true, |all, time| all & time.is_finite());
    if is_finite
        && times
            .windows(2)
            .fold(true, |all, pair| all & (pair[1] > pair[0]))
    {
        return Ok(());
    }
    let previous = [f64::NEG_INFINITY];
    let pairs = previous.iter().chain(times).zip(times);
    match pairs
        .enumerate()
        .find(|(_, (before, time))| !(time > before && time.is_finite()))
    {
        None => Ok(()),
        Some((_, (_, time))) if !time.is_finite() => {
            refuse!("{name} contains {time}: give finite times")
        }
        Some((at, (before, time))) => refuse!(
            "{name}[{at}]={time:?} is not later than {name}[{}]={before:?}: give increasing \
             times",
            at - 1
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_that_do_not_increase_are_named() {
        let message = |times: &[f64]| increasing("time", times).unwrap_err().to_string();
        assert!(message(&[0.0, 1.0, 1.0]).starts_with("time[2]=1.0 is not later than time[1]"));
        assert!(message(&[f64::NAN]).contains("contains NaN"));
        assert!(message(&[0.0, f64::INFINITY]).contains("finite"));
        assert!(increasing("time", &[]).is_ok());
    }

    #[test]
    fn a_time_a_rounding_beside_a_sample_is_that_sample() {
        let sample = Some((0.065, 0.0));
        let t = 100.0 + 3.0 * 0.065;
        assert_eq!(on_sample(t - 100.0, 100.0, sample), 3.0 * 0.065);
        assert_eq!(on_sample(0.1951, 100.0, sample), 0.1951);
        assert_eq!(on_sample(t - 100.0, 100.0, None), t - 100.0);
    }
}
