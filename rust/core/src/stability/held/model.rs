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
//! the series), are compared with the polynomials themselves: `coefficients` of `Hold`. Over an
//! interval of a number the same formulas give polynomials that enclose all of it (`Enclosed`).

use crate::Error;
use crate::dde::control_loop::sampled::Timing;
use crate::dde::{LinearLoop, Update, countable};
use crate::elementary::DoubleDouble;
use crate::linear_algebra::balance::balanced;
use crate::stability::crossings::sizes;

use super::step::{Coefficient, Step, identity, joined, times};

/// Bound on the errors in double-double arithmetic, relative to sums of moduli: some thousand
/// roundings of 2⁻¹⁰⁴ each, and doublings that enlarge them.
const ROUGHNESS: f64 = 1e-25;

/// Share of the largest entry of M that is added to the modulus of each.
const SPREAD: f64 = 1e-4;

/// Upper limit on the states: the recursion loses digits with each.
const MOST_STATES: usize = 24;

/// Least |σ| at which bounds are compared, in units of one over the delay; and the largest, in
/// units of one over the sample time, for |z| ≤ 1.
const LEAST: f64 = 1.0 / 64.0;
const LARGEST: f64 = 4.0;

/// A polynomial in σ with bounds on the sums of moduli that its coefficients come from.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Polynomial {
    pub(super) coefficients: Vec<f64>,
    pub(super) errors: Vec<f64>,
}

/// What the polynomials of a loop with any feedback follow from.
#[derive(Debug, Clone)]
pub(super) struct LoopPolynomials<T = DoubleDouble> {
    /// d, s.
    pub(super) delay: f64,
    pub(super) a: Polynomial,
    /// Exponents of the units of the states.
    units: Vec<i32>,
    pub(super) a_exact: Vec<T>,
    a_moduli: Vec<f64>,
    /// adj(σI − M) (G + Γ₀ σ): for each power of σ a vector, with moduli.
    forward: Vec<Vec<T>>,
    forward_moduli: Vec<Vec<f64>>,
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
            "plant and controller have {n} states, but a map of a sampled loop can have at most \
             {MOST_STATES}"
        );
        refuse_if!(
            !(delay.is_finite() && delay >= 0.0 && sample_time.is_finite() && sample_time > 0.0),
            "delay={delay}, sample_time={sample_time}: give a delay of zero or more and a sample \
             time above zero, in s"
        );
        refuse_if!(
            a.iter().chain(b).any(|entry| !entry.is_finite()),
            "a coefficient of the equations is not finite: give smaller gains"
        );
        countable(delay, sample_time)?;
        Ok(Self::double((a, b), None, delay, sample_time))
    }

    /// The same for one loop, whose samples may change its states as well.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(super) fn of_loop(plant: &LinearLoop, delay: f64, sample_time: f64) -> Result<Self, Error> {
        let equations = plant.equations();
        let n = equations.b.len();
        refuse_if!(
            n > MOST_STATES,
            "plant and controller have {n} states, but at most {MOST_STATES} are possible"
        );
        countable(delay, sample_time)?;
        let states = (&equations.a[..], &equations.b[..]);
        Ok(Self::double(states, plant.update(), delay, sample_time))
    }

    fn double((a, b): (&[f64], &[f64]), update: Option<&Update>, delay: f64, period: f64) -> Self {
        let exact = |entries: &[f64]| entries.iter().map(|x| DoubleDouble::from(*x)).collect();
        let update = update.map(|update| Update {
            states: exact(&update.states),
            command: exact(&update.command),
            reference: Vec::new(),
        });
        let timing = Timing::new(delay, period);
        let times = [timing.early, timing.late].map(DoubleDouble::from);
        let delay = (timing.samples + 1) as f64 * period;
        Self::built(
            (&exact(a), &exact(b)),
            update.as_ref(),
            times,
            period.into(),
            delay,
        )
    }

    /// b for this feedback.
    pub(super) fn feedback(&self, k: &[f64], l: f64) -> Polynomial {
        let k: Vec<DoubleDouble> = k.iter().map(|k| DoubleDouble::from(*k)).collect();
        Polynomial::known(self.fed(&k, l.into()))
    }
}

