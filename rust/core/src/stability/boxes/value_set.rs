//! Is h(s; p) ≠ 0 for all p in a box and all s in a stretch of the edge?
//!
//! With centres c, s_0 and p = c + δ, s = s_0 + ηe, |δ_i| ≤ r_i, |η| ≤ ρ, |e| = 1, Taylor's theorem
//! gives
//!     h = h_0 + Σ δ_i ∂_i h + η ∂_η h + E,  |E| ≤ ½ Σ_ab x_a x_b max |∂_a ∂_b h|,  x = (r, ρ),
//! the first part of which fills a zonotope. Its distance from 0 exceeds |E| if, for some n,
//!     |Re n̄ h_0| − Σ_a |Re n̄ ∂_a h| x_a > |n| max |E|.
//! The n tried are the normals of the edges, one of which separates 0 from a polygon if any line
//! does, and h_0 itself (for the disc around it). With f = P e^(−sd), dashes for ∂/∂s, w = |s|, W =
//! |e^(−sd)|:
//!     ∂_i f = (P_i − s d_i P) e^(…),  ∂_η f = e (P′ − d P) e^(…),
//!     |∂_η² f| ≤ W (|P″| + 2|d P′| + d²|P|),  |∂_η ∂_i f| ≤ W (|P_i′| + |d P_i| + |d_i| (|P| + w|P′| + w|d P|)),
//!     |∂_i ∂_l f| ≤ W (|P_il| + w (|d_i P_l| + |d_l P_i|) + w² |d_i d_l P|),
//! bounded by majorants at the upper end of the stretch. Alternatively one row exceeds the others:
//! |f_j| stays within max W ((|P_j′| + |Re e| |d P_j|) ρ + Σ (|P_i| + |Re s| |d_i P_j|) r_i) of its
//! value at s_0. Rounding: as in `quasipoly::probe`, a value or slope of degree n is wrong by at
//! most u (16 (n + 1) + 4 m + 16 wS) of its majorant for m rows, S the sum of the moduli that make
//! up d, plus `digits` of the coefficients; directions and products with them have errors of 32 u
//! more. The same amount is added again, because members are formed in double precision.

use num_complex::Complex64;

use super::box_expansion::{BoxExpansion, ExpansionRow};
use crate::elementary::{exp, sin_cos};
use crate::quasipoly::modulus;
use crate::stability::specification::Piece;

/// Half an ulp of 1, enlarged by the rounding errors of computing the bounds.
const ROUNDING: f64 = 1.02 * 0.5 * f64::EPSILON;

/// Far above every effect of underflow; its square is a normal number.
const FLOOR: f64 = 1e-150;

/// No statement is made about values below this.
const SMALLEST: f64 = 1e-140;

/// Relative length of a stretch below which it is not divided.
const FINEST: f64 = 1e-13;

/// Covers the rounding errors of a bound.
const ROOM: f64 = 1.0 + 1e-9;

/// If h changes along a stretch by less than this many times what it changes over the box, and a
/// member may have a root in the middle of the stretch, the stretch is not divided: the box is.
const COARSE: f64 = 0.3;

/// The same limit, wherever the members' roots are.
const FINE: f64 = 0.1;

/// Result of testing one stretch of the edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Look<const D: usize> {
    /// No member has a root there.
    Clear,
    /// The stretch is too long for a proof.
    Long,
    /// The box is too large for a proof; the contribution of each parameter to that.
    Wide([f64; D]),
}

/// A stretch of the edge: s_0 + η e, |η| ≤ ρ.
struct Stretch {
    middle: Complex64,
    along: Complex64,
    rho: f64,
    /// The largest |s|.
    far: f64,
    /// Least and largest Re s.
    reals: (f64, f64),
}

/// s z, at half the cost on the imaginary axis.
#[inline(always)]
fn times<const AXIS: bool>(s: Complex64, z: Complex64) -> Complex64 {
    if AXIS {
        Complex64::new(-s.im * z.im, s.im * z.re)
    } else {
        s * z
    }
}

impl Stretch {
    fn new(piece: &Piece, from: f64, to: f64) -> Self {
        let t = from + 0.5 * (to - from);
        let rho = (t - from).max(to - t) * (1.0 + 2.0 * f64::EPSILON);
        let middle = piece.from + piece.along * t;
        let (lean, margin) = (
            piece.along.re.abs() * rho,
            8.0 * f64::EPSILON * middle.re.abs(),
        );
        Self {
            middle,
            along: piece.along,
            rho,
            far: if middle.re == 0.0 && lean == 0.0 {
                to
            } else {
                (modulus(middle) + rho) * (1.0 + 8.0 * f64::EPSILON)
            },
            reals: (middle.re - lean - margin, middle.re + lean + margin),
        }
    }

