//! The polynomials of a loop with a hold.
//!
//! ```text
//! x_{k+1} = Φ x_k + Γ₁ u_{k−m−1} + Γ₀ u_{k−m},   u_k = K x_k + L u_{k−m−1}
//! ```
//!
//! (`dde::control_loop::sampled`). With M = (Φ − I)/Ts and G = (Γ₀ + Γ₁)/Ts its poles are the zeros
//! of a(σ) − e^(−s d) b(σ), d = (m + 1) Ts,
//!
//! ```text
//! a = det(σI − M),   b = K adj(σI − M) (G + Γ₀ σ) + L a,
//! ```
//!
//! the adjugate and a by the recursion of Faddeev and LeVerrier (Gantmacher 1959, The Theory of
//! Matrices, chapter IV, section 5). b is linear in K and L, so that a gain in them is one in h.
//!
//! Everything is computed in double-double arithmetic: Φ − I and Γ by Taylor's series of a 2^q-th
//! part of the time and q doublings, as in `dde::propagator`. The errors, below `ROUGHNESS` of the
//! same recursion with moduli (entries of M enlarged by a share of the largest, for the errors of
//! the series), are compared with the polynomials themselves: `coefficients` of `Hold`.

use crate::Error;
use crate::dde::control_loop::sampled::Timing;
use crate::dde::{LinearLoop, Update, countable};
use crate::elementary::DoubleDouble;
use crate::linear_algebra::balance::balanced;
use crate::stability::crossings::sizes;

/// Bound on the errors in double-double arithmetic, relative to sums of moduli: some thousand
/// roundings of 2⁻¹⁰⁴ each, and doublings that enlarge them.
const ROUGHNESS: f64 = 1e-25;

/// Share of the largest entry of M that is added to the modulus of each.
const SPREAD: f64 = 1e-4;

/// Largest norm of A times a step for which the series is summed without doubling, and the size,
/// relative to the first term, of those that are left out, as the 27th with this norm is: 0.5²⁶/27! =
/// 1.4e-36.
const REACH: f64 = 0.5;
const LEFT_OUT: f64 = 2e-36;
const MOST_TERMS: u32 = 27;

/// Upper limit on the doublings.
const MOST_DOUBLINGS: i32 = 1000;

/// Upper limit on the states: the recursion loses digits with each.
const MOST_STATES: usize = 24;

/// Least |σ| at which bounds are compared, in units of one over the delay; and the largest, in
/// units of one over the sample time, for |z| ≤ 1.
const LEAST: f64 = 1.0 / 64.0;
const LARGEST: f64 = 4.0;

type Matrix = Vec<DoubleDouble>;

const ZERO: DoubleDouble = DoubleDouble::new(0.0, 0.0);

/// A polynomial in σ with bounds on the sums of moduli that its coefficients come from.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Polynomial {
    pub(super) coefficients: Vec<f64>,
    pub(super) errors: Vec<f64>,
}

/// What the polynomials of a loop with any feedback follow from.
#[derive(Debug, Clone)]
pub(super) struct LoopPolynomials {
    /// d, s.
    pub(super) delay: f64,
    pub(super) a: Polynomial,
    /// Exponents of the units of the states.
    units: Vec<i32>,
    a_exact: Matrix,
    a_moduli: Vec<f64>,
    /// adj(σI − M) (G + Γ₀ σ): for each power of σ a vector, with moduli.
    forward: Vec<Matrix>,
    forward_moduli: Vec<Vec<f64>>,
}

/// What a step does: Φ − I, and Γ of one input.
struct Step {
    growth: Matrix,
    gamma: Matrix,
}

