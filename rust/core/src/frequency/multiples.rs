//! Crossings of a delay that enters as several multiples of one.
//!
//! h(s) = Σ_{k≤N} P_k(s) zᵏ, z = e^(−s u T), has a root jω for some T only where the polynomial in z
//! has a root on the unit circle, and then it shares that root with its reciprocal Σ conj(P_k) z^(N−k):
//! their resultant vanishes, the determinant of the Schur–Cohn matrix (Schur 1917, Cohn 1922)
//!     C_ij = Σ_{m≤min(i,j)} (conj(P_{i−m}) P_{j−m} − P_{N−i+m} conj(P_{N−j+m})),  0 ≤ i, j < N.
//! It is Hermitian, so that the determinant is a real function of ω, of which `zeros` misses no zero
//! up to a frequency that no unstable root exceeds. Zeros that belong to a pair of roots z, 1/conj(z)
//! off the circle are sorted out, the others refined with T by Newton's iteration for h: that is
//! not proved. As T grows the pair at jω goes to the right where Re(P′/(s S)) > 0, with P′ = Σ P_k′ zᵏ
//! and S = Σ k P_k zᵏ, whatever of its delays T is (Olgac and Sipahi 2002).

use num_complex::Complex64;

use super::bounds::{fujiwara, moduli};
use super::passage::Passage;
use super::polynomial::roots;
use super::two_sided::TwoSided;
use super::waves::{Waves, polynomial};
use super::zeros::zeros_between;
use crate::elementary::{angle, sin_cos};
use crate::quasipoly::QuasiPolynomial;
use crate::{Error, Task};

/// Largest multiple: the determinant has the order of it.
const MOST: usize = 5;

/// Relative difference of frequencies, and difference of angles in rad, below which two crossings
/// are one: larger ones merge neighbours, smaller ones list a crossing twice.
const SAME_OMEGA: f64 = 1e-9;
const SAME_TURN: f64 = 1e-7;

/// Sine of the angle between the derivatives by frequency and by angle below which they are taken
/// for parallel: larger values give up Newton's iteration where it would still converge.
const PARALLEL: f64 = 1e-14;

/// Relative length of the last step of Newton's iteration; below it steps are rounding errors.
const SETTLED: f64 = 1e-15;

/// Share of the sum of the moduli below which a value is a rounding error: larger values accept
/// what is no root.
const ROUNDING: f64 = 1e-12;

/// Sine of the angle at which a root crosses below which it counts as touching the axis.
const TANGENT: f64 = 1e-8;

/// How exactly the multiples are whole ones of one.
const WHOLE: f64 = 1e-9;

/// Modulus of a root, less one, up to which it may lie on the circle, and steps that put it there.
const ON_CIRCLE: f64 = 1e-2;
const STEPS: u32 = 30;

/// How far Newton's iteration may move a frequency that is known, as a part of it.
const MOVE: f64 = 1e-3;

/// Where h touches the axis, the modulus of z less one that double precision leaves.
const TOUCHING: f64 = 1e-6;

/// One term P_k zᵏ.
struct Part {
    multiple: usize,
    function: QuasiPolynomial,
    slope: QuasiPolynomial,
    sizes: Vec<f64>,
}

/// Frequencies at which roots cross, from the terms that go with each multiple of the delay
/// `name`; `slopes` are the multiples, increasing from zero.
///
/// # Errors
/// [`Error::Argument`] where the multiples are no whole multiples of one number, or of too many, or
/// there is no end to the frequencies; [`Error::Interrupted`].
pub(super) fn crossings_of_multiples(
    parts: &[QuasiPolynomial],
    slopes: &[f64],
    name: &str,
    task: &Task,
) -> Result<Vec<Passage>, Error> {
    let (unit, multiples) = common(slopes, name)?;
    let order = multiples.last().copied().unwrap_or(0);
    let mut on_axis = vec![TwoSided::default(); order + 1];
    let mut terms = Vec::with_capacity(parts.len());
    for (function, multiple) in parts.iter().zip(multiples) {
        on_axis[multiple] = TwoSided::of(function);
        terms.push(Part {
            multiple,
            function: function.clone(),
            slope: function.derivative(1)?,
            sizes: moduli(function),
        });
    }
    let resultant = determinant(&schur_cohn(&on_axis));
    let mut function = Waves::cleaned(&resultant, 1);
    let highest = highest(parts, name)?;
    let mut found: Vec<(f64, f64)> = Vec::new();
    for omega in zeros_between(&mut function, 0.0, highest, task)? {
        for z in roots_near_circle(&terms, omega, order) {
            let Some(place) = refined(&terms, omega, z) else {
                continue;
            };
            let same = |known: &(f64, f64)| {
                let apart = (known.1 - place.1).rem_euclid(std::f64::consts::TAU);
                (known.0 - place.0).abs() <= SAME_OMEGA * known.0
                    && apart.min(std::f64::consts::TAU - apart) <= SAME_TURN
            };
            if !found.iter().any(same) {
                found.push(place);
            }
        }
    }
    let passage = |(omega, turn): (f64, f64)| {
        Passage::new(
            omega,
            -turn,
            unit,
            direction(&at(&terms, omega, turn), omega),
        )
    };
    Ok(found.into_iter().map(passage).collect())
}