    fn is_on_axis(&self) -> bool {
        self.reals == (0.0, 0.0)
    }

    /// Bound on |e^(−sd)| for delays up to `spread` around `delay`.
    fn heaviest(&self, delay: f64, spread: f64) -> f64 {
        let (low, high) = self.reals;
        let products = [delay - spread, delay + spread].map(|d| (-d * low).max(-d * high));
        exp(products[0].max(products[1])) * ROOM
    }
}

/// First and second order of h around the middle of a stretch.
struct Expansion<const D: usize> {
    value: Complex64,
    slopes: [Complex64; D],
    turn: Complex64,
    /// |∂_η² h|, |∂_η ∂_i h| and |∂_i ∂_l h|.
    bend: f64,
    mixed: [f64; D],
    bends: [[f64; D]; D],
    /// The least excess of the largest row over the others, all over box and stretch.
    excess: f64,
    /// Bound on the rounding errors of the zonotope.
    rounding: f64,
}

/// Majorants of a polynomial over the box up to one |s|: P, P′, P″.
#[inline(always)]
fn majorants<const D: usize>(row: &ExpansionRow<D>, w: f64) -> (f64, f64, f64) {
    let (mut p, mut dp, mut ddp) = (0.0, 0.0, 0.0);
    for c in row.coefficients.iter().rev() {
        ddp = ddp * w + dp;
        dp = dp * w + p;
        p = p * w + c.most;
    }
    (p, dp, 2.0 * ddp)
}

impl<const D: usize> Expansion<D> {
    fn new(expansion: &BoxExpansion<D>, stretch: &Stretch) -> Self {
        if stretch.is_on_axis() {
            Self::at::<true>(expansion, stretch)
        } else {
            Self::at::<false>(expansion, stretch)
        }
    }

    fn at<const AXIS: bool>(expansion: &BoxExpansion<D>, stretch: &Stretch) -> Self {
        let half = &expansion.half;
        let (s, top, rho) = (stretch.middle, stretch.far, stretch.rho);
        let lean = stretch.along.re.abs();
        let leftmost = stretch.reals.0.abs().max(stretch.reals.1.abs());
        let mut own = Self {
            value: Complex64::ZERO,
            slopes: [Complex64::ZERO; D],
            turn: Complex64::ZERO,
            bend: 0.0,
            mixed: [0.0; D],
            bends: [[0.0; D]; D],
            excess: 0.0,
            rounding: FLOOR,
        };
        let (mut largest, mut all) = (0.0f64, 0.0);
        for row in &expansion.rows {
            let (mut p, mut dp) = (Complex64::ZERO, Complex64::ZERO);
            for c in row.coefficients.iter().rev() {
                dp = times::<AXIS>(s, dp) + p;
                p = times::<AXIS>(s, p) + c.value;
            }
            let turned = if row.delay == 0.0 {
                Complex64::ONE
            } else {
                let (sine, cosine) = sin_cos(row.delay * s.im);
                let weight = if AXIS { 1.0 } else { exp(-row.delay * s.re) };
                Complex64::new(weight * cosine, -weight * sine)
            };
            let value = p * turned;
            let slope = dp * turned - value * row.delay;
            own.value += value;
            own.turn += times::<AXIS>(stretch.along, slope);
            let heaviest = if AXIS {
                1.0
            } else {
                stretch.heaviest(row.delay, row.spread)
            };
            let (most, most_slope, most_bend) = majorants(row, top);
            let d = row.longest;
            let pace = most_slope + d * most;
            own.bend += heaviest * (most_bend + d * (most_slope + pace));
            let mut sizes = most + pace * rho;
            let size = modulus(value);
            largest = largest.max(size);
            let mut moved = (most_slope + lean * d * most) * rho;
            if row.moves {
                for (i, r) in half.iter().enumerate() {
                    let mut p_i = Complex64::ZERO;
                    let (mut most_i, mut most_slope_i) = (0.0, 0.0);
                    for c in row.coefficients.iter().rev() {
                        p_i = times::<AXIS>(s, p_i) + c.slopes[i];
                        most_slope_i = most_slope_i * top + most_i;
                        most_i = most_i * top + c.most_slopes[i];
                    }
                    let rate = row.rates[i];
                    own.slopes[i] += p_i * turned;
                    if rate != 0.0 {
                        own.slopes[i] -= times::<AXIS>(s, value) * row.slopes[i];
                    }
                    sizes += (most_i + top * rate * most) * r;
                    moved += (most_i + leftmost * rate * most) * r;
                    own.mixed[i] +=
                        heaviest * (most_slope_i + d * most_i + rate * (most + top * pace));
                    for l in 0..D {
                        let (mut bend, mut most_l) = (0.0, 0.0);
                        for c in row.coefficients.iter().rev() {
                            bend = bend * top + c.bends[i][l];
                            most_l = most_l * top + c.most_slopes[l];
                        }
                        let other = row.rates[l];
                        own.bends[i][l] += heaviest
                            * (bend + top * (rate * most_l + other * (most_i + top * rate * most)));
                    }
                }
            }
            all += size + heaviest * moved;
            own.rounding +=
                2.0 * ROUNDING * (expansion.roundings + 16.0 * top * row.size) * heaviest * sizes;
        }
        own.excess = 2.0 * largest - all * ROOM;
        own
    }

