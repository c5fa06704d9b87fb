//! One root of A + k B, followed as k varies.
//!
//! From the last two values of k the next root is extrapolated (cubic, with the slopes ds/dk = −B/h′),
//! and Newton's step taken there, at s₀, to s₁. Let a = |h′(s₀)| − e₁, η = (|h(s₀)| + e₀)/a, and M bound |h″|
//! within 2η of s₀. If M η ≤ a/4, then by Rouché's theorem exactly one root lies within 2η of s₀: on that circle
//! |h′ (s − s₀)| ≥ 2aη exceeds |h(s₀)| + e₀ + M (2η)²/2 ≤ 1.5 aη. By Taylor's formula at s₀ it lies within
//! (2Mη² + e₀ + 2 e₁ η)/a of s₁ (Kantorovich 1948), besides the rounding of s₁ itself. e₀ and e₁ are bounds on
//! rounding as in `pencil`, which also cover coefficients that are sums of a few rounded products.

use num_complex::Complex64;

use super::pencil::{sizes, united};
use crate::elementary::{exp, sin_cos};
use crate::quasipoly::{QuasiPolynomial, modulus};

/// A radius as wide as this, relative to the root, is worth another step.
const SHARP: f64 = 1e-13;

/// A radius that rounding keeps wider is taken up to this, relative to the root or to one over the longest delay.
const WIDEST: f64 = 1e-11;

/// Steps before a branch is taken for lost.
const MAX_STEPS: u32 = 8;

/// Bounds hold as far as this around the place they were made for, in units of one over the longest delay and
/// of |s|.
const AROUND: f64 = 0.1;

/// Rounding of the bounds themselves.
const ROOM: f64 = 1.0 + 1e-9;

/// Weights outside this are none of double precision's business.
const USABLE: std::ops::Range<f64> = 1e-250..1e250;

/// A simple root, its disc and its slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Root {
    pub(super) s: Complex64,
    pub(super) radius: f64,
    /// ds/dk.
    slope: Complex64,
    k: f64,
}

impl Root {
    /// Does it stand for its mirror image as well? `None` where that cannot be told.
    pub(super) fn weight(&self) -> Option<i32> {
        if self.s.im == 0.0 {
            Some(1)
        } else {
            (self.s.im.abs() > self.radius).then_some(2)
        }
    }
}

/// Evaluates A + k B and its derivatives anywhere.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    rows: Vec<(f64, Vec<f64>, Vec<f64>)>,
    degree: f64,
    longest: f64,
}

/// Bounds within `radius` of `center`: on A, A′, A″ and those of B, and ε.
#[derive(Debug, Clone, Copy)]
struct Around {
    center: Complex64,
    radius: f64,
    a: [f64; 3],
    b: [f64; 3],
    rounding: f64,
}

impl Plane {
    pub(super) fn new(a: &QuasiPolynomial, b: &QuasiPolynomial) -> Self {
        let rows = united(a, b);
        let first = rows.first().map_or(0.0, |row| row.0);
        let rows: Vec<_> = rows
            .into_iter()
            .map(|(d, a, b)| (d - first, a, b))
            .collect();
        Self {
            degree: a.degree().max(b.degree()) as f64,
            longest: rows.last().map_or(0.0, |row| row.0),
            rows,
        }
    }

    /// A, A′, B, B′ at s.
    fn at(&self, s: Complex64) -> [Complex64; 4] {
        let mut sums = [Complex64::ZERO; 4];
        for (delay, a, b) in &self.rows {
            let turn = if *delay == 0.0 {
                Complex64::ONE
            } else {
                let (sine, cosine) = sin_cos(delay * s.im);
                let weight = exp(-delay * s.re);
                Complex64::new(weight * cosine, -weight * sine)
            };
            for (place, row) in [(0, a), (2, b)] {
                let (mut p, mut p1) = (Complex64::ZERO, Complex64::ZERO);
                for c in row.iter().rev() {
                    p1 = p1 * s + p;
                    p = p * s + c;
                }
                sums[place] += p * turn;
                sums[place + 1] += (p1 - p * *delay) * turn;
            }
        }
        sums
    }

    /// A length over which the exponentials change, or `size` where there are none.
    fn unit(&self, size: f64) -> f64 {
        if self.longest > 0.0 {
            1.0 / self.longest
        } else {
            size
        }
    }

