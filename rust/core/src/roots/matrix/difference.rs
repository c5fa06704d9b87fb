//! Chains of neutral matrix systems: the difference part I + Σ C_j e^(−s τ_j), C_j = E⁻¹ N_j.
//!
//! Roots of large modulus lie near or left of Re s = C_D, where the largest spectral radius of C(θ)
//! = Σ C_j e^(−σ τ_j + i θ_j) over all angles θ is 1 (Hale and Verduyn Lunel 2002); with delays
//! free to vary that is attained or approached. It falls with σ, and a common angle does not
//! matter. *Upper end*: the spectral radius is below 1 if ‖C(θ)^k‖ < 1 for k = 2^q. On a box of
//! angles with centre θ₀, C differs by at most e = Σ ‖C_j‖ w_j h_j; squaring makes of (N, e) at
//! most (‖C(θ₀)^2k‖, 2 N e + e²) and of rounding (n + 4) u |C|² more, |C| the Frobenius norm; boxes
//! are halved until each is proved. *Lower end*: |tr C^k| ≤ n ρ^k at any one θ. ‖·‖ is the spectral
//! norm, bounded by the Frobenius norm and by √(‖·‖₁ ‖·‖_∞). The spectral radius is
//! plurisubharmonic (Vesentini 1968), as is ‖C^k‖: a bound on the torus holds for all smaller
//! moduli, hence right of σ, and ‖(I + C)⁻¹‖ ≤ Π (1 + N_2^i)/(1 − N_k).
//! Both ends are one argument over the same boxes and bounds, so they share a file.

use std::f64::consts::{LN_2, PI, TAU};

use num_complex::Complex64;

use super::factor::ROUNDING;
use crate::elementary::{exp, exp_above, log, sin_cos};
use crate::linear_algebra::rows::Rows;
use crate::{Error, Task};

const MARGIN: f64 = 1.0 + 1e-9;

/// Covers the rounding errors of a bound from below.
const SHRUNK: f64 = 1.0 - 1e-9;

/// Larger than what squares lose in underflow.
const FLOOR: f64 = 1e-150;

/// Rounding errors of an entry of C, apart from one for each term, and those for each unit of σ τ,
/// which the exponential carries.
const ENTRY_ROUNDINGS: f64 = 8.0;
const EXPONENT_ROUNDINGS: f64 = 4.0;

/// Rounding error of a trace, for each row of a matrix of norm up to 2.
const TRACE_ROUNDING: f64 = 1e-15;

/// Rounding error of a logarithm, relative to one more than its modulus.
const LOG_ROUNDING: f64 = 1e-15;

/// Upper limit on the angles that are searched; with more of them, only norms are compared.
const MAX_ANGLES: usize = 3;

/// Squarings after which a box is halved, and those for a single matrix. More squarings need fewer
/// boxes.
const SQUARINGS: u32 = 16;
const MANY_SQUARINGS: u32 = 24;

/// Squarings for a spectral radius that is only compared with others.
const SAMPLE_SQUARINGS: u32 = 13;

/// Upper limit on the operations for one line (bounds the time).
const MAX_WORK: f64 = 1e9;

/// Operations for each complex multiplication and addition of a squaring, and those that it costs
/// whatever its size. Larger: the work on a line ends earlier; smaller: it takes longer.
const PRODUCT_COST: f64 = 8.0;
const FIXED_COST: f64 = 3000.0;

/// Norm of a power below which the inverse is bounded. Larger: fewer squarings, worse bounds;
/// smaller: more squarings.
const CONTRACTED: f64 = 0.999_999;

/// Norm of a power, or of the product over them, at which squaring ends, before anything overflows.
/// Larger: useless squarings; smaller: boxes are halved although further squarings would do.
const MOST_NORM: f64 = 1e60;

/// Error of a power at which squaring ends, because an error above 1 only grows. Larger: useless
/// squarings; smaller than 1: boxes are halved although further squarings would do.
const MOST_OFF: f64 = 4.0;