impl<T: Coefficient> LoopPolynomials<T> {
    /// Of the parts of a sample before and after a command arrives, and d = (m + 1) Ts.
    pub(super) fn built(
        (a, b): (&[T], &[T]),
        update: Option<&Update<T>>,
        [early, late]: [T; 2],
        sample_time: T,
        delay: f64,
    ) -> Self {
        let n = b.len();
        // In units of the states, powers of two, that make A small.
        let near: Vec<f64> = a.iter().map(|entry| entry.near()).collect();
        let (_, units) = balanced(&near, n);
        let power = |exponent: i32| libm::ldexp(1.0, exponent);
        let scaled = |vector: &[T]| -> Vec<T> {
            let entries = vector.iter().zip(&units);
            entries.map(|(x, unit)| x.scaled(power(-unit))).collect()
        };
        let square = |entries: &[T]| -> Vec<T> {
            let place = |(i, x): (usize, &T)| x.scaled(power(units[i % n] - units[i / n]));
            entries.iter().enumerate().map(place).collect()
        };
        let (a, b) = (square(a), scaled(b));
        let late = Step::new(&a, &b, late);
        let early = Step::new(&a, &b, early);
        // Φ − I = F₀ + F₁ + F₀ F₁ with F = Φ − I of both parts.
        let product = times(&late.growth, &early.growth, n);
        let sum = |x: T, y: T| x + y;
        let mut growth = joined(&joined(&late.growth, &early.growth, sum), &product, sum);
        // Γ₀ + (I + F₀) Γ(δ).
        let moved = times(&late.growth, &early.gamma, n);
        let mut all = joined(&joined(&late.gamma, &early.gamma, sum), &moved, sum);
        if let Some(update) = update {
            // x becomes J x + G w first: Φ J − I = F J + (J − I), and Φ G is added.
            let (states, command) = (square(&update.states), scaled(&update.command));
            let change = joined(&states, &identity(n), |x, y| x - y);
            let added = joined(&command, &times(&growth, &command, n), sum);
            all = joined(&all, &added, sum);
            growth = joined(&times(&growth, &states, n), &change, sum);
        }
        let m: Vec<T> = growth.iter().map(|entry| entry.per(sample_time)).collect();
        let g: Vec<T> = all.iter().map(|entry| entry.per(sample_time)).collect();
        let found = Self::of(&m, &g, &late.gamma, delay);
        Self { units, ..found }
    }

    fn of(m: &[T], g: &[T], now: &[T], delay: f64) -> Self {
        let n = g.len();
        let zero = T::from(0.0);
        let sizes = moduli(m);
        let mut a = vec![zero; n + 1];
        let mut a_moduli = vec![0.0; n + 1];
        let mut forward = vec![vec![zero; n]; n + 1];
        let mut forward_moduli = vec![vec![0.0; n]; n + 1];
        if let Some(leading) = a.last_mut() {
            *leading = T::from(1.0);
        }
        if let Some(leading) = a_moduli.last_mut() {
            *leading = 1.0;
        }
        let (g_sizes, now_sizes) = (moduli(g), moduli(now));
        // The coefficient of σʲ of the adjugate, from j = n − 1 down.
        let mut adjugate: Vec<T> = identity(n);
        let mut adjugate_sizes: Vec<f64> = adjugate.iter().map(|entry| entry.near()).collect();
        for power in (0..n).rev() {
            add_product(&mut forward[power], &adjugate, g);
            add_product(&mut forward[power + 1], &adjugate, now);
            add_sizes(&mut forward_moduli[power], &adjugate_sizes, &g_sizes);
            add_sizes(&mut forward_moduli[power + 1], &adjugate_sizes, &now_sizes);
            let next = times(m, &adjugate, n);
            let next_sizes = times_sizes(&sizes, &adjugate_sizes, n);
            let count = (n - power) as f64;
            let trace = (0..n).fold(zero, |sum, i| sum + next[i * n + i]);
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

    /// The coefficients of b for this feedback, with sums of moduli.
    pub(super) fn fed(&self, k: &[T], l: T) -> Vec<(T, f64)> {
        let mut found = Vec::with_capacity(self.forward.len());
        let powers = self.forward.iter().zip(&self.forward_moduli);
        for ((vector, moduli), (a, a_size)) in powers.zip(self.a_exact.iter().zip(&self.a_moduli)) {
            let mut sum = *a * l;
            let mut size = l.size() * a_size;
            for ((entry, modulus), (k, unit)) in
                vector.iter().zip(moduli).zip(k.iter().zip(&self.units))
            {
                let k = k.scaled(libm::ldexp(1.0, *unit));
                sum = sum + *entry * k;
                size += k.size() * modulus;
            }
            found.push((sum, size));
        }
        found
    }
}

impl Polynomial {
    /// From coefficients and sums of moduli. One below its error is taken as exactly zero: a zero and
    /// a pole at z = 1 of a controller cancel, and what rounding leaves of them would count as a root.
    fn known<T: Coefficient>(coefficients: impl IntoIterator<Item = (T, f64)>) -> Self {
        let mut found = Self::default();
        for (c, size) in coefficients {
            let error = ROUGHNESS * size;
            let is_zero = c.size() <= error;
            found
                .coefficients
                .push(if is_zero { 0.0 } else { c.near() });
            found.errors.push(if is_zero { 0.0 } else { error });
        }
        found
    }
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

/// `sum` += matrix times vector.
fn add_product<T: Coefficient>(sum: &mut [T], matrix: &[T], vector: &[T]) {
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
fn moduli<T: Coefficient>(entries: &[T]) -> Vec<f64> {
    let largest = entries
        .iter()
        .fold(0.0, |most: f64, entry| most.max(entry.size()));
    entries
        .iter()
        .map(|entry| entry.size() + SPREAD * largest)
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
