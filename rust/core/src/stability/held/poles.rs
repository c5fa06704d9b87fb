//! All poles of a loop with a hold, in discs that are proved to hold them.
//!
//! q(σ) = z^(m+1) a(σ) − b(σ), z = 1 + Ts σ, has degree N = n + m + 1 and the leading coefficient
//! Ts^(m+1). With approximations σ_i of its zeros and
//!
//! ```text
//! W_i = q(σ_i)/(Ts^(m+1) ∏_{j≠i} (σ_i − σ_j))
//! ```
//!
//! the discs |σ − σ_i| ≤ N |W_i| hold all zeros, and k of them that are joined hold k (Smith 1970,
//! Journal of the ACM 17, 661). |q| is taken with the errors of its coefficients and of its
//! evaluation. The approximations are eigenvalues of the transition matrix, moved by −W_i (Durand 1960,
//! Kerner 1966), which gains the digits that they lose next to z = 1. Discs that meet become one
//! around both. Powers of σ that a and b share, and eigenvalues z = 0 that stand alone in the
//! matrix, are exact and left out of N.

use num_complex::Complex64;

use super::model::{LoopPolynomials, Polynomial};
use crate::Error;
use crate::dde::LinearLoop;
use crate::dde::control_loop::sampled;
use crate::elementary::angle;
use crate::quasipoly::modulus;
use crate::roots::{self, Edge, Region, RootSet};

/// Corrections of the approximations: more come closer to multiple poles and take longer.
const CORRECTIONS: u32 = 3;

/// Share of the distance to the next approximation that a correction may be.
const NEAR: f64 = 0.25;

/// Relative distance by which equal approximations are set apart, about the root of the rounding.
const APART: f64 = 1e-8;

/// Covers the rounding of radii and of products of up to 2000 factors.
const ROOM: f64 = 1.0 + 1e-9;

/// Roundings of an elementary function or a few operations.
const FEW: f64 = 8.0 * f64::EPSILON;

/// |z| up to which a pole counts as z = 0 where its disc holds that: what it moves decays to this
/// within a sample.
const GONE: f64 = 1e-4;

/// Sizes between which a product needs no other exponent.
const USABLE: std::ops::Range<f64> = 1e-60..1e60;

/// The number of poles in a disc in σ of the closed upper half plane. Those about a real centre are
/// all that it holds; the others have mirror images.
#[derive(Debug, Clone, Copy)]
struct Disc {
    center: Complex64,
    radius: f64,
    poles: u32,
}

/// The zeros of q.
pub(super) struct Poles {
    sample_time: f64,
    discs: Vec<Disc>,
}

impl Poles {
    /// Of a loop with a hold.
    ///
    /// # Errors
    /// [`Error::Argument`] where the polynomials are not known, [`Error::TooMuch`] for too many
    /// samples of delay, [`Error::Convergence`] where the eigenvalues are not found.
    pub(super) fn of(plant: &LinearLoop, sample_time: f64) -> Result<Self, Error> {
        let model = LoopPolynomials::of_loop(plant, plant.delay(), sample_time)?;
        let equations = plant.equations();
        let b = model.feedback(&equations.k, equations.l);
        let (found, _) = sampled::multipliers(plant)?;
        let mut equation = Equation::new(&model.a, &b, model.delay, sample_time);
        equation.start(found);
        for _ in 0..CORRECTIONS {
            equation.correct();
        }
        Ok(Self {
            sample_time,
            discs: equation.discs(),
        })
    }

    /// Are all inside the unit circle? `None` where a disc meets it.
    pub(super) fn are_inside(&self) -> Option<bool> {
        let ts = self.sample_time;
        let mut all = Some(true);
        for disc in &self.discs {
            // |z|² − 1, and what the disc and rounding change in it.
            let Complex64 { re, im } = disc.center * ts;
            let (linear, square) = (2.0 * re, re * re + im * im);
            let reach = disc.radius * ts;
            let change = reach * (2.0 * (linear + square + 1.0).max(0.0).sqrt() + reach) * ROOM
                + FEW * (linear.abs() + square);
            let excess = linear + square;
            if excess > change || (excess == 0.0 && change == 0.0) {
                return Some(false);
            }
            if excess >= -change || (excess + change).is_nan() {
                all = None;
            }
        }
        all
    }