/// Part of its modulus by which the upper end of the bisection for the norm bound is raised, so that
/// it lies above the zero in spite of rounding, and the least modulus that this part refers to.
/// Larger: a bound that is farther off after the bisection; smaller: rounding counts.
const HEADROOM: f64 = 1e-9;
const LEAST_ABSCISSA: f64 = 1e-9;

/// Samples of each angle, by the number of angles.
const SAMPLES: [usize; 4] = [1, 48, 14, 8];

/// First distance below the estimate at which a lower bound is tried, relative to the rates; each
/// further one is four times as large.
const LOWER_GAP: f64 = 1e-13;

/// Distance below the estimate at which the search for a lower bound ends, relative to the rates.
/// Larger: more attempts in vain; smaller: poor lower bounds are missed.
const LAST_LOWER_GAP: f64 = 10.0;

/// Factor from one distance to the next, above and below the estimate. Larger: fewer attempts, wider
/// enclosures; smaller: the reverse.
const GAP_GROWTH: f64 = 4.0;

/// First distance above the estimate at which an upper bound is tried, by the number of angles.
/// With more angles a proof close to the chains costs more.
const UPPER_GAPS: [f64; 4] = [1e-10, 1e-5, 1e-3, 1e-2];

/// The same for more angles than are listed, which `MAX_ANGLES` does not admit.
const OTHER_UPPER_GAP: f64 = 0.1;

/// Largest distance from the norm bound at which chains are searched for, in units of one over the
/// longest delay.
const FARTHEST: f64 = 1e3;

/// Factor on the steps down from the norm bound where there is no estimate. Larger: fewer proofs,
/// worse bounds; smaller: the reverse.
const STEP_GROWTH: f64 = 2.0;

/// Upper limit on the steps of the estimate.
const MAX_STEPS: usize = 30;

/// Step of the difference quotient, in units of one over the longest delay.
const DIFFERENCE: f64 = 1e-4;

/// Least slope of log ρ, in units of the shortest delay.
const LEAST_SLOPE: f64 = 0.2;

/// Size of log ρ at which the estimate ends.
const ARRIVED: f64 = 1e-13;

/// First and last step of the search for angles, rad.
const ANGLE_STEPS: (f64, f64) = (0.1, 1e-7);

/// Factor on that step where no angle improves. Larger: more evaluations; smaller: more moves with
/// each step.
const ANGLE_SHRINKAGE: f64 = 0.25;

/// The difference part of a neutral system.
#[derive(Debug, Clone)]
pub(super) struct Difference {
    size: usize,
    /// Delay, C_j, a bound on its norm.
    terms: Vec<(f64, Rows, f64)>,
    /// Bounds on the errors of C_j, and of the identity.
    losses: Vec<f64>,
    loss: f64,
}

/// A box of angles.
#[derive(Debug, Clone)]
struct Box {
    center: Vec<f64>,
    half: Vec<f64>,
}

impl Difference {
    pub(super) fn new(size: usize, late: Vec<(f64, Vec<Vec<f64>>, f64)>, loss: f64) -> Self {
        let mut terms = Vec::new();
        let mut losses = Vec::new();
        for (delay, matrix, lost) in late {
            let mut rows = Rows::zeros(size);
            for (i, row) in matrix.iter().enumerate() {
                for (j, x) in row.iter().enumerate() {
                    rows.add(i, j, Complex64::new(*x, 0.0));
                }
            }
            let norm = norm(&rows);
            terms.push((delay, rows, norm));
            losses.push(lost);
        }
        Self {
            size,
            terms,
            losses,
            loss,
        }
    }

    /// Are there no delayed derivatives?
    pub(super) fn is_trivial(&self) -> bool {
        self.terms.is_empty()
    }

    pub(super) fn number_of_terms(&self) -> usize {
        self.terms.len()
    }

    fn angles(&self) -> usize {
        self.terms.len().saturating_sub(1)
    }

