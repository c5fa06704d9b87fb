//! Crossings of a level by a polynomial on [0, 1].

use super::series::{DEGREE, Series};
use crate::dde::scalar::Scalar;

/// Width below which an interval is not halved any more.
const NARROWEST: f64 = 1.0 / (1_u64 << 40) as f64;

/// The value of `u` at σ.
pub(crate) fn value_at<S: Scalar>(u: &Series<S>, sigma: f64) -> f64 {
    let terms = u.terms().iter().rev();
    terms.fold(0.0, |sum, c| sum * sigma + c.value())
}

/// Zeros of `u` − `level` in (0, 1) at which the sign may change.
pub(crate) fn crossings<S: Scalar>(u: &Series<S>, level: f64, zeros: &mut Vec<f64>) {
    let noise = 4.0
        * f64::EPSILON
        * u.terms()
            .iter()
            .fold(level.abs(), |m, c| f64::max(m, c.value().abs()));
    let degree = u.degree;
    let mut root = Bernstein {
        b: from_powers(u, level),
        low: 0.0,
        high: 1.0,
    };
    let mut stack = Vec::new();
    loop {
        let terms = &root.b[..=degree];
        let live = terms.iter().any(|b| b.abs() > noise);
        let changes = if live { sign_changes(terms) } else { 0 };
        if changes == 1 {
            zeros.push(bisect(u, level, &root, degree));
        } else if changes > 1 {
            if root.high - root.low > NARROWEST {
                let (left, right) = root.halve(degree);
                stack.push(right);
                root = left;
                continue;
            }
            if changes % 2 == 1 {
                zeros.push(0.5 * (root.low + root.high));
            }
        }
        match stack.pop() {
            Some(next) => {
                // A zero exactly on the common end of two halves is an end of both and a sign
                // change in neither.
                if next.b[0] == 0.0 {
                    zeros.push(next.low);
                }
                root = next;
            }
            None => return,
        }
    }
}

/// The zeros in order of u less each of some levels, after those that are there already.
pub(crate) fn in_order<S: Scalar>(
    u: &Series<S>,
    levels: impl IntoIterator<Item = f64>,
    mut zeros: Vec<f64>,
) -> Vec<f64> {
    for level in levels {
        crossings(u, level, &mut zeros);
    }
    zeros.sort_by(f64::total_cmp);
    zeros
}

/// The turning points of a polynomial inside a part of [0, 1], in order, between its ends; without them
/// where they do not matter.
pub(crate) fn corners(y: &Series, (from, to): (f64, f64), matters: bool, places: &mut Vec<f64>) {
    places.clear();
    if matters && may_turn(y) {
        crossings(&y.derivative(), 0.0, places);
        places.retain(|sigma| *sigma > from && *sigma < to);
        places.sort_by(f64::total_cmp);
    }
    places.insert(0, from);
    places.push(to);
}

/// May the derivative change its sign on [0, 1]?
fn may_turn(y: &Series) -> bool {
    let slopes = y.terms().iter().enumerate().skip(2);
    let others: f64 = slopes.map(|(j, c)| j as f64 * c.abs()).sum();
    y.degree > 1 && others >= y.coefficients[1].abs()
}

/// Where a polynomial last enters the band between two levels, in a part of [0, 1].
pub(crate) fn last_entry(y: &Series, (low, high): (f64, f64), part: (f64, f64)) -> Option<f64> {
    let (least, most) = y.range();
    let passed = [(low, least < low), (high, most > high)];
    let levels = passed.into_iter().filter(|(_, is_passed)| *is_passed);
    let mut zeros = in_order(y, levels.map(|(level, _)| level), Vec::new()).into_iter();
    zeros.rfind(|sigma| (part.0..=part.1).contains(sigma))
}

/// Bernstein coefficients on an interval of σ.
#[derive(Debug, Clone, Copy)]
struct Bernstein {
    b: [f64; DEGREE + 1],
    low: f64,
    high: f64,
}

impl Bernstein {
    fn halve(&self, degree: usize) -> (Self, Self) {
        let mid = 0.5 * (self.low + self.high);
        let mut left = Self { high: mid, ..*self };
        let mut right = Self { low: mid, ..*self };
        let mut b = self.b;
        for level in 0..=degree {
            left.b[level] = b[0];
            right.b[degree - level] = b[degree - level];
            for i in 0..degree - level {
                b[i] = 0.5 * (b[i] + b[i + 1]);
            }
        }
        (left, right)
    }
}

/// b_i = Σ_{j ≤ i} C(i, j)/C(d, j) c_j, by sums of c_j/C(d, j) as in Pascal's triangle.
fn from_powers<S: Scalar>(u: &Series<S>, level: f64) -> [f64; DEGREE + 1] {
    let degree = u.degree;
    let mut b = u.coefficients.map(S::value);
    b[0] -= level;
    let mut binomial = 1.0;
    for (j, b) in b.iter_mut().enumerate().take(degree + 1) {
        *b /= binomial;
        binomial = binomial * (degree - j) as f64 / (j + 1) as f64;
    }
    for first in 1..=degree {
        for i in (first..=degree).rev() {
            b[i] += b[i - 1];
        }
    }
    b
}

fn sign_changes(terms: &[f64]) -> usize {
    let mut changes = 0;
    let mut last = 0.0;
    for &b in terms {
        if b != 0.0 {
            if last * b.signum() < 0.0 {
                changes += 1;
            }
            last = b.signum();
        }
    }
    changes
}

/// The one crossing in an interval with one sign change.
fn bisect<S: Scalar>(u: &Series<S>, level: f64, interval: &Bernstein, degree: usize) -> f64 {
    let (mut low, mut high) = (interval.low, interval.high);
    let rising = interval.b[..=degree]
        .iter()
        .find(|b| **b != 0.0)
        .is_some_and(|b| *b < 0.0);
    loop {
        let mid = 0.5 * (low + high);
        if mid <= low || mid >= high || high - low < f64::EPSILON * 0.25 {
            return mid;
        }
        if (value_at(u, mid) < level) == rising {
            low = mid;
        } else {
            high = mid;
        }
    }
}