    /// The poles s in a region.
    ///
    /// # Errors
    /// [`Error::OnEdge`] where a disc meets the edge.
    pub(super) fn within(&self, region: &Region) -> Result<RootSet, Error> {
        let (left, ts) = (region.re.0, self.sample_time);
        // A disc about z = 0 has no finite one in s.
        let reaches = |disc: &Disc| {
            let size = modulus(Complex64::ONE + disc.center * ts) + disc.radius * ts;
            size * ROOM >= (left * ts).exp() || size.is_nan()
        };
        let discs = self.discs.iter().filter(|disc| reaches(disc));
        roots::within(&self.listed(discs, region), region, Edge::Refused)
    }

    /// The `n` rightmost discs in the upper half plane, and their mirror images.
    pub(super) fn rightmost(&self, n: usize) -> RootSet {
        let top = std::f64::consts::PI / self.sample_time;
        let every = Region {
            re: (f64::NEG_INFINITY, f64::INFINITY),
            im: (-top, top),
        };
        let all = self.listed(self.discs.iter(), &every);
        let mut upper = 0;
        let kept: Vec<bool> = all
            .roots
            .iter()
            .map(|root| {
                upper += usize::from(root.im >= 0.0);
                upper <= n
            })
            .collect();
        let listed = all.roots.iter().zip(&kept).filter(|(_, kept)| **kept);
        let furthest = listed.fold(f64::INFINITY, |least, (root, _)| least.min(root.re));
        let re = if furthest == f64::INFINITY {
            every.re
        } else {
            (furthest, f64::INFINITY)
        };
        all.part(Region { re, ..every }, |i| kept.get(i) == Some(&true))
    }

    /// Discs in s; those about z = 0 are left out.
    fn listed<'a>(&self, discs: impl Iterator<Item = &'a Disc>, region: &Region) -> RootSet {
        let mut found = Vec::new();
        for disc in discs {
            let Some((center, radius)) = self.logarithm(disc) else {
                continue;
            };
            let one = roots::Disc {
                center,
                radius,
                isolation: radius,
                multiplicity: disc.poles,
            };
            found.push(one);
            if disc.center.im > 0.0 {
                found.push(roots::Disc {
                    center: center.conj(),
                    ..one
                });
            }
        }
        RootSet::new(found, *region)
    }

    /// Centre and radius of a disc in s = ln(z)/Ts that holds the logarithms of this one.
    fn logarithm(&self, disc: &Disc) -> Option<(Complex64, f64)> {
        let ts = self.sample_time;
        let step = disc.center * ts;
        let z = Complex64::ONE + step;
        let (size, reach) = (modulus(z), disc.radius * ts);
        if size == 0.0 || (reach >= size && size + reach <= GONE) {
            return None;
        }
        let excess = 2.0 * step.re + step.norm_sqr();
        let growth = if excess.abs() < 0.5 {
            0.5 * libm::log1p(excess)
        } else {
            libm::log(size)
        };
        // Negative z are at π/Ts.
        let turn = angle(z.im, z.re);
        // |ln(1 + w)| ≤ −ln(1 − |w|).
        let spread = if reach < size {
            -libm::log1p(-reach / size)
        } else {
            f64::INFINITY
        };
        let errors = modulus(step) * (1.0 + modulus(step)) / (size * size);
        let rounding = FEW * (growth.abs() + turn.abs() + errors);
        Some((
            Complex64::new(growth / ts, turn / ts),
            (spread * ROOM + rounding) / ts,
        ))
    }
}

impl Disc {
    /// A disc on the real axis holds the mirror images of its poles.
    fn settled(self) -> Self {
        if self.center.im == 0.0 || self.center.im > self.radius * ROOM {
            return self;
        }
        Self {
            center: Complex64::from(self.center.re),
            radius: (self.radius + self.center.im) * ROOM,
            poles: 2 * self.poles,
        }
    }

