//! Scaling of M(s) at one point: rows by e^(s τ_c(i)) and powers of two, columns by powers of two.
//!
//! With b_ij the logarithms of the moduli of the entries, the assignment of rows to columns with
//! the largest sum, and its dual solution, b_ij ≤ u_i + v_j with equality where a row is assigned,
//! make the scaled entries at most 1 and those assigned about 1 (Olschowka and Neumaier 1996).
//! τ_c(i) is the delay that is largest in the entry assigned. Positive factors do not change the
//! argument of the determinant, and powers of two are exact. The assignment is found by shortest
//! augmenting paths (Kuhn 1955; Jonker and Volgenant 1987). No proof depends on the quality of the
//! scaling.

use std::f64::consts::LN_2;

use num_complex::Complex64;

use super::system::{Irreducible, Term};
use crate::elementary::log;
use crate::quasipoly::modulus;

/// Cost that stands for an entry that is zero.
const FORBIDDEN: f64 = 1e12;

/// Factor on |s| up to which a scaling is kept. Larger: the entries differ more in size; smaller: it
/// is chosen anew more often.
const MOST_GROWTH: f64 = 30.0;

/// Modulus that replaces that of points close to 0, in units of the rate of the system.
const LEAST_SIZE: f64 = 1e-2;

/// The power of two next to e^(−d x). It is taken out of the exponential, so that neither the
/// exponential nor the entries leave the range of double precision unless their product does.
pub(super) fn exponent(gap: f64, x: f64) -> f64 {
    (-gap * x / LN_2).round().clamp(-1e9, 1e9)
}

/// The rows of a scaled matrix.
#[derive(Debug, Clone)]
pub(super) struct Balanced {
    /// Where the scaling was chosen; the powers of two of the exponentials are those of that point.
    pub(super) place: Complex64,
    /// c(i).
    pub(super) references: Vec<usize>,
    /// Terms with entries scaled, and multiplied by two to the power of [`exponent`].
    pub(super) rows: Vec<Vec<Term>>,
}

impl Balanced {
    /// Is the scaling good enough at `s`? `farthest` is the largest change of Re s, in units of one
    /// over the longest delay.
    pub(super) fn suits(&self, system: &Irreducible, s: Complex64, farthest: f64) -> bool {
        let least = LEAST_SIZE * system.rate();
        let (here, there) = (modulus(s).max(least), modulus(self.place).max(least));
        (s.re - self.place.re).abs() * system.longest() <= farthest
            && (1.0 / MOST_GROWTH..MOST_GROWTH).contains(&(here / there))
    }
}

/// Scale M at `s`; `None` where its determinant is zero because of its pattern of zeros.
pub(super) fn balance(system: &Irreducible, s: Complex64) -> Option<Balanced> {
    let n = system.size();
    let distance = modulus(s);
    let mut costs = vec![FORBIDDEN; n * n];
    let mut largest = vec![0; n * n];
    let delay = |index: usize| system.delays().get(index).copied().unwrap_or(0.0);
    let lag = |index: usize| delay(index) * s.re / LN_2;
    for (i, terms) in system.rows().iter().enumerate() {
        for term in terms {
            let lag = lag(term.delay);
            for entry in &term.entries {
                let size = distance * entry.slope.abs() + entry.value.abs();
                let cost = lag - log(size) / LN_2;
                let at = i * n + entry.column;
                if let (Some(known), Some(delay)) = (costs.get_mut(at), largest.get_mut(at))
                    && cost < *known
                {
                    *known = cost;
                    *delay = term.delay;
                }
            }
        }
    }
    let (assigned, u, v) = assign(n, &costs)?;
    let mut references = Vec::with_capacity(n);
    let mut rows = Vec::with_capacity(n);
    for ((i, terms), (column, u)) in system
        .rows()
        .iter()
        .enumerate()
        .zip(assigned.iter().zip(&u))
    {
        let reference = largest.get(i * n + column).copied()?;
        references.push(reference);
        let own = (u - lag(reference)).round();
        let scaled = terms.iter().map(|term| {
            let gap = delay(term.delay) - delay(reference);
            let own = own + exponent(gap, s.re);
            let entries = term.entries.iter().map(|entry| {
                let across = v.get(entry.column).copied().unwrap_or(0.0).round();
                let exponent = (own + across) as i32;
                let mut scaled = *entry;
                scaled.slope = libm::ldexp(entry.slope, exponent);
                scaled.value = libm::ldexp(entry.value, exponent);
                scaled
            });
            Term {
                delay: term.delay,
                entries: entries.collect(),
            }
        });
        rows.push(scaled.collect());
    }
    Some(Balanced {
        place: s,
        references,
        rows,
    })
}

/// The column of each row, and potentials with u_i + v_j ≤ cost, for the least sum of costs.
fn assign(n: usize, costs: &[f64]) -> Option<(Vec<usize>, Vec<f64>, Vec<f64>)> {
    // Column n holds the row that is not assigned yet.
    let (mut u, mut v) = (vec![0.0; n], vec![0.0; n + 1]);
    let mut rows: Vec<Option<usize>> = vec![None; n + 1];
    for row in 0..n {
        *rows.last_mut()? = Some(row);
        let mut column = n;
        let mut least = vec![f64::INFINITY; n];
        let mut before = vec![n; n];
        let mut seen = vec![false; n + 1];
        while let Some(Some(here)) = rows.get(column).copied() {
            *seen.get_mut(column)? = true;
            let line = costs.get(here * n..(here + 1) * n)?;
            let base = *u.get(here)?;
            let (mut step, mut next) = (f64::INFINITY, n);
            let known = least.iter_mut().zip(&mut before);
            for (j, ((cost, v), (least, before))) in line.iter().zip(&v).zip(known).enumerate() {
                if seen.get(j).copied().unwrap_or(true) {
                    continue;
                }
                let reduced = cost - base - v;
                if reduced < *least {
                    (*least, *before) = (reduced, column);
                }
                if *least < step {
                    (step, next) = (*least, j);
                }
            }
            if next == n {
                return None;
            }
            for (j, seen) in seen.iter().enumerate() {
                if *seen {
                    if let Some(Some(row)) = rows.get(j) {
                        *u.get_mut(*row)? += step;
                    }
                    *v.get_mut(j)? -= step;
                } else if let Some(least) = least.get_mut(j) {
                    *least -= step;
                }
            }
            column = next;
        }
        while column != n {
            let from = before.get(column).copied()?;
            *rows.get_mut(column)? = rows.get(from).copied()?;
            column = from;
        }
    }
    let mut assigned = vec![0; n];
    for (column, row) in rows.iter().take(n).enumerate() {
        *assigned.get_mut((*row)?)? = column;
    }
    let cost = |(row, column): (usize, &usize)| costs.get(row * n + column).copied();
    let possible = assigned
        .iter()
        .enumerate()
        .all(|pair| cost(pair).is_some_and(|cost| cost < 0.5 * FORBIDDEN));
    possible.then_some((assigned, u, v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_of_all_assignments() {
        let costs = [4.0, 1.0, 3.0, 2.0, 0.0, 5.0, 3.0, 2.0, 2.0];
        let (assigned, u, v) = assign(3, &costs).unwrap();
        assert_eq!(assigned, [1, 0, 2]);
        for i in 0..3 {
            for j in 0..3 {
                let slack = costs[3 * i + j] - u[i] - v[j];
                assert!(slack >= 0.0 && (assigned[i] != j || slack == 0.0));
            }
        }
        assert!(assign(2, &[1.0, FORBIDDEN, 1.0, FORBIDDEN]).is_none());
    }
}