/// The largest number of which all slopes are whole multiples, and the multiples.
fn common(slopes: &[f64], name: &str) -> Result<(f64, Vec<usize>), Error> {
    let first = slopes.get(1).copied().unwrap_or(1.0);
    for parts in 1..=MOST {
        let exact = slopes.iter().map(|slope| slope / first * parts as f64);
        let is_whole = |m: f64| (m - m.round()).abs() <= WHOLE * m;
        if exact
            .clone()
            .all(|m| is_whole(m) && m.round() <= MOST as f64)
        {
            let multiples = exact.map(|m| m.round() as usize).collect();
            return Ok((first / parts as f64, multiples));
        }
    }
    let shown: Vec<String> = slopes
        .iter()
        .skip(1)
        .map(|slope| format!("{slope} {name}"))
        .collect();
    refuse!(
        "{name} appears in several delays ({}). Crossings can be found only if these are whole \
         multiples of one delay, at most {MOST} times as long. A map over {name} and a second \
         parameter also works",
        shown.join(", ")
    )
}

fn schur_cohn(p: &[TwoSided]) -> Vec<Vec<TwoSided>> {
    let order = p.len() - 1;
    let bar: Vec<TwoSided> = p.iter().map(TwoSided::mirrored).collect();
    let entry = |i: usize, j: usize| {
        (0..=i.min(j)).fold(TwoSided::default(), |sum, m| {
            let forth = bar[i - m].times(&p[j - m]);
            let back = p[order - i + m].times(&bar[order - j + m]);
            sum.plus(1.0, &forth).plus(-1.0, &back)
        })
    };
    (0..order)
        .map(|i| (0..order).map(|j| entry(i, j)).collect())
        .collect()
}

/// By the first row; the orders are small.
fn determinant(matrix: &[Vec<TwoSided>]) -> TwoSided {
    let Some((first, rest)) = matrix.split_first() else {
        return TwoSided::default();
    };
    if rest.is_empty() {
        return first.first().cloned().unwrap_or_default();
    }
    let mut total = TwoSided::default();
    for (j, entry) in first.iter().enumerate() {
        let minor: Vec<Vec<TwoSided>> = rest
            .iter()
            .map(|row| {
                let mut row = row.clone();
                row.remove(j);
                row
            })
            .collect();
        let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
        total = total.plus(sign, &entry.times(&determinant(&minor)));
    }
    total
}

/// A radius that no root with Re s ≥ 0 exceeds.
fn highest(parts: &[QuasiPolynomial], name: &str) -> Result<f64, Error> {
    let degree = parts.iter().map(QuasiPolynomial::degree).max().unwrap_or(0);
    let mut sizes = vec![0.0; degree + 1];
    for part in parts {
        for (total, size) in sizes.iter_mut().zip(moduli(part)) {
            *total += size;
        }
    }
    let first = parts.first().and_then(|part| part.coefficients().first());
    let lead = first
        .and_then(|row| row.get(degree))
        .map_or(0.0, |c| c.abs());
    let all = sizes.pop().unwrap_or(0.0);
    let radius = fujiwara(&sizes, 2.0 * lead - all);
    if radius.is_finite() {
        return Ok(radius);
    }
    refuse!(
        "at high frequencies, the terms with {name} dominate the leading term, so roots may cross \
         at infinitely many frequencies"
    )
}

fn roots_near_circle(parts: &[Part], omega: f64, order: usize) -> Vec<Complex64> {
    let mut values = vec![Complex64::ZERO; order + 1];
    for part in parts {
        values[part.multiple] = part.function.value(Complex64::new(0.0, omega));
    }
    let mut near = roots(&values);
    near.retain(|z| (z.norm() - 1.0).abs() < ON_CIRCLE);
    near
}

/// h, P′, S and the sum of moduli in h, at s = jω and z = e^(j `turn`).
struct At {
    value: Complex64,
    slope: Complex64,
    by_turn: Complex64,
    size: f64,
}

fn at(parts: &[Part], omega: f64, turn: f64) -> At {
    let s = Complex64::new(0.0, omega);
    let mut found = At {
        value: Complex64::ZERO,
        slope: Complex64::ZERO,
        by_turn: Complex64::ZERO,
        size: 0.0,
    };
    for part in parts {
        let k = part.multiple as f64;
        let (sine, cosine) = sin_cos(k * turn);
        let power = Complex64::new(cosine, sine);
        let term = part.function.value(s) * power;
        found.value += term;
        found.slope += part.slope.value(s) * power;
        found.by_turn += term * k;
        found.size += polynomial(&part.sizes, omega);
    }
    found
}

/// The frequency and the angle on the circle next to these at which h vanishes.
fn refined(parts: &[Part], omega: f64, z: Complex64) -> Option<(f64, f64)> {
    let (mut place, mut turn) = (omega, angle(z.im, z.re));
    for _ in 0..STEPS {
        let here = at(parts, place, turn);
        let (a, b) = (Complex64::I * here.slope, Complex64::I * here.by_turn);
        let area = a.re * b.im - a.im * b.re;
        if area.abs() <= PARALLEL * a.norm() * b.norm() {
            // Roots only touch the axis here: the two numbers are known to what that leaves.
            return ((z.norm() - 1.0).abs() <= TOUCHING).then_some((place, turn));
        }
        let by_omega = -(here.value.re * b.im - here.value.im * b.re) / area;
        let by_angle = -(a.re * here.value.im - a.im * here.value.re) / area;
        place += by_omega;
        turn += by_angle;
        if (place - omega).abs() > MOVE * omega {
            return None;
        }
        if by_omega.abs() <= SETTLED * place && by_angle.abs() <= SETTLED {
            break;
        }
    }
    let here = at(parts, place, turn);
    (here.value.norm() <= ROUNDING * here.size).then_some((place, turn))
}

fn direction(here: &At, omega: f64) -> i32 {
    let below = Complex64::new(0.0, omega) * here.by_turn;
    let across = (here.slope * below.conj()).re;
    if across.abs() <= TANGENT * here.slope.norm() * below.norm() {
        0
    } else if across > 0.0 {
        2
    } else {
        -2
    }
}