    fn meets(&self, other: &Self) -> bool {
        let (distance, reach) = (
            modulus(self.center - other.center),
            self.radius + other.radius,
        );
        distance <= reach * ROOM || (distance + reach).is_nan()
    }

    /// A disc around both.
    fn joined(self, other: Self) -> Self {
        let is_real = self.center.im == 0.0 || other.center.im == 0.0;
        let weight = |disc: &Self| {
            let pairs = if is_real && disc.center.im > 0.0 {
                2
            } else {
                1
            };
            pairs * disc.poles
        };
        let (own, its) = (weight(&self), weight(&other));
        let share = f64::from(its) / f64::from(own + its);
        let mut center = self.center + (other.center - self.center) * share;
        if is_real {
            center.im = 0.0;
        }
        let reach = |disc: &Self| modulus(disc.center - center) + disc.radius;
        Self {
            center,
            radius: reach(&self).max(reach(&other)) * ROOM,
            poles: own + its,
        }
        .settled()
    }
}

/// q, and approximations of its zeros.
struct Equation<'a> {
    a: &'a Polynomial,
    b: &'a Polynomial,
    /// m + 1.
    samples: i32,
    sample_time: f64,
    /// Of the upper half plane.
    places: Vec<Complex64>,
    /// Poles that are exactly at z = 1 and z = 0.
    ones: u32,
    gone: u32,
}

impl<'a> Equation<'a> {
    fn new(a: &'a Polynomial, b: &'a Polynomial, delay: f64, sample_time: f64) -> Self {
        let powers = |p: &Polynomial| p.coefficients.iter().take_while(|c| **c == 0.0).count();
        Self {
            a,
            b,
            samples: (delay / sample_time).round() as i32,
            sample_time,
            places: Vec::new(),
            ones: powers(a).min(powers(b)) as u32,
            gone: 0,
        }
    }

    /// Take eigenvalues z for approximations: those nearest to one for the exact ones.
    fn start(&mut self, mut found: Vec<Complex64>) {
        let all = found.len();
        found.retain(|z| *z != Complex64::ZERO);
        self.gone = (all - found.len()) as u32;
        found.sort_by(|p, q| modulus(p - 1.0).total_cmp(&modulus(q - 1.0)));
        let ones = self.ones as usize;
        for z in found.into_iter().skip(ones).filter(|z| z.im >= 0.0) {
            let mut sigma = (z - 1.0) / self.sample_time;
            while self.places.contains(&sigma) {
                let size = modulus(sigma);
                sigma.re += APART
                    * if size > 0.0 {
                        size
                    } else {
                        1.0 / self.sample_time
                    };
            }
            self.places.push(sigma);
        }
    }

    /// Move every approximation by its W, where that is short.
    fn correct(&mut self) {
        let moved = self.places.iter().enumerate().map(|(i, sigma)| {
            let (change, _) = self.correction(i);
            let others = self.places.iter().enumerate().filter(|(j, _)| *j != i);
            let near = others.fold(2.0 * sigma.im, |least, (_, other)| {
                let distance = modulus(sigma - other);
                if least == 0.0 {
                    distance
                } else {
                    least.min(distance)
                }
            });
            let is_short = modulus(change) <= NEAR * near || near == 0.0;
            if is_short && change.is_finite() {
                sigma - change
            } else {
                *sigma
            }
        });
        let moved: Vec<Complex64> = moved.collect();
        let stays = |sigma: &Complex64| moved.iter().filter(|other| *other == sigma).count() == 1;
        if moved.iter().all(|sigma| sigma.im >= 0.0 && stays(sigma)) {
            self.places = moved;
        }
    }

