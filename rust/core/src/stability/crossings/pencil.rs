//! A pencil A(s) + k B(s) on a straight line s = s₀ + c t, |c| = 1, and the function F(t) whose
//! zeros are its crossings.
//!
//! With the delays counted from one of B's, F(t) = Im(A B*) vanishes where some real k makes A + k
//! B zero at s, and there k = −Re(A/B) (D-subdivision: Neimark 1949). F and its first two
//! derivatives in t come from A, A′, A″ and those of B; |F‴| ≤ A₃B₀ + 3A₂B₁ + 3A₁B₂ + A₀B₃, where
//! A_i bounds |A⁽ⁱ⁾| by the moduli of its coefficients on a stretch of the line.
//!
//! With k = e^(−s d) on the imaginary axis, d a delay, some d makes A + k B zero where F(t) = |A|² −
//! |B|² vanishes (Walton and Marshall 1987); |F‴| ≤ 2 (A₃A₀ + 3A₂A₁ + B₃B₀ + 3B₂B₁).
//!
//! Rounding, as derived in `quasipoly::probe`: A, A′ and A″ of degree n with m terms are within ε
//! A_i, ε = u (12n + m + 16 + 4 d (|x| + |y|)), d the largest delay. Coefficients and delays that
//! are themselves sums of a few rounded products change A by u (8 + 8 d (|x| + |y|)) A₀ at most,
//! which ε includes, so that the proofs hold for both. Then F⁽ⁱ⁾ is within 2.25 ε times the sum of
//! products of bounds that bounds it: 2 ε + ε² from the factors, 3 u from their product. With a `hold` the
//! polynomials are those in σ, and ε is larger by what `hold` adds.

use num_complex::Complex64;

use crate::elementary::{exp, sin_cos};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::stability::hold::{Hold, ROUNDINGS};
use crate::stability::specification::Piece;

/// Bounds are computed up to this factor further than needed now, plus a step, so that they need
/// not be renewed at every step.
const AHEAD: f64 = 1.1;

/// Covers the rounding errors of the bounds themselves and of inequalities with them.
const ROOM: f64 = 1.0 + 1e-9;

/// Range in which underflow cannot change a sum.
const USABLE: std::ops::Range<f64> = 1e-250..1e280;

/// The rows of A and B with one delay d, and |e^(−s d)| where it is constant along the line.
#[derive(Debug, Clone)]
struct Row {
    a: Vec<f64>,
    b: Vec<f64>,
    delay: f64,
    weight: Option<f64>,
}

/// What k is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Factor {
    /// A real number: F = Im(A B*).
    Gain,
    /// e^(−s d), on the imaginary axis: F = |A|² − |B|².
    Delay,
}

/// A(s) + k B(s) along a line.
#[derive(Debug, Clone)]
pub(crate) struct Pencil {
    rows: Vec<Row>,
    line: Piece,
    factor: Factor,
    degree: f64,
    longest: f64,
    hold: Option<Hold>,
}

/// Value and first two derivatives.
type Jet = [Complex64; 3];

/// The values at one t.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Point {
    pub(crate) t: f64,
    pub(crate) s: Complex64,
    pub(crate) a: Complex64,
    pub(crate) b: Complex64,
    /// F, F′, F″.
    pub(crate) f: [f64; 3],
}

/// Bounds on a stretch of the line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    /// The t of its far end.
    pub(crate) reach: f64,
    /// A₀, A₁.
    pub(crate) a: [f64; 2],
    pub(crate) b: [f64; 2],
    /// On the rate of change of |A| and |B|.
    pub(crate) modulus: [f64; 2],
    /// On |F‴|.
    pub(crate) third: f64,
    /// On the errors of F, F′, F″.
    pub(crate) error: [f64; 3],
    /// ε.
    pub(crate) rounding: f64,
}

impl Pencil {
    /// `None` where B is zero, or numbers would leave the range of double precision.
    pub(crate) fn new(
        a: &QuasiPolynomial,
        b: &QuasiPolynomial,
        line: Piece,
        factor: Factor,
        hold: Option<Hold>,
    ) -> Option<Self> {
        let origin = b.delays().first().copied().filter(|_| !b.is_zero())?;
        let rows: Vec<Row> = united(a, b)
            .into_iter()
            .map(|(delay, a, b)| {
                let delay = delay - origin;
                let upright = line.along.re == 0.0;
                Row {
                    a,
                    b,
                    delay,
                    weight: (upright || delay == 0.0).then(|| exp(-line.from.re * delay)),
                }
            })
            .collect();
        let usable = |row: &Row| {
            row.weight.is_none_or(|weight| USABLE.contains(&weight)) && row.delay.is_finite()
        };
        let longest = rows.iter().fold(0.0, |d, row| row.delay.abs().max(d));
        rows.iter().all(usable).then(|| Self {
            line,
            factor,
            degree: a.degree().max(b.degree()) as f64,
            longest,
            rows,
            hold,
        })
    }