    /// Second order in the parameters alone, with the share of each.
    fn remainder(&self, half: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|i| {
            let sum: f64 = self.bends[i].iter().zip(half).map(|(b, r)| b * r).sum();
            0.5 * half[i] * sum
        })
    }

    /// Does a line separate 0 from all values when s is within `rho`?
    fn is_clear(&self, half: &[f64; D], rho: f64, rest: f64) -> bool {
        let mixed: f64 = self.mixed.iter().zip(half).map(|(m, r)| m * r).sum();
        let rest = rest + rho * (mixed + 0.5 * rho * self.bend);
        let rest = rest * ROOM + self.rounding;
        let separates = |n: Complex64| {
            let along = |z: Complex64| (n.re * z.re + n.im * z.im).abs();
            let mut reach = along(self.turn) * rho;
            for (slope, r) in self.slopes.iter().zip(half) {
                reach += along(*slope) * r;
            }
            let excess = along(self.value) - reach;
            // Scaled so that the squares stay in range.
            let size = n.norm_sqr();
            excess > SMALLEST
                && size > SMALLEST * SMALLEST
                && excess * excess > size * rest * rest * ROOM
        };
        let normal = |z: Complex64| Complex64::new(-z.im, z.re);
        separates(normal(self.turn))
            || separates(self.value)
            || self.slopes.iter().any(|slope| separates(normal(*slope)))
    }
}

/// Test the stretch of a piece of the edge from `from` to `to`.
pub(crate) fn look<const D: usize>(
    expansion: &BoxExpansion<D>,
    piece: &Piece,
    from: f64,
    to: f64,
) -> Look<D> {
    let stretch = Stretch::new(piece, from, to);
    let rho = stretch.rho;
    let own = Expansion::new(expansion, &stretch);
    let half = &expansion.half;
    let remainder = own.remainder(half);
    let rest: f64 = remainder.iter().sum();
    if own.is_clear(half, rho, rest) || own.excess > own.rounding {
        return Look::Clear;
    }
    // Perpendicular to the direction in which h moves with s, only the parameters can lead away
    // from 0.
    let along = |z: &Complex64| {
        let size = own.turn.norm_sqr().sqrt();
        if size > 0.0 {
            (own.turn.re * z.im - own.turn.im * z.re).abs() / size
        } else {
            z.norm_sqr().sqrt()
        }
    };
    let mixed = |i: usize| own.mixed[i] * rho;
    let shares: [f64; D] =
        std::array::from_fn(|i| (along(&own.slopes[i]) + mixed(i)) * half[i] + remainder[i]);
    let spread: f64 = shares.iter().sum();
    let pace = own.turn.norm_sqr().sqrt() * rho;
    // Where an exponential overflows, nothing is proved.
    let finest = rho <= FINEST * to || pace <= own.rounding || !own.rounding.is_finite();
    if finest || (pace < COARSE * spread && !own.is_clear(half, 0.0, rest)) {
        return Look::Wide(shares);
    }
    if pace + own.bend * rho * rho < FINE * spread {
        return Look::Wide(shares);
    }
    Look::Long
}

/// h and its derivatives with respect to the parameters and along the edge, at one point of a
/// piece.
pub(crate) fn tangent<const D: usize>(
    expansion: &BoxExpansion<D>,
    piece: &Piece,
    t: f64,
) -> (Complex64, [Complex64; D], Complex64) {
    let own = Expansion::new(expansion, &Stretch::new(piece, t, t));
    (own.value, own.slopes, own.turn)
}