    /// Smith's discs, none of which meet.
    fn discs(&self) -> Vec<Disc> {
        let pairs = self.places.iter().filter(|sigma| sigma.im > 0.0).count();
        let degree = (self.places.len() + pairs) as f64;
        let mut kept: Vec<Disc> = Vec::with_capacity(self.places.len() + 1);
        if self.ones > 0 {
            kept.push(Disc {
                center: Complex64::ZERO,
                radius: 0.0,
                poles: self.ones,
            });
        }
        for (i, center) in self.places.iter().enumerate() {
            let (_, size) = self.correction(i);
            let radius = degree * size * ROOM;
            let mut disc = Disc {
                center: *center,
                radius: if radius.is_nan() {
                    f64::INFINITY
                } else {
                    radius
                },
                poles: 1,
            }
            .settled();
            while let Some(place) = kept.iter().position(|other| disc.meets(other)) {
                disc = disc.joined(kept.swap_remove(place));
            }
            kept.push(disc);
        }
        kept
    }

    /// W of an approximation, and a bound on its modulus.
    fn correction(&self, i: usize) -> (Complex64, f64) {
        let Some(sigma) = self.places.get(i).copied() else {
            return (Complex64::ZERO, 0.0);
        };
        let step = sigma * self.sample_time;
        let z = Complex64::ONE + step;
        let size = modulus(z);
        // Above one both sides are divided by z^(m+1).
        let is_large = size >= 1.0;
        let turn = z.powi(if is_large {
            -self.samples
        } else {
            self.samples
        });
        let late = FEW * f64::from(self.samples + 1) * (1.0 + modulus(step)) / size;
        let ((of_a, error_a), (of_b, error_b)) = (value(self.a, sigma), value(self.b, sigma));
        let (first, second) = if is_large {
            ((of_a, error_a), (of_b * turn, error_b * modulus(turn)))
        } else {
            ((of_a * turn, error_a * modulus(turn)), (of_b, error_b))
        };
        let turned = if is_large { second.0 } else { first.0 };
        let error = first.1 + second.1 + late * modulus(turned);
        let mut product = Product::default();
        let mut left = self.samples;
        let mut factors = |factor: Complex64| {
            let scaled = if left > 0 {
                let unit = factor * self.sample_time;
                if is_large { unit / z } else { unit }
            } else {
                factor
            };
            left -= 1;
            product.take(scaled);
        };
        for (j, other) in self.places.iter().enumerate() {
            if j != i {
                factors(sigma - other);
            }
            if other.im > 0.0 {
                factors(sigma - other.conj());
            }
        }
        for _ in 0..self.gone {
            factors(z / self.sample_time);
        }
        for _ in 0..self.ones {
            factors(sigma);
        }
        let mut change = product.under(first.0 - second.0);
        if sigma.im == 0.0 {
            change.im = 0.0;
        }
        let whole = modulus(first.0 - second.0) + error;
        (change, modulus(product.under(Complex64::from(whole))))
    }
}

/// A polynomial, and what its coefficients and rounding may change in it.
fn value(p: &Polynomial, sigma: Complex64) -> (Complex64, f64) {
    let size = modulus(sigma);
    let unit = FEW * (p.coefficients.len() + 1) as f64;
    let terms = p.coefficients.iter().zip(&p.errors).rev();
    terms.fold((Complex64::ZERO, 0.0), |(sum, error), (c, own)| {
        (sum * sigma + c, error * size + own + unit * c.abs())
    })
}

/// A product beyond the range of numbers: `value` times 2^`exponent`.
struct Product {
    value: Complex64,
    exponent: i32,
}

impl Default for Product {
    fn default() -> Self {
        Self {
            value: Complex64::ONE,
            exponent: 0,
        }
    }
}

impl Product {
    fn take(&mut self, factor: Complex64) {
        self.value *= factor;
        let size = modulus(self.value);
        if size > 0.0 && size.is_finite() && !USABLE.contains(&size) {
            let exponent = libm::ilogb(size);
            self.value = scaled(self.value, -exponent);
            self.exponent += exponent;
        }
    }

    /// A number over the product.
    fn under(&self, number: Complex64) -> Complex64 {
        scaled(number / self.value, -self.exponent)
    }
}

fn scaled(z: Complex64, exponent: i32) -> Complex64 {
    Complex64::new(libm::ldexp(z.re, exponent), libm::ldexp(z.im, exponent))
}
