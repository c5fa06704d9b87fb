//! A + k B, or A + e^(−s d) B, at any point: value and derivative in SIMD lanes, and bounds around a
//! point.
//!
//! Bounds on A⁽ⁱ⁾ within r of a centre are Σ (P⁽ⁱ⁾ …)(|s| + r) e^(−d (Re s − r)) with the moduli of
//! the coefficients, as in `pencil`, and so is the bound ε on rounding errors. That of `pencil` is
//! derived without fused operations; with them a complex product loses 2 u (Jeannerod, Kornerup,
//! Louvet and Muller 2017) in place of √5 u, and a step of Horner's rule 2 u of the moduli of its
//! summands in place of 3.3 u: the same ε covers both.

use num_complex::Complex64;

use crate::elementary::{exp, simd};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::simd::{Complex, Real, Simd};
use crate::stability::crossings::{sizes, united};
use crate::stability::hold::{Hold, ROUNDINGS};

/// Least radius of bounds around a point, in units of one over the longest delay and of |s|. Larger
/// bounds hold for longer and are wider.
const AROUND: f64 = 0.1;

/// Largest radius of bounds, in units of one over the longest delay: exponentials grow by e^0.5.
const FARTHEST: f64 = 0.5;

/// Covers the rounding errors of the bounds themselves.
const ROOM: f64 = 1.0 + 1e-9;

/// Range of exponentials that double precision can use.
const USABLE: std::ops::Range<f64> = 1e-250..1e250;

/// Evaluates A + k B, or A + e^(−s d) B, and derivatives anywhere.
#[derive(Debug, Clone)]
pub(crate) struct Plane {
    rows: Vec<(f64, Vec<f64>, Vec<f64>)>,
    degree: f64,
    longest: f64,
    hold: Option<Hold>,
    delay: Option<DelayOf>,
}

/// The delay d = σ (k − k₀).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DelayOf {
    /// σ.
    pub(crate) slope: f64,
    /// k₀.
    pub(crate) origin: f64,
    /// The largest d.
    pub(crate) longest: f64,
}

/// Bounds within `radius` of `center`: on A, A′, A″ and those of B, and ε.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Around {
    pub(crate) center: Complex64,
    pub(crate) radius: f64,
    a: [f64; 3],
    b: [f64; 3],
    rounding: f64,
    delay: Option<DelayOf>,
}

impl Plane {
    pub(crate) fn new(
        a: &QuasiPolynomial,
        b: &QuasiPolynomial,
        hold: Option<Hold>,
        delay: Option<DelayOf>,
    ) -> Self {
        let rows = united(a, b);
        let first = rows.first().map_or(0.0, |row| row.0);
        let rows: Vec<_> = rows
            .into_iter()
            .map(|(d, a, b)| (d - first, a, b))
            .collect();
        Self {
            degree: a.degree().max(b.degree()) as f64,
            longest: rows.last().map_or(0.0, |row| row.0)
                + delay.map_or(0.0, |delay| delay.longest),
            rows,
            hold,
            delay,
        }
    }

    /// The member h at k in s, h′, and −∂h/∂k.
    #[inline(always)]
    pub(crate) fn member<S: Simd>(&self, s: Complex<S>, k: Real<S>) -> [Complex<S>; 3] {
        let [a, da, b, db] = self.at(s);
        match self.delay {
            None => [a + b.scaled(k), da + db.scaled(k), -b],
            Some(DelayOf { slope, origin, .. }) => {
                let delay = (k - origin) * slope;
                let (sine, cosine) = simd::sin_cos(s.im * delay);
                let weight = simd::exp(-(s.re * delay));
                let turn = Complex::new(weight * cosine, -(weight * sine));
                let turned = b * turn;
                let derivative = (db - b.scaled(delay)) * turn;
                [a + turned, da + derivative, (turned * s).scaled(slope)]
            }
        }
    }

    /// A, A′, B, B′ at s.
    #[inline(always)]
    pub(crate) fn at<S: Simd>(&self, s: Complex<S>) -> [Complex<S>; 4] {
        let zero = s.re.constant(0.0);
        let zero = Complex::new(zero, zero);
        let (mut a, mut b) = ([zero; 2], [zero; 2]);
        let (variable, z) = match &self.hold {
            None => (s, None),
            Some(hold) => {
                let (sigma, z) = hold.lanes(s);
                (sigma, Some(z))
            }
        };
        for (delay, of_a, of_b) in &self.rows {
            let turn = (*delay != 0.0).then(|| turned(s, *delay));
            add_term(&mut a, of_a, (variable, z), *delay, turn);
            add_term(&mut b, of_b, (variable, z), *delay, turn);
        }
        [a[0], a[1], b[0], b[1]]
    }

