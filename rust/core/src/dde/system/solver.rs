//! x′ = A x + g over one element, as Legendre series.
//!
//! With x = Σ x_k P_k(ξ), f = x′ = A x + g and ρ = h/2, integration of the P_k gives
//!
//!   x_0 = x(−1) + ρ (f_0 − f_1/3),   x_k = ρ (f_{k−1}/(2k − 1) − f_{k+1}/(2k + 3)),
//!
//! block tridiagonal in the x_k (Lanczos' tau method; Olver and Townsend, SIAM Review 2013, for
//! the idea of sparse operators). It is solved from the highest k down and then up,
//!
//!   D_{k−1} = I + z D_k⁻¹ z/((2k + 1)(2k − 1)), z = ρ A,   and D_0 with I − z in place of I,
//!
//! which costs n³ once for a length and n² for a solution. As z → −∞ the homogeneous part goes
//! to zero: a stiff A restricts the element only while its fast transients last.

use super::legendre::{DEGREE, TERMS};
use crate::linear_algebra::lu::Lu;

/// Number of lengths whose factors are stored.
const KEPT: usize = 4;

/// Solves elements for one A.
#[derive(Debug)]
pub(super) struct Solver {
    n: usize,
    a: Vec<f64>,
    is_zero: bool,
    kept: Vec<Factors>,
    oldest: usize,
    work: Vec<f64>,
}

/// Factors that depend on the length of the element. A singular one gives numbers that are not
/// finite, which the check of growth detects.
#[derive(Debug)]
struct Factors {
    h: f64,
    blocks: Vec<Lu>,
}

impl Solver {
    pub(super) fn new(a: &[f64], n: usize) -> Self {
        Self {
            n,
            a: a.to_vec(),
            is_zero: a.iter().all(|a| *a == 0.0),
            kept: Vec::with_capacity(KEPT),
            oldest: 0,
            work: vec![0.0; 2 * n],
        }
    }

    /// `x` from x(−1) and `g` of degree `degree`; then `f` = A x + g. Series have [`TERMS`]
    /// coefficients for each state. Lengths closer than `slack` are equal.
    pub(super) fn solve(
        &mut self,
        h: f64,
        slack: f64,
        start: &[f64],
        (g, degree): (&[f64], usize),
        x: &mut [f64],
        f: &mut [f64],
    ) {
        let n = self.n;
        f.copy_from_slice(g);
        for i in 0..n {
            let g = &g[i * TERMS..(i + 1) * TERMS];
            integrate(
                g,
                degree,
                0.5 * h,
                start[i],
                &mut x[i * TERMS..(i + 1) * TERMS],
            );
        }
        if self.is_zero {
            return;
        }
        let place = self.factors(h, slack);
        let Some(factors) = self.kept.get(place) else {
            return;
        };
        let rho = 0.5 * factors.h;
        let (now, last) = self.work.split_at_mut(n);
        // Downwards: eliminate x_{k+1} from the right sides.
        last.fill(0.0);
        for k in (0..TERMS).rev() {
            // `last` holds D_{k+1}⁻¹ r_{k+1}.
            let share = rho / (2 * k + 3) as f64;
            for (i, now) in now.iter_mut().enumerate() {
                let row = &self.a[i * n..(i + 1) * n];
                let carried: f64 = row.iter().zip(last.iter()).map(|(a, r)| a * r).sum();
                *now = x[i * TERMS + k] - share * carried;
            }
            factors.blocks[k].solve(now);
            for i in 0..n {
                x[i * TERMS + k] = now[i];
                last[i] = now[i];
            }
        }
        // Upwards: x_k = D_k⁻¹ (r_k + z x_{k−1}/(2k − 1)).
        for k in 1..TERMS {
            let share = rho / (2 * k - 1) as f64;
            for i in 0..n {
                last[i] = x[i * TERMS + k - 1];
            }
            for (i, now) in now.iter_mut().enumerate() {
                let row = &self.a[i * n..(i + 1) * n];
                *now = share * row.iter().zip(last.iter()).map(|(a, r)| a * r).sum::<f64>();
            }
            factors.blocks[k].solve(now);
            for i in 0..n {
                x[i * TERMS + k] += now[i];
            }
        }
        for i in 0..n {
            for (j, a) in self.a[i * n..(i + 1) * n].iter().enumerate() {
                if *a != 0.0 {
                    let x = &x[j * TERMS..(j + 1) * TERMS];
                    for (f, x) in f[i * TERMS..(i + 1) * TERMS].iter_mut().zip(x) {
                        *f += a * x;
                    }
                }
            }
        }
    }