    fn around(&self, center: Complex64) -> Option<Around> {
        let size = modulus(center);
        let unit = self.unit(size);
        let radius = AROUND * unit.min(size.max(0.1 * unit));
        let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
        let far = (size + radius) * ROOM;
        for (delay, of_a, of_b) in &self.rows {
            let weight = exp(-delay * (center.re - radius)) * ROOM;
            if !USABLE.contains(&weight) {
                return None;
            }
            for (sums, row) in [(&mut a, of_a), (&mut b, of_b)] {
                let [p, p1, p2, _] = sizes(row, far);
                sums[0] += weight * p * ROOM;
                sums[1] += weight * (p1 + delay * p) * ROOM;
                sums[2] += weight * (p2 + delay * (2.0 * p1 + delay * p)) * ROOM;
            }
        }
        let units = 12.0 * self.degree + self.rows.len() as f64 + 24.0 + 16.0 * self.longest * far;
        Some(Around {
            center,
            radius,
            a,
            b,
            rounding: 0.51 * f64::EPSILON * units,
        })
    }
}

/// A root on its way along k.
#[derive(Debug, Clone)]
pub(super) struct Branch {
    around: Around,
    before: Root,
    now: Root,
}

impl Branch {
    /// A branch through the root next to `s` at `k`; `None` where it is not proved to be simple.
    pub(super) fn through(plane: &Plane, s: Complex64, k: f64) -> Option<Self> {
        let mut around = plane.around(s)?;
        let now = settle(plane, &mut around, s, k)?;
        Some(Self {
            around,
            before: now,
            now,
        })
    }

    /// The root at the last k.
    pub(super) fn root(&self) -> &Root {
        &self.now
    }

    /// Follow the root to another k; `None` where it is lost, or would be the mirror image of one that is followed
    /// as well.
    pub(super) fn follow(&mut self, plane: &Plane, k: f64) -> Option<()> {
        let guess = self.extrapolated(k);
        let root = settle(plane, &mut self.around, guess, k).filter(|root| root.s.im >= 0.0)?;
        // Newton's step from next to a multiple root leads anywhere.
        let size = modulus(self.now.s);
        if modulus(root.s - self.now.s) > plane.unit(size) {
            return None;
        }
        self.before = std::mem::replace(&mut self.now, root);
        Some(())
    }

    /// Hermite's cubic through the last two roots and slopes, or the tangent.
    fn extrapolated(&self, k: f64) -> Complex64 {
        let (old, new) = (&self.before, &self.now);
        let span = new.k - old.k;
        if span == 0.0 {
            return new.s + new.slope * (k - new.k);
        }
        let t = (k - new.k) / span;
        // In powers of t from the newer root on; at t = −1 lies the older one.
        let (d0, d1) = (old.slope * span, new.slope * span);
        let gap = new.s - old.s;
        let square = 2.0 * d1 + d0 - 3.0 * gap;
        let cube = d1 + d0 - 2.0 * gap;
        new.s + (d1 + (square + cube * t) * t) * t
    }
}

/// The disc of the root near `start`.
fn settle(plane: &Plane, around: &mut Around, start: Complex64, k: f64) -> Option<Root> {
    let mut s = start;
    for _ in 0..MAX_STEPS {
        if modulus(s - around.center) > 0.5 * around.radius {
            *around = plane.around(s)?;
        }
        let [a, da, b, db] = plane.at(s);
        let (h, dh) = (a + b * k, da + db * k);
        let bound = |i: usize| around.a[i] + k.abs() * around.b[i];
        let (e0, e1) = (around.rounding * bound(0), around.rounding * bound(1));
        let slope = modulus(dh);
        let least = (slope - e1) * (1.0 - 1e-9);
        let reach = (modulus(h) + e0) / least;
        let proved =
            least > 0.0 && 4.0 * bound(2) * reach <= least && 2.0 * reach <= 0.5 * around.radius;
        let next = s - h / dh;
        if proved {
            let radius = (2.0 * bound(2) * reach * reach + e0 + 2.0 * e1 * reach) / least * ROOM
                + 8.0 * f64::EPSILON * (modulus(s) + reach);
            let size = modulus(next);
            let rounded =
                radius <= 4.0 * e0 / least && radius <= WIDEST * size.max(plane.unit(size));
            if radius <= SHARP * size || rounded {
                return Some(Root {
                    s: next,
                    radius,
                    slope: -b / dh,
                    k,
                });
            }
        }
        if !next.is_finite() {
            return None;
        }
        s = next;
    }
    None
}
