//! Transition and process noise of x′ = A x + G ξ over a step h, ξ white of unit intensity:
//!
//!   Φ = e^{A h},   Q = ∫₀ʰ e^{A s} G Gᵀ e^{Aᵀ s} ds.
//!
//! Both are summed by Taylor for h / 2^k with ‖A‖₁ h / 2^k ≤ 1/4 and doubled k times:
//! Φ(2h) = Φ(h)², Q(2h) = Q(h) + Φ(h) Q(h) Φ(h)ᵀ. Every term of the doubling of Q is positive
//! semidefinite, so that states that decay fast lose no digits. They do in the block exponential of
//! Van Loan (1978), which holds e^{−A h}.

use super::path::dot;

/// Largest ‖A‖₁ h for which the series is summed without doubling.
const REACH: f64 = 0.25;

/// Number of terms. Those of Q shrink by 2 ‖A‖₁ h / k, and 0.5^17 / 17! is below 1e-19.
const TERMS: u32 = 17;

/// Φ and Q of one step length, row-major.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Propagation {
    pub(super) phi: Vec<f64>,
    pub(super) q: Vec<f64>,
}

impl Propagation {
    /// For A (n × n, row-major), the intensity G Gᵀ of the noise, and a step `h` above zero.
    pub(super) fn new(a: &[f64], noise: &[f64], h: f64) -> Self {
        let n = side(a);
        let doublings = doublings(norm(a, n) * h);
        let step = h * 0.5_f64.powi(doublings);
        let mut phi = identity(n);
        let mut term = phi.clone();
        for k in 1..=TERMS {
            term = scaled(&product(a, &term, n), step / f64::from(k));
            add(&mut phi, &term);
        }
        let mut term = scaled(noise, step);
        let mut q = term.clone();
        for k in 2..=TERMS {
            let half = product(a, &term, n);
            term = scaled(&with_transpose(&half, n), step / f64::from(k));
            add(&mut q, &term);
        }
        let mut found = Self { phi, q };
        for _ in 0..doublings {
            let moved = found.moved(&found.q);
            add(&mut found.q, &moved);
            found.phi = product(&found.phi, &found.phi, n);
        }
        found
    }

    /// Φ P Φᵀ for a symmetric P.
    pub(super) fn moved(&self, p: &[f64]) -> Vec<f64> {
        let n = side(p);
        let left = product(&self.phi, p, n);
        let mut out = vec![0.0; n * n];
        for (row, left) in out.chunks_exact_mut(n).zip(left.chunks_exact(n)) {
            for (place, phi) in row.iter_mut().zip(self.phi.chunks_exact(n)) {
                *place = dot(left, phi);
            }
        }
        out
    }
}

/// Side of a square matrix.
fn side(a: &[f64]) -> usize {
    a.len().isqrt()
}

fn identity(n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    out.iter_mut().step_by(n + 1).for_each(|place| *place = 1.0);
    out
}

fn add(to: &mut [f64], what: &[f64]) {
    for (to, what) in to.iter_mut().zip(what) {
        *to += what;
    }
}

fn scaled(a: &[f64], factor: f64) -> Vec<f64> {
    a.iter().map(|entry| entry * factor).collect()
}

fn product(a: &[f64], b: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for (out, row) in out.chunks_exact_mut(n).zip(a.chunks_exact(n)) {
        for (factor, b) in row.iter().zip(b.chunks_exact(n)) {
            for (out, b) in out.iter_mut().zip(b) {
                *out += factor * b;
            }
        }
    }
    out
}

/// A + Aᵀ.
fn with_transpose(a: &[f64], n: usize) -> Vec<f64> {
    let mut out = a.to_vec();
    for (row, out) in out.chunks_exact_mut(n).enumerate() {
        for (out, mirrored) in out.iter_mut().zip(a.iter().skip(row).step_by(n)) {
            *out += mirrored;
        }
    }
    out
}

/// Largest column sum.
fn norm(a: &[f64], n: usize) -> f64 {
    (0..n)
        .map(|column| {
            a.iter()
                .skip(column)
                .step_by(n.max(1))
                .map(|x| x.abs())
                .sum()
        })
        .fold(0.0, f64::max)
}

fn doublings(size: f64) -> i32 {
    let mut count = 0;
    let mut size = size;
    while size > REACH && count < 1000 {
        size *= 0.5;
        count += 1;
    }
    count
}
