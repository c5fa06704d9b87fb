//! Polynomials in s, their coefficients in descending order.

use super::entry::Entry;

/// p q.
pub(super) fn product<S: Entry>(p: &[S], q: &[S]) -> Vec<S> {
    let mut out = vec![S::from(0.0); (p.len() + q.len()).saturating_sub(1)];
    for (i, a) in p.iter().enumerate() {
        for (place, b) in out.iter_mut().skip(i).zip(q) {
            *place = place.clone() + a.clone() * b.clone();
        }
    }
    out
}

/// p + q.
pub(super) fn sum<S: Entry>(p: Vec<S>, q: Vec<S>) -> Vec<S> {
    let (mut long, short) = if p.len() < q.len() { (q, p) } else { (p, q) };
    let head = long.len() - short.len();
    for (place, b) in long.iter_mut().skip(head).zip(short) {
        *place = place.clone() + b;
    }
    long
}

/// c p.
pub(super) fn scaled<S: Entry>(c: &S, p: &[S]) -> Vec<S> {
    p.iter().map(|a| c.clone() * a.clone()).collect()
}

/// Numbers as entries.
pub(super) fn entries<S: Entry>(numbers: &[f64]) -> Vec<S> {
    numbers.iter().map(|number| S::from(*number)).collect()
}

/// Without leading coefficients that are zero; at least one is kept.
pub(super) fn led<S: Entry>(p: &[S]) -> &[S] {
    let first = p.iter().position(|c| !c.is_zero());
    p.get(first.unwrap_or(p.len().saturating_sub(1))..)
        .unwrap_or_default()
}