    /// A step along the line in which the arguments of the exponentials change by at most 1 rad;
    /// infinite without delays.
    pub(crate) fn step(&self) -> f64 {
        1.0 / self.longest
    }

    /// How far bounds are needed from t on. On a slanted line, along which the exponentials grow,
    /// bounds from further ahead would be wide.
    pub(crate) fn horizon(&self, t: f64, step: f64) -> f64 {
        if self.line.along.re == 0.0 {
            (0.5 + 0.5 * AHEAD) * t + 0.5 * step
        } else {
            t + 0.5 * step
        }
    }

    /// A, B and F at one t.
    pub(crate) fn at(&self, t: f64) -> Point {
        let s = self.line.from + self.line.along * t;
        let (mut a, mut b) = ([Complex64::ZERO; 3], [Complex64::ZERO; 3]);
        let held = self.hold.map(|hold| (hold.at(s), hold.sample_time));
        let variable = held.map_or(s, |((sigma, _), _)| sigma);
        let inner = held.map(|((_, z), sample_time)| (z, sample_time));
        for row in &self.rows {
            let weight = row.weight.unwrap_or_else(|| exp(-row.delay * s.re));
            let turn = if row.delay == 0.0 {
                Complex64::new(weight, 0.0)
            } else {
                let (sine, cosine) = sin_cos(row.delay * s.im);
                Complex64::new(weight * cosine, -weight * sine)
            };
            add_term(&mut a, &row.a, (variable, inner), row.delay, turn);
            add_term(&mut b, &row.b, (variable, inner), row.delay, turn);
        }
        // d/dt = c d/ds.
        let c = self.line.along;
        let along = |[value, slope, bend]: Jet| [value, c * slope, c * c * bend];
        let (p, q) = (along(a), along(b));
        let cross = |i: usize, j: usize| p[i].im * q[j].re - p[i].re * q[j].im;
        let real = |u: Complex64, v: Complex64| u.re * v.re + u.im * v.im;
        let square = |i: usize, j: usize| real(p[i], p[j]) - real(q[i], q[j]);
        Point {
            t,
            s,
            a: p[0],
            b: q[0],
            f: match self.factor {
                Factor::Gain => [
                    cross(0, 0),
                    cross(1, 0) + cross(0, 1),
                    cross(2, 0) + 2.0 * cross(1, 1) + cross(0, 2),
                ],
                Factor::Delay => [
                    square(0, 0),
                    2.0 * square(1, 0),
                    2.0 * (square(2, 0) + square(1, 1)),
                ],
            },
        }
    }

