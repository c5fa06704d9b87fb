//! No root right of a line Re s = x comes from infinity, and none has |s| beyond a radius W.
//!
//! Let n be the highest degree, a(p) the coefficient of sⁿ in the row of the smallest delay, b_j(p)
//! those of the others, d_j(p) ≥ 0 their delays relative to it, e_j = e^(−x d_j).
//! 1. If min |a| > Σ max |b_j e_j| over the box, the leading term of that row exceeds all others
//!    outside one disc, for Re s ≥ x and all p: the roots there are bounded, and as p moves their
//!    number changes only through roots on the edge of the specification. W is a radius for which
//!    min |a| > Σ max |a_k| W^(k−n) + Σ max |b_jk e_j| W^(k−n).
//! 2. For x = 0, only roots on the axis matter. On s = iw, powers of the same parity are collinear,
//!    the others perpendicular: |P_j| / wⁿ ≤ (A_j² + B_j²)^(1/2) with A_j, B_j the sums of |b_jk|
//!    w^(k−n) over n − k even and odd, and the first row is at least |a| − Σ |a_k| w^(k−n), n − k =
//!    2, 4, …. The former rises with w, the others fall: an inequality at W holds beyond.
//!    (Comparing moduli of whole rows, it holds from a far smaller W than one between the terms
//!    where chains lie close to the axis.)
//! 3. If Σ min |b_j e_j| > max |a|, all d_j > 0 and no two of them equal, infinitely many roots lie
//!    right of the line for every p, robustly: under arbitrarily small changes of the delays
//!    (Avellar and Hale 1980); with one b_j that exceeds all others and a, as it stands.
//!
//! Inequalities are tested with a relative margin of 1e-9, far above the rounding errors of such
//! sums.

use super::box_expansion::{BoxExpansion, ExpansionRow};
use crate::elementary::exp;

const MARGIN: f64 = 1e-9;

/// Ratio of the bounds at which the bisection for the radius ends.
const WIDTH: f64 = 1.05;

/// What is proved for large |s| over a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum UnboundedFrequency<const D: usize> {
    /// All members have infinitely many unstable roots.
    Endless,
    /// No member has a root on the edge beyond this |s|, and no root comes from infinity.
    Bounded(f64),
    /// Neither is proved; the contribution of each parameter to what is missing.
    Open([f64; D]),
}

/// Least and largest value of d_j − d_i over the box, including rounding errors.
fn gap<const D: usize>(
    from: &ExpansionRow<D>,
    to: &ExpansionRow<D>,
    half: &[f64; D],
) -> (f64, f64) {
    let centre = to.delay - from.delay;
    let mut spread = 0.0;
    let mut least = centre;
    for ((own, other), r) in to.slopes.iter().zip(&from.slopes).zip(half) {
        let reach = (own - other).abs() * r;
        spread += reach;
        least -= reach;
    }
    let rounding = 16.0 * f64::EPSILON * (from.size + to.size);
    // A single parameter, or a number, is never less than its range states.
    let plain = rounding > 0.0 && least.abs() <= rounding && to.is_plain() && from.is_plain();
    let least = if plain { 0.0 } else { least - rounding };
    (least, centre + spread + rounding)
}

impl<const D: usize> ExpansionRow<D> {
    /// Is this zero, or a positive multiple of one parameter?
    fn is_plain(&self) -> bool {
        let moving = self.slopes.iter().filter(|slope| **slope != 0.0).count();
        moving <= 1 && self.slopes.iter().all(|slope| *slope >= 0.0)
    }
}

/// Bounds on e^(−x d) for delays within a range.
fn weights(line: f64, gap: (f64, f64)) -> (f64, f64) {
    if line == 0.0 {
        return (1.0, 1.0);
    }
    let ends = (exp(-line * gap.0), exp(-line * gap.1));
    (
        ends.0.min(ends.1) * (1.0 - MARGIN),
        ends.0.max(ends.1) * (1.0 + MARGIN),
    )
}

