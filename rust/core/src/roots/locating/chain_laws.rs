//! The laws that roots of large modulus follow, as far as they are periodic.
//!
//! Where e^(−Re s) = |s|^μ, the row with delay τ and degree n is of the size |s|^(n + μτ). Two rows
//! or more can only cancel where they are largest together: on an edge of the upper convex hull of
//! the points (τ, n), with μ minus its slope (Bellman and Cooke 1963, chapter 12). With b_j the
//! leading coefficients there and d_j the delays less the first of the edge, s + μ log s tends to a
//! root v of Σ b_j e^(−v d_j). If the d_j are whole multiples of a base, this is a polynomial in
//! z = e^(−v base), and each of its roots makes one chain in the upper half plane, v = (2πik − log
//! z)/base. Nothing is proved here: the laws give starting values.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::starts::tropical_roots;
use crate::elementary::{angle, log};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::chains::base_delay;

/// Distance from an edge, in degrees of a polynomial, below which a point counts as on it.
const ON_EDGE: f64 = 1e-9;

/// Largest degree of the polynomial in z whose roots are computed, one for each chain.
const MAX_DEGREE: usize = 32;

/// Upper limit on the steps of their iteration.
const MAX_STEPS: usize = 100;

/// Relative step below which a root has settled.
const SETTLED: f64 = 1e-14;

/// Relative distance from the others from which on a root is a simple one.
const APART: f64 = 1e-5;

/// Relative imaginary part of a real start.
const ON_AXIS: f64 = 1e-9;

/// A tenth of a radian, by which starts are turned.
const TURN: Complex64 = Complex64::new(0.995_004_165_278_025_8, 0.099_833_416_646_828_15);

/// Chain of simple roots of large modulus: s + μ log s ≈ c + i (φ + spacing k).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Law {
    /// A row whose delay and degree lie on the edge.
    pub(crate) row: usize,
    /// μ in 1/s.
    pub(crate) bend: f64,
    /// c in 1/s.
    pub(crate) offset: f64,
    /// φ in rad/s.
    pub(crate) phase: f64,
    /// Distance of neighbours, in rad/s.
    pub(crate) spacing: f64,
}

/// A row as a point: its index, delay and degree, and its leading coefficient.
type Point = (usize, f64, usize, f64);

/// All laws of chains whose roots are simple and periodic.
pub(crate) fn laws(h: &QuasiPolynomial) -> Vec<Law> {
    let rows = h.terms().enumerate();
    let points: Vec<Point> = rows
        .filter_map(|(index, (row, delay))| {
            let top = row.last().copied().filter(|top| *top != 0.0)?;
            Some((index, delay, row.len() - 1, top))
        })
        .collect();
    let mut laws = Vec::new();
    let mut first = 0;
    while let Some(&from) = points.get(first) {
        let slope = |to: &Point| (to.2 as f64 - from.2 as f64) / (to.1 - from.1);
        let later = points.iter().enumerate().skip(first + 1);
        let steepest = later
            .clone()
            .fold(f64::NEG_INFINITY, |most, (_, to)| most.max(slope(to)));
        let on: Vec<(usize, Point)> = later
            .filter(|(_, to)| (steepest - slope(to)) * (to.1 - from.1) <= ON_EDGE)
            .map(|(index, to)| (index, *to))
            .collect();
        let Some(&(last, _)) = on.last() else { break };
        let edge: Vec<Point> = std::iter::once(from)
            .chain(on.into_iter().map(|(_, to)| to))
            .collect();
        laws.extend(of_edge(&edge).unwrap_or_default());
        first = last;
    }
    laws
}

/// The laws of one edge; none where its delays have no common base.
fn of_edge(edge: &[Point]) -> Option<Vec<Law>> {
    let (&(row, tau, degree, _), &(_, last, other, _)) = (edge.first()?, edge.last()?);
    let bend = (degree as f64 - other as f64) / (last - tau);
    let rows = edge.iter().map(|point| vec![point.3]).collect();
    let gaps = edge.iter().map(|point| point.1 - tau).collect();
    let base = base_delay(&QuasiPolynomial::new(rows, gaps).ok()?)?;
    let power = |gap: f64| (gap / base).round() as usize;
    if power(last - tau) > MAX_DEGREE {
        return None;
    }
    let mut ascending = vec![0.0; power(last - tau) + 1];
    for point in edge {
        *ascending.get_mut(power(point.1 - tau))? = point.3;
    }
    let law = |z: Complex64| Law {
        row,
        bend,
        offset: -log(modulus(z)) / base,
        phase: -angle(z.im, z.re) / base,
        spacing: TAU / base,
    };
    Some(simple_roots(&ascending).into_iter().map(law).collect())
}