    /// Bounds from `low` to slightly more than `high`, about one `step`; `None` where they leave
    /// the range of double precision.
    pub(crate) fn bounds(&self, low: f64, high: f64, step: f64) -> Option<Bounds> {
        let reach = if self.line.along.re == 0.0 {
            AHEAD * high + step
        } else {
            high + step
        };
        let ends = [low, reach].map(|t| self.line.from + self.line.along * t);
        // A modulus is largest at one of the ends, and so is an exponential of the real part.
        let size = modulus(ends[0]).max(modulus(ends[1])) * ROOM;
        let held = self.hold.map(|hold| (hold, hold.sizes(ends)));
        let derivatives = |coefficients: &[f64]| match held {
            None => sizes(coefficients, size),
            Some((hold, (sigma, z))) => hold.chain(sizes(coefficients, sigma), z),
        };
        let heaviest = |row: &Row| {
            let [first, last] = ends.map(|s| exp(-row.delay * s.re));
            row.weight.unwrap_or(first.max(last) * ROOM)
        };
        let weights: Vec<f64> = self.rows.iter().map(heaviest).collect();
        if !weights.iter().all(|weight| USABLE.contains(weight)) {
            return None;
        }
        let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
        for (row, weight) in self.rows.iter().zip(&weights) {
            let d = row.delay.abs();
            for (sums, coefficients) in [(&mut a, &row.a), (&mut b, &row.b)] {
                let [p, p1, p2, p3] = derivatives(coefficients);
                let terms = [
                    p,
                    p1 + d * p,
                    p2 + d * (2.0 * p1 + d * p),
                    p3 + d * (3.0 * p2 + d * (3.0 * p1 + d * p)),
                ];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    *sum += weight * term * ROOM;
                }
            }
        }
        // On an upright line the rate of change of a modulus does not depend on the reference
        // delay; otherwise each row is taken relative to its own delay.
        let modulus = [0, 1].map(|which| {
            let from = |origin: f64| {
                self.rows
                    .iter()
                    .zip(&weights)
                    .fold(0.0, |sum, (row, weight)| {
                        let [p, p1, ..] = derivatives(if which == 0 { &row.a } else { &row.b });
                        sum + weight * (p1 + (row.delay - origin).abs() * p) * ROOM
                    })
            };
            if self.line.along.re != 0.0 {
                return from(0.0);
            }
            let all = self.rows.iter().map(|row| from(row.delay));
            all.fold(f64::INFINITY, f64::min)
        });
        let units = 12.0 * self.degree + self.rows.len() as f64 + 24.0 + 32.0 * self.longest * size;
        let held = self.hold.map_or(0.0, |hold| {
            hold.coefficients + 0.51 * f64::EPSILON * ROUNDINGS * (self.degree + 1.0)
        });
        let rounding = 0.51 * f64::EPSILON * units + held;
        // Bounds on the derivatives of the product of functions with the bounds p and q.
        let product = |p: [f64; 4], q: [f64; 4]| {
            [
                p[0] * q[0],
                p[1] * q[0] + p[0] * q[1],
                p[2] * q[0] + 2.0 * p[1] * q[1] + p[0] * q[2],
                p[3] * q[0] + 3.0 * (p[2] * q[1] + p[1] * q[2]) + p[0] * q[3],
            ]
        };
        let [value, first, second, third] = match self.factor {
            Factor::Gain => product(a, b),
            Factor::Delay => {
                let (one, other) = (product(a, a), product(b, b));
                std::array::from_fn(|i| one[i] + other[i])
            }
        };
        let products = [value, first, second];
        let usable = USABLE.contains(&products[0]) && (third + second + first).is_finite();
        usable.then(|| Bounds {
            reach,
            a: [a[0], a[1]],
            b: [b[0], b[1]],
            modulus,
            third: third * ROOM,
            error: products.map(|product| 2.25 * rounding * product * ROOM),
            rounding,
        })
    }
}

/// The delays of A and B, increasing, with the rows of both.
pub(crate) fn united(a: &QuasiPolynomial, b: &QuasiPolynomial) -> Vec<(f64, Vec<f64>, Vec<f64>)> {
    let mut delays: Vec<f64> = a.delays().iter().chain(b.delays()).copied().collect();
    delays.sort_by(f64::total_cmp);
    delays.dedup();
    let row_of = |h: &QuasiPolynomial, delay: f64| {
        let place = h.delays().iter().position(|d| *d == delay);
        let row = place.and_then(|index| h.coefficients().get(index));
        row.cloned().unwrap_or_default()
    };
    let rows = delays.into_iter();
    rows.map(|delay| (delay, row_of(a, delay), row_of(b, delay)))
        .collect()
}

/// Add p `turn` and its derivatives by s; p is a polynomial in `variable`, which is s, or σ with
/// z and the sample time of a hold.
#[inline(always)]
fn add_term(
    sum: &mut Jet,
    row: &[f64],
    (variable, inner): (Complex64, Option<(Complex64, f64)>),
    delay: f64,
    turn: Complex64,
) {
    if row.is_empty() {
        return;
    }
    let (mut p, mut p1, mut p2) = (Complex64::ZERO, Complex64::ZERO, Complex64::ZERO);
    for c in row.iter().rev() {
        p2 = p2 * variable + p1;
        p1 = p1 * variable + p;
        p = p * variable + c;
    }
    if let Some((z, sample_time)) = inner {
        p2 = z * (z * p2 + 0.5 * sample_time * p1);
        p1 *= z;
    }
    sum[0] += p * turn;
    sum[1] += (p1 - p * delay) * turn;
    sum[2] += (2.0 * p2 - (2.0 * p1 - p * delay) * delay) * turn;
}

/// The polynomial with the moduli of the coefficients, and its first three derivatives.
pub(crate) fn sizes(row: &[f64], size: f64) -> [f64; 4] {
    let mut p = [0.0; 4];
    for c in row.iter().rev() {
        p[3] = p[3] * size + p[2];
        p[2] = p[2] * size + p[1];
        p[1] = p[1] * size + p[0];
        p[0] = p[0] * size + c.abs();
    }
    [p[0], p[1], 2.0 * p[2], 6.0 * p[3]]
}
