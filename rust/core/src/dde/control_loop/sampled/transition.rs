//! Transition matrix of the sampled loop without its limit, and its poles.
//!
//!   x_{k+1} = Φ x_k + Γ₁ u_{k−m−1} + Γ₀ u_{k−m},   u_k = K x_k + L u_{k−m−1},
//!
//! Γ₀ = Γ(Ts − δ), Γ₁ = Φ(Ts − δ) Γ(δ); the state is (x_k, u_{k−1}, …, u_{k−m−1}), m + 1 commands
//! behind x. Where a sample changes states, x_k is J x_k + G u_{k−m−1} in the first equation, with
//! u_k computed before. Reference: Åström & Wittenmark, Computer-Controlled Systems (3rd ed. 1997),
//! section 2.3, with the feedback closed. Eigenvalues by the QR algorithm (backward stable), of the
//! matrix with states and commands in units of powers of two that make its norm small: the error is
//! relative to that norm and does not depend on the units of the gains.

use num_complex::Complex64;

use crate::Error;
use crate::dde::control_loop::linear_loop::{LinearLoop, Update};
use crate::dde::propagator::{Propagator, multiply_add};
use crate::linear_algebra::balance::balanced;
use crate::linear_algebra::eigenvalues;

use super::timing::Timing;

/// Upper limit on the size of the dense eigenvalue problem (bounds the time).
const MOST_STATES: usize = 2000;

/// The open-loop pieces Φ, Γ₀, Γ₁ of one sample.
struct Sample {
    phi: Vec<f64>,
    now: Vec<f64>,
    past: Vec<f64>,
    lag: usize,
}

impl Sample {
    fn new(a: &[f64], b: &[f64], delay: f64, sample_time: f64) -> Self {
        let timing = Timing::new(delay, sample_time);
        let late = Propagator::new(a, &[b], timing.late);
        let early = Propagator::new(a, &[b], timing.early);
        let mut past = vec![0.0; b.len()];
        late.apply(early.gamma(0), &[0.0], &mut past);
        let mut phi = vec![0.0; a.len()];
        product(&late.phi(), &early.phi(), b.len(), &mut phi);
        Self {
            phi,
            now: late.gamma(0).to_vec(),
            past,
            lag: timing.samples,
        }
    }

    /// The same sample, preceded by an update of the states.
    fn updated(mut self, update: &Update) -> Self {
        let n = self.now.len();
        multiply_add(&self.phi, &update.command, &mut self.past);
        let mut phi = vec![0.0; n * n];
        product(&self.phi, &update.states, n, &mut phi);
        self.phi = phi;
        self
    }

    /// Side of the transition matrix.
    fn size(&self) -> usize {
        self.states() + self.lag + 1
    }

    /// Number of states without the commands in the delay.
    fn states(&self) -> usize {
        self.now.len()
    }

    /// The loop closed with u = K x + L w; row-major.
    fn close(&self, k: &[f64], l: f64) -> Vec<f64> {
        let (n, size) = (self.now.len(), self.size());
        let oldest = size - 1;
        let mut matrix = vec![0.0; size * size];
        for row in 0..n {
            let line = &mut matrix[row * size..(row + 1) * size];
            line[..n].copy_from_slice(&self.phi[row * n..(row + 1) * n]);
            line[oldest] += self.past[row];
            if self.lag == 0 {
                // u_{k−m} is the command of this sample itself.
                for (entry, k) in line.iter_mut().zip(k) {
                    *entry += self.now[row] * k;
                }
                line[oldest] += self.now[row] * l;
            } else {
                line[oldest - 1] += self.now[row];
            }
        }
        let newest = &mut matrix[n * size..(n + 1) * size];
        newest[..n].copy_from_slice(k);
        newest[oldest] += l;
        for row in n + 1..size {
            matrix[row * size + row - 1] = 1.0;
        }
        matrix
    }
}

/// The transition matrix, row-major, and its side.
///
/// # Errors
/// [`Error::Argument`] for a continuous loop, [`Error::TooMuch`] for too many samples of delay.
pub fn transition_matrix(plant: &LinearLoop) -> Result<(Vec<f64>, usize), Error> {
    let (matrix, sample, _) = closed(plant)?;
    Ok((matrix, sample.size()))
}

/// The transition matrix, its sample and the sample time.
fn closed(plant: &LinearLoop) -> Result<(Vec<f64>, Sample, f64), Error> {
    let Some(sample_time) = plant.sample_time() else {
        refuse!("a continuous loop has no transition matrix: give the loop a sample_time");
    };
    let equations = plant.equations();
    check_size(equations.states(), plant.delay(), sample_time)?;
    let mut sample = Sample::new(&equations.a, &equations.b, plant.delay(), sample_time);
    if let Some(update) = plant.update() {
        sample = sample.updated(update);
    }
    let matrix = sample.close(&equations.k, equations.l);
    Ok((matrix, sample, sample_time))
}

