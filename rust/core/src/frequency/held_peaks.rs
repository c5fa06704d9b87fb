//! The largest moduli of the sensitivities of a loop with a hold, on the unit circle.
//!
//! With L = −e b/a, e = e^(−jω d), and h = a − e b (`gain_crossovers`) the sensitivity is a/h, the
//! complementary one −e b/h and half of their difference (a + e b)/2h. At a level γ each reaches it
//! where
//!     γ² |h|² − |·|² = p |a|² + q |b|² + r Re(a conj(b) conj(e)) = 0.
//! a and b are polynomials in σ = σ₀ + z₀ (e^(jtTs) − 1)/Ts, t = ω − ω₀: Taylor series of the function
//! follow by products of series. The same products of the moduli of all coefficients, |σ₀| in the place
//! of σ₀, bound its derivatives and, times the roundings of one step, their errors.

use num_complex::Complex64;
use std::f64::consts::PI;

use super::norms::Peaks;
use super::peaks::{CLOSE, Modulus, Peak, Sought, highest};
use super::zeros::{ORDER, RealFunction, Taylor, zeros_between};
use crate::elementary::sin_cos;
use crate::quasipoly::modulus;
use crate::stability::{HeldNumbers, ROUNDINGS};
use crate::{Error, Task};

/// Frequencies at which a sensitivity is looked at first, by octaves from π/Ts down: more find a
/// larger value to start from.
const OCTAVES: i32 = 24;

/// Terms of a series: all below the order of `zeros`, and the next one for its bound.
const TERMS: usize = ORDER + 1;

/// Which of them, as the factors on a, e b and h.
#[derive(Debug, Clone, Copy)]
enum Which {
    Sensitivity,
    Complementary,
    Disk,
}

/// One sensitivity of a loop.
struct OnCircle<'a> {
    numbers: &'a HeldNumbers,
    /// Without common powers of σ.
    a: &'a [f64],
    b: &'a [f64],
    which: Which,
}

/// The sensitivity alone of a stable loop.
///
/// # Errors
/// As [`held_peaks`].
pub(super) fn held_peak(numbers: &HeldNumbers, places: &[f64], task: &Task) -> Result<Peak, Error> {
    largest(numbers, Which::Sensitivity, places, task)
}

/// The sensitivities of a stable loop; `places` are frequencies near which their largest values may be.
///
/// # Errors
/// [`Error::Argument`] where rounding hides a pole next to the circle; [`Error::Interrupted`].
pub(super) fn held_peaks(
    numbers: &HeldNumbers,
    places: &[f64],
    task: &Task,
) -> Result<Peaks, Error> {
    let of = |which| largest(numbers, which, places, task);
    Ok(Peaks {
        sensitivity: of(Which::Sensitivity)?,
        complementary: of(Which::Complementary)?,
        disk: of(Which::Disk)?,
    })
}

fn largest(
    numbers: &HeldNumbers,
    which: Which,
    places: &[f64],
    task: &Task,
) -> Result<Peak, Error> {
    let (a, b) = numbers.polynomials();
    let zeros = |row: &[f64]| row.iter().take_while(|c| **c == 0.0).count();
    let common = zeros(a).min(zeros(b));
    let of = OnCircle {
        numbers,
        a: a.get(common..).unwrap_or_default(),
        b: b.get(common..).unwrap_or_default(),
        which,
    };
    let top = of.top();
    let octaves = (0..OCTAVES).map(|k| libm::ldexp(top, -k));
    let start = [0.0].into_iter().chain(octaves);
    let mut start: Vec<f64> = start.chain(places.iter().copied()).collect();
    highest(&of, Peak::NONE, &mut start, Sought::Value(CLOSE), task)
}

impl OnCircle<'_> {
    fn top(&self) -> f64 {
        PI / self.numbers.sample_time()
    }

    /// p, q and r at a level.
    fn factors(&self, level: f64) -> [f64; 3] {
        let square = level * level;
        match self.which {
            Which::Sensitivity => [(level - 1.0) * (level + 1.0), square, -2.0 * square],
            Which::Complementary => [square, (level - 1.0) * (level + 1.0), -2.0 * square],
            Which::Disk => {
                let rest = (level - 0.5) * (level + 0.5);
                [rest, rest, -2.0 * square - 0.5]
            }
        }
    }
}

impl Modulus for OnCircle<'_> {
    fn at(&self, omega: f64) -> f64 {
        let sigma = self.numbers.variable(omega);
        let value = |row: &[f64]| {
            row.iter()
                .rev()
                .fold(Complex64::ZERO, |sum, c| sum * sigma + c)
        };
        let (sine, cosine) = sin_cos(omega * self.numbers.delay());
        let (a, fed) = (value(self.a), value(self.b) * Complex64::new(cosine, -sine));
        let above = match self.which {
            Which::Sensitivity => a,
            Which::Complementary => fed,
            Which::Disk => 0.5 * (a + fed),
        };
        modulus(above) / modulus(a - fed)
    }

    fn reaching(&self, level: f64, task: &Task) -> Result<(Vec<f64>, f64), Error> {
        let mut excess = Excess {
            of: self,
            factors: self.factors(level),
        };
        let top = self.top();
        Ok((zeros_between(&mut excess, 0.0, top, task)?, top))
    }
}

