//! What the states of a loop do over a part of a sample, in numbers or over an interval of one.
//!
//! Φ − I and Γ by Taylor's series of a 2^q-th part of the time and q doublings, as in `dde::propagator`.

use std::ops::{Add, Mul, Neg, Sub};

use crate::elementary::{DoubleDouble, Enclosed};

/// Largest norm of A times a step for which the series is summed without doubling, and the size,
/// relative to the first term, of those that are left out, as the 27th with this norm is: 0.5²⁶/27! =
/// 1.4e-36.
const REACH: f64 = 0.5;
const LEFT_OUT: f64 = 2e-36;
const MOST_TERMS: u32 = 27;

/// Upper limit on the doublings.
const MOST_DOUBLINGS: i32 = 1000;

/// What the coefficients are computed in.
pub(super) trait Coefficient:
    Copy + From<f64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// The double next to it.
    fn near(self) -> f64;
    /// A bound on its modulus, up to rounding.
    fn size(self) -> f64;
    /// Is it known to be zero?
    fn is_nothing(self) -> bool {
        self.size() == 0.0
    }
    /// Divided by a double.
    fn over(self, divisor: f64) -> Self;
    /// Divided by another one, of which this is known to be exact where it is a double.
    fn per(self, divisor: Self) -> Self;
    /// Times a power of two.
    fn scaled(self, power: f64) -> Self;
    /// With a known error.
    fn blurred(self, error: f64) -> Self;
    /// Φ − I and Γ of twice the time.
    fn doubled(step: &Step<Self>, n: usize) -> Step<Self>;
}

impl Coefficient for DoubleDouble {
    fn near(self) -> f64 {
        self.high
    }

    fn size(self) -> f64 {
        self.high.abs()
    }

    fn over(self, divisor: f64) -> Self {
        Self::over(self, divisor)
    }

    fn per(self, divisor: Self) -> Self {
        Self::over(self, divisor.high)
    }

    fn scaled(self, power: f64) -> Self {
        Self::scaled(self, power)
    }

    fn blurred(self, _: f64) -> Self {
        self
    }

    fn doubled(step: &Step<Self>, n: usize) -> Step<Self> {
        let twice = |x: Self, y: Self| x.scaled(2.0) + y;
        Step {
            gamma: joined(&step.gamma, &times(&step.growth, &step.gamma, n), twice),
            growth: joined(&step.growth, &times(&step.growth, &step.growth, n), twice),
        }
    }
}

impl Coefficient for Enclosed {
    fn near(self) -> f64 {
        Self::near(self)
    }

    fn size(self) -> f64 {
        Self::size(self)
    }

    fn over(self, divisor: f64) -> Self {
        Self::over(self, divisor)
    }

    fn per(self, divisor: Self) -> Self {
        self / divisor
    }

    fn scaled(self, power: f64) -> Self {
        Self::scaled(self, power)
    }

    fn blurred(self, error: f64) -> Self {
        Self::blurred(self, error)
    }

    /// By Φ, whose entries fall where a mode decays: those of Φ − I would double their errors.
    fn doubled(step: &Step<Self>, n: usize) -> Step<Self> {
        let one = identity(n);
        let phi = joined(&step.growth, &one, |x, y| x + y);
        Step {
            gamma: joined(&step.gamma, &times(&phi, &step.gamma, n), |x, y| x + y),
            growth: joined(&times(&phi, &phi, n), &one, |x, y| x - y),
        }
    }
}

/// What a step does: Φ − I, and Γ of one input.
pub(super) struct Step<T> {
    pub(super) growth: Vec<T>,
    pub(super) gamma: Vec<T>,
}

impl<T: Coefficient> Step<T> {
    pub(super) fn new(a: &[T], b: &[T], time: T) -> Self {
        let n = b.len();
        let norm = (0..n).fold(0.0, |most: f64, j| {
            most.max((0..n).map(|i| a[i * n + j].size()).sum())
        });
        let mut doublings = 0;
        let mut step = time;
        while norm * step.size() > REACH && doublings < MOST_DOUBLINGS {
            step = step.scaled(0.5);
            doublings += 1;
        }
        // F = Σ (A t)ʲ/j!, Γ = Σ Aʲ tʲ⁺¹/(j + 1)! B.
        let sum = |x: T, y: T| x + y;
        let mut growth = vec![T::from(0.0); n * n];
        let mut power = identity(n);
        let mut gamma: Vec<T> = b.iter().map(|g| *g * step).collect();
        let mut term = gamma.clone();
        let mut size = 1.0;
        for j in 1..=MOST_TERMS {
            if size < LEFT_OUT {
                break;
            }
            size *= norm * step.size() / f64::from(j + 1);
            let scaled = |entry: &T, divisor: u32| (*entry * step).over(f64::from(divisor));
            power = times(a, &power, n)
                .iter()
                .map(|entry| scaled(entry, j))
                .collect();
            growth = joined(&growth, &power, sum);
            term = times(a, &term, n)
                .iter()
                .map(|entry| scaled(entry, j + 1))
                .collect();
            gamma = joined(&gamma, &term, sum);
        }
        let largest = gamma
            .iter()
            .fold(0.0, |most: f64, entry| most.max(entry.size()));
        let (of_growth, of_gamma) = (LEFT_OUT * norm * step.size(), LEFT_OUT * largest);
        let blurred = |entries: Vec<T>, error: f64| -> Vec<T> {
            entries
                .into_iter()
                .map(|entry| entry.blurred(error))
                .collect()
        };
        let mut found = Self {
            growth: blurred(growth, of_growth),
            gamma: blurred(gamma, of_gamma),
        };
        for _ in 0..doublings {
            found = T::doubled(&found, n);
        }
        found
    }
}

/// Φ and Γ of x′ = A x + B u over a time.
pub fn enclosed_step(
    a: &[Enclosed],
    b: &[Enclosed],
    time: Enclosed,
) -> (Vec<Enclosed>, Vec<Enclosed>) {
    let Step { growth, gamma } = Step::new(a, b, time);
    let phi = joined(&growth, &identity(b.len()), |x, y| x + y);
    (phi, gamma)
}

pub(super) fn identity<T: Coefficient>(n: usize) -> Vec<T> {
    let entry = |place: usize| T::from(f64::from(u8::from(place.is_multiple_of(n + 1))));
    (0..n * n).map(entry).collect()
}

/// The product of a square matrix of side n with another matrix, both row-major.
pub(super) fn times<T: Coefficient>(left: &[T], right: &[T], n: usize) -> Vec<T> {
    let width = right.len().checked_div(n).unwrap_or(0);
    let mut product = vec![T::from(0.0); right.len()];
    for i in 0..n {
        for j in 0..width {
            let mut sum = T::from(0.0);
            for inner in 0..n {
                let (x, y) = (left[i * n + inner], right[inner * width + j]);
                if !(x.is_nothing() || y.is_nothing()) {
                    sum = sum + x * y;
                }
            }
            product[i * width + j] = sum;
        }
    }
    product
}

/// Two matrices, entry by entry.
pub(super) fn joined<T: Coefficient>(left: &[T], right: &[T], with: impl Fn(T, T) -> T) -> Vec<T> {
    left.iter().zip(right).map(|(x, y)| with(*x, *y)).collect()
}