impl LoopPolynomials {
    /// Of the loop with these states (A row-major), whose command is delayed.
    ///
    /// # Errors
    /// [`Error::Argument`] for more than 24 states or numbers that are not finite.
    pub(super) fn new(a: &[f64], b: &[f64], delay: f64, sample_time: f64) -> Result<Self, Error> {
        let n = b.len();
        refuse_if!(
            n > MOST_STATES,
            "{n} states of plant and controller: a map of a sampled loop takes up to {MOST_STATES}"
        );
        refuse_if!(
            !(delay.is_finite() && delay >= 0.0 && sample_time.is_finite() && sample_time > 0.0),
            "delay={delay}, sample_time={sample_time}: delays are zero or more, sample times above \
             zero, in s"
        );
        refuse_if!(
            a.iter().chain(b).any(|entry| !entry.is_finite()),
            "an entry of the equations is not finite: choose smaller gains"
        );
        countable(delay, sample_time)?;
        Ok(Self::built((a, b), None, delay, sample_time))
    }

    /// The same for a loop whose samples change its states as well.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(super) fn of_loop(plant: &LinearLoop, delay: f64, sample_time: f64) -> Result<Self, Error> {
        let equations = plant.equations();
        let (a, b) = (&equations.a[..], &equations.b[..]);
        match plant.update() {
            None => Self::new(a, b, delay, sample_time),
            Some(update) if b.len() <= MOST_STATES => {
                countable(delay, sample_time)?;
                Ok(Self::built((a, b), Some(update), delay, sample_time))
            }
            Some(_) => refuse!(
                "{} states of plant and controller: up to {MOST_STATES} are taken",
                b.len()
            ),
        }
    }

    fn built(
        (a, b): (&[f64], &[f64]),
        update: Option<&Update>,
        delay: f64,
        sample_time: f64,
    ) -> Self {
        let n = b.len();
        // In units of the states, powers of two, that make A small.
        let (a, units) = balanced(a, n);
        let scaled = |vector: &[f64]| -> Vec<f64> {
            let entries = vector.iter().zip(&units);
            entries.map(|(x, unit)| libm::ldexp(*x, -unit)).collect()
        };
        let timing = Timing::new(delay, sample_time);
        let late = Step::new(&a, &scaled(b), timing.late);
        let early = Step::new(&a, &scaled(b), timing.early);
        // Φ − I = F₀ + F₁ + F₀ F₁ with F = Φ − I of both parts.
        let product = times(&late.growth, &early.growth, n);
        let sum = |x: DoubleDouble, y: DoubleDouble| x + y;
        let mut growth = joined(&joined(&late.growth, &early.growth, sum), &product, sum);
        // Γ₀ + (I + F₀) Γ(δ).
        let moved = times(&late.growth, &early.gamma, n);
        let mut all = joined(&joined(&late.gamma, &early.gamma, sum), &moved, sum);
        if let Some(update) = update {
            // x becomes J x + G w first: Φ J − I = F J + (J − I), and Φ G is added.
            let exact = |entries: &[f64]| -> Matrix {
                entries
                    .iter()
                    .map(|entry| DoubleDouble::from(*entry))
                    .collect()
            };
            let place = |i: usize| libm::ldexp(update.states[i], units[i % n] - units[i / n]);
            let states: Vec<f64> = (0..n * n).map(place).collect();
            let (states, command) = (exact(&states), exact(&scaled(&update.command)));
            let change = joined(&states, &identity(n), |x, y| x - y);
            let added = joined(&command, &times(&growth, &command, n), sum);
            all = joined(&all, &added, sum);
            growth = joined(&times(&growth, &states, n), &change, sum);
        }
        let m: Matrix = growth.iter().map(|entry| entry.over(sample_time)).collect();
        let g: Matrix = all.iter().map(|entry| entry.over(sample_time)).collect();
        let delay = (timing.samples + 1) as f64 * sample_time;
        let found = Self::of(&m, &g, &late.gamma, delay);
        Self { units, ..found }
    }

    fn of(m: &[DoubleDouble], g: &[DoubleDouble], now: &[DoubleDouble], delay: f64) -> Self {
        let n = g.len();
        let sizes = moduli(m);
        let mut a = vec![ZERO; n + 1];
        let mut a_moduli = vec![0.0; n + 1];
        let mut forward = vec![vec![ZERO; n]; n + 1];
        let mut forward_moduli = vec![vec![0.0; n]; n + 1];
        if let Some(leading) = a.last_mut() {
            *leading = DoubleDouble::ONE;
        }
        if let Some(leading) = a_moduli.last_mut() {
            *leading = 1.0;
        }
        let (g_sizes, now_sizes) = (moduli(g), moduli(now));
        // The coefficient of σʲ of the adjugate, from j = n − 1 down.
        let mut adjugate = identity(n);
        let mut adjugate_sizes: Vec<f64> = adjugate.iter().map(|entry| entry.high).collect();
        for power in (0..n).rev() {
            add_product(&mut forward[power], &adjugate, g);
            add_product(&mut forward[power + 1], &adjugate, now);
            add_sizes(&mut forward_moduli[power], &adjugate_sizes, &g_sizes);
            add_sizes(&mut forward_moduli[power + 1], &adjugate_sizes, &now_sizes);
            let next = times(m, &adjugate, n);
            let next_sizes = times_sizes(&sizes, &adjugate_sizes, n);
            let count = (n - power) as f64;
            let trace = (0..n).fold(ZERO, |sum, i| sum + next[i * n + i]);
            a[power] = (-trace).over(count);
            a_moduli[power] = (0..n).map(|i| next_sizes[i * n + i]).sum::<f64>() / count;
            adjugate = next;
            adjugate_sizes = next_sizes;
            for i in 0..n {
                adjugate[i * n + i] = adjugate[i * n + i] + a[power];
                adjugate_sizes[i * n + i] += a_moduli[power];
            }
        }
        Self {
            delay,
            a: Polynomial::known(a.iter().copied().zip(a_moduli.iter().copied())),
            units: Vec::new(),
            a_exact: a,
            a_moduli,
            forward,
            forward_moduli,
        }
    }

    /// b for this feedback.
    pub(super) fn feedback(&self, k: &[f64], l: f64) -> Polynomial {
        let mut found = Vec::with_capacity(self.forward.len());
        let powers = self.forward.iter().zip(&self.forward_moduli);
        for ((vector, moduli), (a, a_size)) in powers.zip(self.a_exact.iter().zip(&self.a_moduli)) {
            let mut sum = *a * l;
            let mut size = l.abs() * a_size;
            for ((entry, modulus), (k, unit)) in
                vector.iter().zip(moduli).zip(k.iter().zip(&self.units))
            {
                let k = libm::ldexp(*k, *unit);
                sum = sum + *entry * k;
                size += k.abs() * modulus;
            }
            found.push((sum, size));
        }
        Polynomial::known(found.into_iter())
    }
}