    /// C at the angles of all terms but the first, on Re s = `sigma`, and a bound on its rounding
    /// errors.
    pub(super) fn at(&self, sigma: f64, angles: &[f64]) -> (Rows, f64) {
        let mut sum = Rows::zeros(self.size);
        let mut lost = self.loss;
        let angles = std::iter::once(&0.0).chain(angles);
        for (((delay, matrix, norm), loss), angle) in
            self.terms.iter().zip(&self.losses).zip(angles)
        {
            let weight = exp(-sigma * delay);
            let (sine, cosine) = sin_cos(*angle);
            let (re, im) = (weight * cosine, weight * sine);
            for (target, x) in sum.re.iter_mut().zip(&matrix.re) {
                *target += re * x;
            }
            for (target, x) in sum.im.iter_mut().zip(&matrix.re) {
                *target += im * x;
            }
            let rounding = ENTRY_ROUNDINGS
                + self.terms.len() as f64
                + EXPONENT_ROUNDINGS * (sigma * delay).abs();
            lost += weight * (loss + rounding * ROUNDING * norm) * MARGIN;
        }
        (sum, lost)
    }

    /// A bound on ‖(I + C)⁻¹‖ on Re s ≥ `sigma` for all angles. `None` where it cannot be computed,
    /// as left of the chains.
    pub(super) fn inverse_bound(&self, sigma: f64, task: &Task) -> Result<Option<f64>, Error> {
        if self.is_trivial() {
            return Ok(Some(1.0 / (1.0 - self.loss)));
        }
        let norms: Vec<f64> = self
            .terms
            .iter()
            .map(|(delay, _, norm)| norm * exp_above(-sigma * delay) * MARGIN)
            .collect();
        let (free, squarings) = match self.angles() {
            0 => (0, MANY_SQUARINGS),
            free if free <= MAX_ANGLES => (free, SQUARINGS),
            _ => {
                let sum = norms.iter().sum::<f64>() + self.loss + self.losses.iter().sum::<f64>();
                return Ok((sum * MARGIN < 1.0).then(|| 1.0 / (1.0 - sum * MARGIN)));
            }
        };
        let n = self.size as f64;
        let mut work = MAX_WORK;
        // Changing the signs of all angles conjugates C, so that the first angle need not be
        // negative.
        let mut boxes = vec![Box {
            center: (0..free)
                .map(|k| if k == 0 { 0.5 * PI } else { 0.0 })
                .collect(),
            half: (0..free)
                .map(|k| if k == 0 { 0.5 * PI } else { PI })
                .collect(),
        }];
        let mut most = 0.0f64;
        while let Some(one) = boxes.pop() {
            task.check()?;
            let (matrix, lost) = self.at(sigma, &one.center);
            let moved = |(norm, half): (&f64, &f64)| norm * half.min(2.0);
            let off: Vec<f64> = norms.iter().skip(1).zip(&one.half).map(moved).collect();
            let (bound, spent) =
                inverse_bound(matrix, lost + off.iter().sum::<f64>() * MARGIN, squarings);
            work -= f64::from(spent + 1) * (PRODUCT_COST * n * n * n + FIXED_COST);
            match bound {
                Some(bound) => most = most.max(bound),
                None if free == 0 || work < 0.0 => return Ok(None),
                None => {
                    let widest = off
                        .iter()
                        .enumerate()
                        .fold((0, 0.0), |a, (k, x)| if *x > a.1 { (k, *x) } else { a })
                        .0;
                    for sign in [-1.0, 1.0] {
                        let mut part = one.clone();
                        if let (Some(center), Some(half)) =
                            (part.center.get_mut(widest), part.half.get_mut(widest))
                        {
                            *half *= 0.5 * MARGIN;
                            *center += sign * *half / MARGIN;
                        }
                        boxes.push(part);
                    }
                }
            }
        }
        Ok(Some(most))
    }