/// Judge large |s| over a box, for roots right of Re s = `line`.
pub(crate) fn unbounded_frequency<const D: usize>(
    expansion: &BoxExpansion<D>,
    degree: usize,
    line: f64,
) -> UnboundedFrequency<D> {
    let half = &expansion.half;
    let smallest = expansion
        .rows
        .iter()
        .enumerate()
        .min_by(|a, b| a.1.delay.total_cmp(&b.1.delay));
    let Some((own, first)) = smallest else {
        return UnboundedFrequency::Open([0.0; D]);
    };
    let leading = |row: &ExpansionRow<D>| {
        let found = row.coefficients.get(degree);
        found.map_or((0.0, 0.0), |c| c.modulus(half))
    };
    let (least, most) = leading(first);
    let (mut others_least, mut others_most) = (0.0, 0.0);
    let mut ordered = true;
    let mut apart = true;
    let mut chains: Vec<&ExpansionRow<D>> = Vec::new();
    let mut heaviest = vec![1.0; expansion.rows.len()];
    for (index, row) in expansion.rows.iter().enumerate() {
        if index == own {
            continue;
        }
        let away = gap(first, row, half);
        ordered &= away.0 >= 0.0;
        let (low, high) = leading(row);
        let (lightest, heavy) = weights(line, away);
        if let Some(weight) = heaviest.get_mut(index) {
            *weight = heavy;
        }
        if high > 0.0 {
            apart &= away.0 > 0.0;
            others_least += low * lightest;
            others_most += high * heavy;
            chains.push(row);
        }
    }
    if least * (1.0 - MARGIN) > others_most * (1.0 + MARGIN) && ordered {
        return match radius(expansion, own, degree, &heaviest, line == 0.0) {
            Some(radius) => UnboundedFrequency::Bounded(radius),
            None => UnboundedFrequency::Open(shares(expansion, degree)),
        };
    }
    if ordered && apart && others_least * (1.0 - MARGIN) > most * (1.0 + MARGIN) {
        let separate = chains.iter().enumerate().all(|(i, one)| {
            chains.iter().skip(i + 1).all(|other| {
                let (low, high) = gap(one, other, half);
                low > 0.0 || high < 0.0
            })
        });
        if separate {
            return UnboundedFrequency::Endless;
        }
    }
    UnboundedFrequency::Open(shares(expansion, degree))
}

/// The contribution of each parameter to the uncertainty of the leading terms, or of the order of
/// the delays.
fn shares<const D: usize>(expansion: &BoxExpansion<D>, degree: usize) -> [f64; D] {
    let leading = |i: usize| {
        let slope = |row: &ExpansionRow<D>| {
            row.coefficients
                .get(degree)
                .map_or(0.0, |c| c.most_slopes[i])
        };
        expansion.rows.iter().map(slope).sum::<f64>() * expansion.half[i]
    };
    let shares = std::array::from_fn(leading);
    if shares.iter().any(|share| *share > 0.0) {
        return shares;
    }
    std::array::from_fn(|i| {
        expansion.rows.iter().map(|row| row.rates[i]).sum::<f64>() * expansion.half[i]
    })
}

/// The radius W, on the `axis` that of item 2, within a few per cent of the least one.
fn radius<const D: usize>(
    expansion: &BoxExpansion<D>,
    own: usize,
    degree: usize,
    heaviest: &[f64],
    axis: bool,
) -> Option<f64> {
    let holds = |w: f64| {
        let (mut first, mut others) = (0.0, 0.0);
        for (index, (row, weight)) in expansion.rows.iter().zip(heaviest).enumerate() {
            // Sums over the powers that are collinear, and over those perpendicular to them.
            let (mut same, mut other) = (0.0, 0.0);
            for (k, c) in row.coefficients.iter().enumerate() {
                let (low, high) = c.modulus(&expansion.half);
                let power = (k..degree).fold(1.0, |power, _| power / w);
                let collinear = !axis || (degree - k).is_multiple_of(2);
                let part = match (index == own, collinear) {
                    (true, true) if k == degree => low,
                    (true, true) => -high * power,
                    (true, false) => 0.0,
                    (false, _) => weight * high * power,
                };
                if collinear {
                    same += part;
                } else {
                    other += part;
                }
            }
            if index == own {
                first = same;
            } else {
                others += (same * same + other * other).sqrt();
            }
        }
        first * (1.0 - MARGIN) > others * (1.0 + MARGIN)
    };
    if degree == 0 {
        return holds(1.0).then_some(0.0);
    }
    let (mut low, mut high) = (1.0, 1.0);
    if holds(1.0) {
        for _ in 0..60 {
            low *= 0.25;
            if !holds(low) {
                break;
            }
            high = low;
        }
    } else {
        for step in 0.. {
            high *= 4.0;
            if holds(high) {
                break;
            }
            low = high;
            if step > 150 {
                return None;
            }
        }
    }
    while high > WIDTH * low {
        let middle = (low * high).sqrt();
        if holds(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}