impl Polynomial {
    /// From coefficients and sums of moduli. One below its error is taken as exactly zero: a zero and
    /// a pole at z = 1 of a controller cancel, and what rounding leaves of them would count as a root.
    fn known(coefficients: impl Iterator<Item = (DoubleDouble, f64)>) -> Self {
        let mut found = Self::default();
        for (c, size) in coefficients {
            let error = ROUGHNESS * size;
            let is_zero = c.high.abs() <= error;
            found.coefficients.push(if is_zero { 0.0 } else { c.high });
            found.errors.push(if is_zero { 0.0 } else { error });
        }
        found
    }
}

impl Step {
    fn new(a: &[f64], b: &[f64], time: f64) -> Self {
        let n = b.len();
        let norm = (0..n).fold(0.0, |most: f64, j| {
            most.max((0..n).map(|i| a[i * n + j].abs()).sum())
        });
        let mut doublings = 0;
        let mut step = time;
        while norm * step > REACH && doublings < MOST_DOUBLINGS {
            step *= 0.5;
            doublings += 1;
        }
        let a: Matrix = a.iter().map(|entry| DoubleDouble::from(*entry)).collect();
        // F = Σ (A t)ʲ/j!, Γ = Σ Aʲ tʲ⁺¹/(j + 1)! B.
        let mut growth = vec![ZERO; n * n];
        let mut power = identity(n);
        let mut gamma: Matrix = b.iter().map(|g| DoubleDouble::product(*g, step)).collect();
        let mut term = gamma.clone();
        let mut size = 1.0;
        for j in 1..=MOST_TERMS {
            if size < LEFT_OUT {
                break;
            }
            size *= norm * step / f64::from(j + 1);
            let scaled =
                |entry: &DoubleDouble, divisor: u32| (*entry * step).over(f64::from(divisor));
            power = times(&a, &power, n)
                .iter()
                .map(|entry| scaled(entry, j))
                .collect();
            growth = joined(&growth, &power, |x, y| x + y);
            term = times(&a, &term, n)
                .iter()
                .map(|entry| scaled(entry, j + 1))
                .collect();
            gamma = joined(&gamma, &term, |x, y| x + y);
        }
        for _ in 0..doublings {
            let twice = |x: DoubleDouble, y: DoubleDouble| x.scaled(2.0) + y;
            gamma = joined(&gamma, &times(&growth, &gamma, n), twice);
            growth = joined(&growth, &times(&growth, &growth, n), twice);
        }
        Self { growth, gamma }
    }
}

