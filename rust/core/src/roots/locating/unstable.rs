//! One root proved to lie right of the imaginary axis, which proves that an equation is not stable.
//!
//! Where the leading term outweighs the others only far out, the axis is long and a count of the
//! half plane costly; a single disc right of the axis answers the question. On a ray from 0 two
//! terms can cancel where the largest term changes; Newton's iteration starts from these points. If
//! no disc is found, nothing is decided.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::isolate::{Search, Seek};
use super::starts::tropical_roots;
use crate::elementary::{log, sin_cos};
use crate::order::sort_down;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::counting::{MAX_EVALUATIONS, Walker};
use crate::{Error, Task};

/// Angles of the rays, rad.
const RAYS: [f64; 6] = [0.0, 0.25, 0.5, 0.8, 1.1, 1.4];

/// Heights above the real axis, in half turns of the exponentials.
const HEIGHTS: [f64; 6] = [0.25, 0.5, 1.0, 1.5, 2.0, 3.0];

/// Upper limit on the hints from which Newton's iteration is started; the rightmost ones are used.
const MOST_HINTS: usize = 24;

/// Upper limit on the changes of the largest term that are used on a ray.
const MOST_CHANGES: usize = 6;

/// Powers of two between which a radius is searched for.
const EXPONENTS: std::ops::Range<i32> = -300..300;

/// Is a root of `h` found and proved to lie right of the imaginary axis? `hints` are starting
/// points in addition to those that the terms give.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn has_unstable_root(
    h: &QuasiPolynomial,
    hints: Vec<Complex64>,
    task: &Task,
) -> Result<bool, Error> {
    let mut starts = rightmost_first(hints);
    starts.extend(balances(h));
    starts.extend(h.coefficients().iter().flat_map(|row| tropical_roots(row)));
    leads_right(&mut Walker::with_limit(h, task, MAX_EVALUATIONS), &starts)
}

/// The rightmost hints right of the axis.
pub(crate) fn rightmost_first(mut hints: Vec<Complex64>) -> Vec<Complex64> {
    hints.retain(|hint| hint.re > 0.0);
    sort_down(&mut hints, |hint| hint.re);
    hints.truncate(MOST_HINTS);
    hints
}

/// Does Newton's iteration from one of `starts` lead to a root proved to lie right of the axis?
///
/// # Errors
/// Those of the iteration.
pub(crate) fn leads_right<W: Seek>(walker: &mut W, starts: &[Complex64]) -> Result<bool, Error> {
    let mut search = Search::new(walker);
    for start in starts {
        search.iterate_from(&[*start], |s| s.is_finite())?;
        if search.weight_right_of(0.0) > 0 {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Points in the right half plane where two terms have the same modulus and no other is larger.
pub(crate) fn balances(h: &QuasiPolynomial) -> Vec<Complex64> {
    let Some(first) = h.delays().first().copied() else {
        return Vec::new();
    };
    let gaps = || h.delays().iter().skip(1).map(|delay| delay - first);
    let terms: Vec<Term> = h
        .terms()
        .flat_map(|(row, delay)| {
            let used = row.iter().enumerate().filter(|(_, c)| **c != 0.0);
            used.map(move |(k, c)| Term {
                size: log(c.abs()),
                power: k as f64,
                delay: delay - first,
            })
        })
        .collect();
    let mut starts = Vec::new();
    for ray in RAYS {
        let (sine, cosine) = sin_cos(ray);
        for radius in changes(&terms, cosine) {
            starts.push(Complex64::new(radius * cosine, radius * sine));
            if ray == 0.0 {
                starts.extend(gaps().flat_map(|gap| {
                    HEIGHTS.map(|height| Complex64::new(radius, height * PI / gap))
                }));
            }
        }
    }
    starts
}

/// |c sᵏ e^(−s τ)| in logarithms.
struct Term {
    size: f64,
    power: f64,
    delay: f64,
}

impl Term {
    fn at(&self, r: f64, cosine: f64) -> f64 {
        self.size + self.power * log(r) - self.delay * r * cosine
    }
}

/// The largest radii, to about one bit, at which another term becomes the largest on the ray.
fn changes(terms: &[Term], cosine: f64) -> Vec<f64> {
    let largest = |r: f64| {
        let sizes = terms.iter().map(|term| term.at(r, cosine)).enumerate();
        sizes
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(index, _)| index)
    };
    let mut found = Vec::new();
    let mut above = largest(libm::ldexp(1.0, EXPONENTS.end));
    for power in EXPONENTS.rev() {
        let mut low = libm::ldexp(1.0, power);
        let here = largest(low);
        if here == above {
            continue;
        }
        let mut high = 2.0 * low;
        for _ in 0..10 {
            let middle = 0.5 * (low + high);
            if largest(middle) == above {
                high = middle;
            } else {
                low = middle;
            }
        }
        found.push(low);
        above = here;
        if found.len() == MOST_CHANGES {
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;

    fn found(rows: &[&[f64]], delays: &[f64]) -> Result<bool, Error> {
        has_unstable_root(&make(rows, delays), Vec::new(), &Task::new())
    }

    #[test]
    fn a_root_far_right_of_the_axis_is_found() {
        assert_eq!(found(&[&[0.0, 1.0], &[1e8, 0.5]], &[0.0, 1.0]), Ok(true));
        assert_eq!(found(&[&[-1e8, 1.0], &[1.0]], &[0.0, 1.0]), Ok(true));
        // Along the positive axis s exceeds 30 before the delayed term matters.
        assert_eq!(found(&[&[30.0, 1.0], &[1e8, 0.4]], &[0.0, 4.6]), Ok(true));
        let rows: &[&[f64]] = &[&[1e12, 1e-3, 1.0], &[1e12]];
        assert_eq!(found(rows, &[0.0, 1e-3]), Ok(true));
    }

    #[test]
    fn none_is_found_where_there_is_none() {
        assert_eq!(found(&[&[0.0, 1.0], &[4.0]], &[0.0, 0.36]), Ok(false));
        assert_eq!(found(&[&[1e8, 1.0], &[1e7, 0.5]], &[0.0, 1.0]), Ok(false));
    }
}