/// Poles s = ln(z)/Ts of the sampled loop, rightmost first; z = 0 gives re s = −∞.
///
/// # Errors
/// As [`transition_matrix`]; [`Error::Convergence`] where the QR algorithm fails.
pub fn poles(plant: &LinearLoop) -> Result<Vec<Complex64>, Error> {
    let (multipliers, sample_time) = multipliers(plant)?;
    let mut poles: Vec<_> = multipliers
        .into_iter()
        .map(|z| Complex64::new(z.norm().ln() / sample_time, z.arg() / sample_time))
        .collect();
    poles.sort_by(|p, q| q.re.total_cmp(&p.re).then(q.im.total_cmp(&p.im)));
    Ok(poles)
}

/// The eigenvalues z of the transition matrix, and the sample time.
///
/// # Errors
/// As [`poles`].
pub(crate) fn multipliers(plant: &LinearLoop) -> Result<(Vec<Complex64>, f64), Error> {
    let (matrix, sample, sample_time) = closed(plant)?;
    let found = eigenvalues(matrix, sample.states(), sample.size())?;
    Ok((found, sample_time))
}

/// Choose units of the states and one unit of all commands; `matrix` is row-major.
fn balance(matrix: &mut [f64], states: usize, size: usize) {
    // With the commands as one group: each of them except the newest equals the one before it.
    let side = states + 1;
    let mut small = vec![0.0; side * side];
    for i in 0..states {
        let line = &matrix[i * size..(i + 1) * size];
        small[i * side..i * side + states].copy_from_slice(&line[..states]);
        small[i * side + states] = line[states..].iter().map(|x| x.abs()).sum();
    }
    let newest = &matrix[states * size..(states + 1) * size];
    small[states * side..states * side + states].copy_from_slice(&newest[..states]);
    small[states * side + states] = newest[states..].iter().map(|x| x.abs()).sum::<f64>() + 1.0;
    let (_, exponents) = balanced(&small, side);
    let unit = |i: usize| exponents[i.min(states)];
    for i in 0..size {
        for j in 0..size {
            let entry = &mut matrix[i * size + j];
            *entry = libm::ldexp(*entry, unit(j) - unit(i));
        }
    }
}

/// Refuse a dense eigenvalue problem that is too large.
fn check_size(n: usize, delay: f64, sample_time: f64) -> Result<(), Error> {
    if delay / sample_time + n as f64 > MOST_STATES as f64 {
        return Err(Error::TooMuch {
            what: "the transition matrix",
            limit: MOST_STATES as u64,
            unit: "states",
            advice: format!(
                "the delay of {delay} s has too many samples of {sample_time} s: give a longer \
                 sample time, or treat the loop as continuous"
            ),
        });
    }
    Ok(())
}

/// Eigenvalues of a transition matrix, row-major, with `states` before the commands.
pub(crate) fn eigenvalues(
    mut matrix: Vec<f64>,
    states: usize,
    size: usize,
) -> Result<Vec<Complex64>, Error> {
    let (mut found, places) = alone(&matrix, size);
    let (states, side) = (
        places.iter().filter(|place| **place < states).count(),
        places.len(),
    );
    if side < size {
        let entry = |k: usize| matrix[places[k / side] * size + places[k % side]];
        matrix = (0..side * side).map(entry).collect();
    }
    if side > states {
        balance(&mut matrix, states, side);
    }
    let rest = eigenvalues::eigenvalues(&matrix, side).ok_or_else(|| Error::Convergence {
        what: "the eigenvalues of the transition matrix",
        best: Complex64::new(f64::NAN, f64::NAN),
        advice: "the loop is scaled too badly: choose units in which its gains are moderate"
            .to_owned(),
    })?;
    found.extend(rest);
    Ok(found)
}

/// Eigenvalues on the diagonal, in rows or columns that hold nothing else, and the other rows: an
/// integrator of an open loop, and commands that have no effect.
fn alone(matrix: &[f64], size: usize) -> (Vec<Complex64>, Vec<usize>) {
    let (mut found, mut places) = (Vec::new(), (0..size).collect::<Vec<_>>());
    let is_alone = |i: usize, places: &[usize]| {
        let empty = |at: &dyn Fn(usize) -> usize| {
            let mut others = places.iter().filter(|j| **j != i);
            others.all(|j| matrix[at(*j)] == 0.0)
        };
        empty(&|j| i * size + j) || empty(&|j| j * size + i)
    };
    while let Some(at) = places.iter().position(|i| is_alone(*i, &places)) {
        let i = places.remove(at);
        found.push(Complex64::from(matrix[i * size + i]));
    }
    (found, places)
}

/// `out` += A B for square matrices of side n.
fn product(a: &[f64], b: &[f64], n: usize, out: &mut [f64]) {
    let mut column = vec![0.0; n];
    let mut result = vec![0.0; n];
    for j in 0..n {
        for i in 0..n {
            column[i] = b[i * n + j];
        }
        result.fill(0.0);
        multiply_add(a, &column, &mut result);
        for i in 0..n {
            out[i * n + j] = result[i];
        }
    }
}
