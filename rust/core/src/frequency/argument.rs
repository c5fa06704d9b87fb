//! The argument of a quasi-polynomial along the imaginary axis, continuous from zero on.
//!
//! An interval is divided until no turn can go unseen in it. With g = h e^(sτ_c), Taylor's formula
//! keeps g in a half plane where |g(m)| > |g′(m)| r + B r²/2, errors and bounds being those of
//! `Probe`. Where one row p_c outweighs all others together, g = p_c e^(−jωd) (1 + ζ) with |ζ| < 1:
//! only polynomials have to keep a half plane there, so that intervals grow with the frequency and not
//! with the turns of the delays. Beyond a frequency where lower powers are lost to rounding, the
//! leading coefficients alone are left. Where rounding hides g, a zero on the axis is passed: the
//! argument grows by half a turn for each multiplicity, as if it lay just left of the axis.

use std::f64::consts::{FRAC_PI_2, TAU};

use num_complex::Complex64;

use super::bounds::{fujiwara, leading, moduli};
use crate::elementary::{angle, sin_cos};
use crate::order::sort_up;
use crate::quasipoly::{Probe, QuasiPolynomial, modulus};
use crate::{Error, Task};

/// Intervals before the phase is given up.
const MOST: u32 = 2_000_000;

/// Lower powers than this part of the leading one are lost to rounding.
const LOST: f64 = 1e-17;

/// Share of an inequality that is left for its rounding, many times what it can be.
const ROOM: f64 = 1e-9;

/// Of its sum of moduli, what a polynomial is wrong by at most.
const ERROR: f64 = 1e-12;

/// Argument of h(jω) in rad at each of `omega` > 0, continuous from ω = 0+ on.
///
/// It starts from k quarter turns for a factor sᵏ, and half a turn more where the rest is negative.
///
/// # Errors
/// [`Error::Argument`] where turns cannot be followed that far; [`Error::Interrupted`].
pub fn argument(h: &QuasiPolynomial, omega: &[f64], task: &Task) -> Result<Vec<f64>, Error> {
    let k = h.powers_of_s();
    let h = h.without_powers(k);
    let degree = h.degree();
    let lead = |row: &Vec<f64>| row.get(degree).copied().unwrap_or(0.0);
    let leader = h.coefficients().iter().position(|row| lead(row) != 0.0);
    let centre = leader
        .and_then(|c| h.delays().get(c))
        .copied()
        .unwrap_or(0.0);
    let mut order: Vec<usize> = (0..omega.len()).collect();
    sort_up(&mut order, |place| omega[*place]);
    let Some(highest) = order.last().map(|last| omega[*last]) else {
        return Ok(Vec::new());
    };
    refuse_if!(
        !(highest * centre).is_finite(),
        "omega={highest:e}: the phase, {centre} s times omega, is beyond 1e308"
    );
    let (far, c) = beyond_lower_powers(&h);
    let only_leading = QuasiPolynomial::new(
        h.coefficients().iter().map(|row| vec![lead(row)]).collect(),
        h.delays().to_vec(),
    )?;
    // The same row, rows without a leading coefficient being gone.
    let own = h.delays().get(c).copied().unwrap_or(0.0);
    let c = only_leading.delays().iter().position(|delay| *delay == own);
    let mut way = Way::new(
        &h,
        leader.unwrap_or(0),
        order.first().map_or(0.0, |i| omega[*i]),
        far,
    )?;
    let mut found = vec![0.0; omega.len()];
    for index in order {
        let end = omega[index];
        let mut turned = way.follow(end.min(far), task)?;
        if end > far {
            let rest = Rows { h: &only_leading };
            turned += rest.turned(c.unwrap_or(0), far, end, centre);
        }
        found[index] = turned - end * centre + FRAC_PI_2 * k as f64;
    }
    Ok(found)
}

/// From where on the leading coefficient of one row outweighs all others, and that row; infinite if
/// none does.
fn beyond_lower_powers(h: &QuasiPolynomial) -> (f64, usize) {
    let degree = h.degree();
    let lead = |row: &Vec<f64>| row.get(degree).map_or(0.0, |c| c.abs());
    let largest = leading(h);
    let c = h.coefficients().iter().position(|row| lead(row) == largest);
    let mut lower = moduli(h);
    let all = lower.pop().unwrap_or(0.0);
    let margin = 2.0 * largest - all;
    let radius = if margin <= ROOM * largest {
        f64::INFINITY
    } else {
        0.5 * fujiwara(&lower, margin * LOST)
    };
    (radius, c.unwrap_or(0))
}

/// The argument of g as far as it is known.
struct Way<'a> {
    probe: Probe<'a>,
    rows: Rows<'a>,
    at: f64,
    argument: f64,
    intervals: u32,
}

impl<'a> Way<'a> {
    /// From ω = 0, or a thousandth of the first frequency where g(0) is hidden by rounding.
    fn new(h: &'a QuasiPolynomial, reference: usize, first: f64, far: f64) -> Result<Self, Error> {
        let mut probe = Probe::new(h);
        probe.refer_to(reference);
        let mut at = 0.0;
        let mut start = probe.jet(Complex64::ZERO);
        if modulus(start.value) <= start.value_error {
            at = 1e-3 * first.min(far);
            start = probe.jet(Complex64::new(0.0, at));
        }
        Ok(Self {
            probe,
            rows: Rows { h },
            at,
            argument: of(start.value),
            intervals: 0,
        })
    }

