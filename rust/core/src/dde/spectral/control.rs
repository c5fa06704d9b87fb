//! Error estimate of an element, and the length and order of the next one.
//!
//! The error of the polynomial is judged by its last coefficients and by its defect at the start,
//! (h/2) |Y′ − f| times the largest integral of the defect's shape. Coefficients of smooth
//! solutions decrease like C ρ^(−k), and the last one bounds the rest. Around a kink they decrease
//! like a power of k, and the rest is about N times the size of the last quarter. The ratio of the
//! last quarter to the one before distinguishes the two cases. As ρ is inversely proportional to
//! the length, an element longer by a factor s has an error s^N times as large.

use super::element::Element;
use super::nodes::{COUPLED, LARGEST, Nodes, ORDERS};
use super::sizes::largest;

/// Share of the tolerance that an element may use.
const SHARE: f64 = 0.2;
/// Weight of the last but one coefficient: in an even or odd function the last one is zero.
const LAST_BUT_ONE: f64 = 0.2;
/// Coefficients below this share of the tolerance are negligible.
const NEGLIGIBLE: f64 = 0.02;
const LONGER: f64 = 2.0;
const SHORTER: f64 = 0.1;

/// Nodes in addition to the terms that the last element needed: so many, and this part of the terms.
/// With fewer, more elements are rejected than nodes are saved.
const SPARE: usize = 6;
const SPARE_PART: usize = 4;
/// Ratio of two numbers of nodes up to which the larger one is kept.
const ONE_LESS: f64 = 1.25;

/// Factor on the length that the error estimate suggests.
const SAFETY: f64 = 0.95;

/// Nodes of the preferred order: their number without any digit of the tolerance, and for each
/// digit.
const NODES: (f64, f64) = (4.0, 1.4);

/// The same where the components are uncoupled.
const UNCOUPLED: (f64, f64) = (8.0, 1.6);
/// Number of components up to which a node costs much less than a call from Python.
const LIGHT: usize = 64;

/// Verdict about an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Verdict {
    /// Error relative to the allowed one.
    pub(super) error: f64,
    /// Coefficients that are not negligible.
    pub(super) terms: usize,
}

/// Judge an element whose coefficients are known.
pub(super) fn judge(element: &Element, nodes: &Nodes) -> Verdict {
    let n = nodes.order + 1;
    let half = 0.5 * (element.end - element.start);
    let mut verdict = Verdict {
        error: 0.0,
        terms: 1,
    };
    for (d, c) in element.coefficients.chunks_exact(n).enumerate() {
        let scale = element.scale[d];
        let size = largest(c);
        // Rounding errors of values, distributed over coefficients and multiplied by k² in the
        // slope.
        let rounding = f64::EPSILON * size;
        let last = c[n - 1].abs().max(LAST_BUT_ONE * c[n - 2].abs());
        let (third, fourth) = (largest(&c[n / 2..3 * n / 4]), largest(&c[3 * n / 4..]));
        let sum = n as f64 * fourth * (fourth / third.max(f64::MIN_POSITIVE)).min(1.0);
        let tail = last.max(if fourth > 4.0 * rounding { sum } else { 0.0 }) - 4.0 * rounding;
        let slope: f64 = (1..n)
            .map(|k| {
                let square = (k * k) as f64;
                if k.is_multiple_of(2) {
                    -square * c[k]
                } else {
                    square * c[k]
                }
            })
            .sum();
        let noise = (n * n) as f64 * rounding;
        let defect = ((slope - half * element.f[d * n]).abs() - noise) * nodes.spread;
        let error = tail.max(defect).max(0.0) / (SHARE * scale);
        verdict.error = verdict.error.max(error);
        let above = c.iter().rposition(|c| c.abs() > NEGLIGIBLE * scale);
        verdict.terms = verdict.terms.max(above.map_or(1, |k| k + 1));
    }
    verdict
}

/// Factor for the length after an element with this error.
pub(super) fn factor(error: f64, order: usize) -> f64 {
    let wanted = (0.5 / error.max(1e-300)).powf(1.0 / order as f64);
    (SAFETY * wanted).clamp(SHORTER, LONGER)
}

/// The smallest order that is at least `wanted`, no more than `most`.
pub(super) fn order_for(wanted: usize, most: usize) -> usize {
    let found = ORDERS.iter().copied().find(|order| *order >= wanted);
    found.unwrap_or(most).min(most)
}

/// The order after an element of this order that needed so many terms.
pub(super) fn next_order(terms: usize, order: usize, most: usize) -> usize {
    let next = order_for(terms + SPARE + terms / SPARE_PART, most);
    // Nodes like those of the element before need no interpolation of the past.
    let is_near = next < order && order <= most && order as f64 <= ONE_LESS * next as f64;
    if is_near { order } else { next }
}

/// The largest order that pays: where calls are costly, nodes are almost free.
pub(super) fn preferred(rtol: f64, costly: bool) -> usize {
    let digits = -rtol.log10();
    let wanted = if costly {
        6.0 + 2.0 * digits
    } else {
        NODES.0 + NODES.1 * digits
    };
    order_for(wanted.ceil() as usize, COUPLED)
}

/// The same where the components are uncoupled, so that nodes cost less: for costly calls as many
/// as serve elements as long as delays often are, unless the work for nodes exceeds that of calls.
pub(super) fn preferred_uncoupled(rtol: f64, costly: bool, dim: usize) -> usize {
    if !costly {
        let wanted = UNCOUPLED.0 - UNCOUPLED.1 * rtol.log10();
        order_for(wanted.ceil() as usize, LARGEST)
    } else if dim <= LIGHT {
        LARGEST
    } else {
        preferred(rtol, costly)
    }
}
