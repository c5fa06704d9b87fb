//! The response of x′ = A x + Σ g_i v_i with constant v_i over a step h.
//!
//!   x(h) = Φ x(0) + Σ Γ_i v_i,   Φ = e^{A h},   Γ_i = ∫₀ʰ e^{A s} ds g_i.
//!
//! Φ − I and Γ are summed by Taylor for h / 2^q with ‖A‖₁ h / 2^q ≤ 1/2 and doubled q times:
//! F(2h) = 2 F + F² for F = Φ − I, Γ(2h) = 2 Γ + F Γ. Working with Φ − I keeps slow modes beside
//! fast ones, and keeping Γ apart from Φ keeps a large input gain from forcing more doublings
//! than A needs. Sastre et al. and Higham (Functions of Matrices, 2008, section 10.3) treat
//! scaling and squaring in general; this is its plain form for a handful of states.
//! Guaranteed: the truncated series is below rounding. Not guaranteed: full relative accuracy of
//! entries far below ‖Φ‖ for strongly non-normal A.

/// Φ and the Γ_i of one step length.
#[derive(Debug, Clone, PartialEq)]
pub struct Propagator {
    n: usize,
    /// Φ − I, row-major.
    growth: Vec<f64>,
    /// Γ_i, one after the other.
    gamma: Vec<f64>,
}

impl Propagator {
    /// For A (n × n row-major), input columns g_i (n each) and step length `h` ≥ 0.
    pub fn new(a: &[f64], inputs: &[&[f64]], h: f64) -> Self {
        let n = inputs.first().map_or_else(|| side(a), |g| g.len());
        let doublings = doublings(norm(a, n) * h);
        let step = h * 0.5_f64.powi(doublings);
        let mut growth = vec![0.0; n * n];
        let mut gamma = vec![0.0; n * inputs.len()];
        // Columns are independent: F by A^j step^j / j! applied to A step, Γ_i by the same
        // series of (e^z − 1)/z applied to g_i step.
        let mut term = vec![0.0; n];
        let mut next = vec![0.0; n];
        for column in 0..n {
            for row in 0..n {
                term[row] = a[row * n + column] * step;
            }
            let mut sum = term.clone();
            accumulate(a, step, &mut term, &mut next, &mut sum);
            for row in 0..n {
                growth[row * n + column] = sum[row];
            }
        }
        for (g, sum) in inputs.iter().zip(gamma.chunks_exact_mut(n.max(1))) {
            for row in 0..n {
                term[row] = g[row] * step;
            }
            sum.copy_from_slice(&term);
            accumulate(a, step, &mut term, &mut next, sum);
        }
        let mut propagator = Self { n, growth, gamma };
        for _ in 0..doublings {
            propagator.double();
        }
        propagator
    }

    /// Φ, row-major.
    pub fn phi(&self) -> Vec<f64> {
        let mut phi = self.growth.clone();
        for i in 0..self.n {
            phi[i * self.n + i] += 1.0;
        }
        phi
    }

    /// Γ of input `i`.
    pub fn gamma(&self, i: usize) -> &[f64] {
        &self.gamma[i * self.n..(i + 1) * self.n]
    }

    /// `out` = Φ x + Σ Γ_i v_i.
    pub fn apply(&self, x: &[f64], inputs: &[f64], out: &mut [f64]) {
        for (row, out) in out.iter_mut().enumerate() {
            let mut change = 0.0;
            for (f, x) in self.growth[row * self.n..(row + 1) * self.n].iter().zip(x) {
                change += f * x;
            }
            for (i, v) in inputs.iter().enumerate() {
                change += self.gamma[i * self.n + row] * v;
            }
            *out = x[row] + change;
        }
    }

    fn double(&mut self) {
        let n = self.n;
        for gamma in self.gamma.chunks_exact_mut(n.max(1)) {
            let old = gamma.to_vec();
            multiply_add(&self.growth, &old, gamma);
            for (new, old) in gamma.iter_mut().zip(&old) {
                *new += old;
            }
        }
        let old = self.growth.clone();
        for column in 0..n {
            for row in 0..n {
                let mut sum = 0.0;
                for inner in 0..n {
                    sum += old[row * n + inner] * old[inner * n + column];
                }
                self.growth[row * n + column] = sum + 2.0 * old[row * n + column];
            }
        }
    }
}

/// Largest ‖A‖₁ h that the series is summed for without doubling.
const REACH: f64 = 0.5;

/// 0.5^17/17! is below 1e-19: the series has ended by then.
const TERMS: u32 = 17;

/// Halvings that bring `size` within reach.
fn doublings(size: f64) -> i32 {
    let mut count = 0;
    let mut size = size;
    while size > REACH && count < 1100 {
        size *= 0.5;
        count += 1;
    }
    count
}

/// `sum` += Σ_{j ≥ 1} (A step)^j term / (j + 1)!, the first term being in `sum` already.
fn accumulate(a: &[f64], step: f64, term: &mut [f64], next: &mut [f64], sum: &mut [f64]) {
    for j in 2..=TERMS {
        next.fill(0.0);
        multiply_add(a, term, next);
        let factor = step / f64::from(j);
        let mut alive = false;
        for ((term, next), sum) in term.iter_mut().zip(next.iter()).zip(sum.iter_mut()) {
            *term = next * factor;
            *sum += *term;
            alive |= *term != 0.0;
        }
        if !alive {
            break;
        }
    }
}

/// `out` += A x.
pub(crate) fn multiply_add(a: &[f64], x: &[f64], out: &mut [f64]) {
    for (row, out) in a.chunks_exact(x.len().max(1)).zip(out) {
        for (a, x) in row.iter().zip(x) {
            *out += a * x;
        }
    }
}

/// ‖A‖₁, the largest column sum.
pub(crate) fn norm(a: &[f64], n: usize) -> f64 {
    (0..n)
        .map(|column| (0..n).map(|row| a[row * n + column].abs()).sum())
        .fold(0.0, f64::max)
}

fn side(a: &[f64]) -> usize {
    (0..).find(|n| n * n >= a.len()).unwrap_or(0)
}