fn identity(n: usize) -> Matrix {
    let entry = |place: usize| DoubleDouble::from(f64::from(u8::from(place.is_multiple_of(n + 1))));
    (0..n * n).map(entry).collect()
}

/// The product of a square matrix of side n with another matrix, both row-major.
fn times(left: &[DoubleDouble], right: &[DoubleDouble], n: usize) -> Matrix {
    let width = right.len().checked_div(n).unwrap_or(0);
    let mut product = vec![ZERO; right.len()];
    for i in 0..n {
        for j in 0..width {
            let mut sum = ZERO;
            for inner in 0..n {
                sum = sum + left[i * n + inner] * right[inner * width + j];
            }
            product[i * width + j] = sum;
        }
    }
    product
}

fn times_sizes(left: &[f64], right: &[f64], n: usize) -> Vec<f64> {
    let entry = |place: usize| {
        let (i, j) = (place / n, place % n);
        (0..n)
            .map(|inner| left[i * n + inner] * right[inner * n + j])
            .sum()
    };
    (0..n * n).map(entry).collect()
}

fn joined(
    left: &[DoubleDouble],
    right: &[DoubleDouble],
    with: impl Fn(DoubleDouble, DoubleDouble) -> DoubleDouble,
) -> Matrix {
    left.iter().zip(right).map(|(x, y)| with(*x, *y)).collect()
}

/// `sum` += matrix times vector.
fn add_product(sum: &mut [DoubleDouble], matrix: &[DoubleDouble], vector: &[DoubleDouble]) {
    for (sum, line) in sum.iter_mut().zip(matrix.chunks_exact(vector.len().max(1))) {
        for (entry, x) in line.iter().zip(vector) {
            *sum = *sum + *entry * *x;
        }
    }
}

fn add_sizes(sum: &mut [f64], matrix: &[f64], vector: &[f64]) {
    for (sum, line) in sum.iter_mut().zip(matrix.chunks_exact(vector.len().max(1))) {
        *sum += line
            .iter()
            .zip(vector)
            .map(|(entry, x)| entry * x)
            .sum::<f64>();
    }
}

/// The moduli of the entries, each enlarged by a share of the largest.
fn moduli(entries: &[DoubleDouble]) -> Vec<f64> {
    let largest = entries
        .iter()
        .fold(0.0, |most: f64, entry| most.max(entry.high.abs()));
    entries
        .iter()
        .map(|entry| entry.high.abs() + SPREAD * largest)
        .collect()
}

/// The largest ratio of a polynomial with the errors of its coefficients to that with their moduli,
/// and of the derivatives of both, wherever a bound is taken.
pub(super) fn share_of_errors(polynomials: &[&Polynomial], delay: f64, sample_time: f64) -> f64 {
    let mut most = 0.0f64;
    let mut x = LEAST / delay;
    while x < LARGEST / sample_time {
        for polynomial in polynomials {
            let bounds = sizes(&polynomial.coefficients, x);
            let errors = sizes(&polynomial.errors, 2.0 * x);
            for (size, error) in bounds.into_iter().zip(errors) {
                if error > 0.0 {
                    most = most.max(error / size);
                }
            }
        }
        x *= 2.0;
    }
    most
}