    /// The abscissa at which norms alone show that the chains end: Σ ‖C_j‖ e^(−σ τ_j) = 1 −
    /// (errors).
    fn norm_bound(&self) -> f64 {
        let margin = 1.0 - self.loss;
        let count = self.terms.len() as f64;
        let parts: Vec<(f64, f64)> = self
            .terms
            .iter()
            .zip(&self.losses)
            .map(|((delay, _, norm), loss)| (log((norm + loss) * count / margin * MARGIN), *delay))
            .collect();
        let bound = |extra: f64| {
            parts
                .iter()
                .map(|(size, delay)| (size + extra) / delay)
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let sum = |sigma: f64| -> f64 {
            parts
                .iter()
                .map(|(size, delay)| exp_above(size - sigma * delay))
                .sum::<f64>()
                / count
        };
        let (mut low, mut high) = (bound(-log(count)), bound(0.0));
        high += HEADROOM * high.abs().max(LEAST_ABSCISSA);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if sum(middle) * MARGIN < 1.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        high
    }

    /// Lower and upper bound of C_D in 1/s; −∞ without chains.
    pub(super) fn enclosure(&self, task: &Task) -> Result<(f64, f64), Error> {
        if self.is_trivial() {
            return Ok((f64::NEG_INFINITY, f64::NEG_INFINITY));
        }
        let top = self.norm_bound();
        let Some((guess, angles)) = self.estimate(top, task)? else {
            // The matrix is nilpotent for every angle, as far as can be decided: no chain is known
            // to exist.
            return Ok((f64::NEG_INFINITY, self.least_proved(top, task)?));
        };
        let rate = 1.0 / self.longest();
        let mut lower = f64::NEG_INFINITY;
        let mut gap = LOWER_GAP * (rate + guess.abs());
        while gap < LAST_LOWER_GAP * (rate + guess.abs()) {
            let (matrix, lost) = self.at(guess - gap, &angles);
            if log_radius_below(matrix, lost) >= 0.0 {
                lower = guess - gap;
                break;
            }
            gap *= GAP_GROWTH;
        }
        if self.angles() > MAX_ANGLES {
            return Ok((lower, top));
        }
        let mut gap = UPPER_GAPS
            .get(self.angles())
            .copied()
            .unwrap_or(OTHER_UPPER_GAP)
            * rate;
        while guess + gap < top {
            if self.inverse_bound(guess + gap, task)?.is_some() {
                return Ok((lower, guess + gap));
            }
            gap *= GAP_GROWTH;
        }
        Ok((lower, top))
    }

    /// An upper bound for the case that the chains cannot be estimated.
    fn least_proved(&self, top: f64, task: &Task) -> Result<f64, Error> {
        let rate = 1.0 / self.longest();
        let mut best = top;
        let mut step = rate;
        while step < FARTHEST * rate {
            if self.inverse_bound(best - step, task)?.is_none() {
                break;
            }
            best -= step;
            step *= STEP_GROWTH;
        }
        Ok(best)
    }

    fn longest(&self) -> f64 {
        self.terms
            .iter()
            .map(|(delay, _, _)| *delay)
            .fold(0.0, f64::max)
    }

    /// An estimate of where the largest spectral radius is 1, and at which angles; `None` where
    /// there is none.
    fn estimate(&self, top: f64, task: &Task) -> Result<Option<(f64, Vec<f64>)>, Error> {
        let rate = 1.0 / self.longest();
        let mut sigma = top;
        let mut best: Option<Vec<f64>> = None;
        for _ in 0..MAX_STEPS {
            let (height, angles) = self.highest(sigma, best.as_deref(), task)?;
            // The slope of log ρ lies between the delays: a step with the longest one never goes
            // too far to the left, where ρ may grow faster than linearly in the logarithm.
            if !(height.is_finite() && sigma > top - FARTHEST * rate) {
                return Ok(None);
            }
            let (ahead, _) = self.highest_from(sigma - DIFFERENCE * rate, &angles);
            let slope = ((ahead - height) / (DIFFERENCE * rate))
                .clamp(LEAST_SLOPE * self.shortest(), self.longest());
            sigma += height / slope;
            best = Some(angles);
            if height.abs() < ARRIVED {
                break;
            }
        }
        Ok(best.map(|angles| (sigma, angles)))
    }

    fn shortest(&self) -> f64 {
        self.terms
            .iter()
            .map(|(delay, _, _)| *delay)
            .fold(f64::INFINITY, f64::min)
    }

    fn log_radius(&self, sigma: f64, angles: &[f64]) -> f64 {
        let squarings = if angles.is_empty() {
            MANY_SQUARINGS
        } else {
            SAMPLE_SQUARINGS
        };
        log_radius(self.at(sigma, angles).0, squarings)
    }

    /// The largest log of the spectral radius among sampled angles, refined.
    fn highest(
        &self,
        sigma: f64,
        known: Option<&[f64]>,
        task: &Task,
    ) -> Result<(f64, Vec<f64>), Error> {
        if let Some(known) = known {
            return Ok(self.highest_from(sigma, known));
        }
        let free = self.angles();
        let samples = SAMPLES.get(free).copied().unwrap_or(2);
        let total = samples.pow(free.min(6) as u32);
        let mut best = (f64::NEG_INFINITY, vec![0.0; free]);
        for index in 0..total {
            task.check()?;
            let mut rest = index;
            let angles: Vec<f64> = (0..free)
                .map(|_| {
                    let k = rest % samples;
                    rest /= samples;
                    TAU * k as f64 / samples as f64
                })
                .collect();
            let height = self.log_radius(sigma, &angles);
            if height > best.0 {
                best = (height, angles);
            }
        }
        Ok(self.highest_from(sigma, &best.1))
    }

    /// Improve the angles one at a time.
    fn highest_from(&self, sigma: f64, angles: &[f64]) -> (f64, Vec<f64>) {
        let mut best = (self.log_radius(sigma, angles), angles.to_vec());
        let mut step = ANGLE_STEPS.0;
        while step > ANGLE_STEPS.1 && !angles.is_empty() {
            let mut improved = false;
            for k in 0..angles.len() {
                for sign in [-1.0, 1.0] {
                    let mut tried = best.1.clone();
                    if let Some(angle) = tried.get_mut(k) {
                        *angle += sign * step;
                    }
                    let height = self.log_radius(sigma, &tried);
                    if height > best.0 {
                        best = (height, tried);
                        improved = true;
                    }
                }
            }
            if !improved {
                step *= ANGLE_SHRINKAGE;
            }
        }
        best
    }
}

fn frobenius(matrix: &Rows) -> f64 {
    let squares: f64 = matrix.re.iter().chain(&matrix.im).map(|x| x * x).sum();
    squares.sqrt() * MARGIN
}

/// A bound on the spectral norm.
pub(super) fn norm(matrix: &Rows) -> f64 {
    let n = matrix.size;
    let mut columns = vec![0.0; n];
    let mut largest = 0.0f64;
    for i in 0..n {
        let (re, im) = matrix.row(i);
        let mut row = 0.0;
        for ((x, y), column) in re.iter().zip(im).zip(&mut columns) {
            let size = (x * x + y * y).sqrt();
            row += size;
            *column += size;
        }
        largest = largest.max(row);
    }
    let tallest = columns.iter().fold(0.0f64, |a, b| a.max(*b));
    // The last summand covers what squares lose in underflow.
    ((largest * tallest).sqrt() * MARGIN).min(frobenius(matrix)) + FLOOR
}

fn square(matrix: &Rows) -> Rows {
    let mut found = Rows::zeros(matrix.size);
    let stride = found.stride();
    let rows = found
        .re
        .chunks_exact_mut(stride)
        .zip(found.im.chunks_exact_mut(stride));
    for (i, (re, im)) in rows.enumerate() {
        let (own_re, own_im) = matrix.row(i);
        for (k, (a, b)) in own_re.iter().zip(own_im).enumerate() {
            if *a == 0.0 && *b == 0.0 {
                continue;
            }
            let (from_re, from_im) = matrix.row(k);
            for (((re, im), x), y) in re.iter_mut().zip(im.iter_mut()).zip(from_re).zip(from_im) {
                *re += a * x - b * y;
                *im += a * y + b * x;
            }
        }
    }
    found
}

/// A bound on ‖(I + C + any change of norm `off`)⁻¹‖ and the number of squarings used.
fn inverse_bound(mut matrix: Rows, mut off: f64, squarings: u32) -> (Option<f64>, u32) {
    let rounding = (matrix.size as f64 + 4.0) * ROUNDING;
    let mut product = 1.0;
    for step in 0..=squarings {
        let size = norm(&matrix);
        let whole = (size + off) * MARGIN;
        if whole < CONTRACTED {
            return (Some(product / (1.0 - whole) * MARGIN), step);
        }
        if !(whole < MOST_NORM && product < MOST_NORM && off < MOST_OFF) || step == squarings {
            return (None, step);
        }
        product *= (1.0 + whole) * MARGIN;
        let whole = frobenius(&matrix);
        off = (2.0 * size * off + off * off + rounding * whole * whole) * MARGIN;
        matrix = square(&matrix);
    }
    (None, squarings)
}

/// Powers of a matrix scaled to norm 1 to 2, each the square of the one before: the logarithm of
/// the factor taken out, the matrix, and a bound on its error.
fn powers(matrix: Rows, lost: f64, squarings: u32, mut visit: impl FnMut(f64, f64, &Rows, f64)) {
    let rounding = (matrix.size as f64 + 4.0) * ROUNDING;
    let (mut matrix, mut off) = (matrix, lost);
    let (mut exponent, mut power) = (0.0f64, 1.0f64);
    for _ in 0..squarings {
        let size = norm(&matrix);
        if !(size > 0.0 && size.is_finite()) {
            visit(power, f64::NEG_INFINITY, &matrix, off);
            return;
        }
        let shift = -libm::ilogb(size);
        let factor = libm::ldexp(1.0, shift);
        for x in matrix.re.iter_mut().chain(&mut matrix.im) {
            *x *= factor;
        }
        off *= factor;
        exponent -= f64::from(shift);
        visit(power, exponent, &matrix, off);
        let (size, whole) = (size * factor, frobenius(&matrix));
        off = (2.0 * size * off + off * off + rounding * whole * whole) * MARGIN;
        matrix = square(&matrix);
        exponent *= 2.0;
        power *= 2.0;
    }
}

/// An estimate of log ρ from norms of powers; −∞ for a nilpotent matrix.
fn log_radius(matrix: Rows, squarings: u32) -> f64 {
    let mut found = f64::NEG_INFINITY;
    powers(matrix, 0.0, squarings, |power, exponent, matrix, _| {
        found = (exponent * LN_2 + log(norm(matrix))) / power;
    });
    found
}

/// A lower bound of log ρ, from traces of powers, for every matrix within `lost`.
fn log_radius_below(matrix: Rows, lost: f64) -> f64 {
    let n = matrix.size as f64;
    let mut best = f64::NEG_INFINITY;
    powers(
        matrix,
        lost,
        MANY_SQUARINGS,
        |power, exponent, matrix, off| {
            let trace: Complex64 = (0..matrix.size).map(|i| matrix.get(i, i)).sum();
            // A change of the matrix changes the trace by at most n times the spectral norm of the
            // change.
            let least = (trace.norm() - n * off * MARGIN) * SHRUNK - TRACE_ROUNDING * n;
            if least > 0.0 {
                let value = (exponent * LN_2 + log(least / n)) / power;
                best = best.max(value - LOG_ROUNDING * (1.0 + value.abs()));
            }
        },
    );
    best
}