/// The simple roots of a polynomial, none of which is 0, by the iteration of Ehrlich (1967) and
/// Aberth (1973).
fn simple_roots(ascending: &[f64]) -> Vec<Complex64> {
    if let [first, second] = *ascending {
        return vec![Complex64::new(-first / second, 0.0)];
    }
    let upper = tropical_roots(ascending);
    let upper = upper.iter().filter(|z| z.im >= -ON_AXIS * z.norm());
    let mirrored = |z: &Complex64| (z.im > ON_AXIS * z.norm()).then(|| z.conj());
    // Turned, because a symmetric set of starts stays symmetric.
    let mut roots: Vec<Complex64> = upper
        .flat_map(|z| std::iter::once(*z).chain(mirrored(z)))
        .map(|z| z * TURN)
        .collect();
    let mut settled = vec![false; roots.len()];
    for _ in 0..MAX_STEPS {
        for (i, done) in settled.iter_mut().enumerate() {
            let Some(&z) = roots.get(i) else { break };
            let (mut p, mut slope) = (Complex64::ZERO, Complex64::ZERO);
            for c in ascending.iter().rev() {
                slope = slope * z + p;
                p = p * z + c;
            }
            let others = roots.iter().enumerate().filter(|(j, _)| *j != i);
            let pull: Complex64 = others.map(|(_, other)| (z - other).inv()).sum();
            let step = p / (slope - p * pull);
            *done = step.norm() <= SETTLED * z.norm();
            if let Some(place) = roots.get_mut(i).filter(|_| step.is_finite()) {
                *place = z - step;
            }
        }
        if settled.iter().all(|done| *done) {
            break;
        }
    }
    let apart = |i: usize, z: &Complex64| {
        let mut others = roots.iter().enumerate().filter(|(j, _)| *j != i);
        others.all(|(_, other)| (z - other).norm() > APART * z.norm())
    };
    let numbered = roots.iter().zip(&settled).enumerate();
    numbered
        .filter(|(i, (z, settled))| **settled && apart(*i, z))
        .map(|(_, (z, _))| *z)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;

    fn laws_of(rows: &[&[f64]], delays: &[f64]) -> Vec<Law> {
        laws(&make(rows, delays))
    }

    #[test]
    fn the_chain_of_two_terms_is_that_of_its_moduli() {
        let laws = laws_of(&[&[0.0, 1.0], &[2.0]], &[0.0, 0.36]);
        assert_eq!(laws.len(), 1);
        for law in laws {
            assert_eq!((law.row, law.bend), (0, 1.0 / 0.36));
            assert!((law.offset - 2f64.ln() / 0.36).abs() < 1e-14);
            assert!((law.spacing - TAU / 0.36).abs() < 1e-13);
        }
    }

    #[test]
    fn every_edge_of_the_hull_makes_a_chain() {
        let rows: &[&[f64]] = &[&[0.0, 0.0, 0.0, 1.0], &[0.0, 0.0, 1.0], &[5.0]];
        let bends: Vec<f64> = laws_of(rows, &[0.0, 1.0, 1.7])
            .iter()
            .map(|l| l.bend)
            .collect();
        assert_eq!(bends, [1.0, 2.0 / 0.7]);
    }

    #[test]
    fn chains_without_a_period_or_of_double_roots_have_no_law() {
        let rows: &[&[f64]] = &[&[1.0, 1.0], &[0.0, 0.4], &[0.0, 0.3]];
        assert!(laws_of(rows, &[0.0, 1.0, 2f64.sqrt()]).is_empty());
        let squared: &[&[f64]] = &[&[0.0, 0.0, 1.0], &[0.0, 2.0], &[1.0]];
        assert!(laws_of(squared, &[0.0, 1.0, 2.0]).is_empty());
        assert!(laws_of(&[&[1.0, 1.0]], &[0.0]).is_empty());
    }
}
