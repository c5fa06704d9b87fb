//! A checked system, and its responses.

use super::equations::{Past, Signal, SystemEquations, SystemResponse};
use super::run;
use crate::dde::limits::finite;
use crate::{Error, Task};

/// A validated system.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearSystem {
    equations: SystemEquations,
}

impl LinearSystem {
    /// Check the equations.
    pub fn new(equations: SystemEquations) -> Result<Self, Error> {
        let (n, p, q) = (equations.states, equations.inputs, equations.outputs);
        let groups = [
            ("A", &equations.state, n, n),
            ("N", &equations.derivative, n, n),
            ("B", &equations.input, n, p),
            ("C", &equations.output, q, n),
            ("F", &equations.output_derivative, q, n),
            ("D", &equations.direct, q, p),
        ];
        for (name, terms, rows, columns) in groups {
            for term in terms {
                term.check(name, rows, columns)?;
            }
        }
        refuse_if!(
            equations.derivative.iter().any(|term| term.delay == 0.0),
            "N has a matrix with delay 0: subtract this matrix from E instead"
        );
        Ok(Self { equations })
    }

    /// y, x and u at `times` (increasing, ≥ 0, s).
    pub fn simulate(
        &self,
        past: Past,
        inputs: &Signal,
        times: &[f64],
        task: &Task,
    ) -> Result<SystemResponse, Error> {
        let n = self.equations.states;
        let widths = [
            ("the initial state", past.state.len(), n),
            ("the history", past.history.track.width(), n),
            ("the input", inputs.track.width(), self.equations.inputs),
        ];
        for (name, found, wanted) in widths {
            refuse_if!(
                found != wanted,
                "{name} has {found} components instead of {wanted}"
            );
        }
        refuse_if!(
            past.slopes
                .as_ref()
                .is_some_and(|slopes| slopes.track.width() != n),
            "the derivative of the history does not have {n} components"
        );
        finite("the initial state", &past.state)?;
        if let Some(time) = times.iter().find(|time| !time.is_finite()) {
            refuse!("the times contain {time}: give finite times");
        }
        if let Some(first) = times.first().filter(|first| **first < 0.0) {
            refuse!("time {first} is before the start of the run: leave it out");
        }
        if let Some(pair) = times.windows(2).find(|pair| pair[1] <= pair[0]) {
            refuse!(
                "time {} is not later than {}: give increasing times",
                pair[1],
                pair[0]
            );
        }
        run::run(&self.equations, past, inputs, times, task)
    }
}
