//! The output over one part of a sample as polynomials in local time.
//!
//! Under constant w, r and v − u, y(σ h) = Σ_j c_j σ^j with
//!
//!   c_0 = C x + D w,   c_{j+1} = ρ_j (A x + B w + E r + G (v − u)) h/(j + 1),
//!   ρ_0 = C,   ρ_{j+1} = ρ_j A h/(j + 1),
//!
//! so that the coefficients are fixed rows times (x, w, r, v − u). A part is divided into equal steps on
//! which the series falls below rounding errors well before its last term.

use crate::dde::control_loop::linear_loop::{Equations, dot};
use crate::dde::control_loop::requested_output::RequestedOutput;
use crate::dde::control_loop::series::{DEGREE, Series};
use crate::dde::propagator::Propagator;
use crate::dde::scalar::Scalar;
use crate::linear_algebra::balance::balanced_norm;

use super::timing::Timing;

/// Largest ‖A‖ h of a step: 1/19! is below rounding errors.
const REACH: f64 = 1.0;

/// The series ends at rows this small relative to the largest one so far.
const NEGLIGIBLE: f64 = 1e-18;

/// Upper limit on the steps of one part.
const MOST_STEPS: f64 = 1e6;

/// w, r and v − u.
pub(super) const INPUTS: usize = 3;

/// The rows of one part.
#[derive(Debug)]
pub(super) struct Window {
    /// Length of a step, s, and the number of steps.
    step: f64,
    steps: usize,
    /// Row j, of n + 3 numbers, gives c_{j+1}.
    rows: Vec<f64>,
    over_step: Propagator,
}

impl Window {
    /// For a part of `length` seconds.
    pub(super) fn new(equations: &Equations, length: f64) -> Self {
        let n = equations.states();
        let cuts = (balanced_norm(&equations.a, n) * length / REACH).ceil();
        let steps = cuts.clamp(1.0, MOST_STEPS) as usize;
        let step = length / steps as f64;
        let mut rows = Vec::new();
        let mut rho = equations.c.clone();
        let mut largest = vec![0.0_f64; n + INPUTS];
        for j in 0..DEGREE {
            let factor = step / (j + 1) as f64;
            let column = |i: usize| -> f64 {
                let entries = equations.a.iter().skip(i).step_by(n.max(1));
                rho.iter().zip(entries).map(|(rho, a)| rho * a).sum()
            };
            let mut next: Vec<f64> = (0..n).map(|i| column(i) * factor).collect();
            let columns = [&equations.b, &equations.e, &equations.excess];
            let forced = columns.map(|g| dot(&rho, g) * factor);
            let mut matters = false;
            for (entry, most) in next.iter().chain(&forced).zip(&mut largest) {
                matters |= entry.abs() > NEGLIGIBLE * *most;
                *most = most.max(entry.abs());
            }
            if !matters {
                break;
            }
            rows.extend(next.iter().chain(&forced));
            std::mem::swap(&mut rho, &mut next);
        }
        Self {
            step,
            steps,
            rows,
            over_step: equations.over(step),
        }
    }

    /// Measure the output from `start` on, where the state is `x`, and store it at all times before
    /// `until`, unless numbers have slopes.
    pub(super) fn serve<S: Scalar>(
        &self,
        equations: &Equations,
        x: &[S],
        inputs: [f64; INPUTS],
        (start, until): (f64, f64),
        requested: &mut RequestedOutput<'_, S>,
    ) {
        let n = equations.states();
        let mut x: Vec<f64> = x.iter().map(|x| x.value()).collect();
        let mut scratch = x.clone();
        let mut y = Series::constant(0.0);
        y.degree = self.rows.len() / (n + INPUTS);
        let inverse = 1.0 / self.step;
        for number in 0..self.steps {
            let from = start + number as f64 * self.step;
            let is_last = number + 1 == self.steps;
            let end = if is_last {
                until
            } else {
                until.min(from + self.step)
            };
            let is_read = !S::MOVES && requested.next_output() < end;
            if requested.is_measured() || is_read {
                let [first, rest @ ..] = &mut y.coefficients;
                *first = equations.output(&x, inputs[0]);
                for (c, row) in rest.iter_mut().zip(self.rows.chunks_exact(n + INPUTS)) {
                    let (states, forced) = row.split_at(n);
                    *c = dot(states, &x) + dot(forced, &inputs);
                }
                requested.measure(from, self.step, 1.0, &y);
            } else if S::MOVES || requested.next_output() >= until {
                return;
            }
            if is_read {
                requested.output_blocks(end, |times| {
                    let sigmas = times.map(|time| ((time.value() - from) * inverse).max(0.0));
                    y.at_each(sigmas).map(S::from)
                });
            }
            if !is_last {
                self.over_step
                    .apply(&x, &inputs[..equations.inputs()], &mut scratch);
                std::mem::swap(&mut x, &mut scratch);
            }
        }
    }
}

/// The polynomials of a run, part by part.
#[derive(Debug)]
pub(super) struct Windows {
    equations: Equations,
    pub(super) early: Window,
    pub(super) late: Window,
}

impl Windows {
    /// For the parts of a sample.
    pub(super) fn new<S: Scalar>(equations: &Equations<S>, timing: Timing<S>) -> Self {
        let values = |from: &[S]| from.iter().map(|v| v.value()).collect();
        let equations = Equations {
            a: values(&equations.a),
            b: values(&equations.b),
            e: values(&equations.e),
            excess: values(&equations.excess),
            c: values(&equations.c),
            d: equations.d.value(),
            ..Equations::default()
        };
        Self {
            early: Window::new(&equations, timing.early.value()),
            late: Window::new(&equations, timing.late.value()),
            equations,
        }
    }

    pub(super) fn equations(&self) -> &Equations {
        &self.equations
    }
}
