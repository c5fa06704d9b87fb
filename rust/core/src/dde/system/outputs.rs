//! The requested outputs, states and inputs of a run, and its breaks.

use super::equations::{SystemEquations, SystemResponse};
use super::terms::Feed;
use super::track::Track;
use crate::Error;
use crate::dde::limits::{RESPONSE, slack};
use crate::memory::{push, reserved};

/// The requested times and the values so far.
#[derive(Debug)]
pub(super) struct Outputs<'a> {
    times: &'a [f64],
    n: usize,
    p: usize,
    q: usize,
    state: Vec<Feed>,
    slope: Vec<Feed>,
    direct: Vec<Feed>,
    places: [usize; 2],
    longest: f64,
    served: usize,
    found: SystemResponse,
}

impl<'a> Outputs<'a> {
    pub(super) fn new(
        equations: &SystemEquations,
        times: &'a [f64],
        longest: f64,
    ) -> Result<Self, Error> {
        let (n, p, q) = (equations.states, equations.inputs, equations.outputs);
        let columns = |width: usize| reserved(RESPONSE, width.saturating_mul(times.len()));
        let found = SystemResponse {
            outputs: columns(q)?,
            states: columns(n)?,
            inputs: columns(p)?,
            breaks: Vec::new(),
        };
        Ok(Self {
            times,
            n,
            p,
            q,
            state: Feed::all(&equations.output, n, 1.0),
            slope: Feed::all(&equations.output_derivative, n, 1.0),
            direct: Feed::all(&equations.direct, p, 1.0),
            places: [0; 2],
            longest,
            served: 0,
            found,
        })
    }

    /// The last requested time.
    pub(super) fn last(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Store the values at the times before `end`, of the state, its derivative and the input.
    pub(super) fn before(&mut self, end: f64, signals: [&Track; 3]) {
        while let Some(&t) = self.times.get(self.served) {
            if t >= end {
                break;
            }
            self.serve(t, signals);
        }
    }

    fn serve(&mut self, t: f64, signals: [&Track; 3]) {
        let tolerance = slack(t, self.longest);
        let [states, _, inputs] = signals;
        let [state, input] = &mut self.places;
        states.seek(state, t, tolerance);
        inputs.seek(input, t, tolerance);
        let found = &mut self.found;
        let state = (0..self.n).map(|i| states.at(*state, t, i));
        found.states.extend(state);
        let input = (0..self.p).map(|i| inputs.at(*input, t, i));
        found.inputs.extend(input);
        let first = found.outputs.len();
        found.outputs.resize(first + self.q, 0.0);
        let y = &mut found.outputs[first..];
        let feeds = [&mut self.state, &mut self.slope, &mut self.direct];
        for (feeds, track) in feeds.into_iter().zip(signals) {
            for feed in feeds {
                feed.add_value(track, t, self.longest, y);
            }
        }
        self.served += 1;
    }

    /// Store a break of the state at `t`, and the times at which it appears in the output.
    pub(super) fn state_break(&mut self, t: f64) -> Result<(), Error> {
        self.note(t)?;
        for i in 0..self.state.len() {
            self.note(t + self.state[i].delay)?;
        }
        for i in 0..self.slope.len() {
            self.note(t + self.slope[i].delay)?;
        }
        Ok(())
    }

    /// Store a break of the input at `t`, and the times at which it appears in the output.
    pub(super) fn input_break(&mut self, t: f64) -> Result<(), Error> {
        self.note(t)?;
        for i in 0..self.direct.len() {
            self.note(t + self.direct[i].delay)?;
        }
        Ok(())
    }

    fn note(&mut self, t: f64) -> Result<(), Error> {
        if t >= 0.0 && t <= self.last() + slack(t, self.longest) {
            push(RESPONSE, &mut self.found.breaks, t)?;
        }
        Ok(())
    }

    /// The result, with breaks in order; those that differ only by rounding errors are merged.
    pub(super) fn finish(mut self) -> SystemResponse {
        let longest = self.longest;
        self.found.breaks.sort_by(f64::total_cmp);
        self.found
            .breaks
            .dedup_by(|later, earlier| *later <= *earlier + 4.0 * slack(*later, longest));
        self.found
    }
}
