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
use crate::dde::propagator::{Propagator, balanced_norm};
use crate::dde::scalar::Scalar;

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
pub(super) struct Window<S> {
    /// Length of a step, s, and the number of steps.
    step: S,
    steps: usize,
    /// Row j, of n + 3 numbers, gives c_{j+1}.
    rows: Vec<S>,
    over_step: Propagator<S>,
}

impl<S: Scalar> Window<S> {
    /// For a part of `length` seconds.
    pub(super) fn new(equations: &Equations<S>, length: S) -> Self {
        let n = equations.states();
        let cuts = (balanced_norm(&equations.a, n) * length.value() / REACH).ceil();
        let steps = cuts.clamp(1.0, MOST_STEPS) as usize;
        let step = length / S::from(steps as f64);
        let mut rows = Vec::new();
        let mut rho = equations.c.clone();
        // Of each column, the largest value and the largest slope.
        let mut largest = vec![(0.0_f64, 0.0_f64); n + INPUTS];
        for j in 0..DEGREE {
            let factor = step / S::from((j + 1) as f64);
            let column = |i: usize| {
                let entries = equations.a.iter().skip(i).step_by(n.max(1));
                let products = rho.iter().zip(entries).map(|(&rho, &a)| rho * a);
                products.fold(S::default(), |sum, product| sum + product)
            };
            let mut next: Vec<S> = (0..n).map(|i| column(i) * factor).collect();
            let columns = [&equations.b, &equations.e, &equations.excess];
            let forced = columns.map(|g| dot(&rho, g) * factor);
            let mut matters = false;
            for (entry, most) in next.iter().chain(&forced).zip(&mut largest) {
                let (value, slope) = (entry.value().abs(), entry.slope().abs());
                matters |= value > NEGLIGIBLE * most.0 || slope > NEGLIGIBLE * most.1;
                *most = (most.0.max(value), most.1.max(slope));
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
    /// `until`.
    pub(super) fn serve(
        &self,
        equations: &Equations<S>,
        x: &[S],
        inputs: [S; INPUTS],
        (start, until): (S, f64),
        requested: &mut RequestedOutput<'_, S>,
    ) {
        let n = equations.states();
        let (mut x, mut scratch) = (x.to_vec(), x.to_vec());
        let mut y = Series::constant(S::default());
        y.degree = self.rows.len() / (n + INPUTS);
        let inverse = S::from(1.0) / self.step;
        for number in 0..self.steps {
            let from = start + S::from(number as f64) * self.step;
            let is_last = number + 1 == self.steps;
            let end = if is_last {
                until
            } else {
                until.min((from + self.step).value())
            };
            if requested.is_measured() || requested.next_output() < end {
                let [first, rest @ ..] = &mut y.coefficients;
                *first = equations.output(&x, inputs[0]);
                for (c, row) in rest.iter_mut().zip(self.rows.chunks_exact(n + INPUTS)) {
                    let (states, forced) = row.split_at(n);
                    *c = dot(states, &x) + dot(forced, &inputs);
                }
                requested.measure(from.value(), self.step.value(), 1.0, &y);
                requested.output_blocks(end, |times| {
                    let sigmas = times.map(|time| (time - from) * inverse);
                    y.at_each(sigmas.map(|sigma| sigma.pinned(sigma.value().max(0.0))))
                });
            } else if requested.next_output() >= until {
                return;
            }
            if !is_last {
                self.over_step
                    .apply(&x, &inputs[..equations.inputs()], &mut scratch);
                std::mem::swap(&mut x, &mut scratch);
            }
        }
    }
}