    /// Go on to `end`.
    fn follow(&mut self, end: f64, task: &Task) -> Result<f64, Error> {
        refuse_if!(
            !(moduli(self.rows.h)
                .iter()
                .rev()
                .fold(0.0, |sum, c| sum * end + c))
            .is_finite(),
            "omega={end:e}: powers of this frequency exceed double precision before one term \
             dominates the others. Give lower frequencies, or choose another unit of time"
        );
        let mut open = vec![(self.at, end)];
        while let Some((a, b)) = open.pop() {
            if b <= a {
                continue;
            }
            self.intervals += 1;
            if self.intervals.is_multiple_of(256) {
                task.check()?;
            }
            refuse_if!(
                self.intervals > MOST,
                "the phase up to {end:e} rad/s would need more than {MOST} intervals, because near \
                 {a:e} rad/s no term dominates: give lower frequencies"
            );
            match self.turned(a, b) {
                Some(turned) => self.argument += turned,
                None => {
                    let m = 0.5 * (a + b);
                    open.push((m, b));
                    open.push((a, m));
                }
            }
        }
        self.at = end;
        Ok(self.argument)
    }

    /// How far the argument turns from a to b; `None` where that is not sure.
    fn turned(&mut self, a: f64, b: f64) -> Option<f64> {
        if let Some(c) = self.rows.leader(a, b) {
            return Some(self.rows.turned(c, a, b, self.probe.delay()));
        }
        let (m, r) = (0.5 * (a + b), 0.5 * (b - a));
        let mut at = |omega| self.probe.jet(Complex64::new(0.0, omega));
        let (first, last, middle) = (at(a), at(b), at(m));
        let slope = modulus(middle.slope) + middle.slope_error;
        let change = (slope * r + 0.5 * self.probe.curvature(b, 0.0) * r * r) * (1.0 + ROOM);
        if modulus(middle.value) > change + middle.value_error {
            return Some(between(first.value, middle.value) + between(middle.value, last.value));
        }
        let is_hidden = change <= middle.value_error || r <= 2.0 * f64::EPSILON * m || m <= a;
        is_hidden.then(|| {
            let turned = of(last.value) - of(first.value);
            (turned + FRAC_PI_2).rem_euclid(TAU) - FRAC_PI_2
        })
    }
}

/// The rows of h on the axis, each a polynomial in ω.
struct Rows<'a> {
    h: &'a QuasiPolynomial,
}

impl Rows<'_> {
    /// The row that outweighs all others from a to b.
    fn leader(&self, a: f64, b: f64) -> Option<usize> {
        let (m, r) = (0.5 * (a + b), 0.5 * (b - a));
        let (mut all, mut best) = (0.0, (0, 0.0, 0.0, 0.0));
        for (index, row) in self.h.coefficients().iter().enumerate() {
            let (value, slope) = on_axis(row, m);
            let (mut p, mut dp, mut ddp) = (0.0, 0.0, 0.0);
            for c in row.iter().rev() {
                ddp = ddp * b + dp;
                dp = dp * b + p;
                p = p * b + c.abs();
            }
            all += p;
            let size = modulus(value);
            if size > best.1 {
                // ddp is half of the second derivative.
                best = (
                    index,
                    size,
                    size - modulus(slope) * r - ddp * r * r - ERROR * p,
                    p,
                );
            }
        }
        let (index, _, least, own) = best;
        (least > (all - own + ERROR * all) * (1.0 + ROOM)).then_some(index)
    }

    /// How far the argument of g turns from a to b, where row c outweighs the others.
    fn turned(&self, c: usize, a: f64, b: f64, centre: f64) -> f64 {
        let Some((row, delay)) = self.h.coefficients().get(c).zip(self.h.delays().get(c)) else {
            return 0.0;
        };
        let at = |omega| on_axis(row, omega).0;
        let (first, middle, last) = (at(a), at(0.5 * (a + b)), at(b));
        between(first, middle) + between(middle, last) - (delay - centre) * (b - a)
            + self.excess(c, b)
            - self.excess(c, a)
    }

    /// The argument of 1 + ζ.
    fn excess(&self, c: usize, omega: f64) -> f64 {
        let rows = self.h.coefficients().iter().zip(self.h.delays());
        let own = rows.clone().nth(c);
        let Some((own, own_delay)) = own.map(|(row, delay)| (on_axis(row, omega).0, *delay)) else {
            return 0.0;
        };
        let others = rows.enumerate().filter(|(index, _)| *index != c);
        of(others.fold(Complex64::ONE, |total, (_, (row, delay))| {
            let (sine, cosine) = sin_cos(omega * (delay - own_delay));
            total + on_axis(row, omega).0 / own * Complex64::new(cosine, -sine)
        }))
    }
}

/// p(jω) and its derivative by s.
fn on_axis(row: &[f64], omega: f64) -> (Complex64, Complex64) {
    let s = Complex64::new(0.0, omega);
    let zero = (Complex64::ZERO, Complex64::ZERO);
    row.iter()
        .rev()
        .fold(zero, |(p, dp), c| (p * s + c, dp * s + p))
}

fn of(value: Complex64) -> f64 {
    angle(value.im, value.re)
}

/// The turn from one value to another, less than half a turn either way.
fn between(from: Complex64, to: Complex64) -> f64 {
    of((to / modulus(to)) * (from / modulus(from)).conj())
}