    /// Index of the factors for this length.
    fn factors(&mut self, h: f64, slack: f64) -> usize {
        if let Some(place) = self.kept.iter().position(|f| (f.h - h).abs() <= slack) {
            return place;
        }
        let made = Factors::new(&self.a, self.n, h);
        if self.kept.len() < KEPT {
            self.kept.push(made);
            return self.kept.len() - 1;
        }
        self.oldest = (self.oldest + 1) % KEPT;
        self.kept[self.oldest] = made;
        self.oldest
    }
}

/// `x` = start + ∫ g, the first [`TERMS`] coefficients.
fn integrate(g: &[f64], degree: usize, rho: f64, start: f64, x: &mut [f64]) {
    let next = |k: usize| if k < DEGREE { g[k + 1] } else { 0.0 };
    x[0] = start + rho * (g[0] - next(0) / 3.0);
    x[1..].fill(0.0);
    for k in 1..=(degree + 1).min(DEGREE) {
        x[k] = rho * (g[k - 1] / (2 * k - 1) as f64 - next(k) / (2 * k + 3) as f64);
    }
}

impl Factors {
    fn new(a: &[f64], n: usize, h: f64) -> Self {
        let z: Vec<f64> = a.iter().map(|a| 0.5 * h * a).collect();
        let mut blocks = Vec::with_capacity(TERMS);
        let mut block = identity(n);
        let mut column = vec![0.0; n];
        for k in (1..TERMS).rev() {
            let lu = Lu::new(block, n);
            // z D_k⁻¹ z, column by column.
            let mut product = vec![0.0; n * n];
            let share = 1.0 / ((2 * k + 1) as f64 * (2 * k - 1) as f64);
            for j in 0..n {
                for i in 0..n {
                    column[i] = z[i * n + j] * share;
                }
                lu.solve(&mut column);
                for i in 0..n {
                    let row = &z[i * n..(i + 1) * n];
                    product[i * n + j] = row.iter().zip(&column).map(|(z, c)| z * c).sum();
                }
            }
            blocks.push(lu);
            block = product;
            for i in 0..n {
                block[i * n + i] += 1.0;
            }
        }
        for (block, z) in block.iter_mut().zip(&z) {
            *block -= z;
        }
        blocks.push(Lu::new(block, n));
        blocks.reverse();
        Self { h, blocks }
    }
}

fn identity(n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for i in 0..n {
        out[i * n + i] = 1.0;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dde::propagator::Propagator;
    use proptest::prelude::*;

    proptest! {
        /// Constant forcing: the end of the element is that of the matrix exponential.
        #[test]
        fn an_element_ends_where_the_propagator_says(
            a in prop::collection::vec(-1.5..1.5, 9),
            g in prop::collection::vec(-2.0..2.0, 3),
            start in prop::collection::vec(-1.0..1.0, 3),
        ) {
            let h = 0.9;
            let mut series = vec![0.0; 3 * TERMS];
            for i in 0..3 {
                series[i * TERMS] = g[i];
            }
            let (mut x, mut f) = (vec![0.0; 3 * TERMS], vec![0.0; 3 * TERMS]);
            Solver::new(&a, 3).solve(h, 0.0, &start, (&series, 0), &mut x, &mut f);
            let mut truth = vec![0.0; 3];
            Propagator::new(&a, &[&g], h).apply(&start, &[1.0], &mut truth);
            for i in 0..3 {
                let end: f64 = x[i * TERMS..(i + 1) * TERMS].iter().sum();
                prop_assert!((end - truth[i]).abs() < 1e-13, "{end} is not {}", truth[i]);
            }
        }
    }

    #[test]
    fn a_stiff_rate_follows_smooth_forcing_over_a_long_element() {
        // x′ = −λ (x − ξ) + 1/ρ has the solution x = ξ where it starts at −1.
        let (lambda, h) = (1e6, 2.0);
        let mut g = [0.0; TERMS];
        (g[0], g[1]) = (1.0, lambda);
        let (mut x, mut f) = ([0.0; TERMS], [0.0; TERMS]);
        Solver::new(&[-lambda], 1).solve(h, 0.0, &[-1.0], (&g, 1), &mut x, &mut f);
        assert!((x[1] - 1.0).abs() < 1e-15);
        assert!(x.iter().enumerate().all(|(k, c)| k == 1 || c.abs() < 1e-15));
    }
}