/// γ² |h|² − |·|² over frequency.
struct Excess<'a> {
    of: &'a OnCircle<'a>,
    factors: [f64; 3],
}

type Series<T> = [T; TERMS];

impl Excess<'_> {
    /// The Taylor coefficients at a frequency.
    fn series(&self, omega: f64) -> Series<f64> {
        let (period, delay) = (self.of.numbers.sample_time(), self.of.numbers.delay());
        let sigma = self.of.numbers.variable(omega);
        let z = 1.0 + sigma * period;
        let step = growing(z / period, Complex64::new(0.0, period), sigma);
        let [a, b] = [self.of.a, self.of.b].map(|row| composed(row, &step, Complex64::from));
        let (sine, cosine) = sin_cos(omega * delay);
        let early = Complex64::new(cosine, sine);
        let turned = growing(early, Complex64::new(0.0, delay), early);
        let conjugate = b.map(|c| c.conj());
        let mixed = product(&product(&a, &conjugate), &turned);
        let [p, q, r] = self.factors;
        let [of_a, of_b] = [&a, &b].map(|row| product(row, &row.map(|c| c.conj())));
        std::array::from_fn(|k| p * of_a[k].re + q * of_b[k].re + r * mixed[k].re)
    }

    /// Bounds on them at all frequencies up to one.
    fn moduli(&self, omega: f64) -> Series<f64> {
        let (period, delay) = (self.of.numbers.sample_time(), self.of.numbers.delay());
        let size = modulus(self.of.numbers.variable(omega.min(self.of.top())));
        let step = growing(1.0 / period, period, size * (1.0 + 1e-12));
        let [a, b] = [self.of.a, self.of.b].map(|row| composed(row, &step, f64::abs));
        let mixed = product(&product(&a, &b), &growing(1.0, delay, 1.0));
        let [p, q, r] = self.factors.map(|factor| factor.abs() + 1.0);
        let [of_a, of_b] = [&a, &b].map(|row| product(row, row));
        std::array::from_fn(|k| p * of_a[k] + q * of_b[k] + r * mixed[k])
    }

    /// Errors of coefficients as a part of their bounds: those of the polynomials, of σ, of the
    /// products, and of the phase.
    fn errors(&self, omega: f64) -> f64 {
        let terms = (self.of.a.len() + self.of.b.len() + 4 * TERMS) as f64;
        2.0 * (ROUNDINGS + 4.0) * terms * f64::EPSILON
            + 2.0 * self.of.numbers.errors()
            + 8.0 * f64::EPSILON * omega * self.of.numbers.delay()
    }
}

impl RealFunction for Excess<'_> {
    fn value(&mut self, omega: f64) -> f64 {
        self.series(omega)[0]
    }

    fn taylor(&mut self, omega: f64) -> Taylor {
        let (series, moduli) = (self.series(omega), self.moduli(omega));
        let share = self.errors(omega);
        let mut found = Taylor::default();
        let mut factorial = 1.0;
        for k in 0..ORDER {
            factorial *= k.max(1) as f64;
            found.values[k] = factorial * series[k];
            found.errors[k] = share * factorial * moduli[k];
        }
        found
    }

    fn bound(&self, omega: f64) -> f64 {
        let factorial: f64 = (1..TERMS).map(|k| k as f64).product();
        factorial * self.moduli(omega)[ORDER] * (1.0 + 1e-9)
    }
}

/// `first` and then `factor` (e^(`rate` t) − 1).
fn growing<T>(factor: T, rate: T, first: T) -> Series<T>
where
    T: Copy + std::ops::Mul<Output = T> + std::ops::Div<f64, Output = T>,
{
    let mut term = factor;
    std::array::from_fn(|k| {
        if k == 0 {
            return first;
        }
        term = term * rate / k as f64;
        term
    })
}

/// A polynomial, ascending coefficients, of a series.
fn composed<T>(row: &[f64], of: &Series<T>, read: impl Fn(f64) -> T) -> Series<T>
where
    T: Copy + Default + std::ops::Mul<Output = T> + std::ops::Add<Output = T>,
{
    row.iter().rev().fold([T::default(); TERMS], |sum, c| {
        let mut next = product(&sum, of);
        next[0] = next[0] + read(*c);
        next
    })
}

fn product<T>(x: &Series<T>, y: &Series<T>) -> Series<T>
where
    T: Copy + Default + std::ops::Mul<Output = T> + std::ops::Add<Output = T>,
{
    std::array::from_fn(|k| (0..=k).fold(T::default(), |sum, i| sum + x[i] * y[k - i]))
}