    /// The imaginary part at which h is real again; infinite without a hold.
    pub(crate) fn top(&self) -> f64 {
        self.hold.map_or(f64::INFINITY, |hold| hold.top())
    }

    /// One over the longest delay, or zero where there is none.
    pub(crate) fn pace(&self) -> f64 {
        if self.longest > 0.0 {
            1.0 / self.longest
        } else {
            0.0
        }
    }

    /// A length over which the exponentials change, or `size` where there are none.
    pub(crate) fn unit(&self, size: f64) -> f64 {
        if self.longest > 0.0 {
            self.pace()
        } else {
            size
        }
    }

    /// Bounds that hold at distance `needed` around a point, if that is not too far, or further.
    pub(crate) fn around(&self, center: Complex64, needed: f64) -> Option<Around> {
        let size = modulus(center);
        let unit = self.unit(size);
        let least = AROUND * unit.min(size.max(0.1 * unit));
        let radius = needed.min(FARTHEST * unit).max(least);
        let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
        let far = (size + radius) * ROOM;
        let held = self
            .hold
            .map(|hold| (hold, hold.sizes_around(center, radius)));
        let derivatives = |row: &[f64]| match held {
            None => sizes(row, far),
            Some((hold, (sigma, z))) => hold.chain(sizes(row, sigma), z),
        };
        for (delay, of_a, of_b) in &self.rows {
            let weight = exp(-delay * (center.re - radius)) * ROOM;
            if !USABLE.contains(&weight) {
                return None;
            }
            for (sums, row) in [(&mut a, of_a), (&mut b, of_b)] {
                let [p, p1, p2, _] = derivatives(row);
                sums[0] += weight * p * ROOM;
                sums[1] += weight * (p1 + delay * p) * ROOM;
                sums[2] += weight * (p2 + delay * (2.0 * p1 + delay * p)) * ROOM;
            }
        }
        let units = 12.0 * self.degree + self.rows.len() as f64 + 24.0 + 16.0 * self.longest * far;
        let held = self.hold.map_or(0.0, |hold| {
            hold.coefficients + 0.51 * f64::EPSILON * ROUNDINGS * (self.degree + 1.0)
        });
        Some(Around {
            center,
            radius,
            a,
            b,
            rounding: 0.51 * f64::EPSILON * units + held,
            delay: self.delay,
        })
    }
}

impl Around {
    /// Bounds on the errors of h at k and of h′, and on |h″|.
    #[inline(always)]
    pub(crate) fn bounds(&self, k: f64) -> [f64; 3] {
        let [h, slope, bend] = match self.delay {
            None => [0, 1, 2].map(|i| self.a[i] + k.abs() * self.b[i]),
            Some(of) => {
                let d = (of.slope * (k - of.origin)).max(0.0) * ROOM;
                let nearest = self.center.re - self.radius;
                let weight = exp(-d * (nearest - 1e-9 * nearest.abs())) * ROOM;
                let [b, b1, b2] = self.b;
                let terms = [b, b1 + d * b, b2 + d * (2.0 * b1 + d * b)];
                [0, 1, 2].map(|i| self.a[i] + weight * terms[i] * ROOM)
            }
        };
        [self.rounding * h, self.rounding * slope, bend]
    }
}

/// e^(−s d).
#[inline(always)]
fn turned<S: Simd>(s: Complex<S>, delay: f64) -> Complex<S> {
    let (sine, cosine) = simd::sin_cos(s.im * delay);
    let weight = simd::exp(s.re * -delay);
    Complex::new(weight * cosine, -(weight * sine))
}

/// Add p `turn` and its derivative by s; p is a polynomial in `variable`, which is s, or σ with z.
#[inline(always)]
fn add_term<S: Simd>(
    sum: &mut [Complex<S>; 2],
    row: &[f64],
    (variable, z): (Complex<S>, Option<Complex<S>>),
    delay: f64,
    turn: Option<Complex<S>>,
) {
    let Some((leading, others)) = row.split_last() else {
        return;
    };
    let zero = variable.re.constant(0.0);
    let mut p = Complex::new(variable.re.constant(*leading), zero);
    let mut slope = Complex::new(zero, zero);
    for c in others.iter().rev() {
        slope = slope * variable + p;
        p = p.mul_add(variable, *c);
    }
    if let Some(z) = z {
        slope = slope * z;
    }
    let (p, slope) = match turn {
        Some(turn) => (p * turn, (slope - p.scaled(delay)) * turn),
        None => (p, slope),
    };
    sum[0] = sum[0] + p;
    sum[1] = sum[1] + slope;
}
