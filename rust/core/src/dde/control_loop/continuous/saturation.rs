//! Where a polynomial on [0, 1] lies within bounds, and where beyond.
//!
//! The zeros of p less a bound are isolated in the Bernstein basis: the number of sign changes of the
//! coefficients bounds the number of zeros and equals it when it is 0 or 1 (Descartes' rule), so an
//! interval with more is halved (de Casteljau) and one with a single change is bisected to the last
//! bit. No crossing is missed. A contact that leaves a bound for less than 2⁻⁴⁰ of the interval
//! is no crossing, and neither are rounding errors around the bound. Crossings are those of the
//! values and have no slope: the limited command is continuous there, so that a shift of a crossing
//! changes the response in second order only.

use crate::dde::scalar::Scalar;

use crate::dde::control_loop::level_crossings::{in_order, value_at};
use crate::dde::control_loop::linear_loop::Bounds;
use crate::dde::control_loop::series::Series;

/// Where the command is relative to a bound: −1 below the least, 1 above the greatest, 0 within.
pub(super) type Side = i8;

/// The side of a command; 0 where there are no bounds.
pub(super) fn side_of(u: f64, bounds: Option<Bounds>) -> Side {
    bounds.map_or(0, |(low, high)| Side::from(u > high) - Side::from(u < low))
}

/// An interval of [0, 1] on one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stretch {
    pub(super) side: Side,
    pub(super) start: f64,
    pub(super) end: f64,
}

/// The intervals of `u` on [0, 1], in order; neighbours differ in their side.
pub(super) fn stretches<S: Scalar>(u: &Series<S>, bounds: Bounds, out: &mut Vec<Stretch>) {
    out.clear();
    let whole = |side| Stretch {
        side,
        start: 0.0,
        end: 1.0,
    };
    let (low, high) = u.range();
    if high <= bounds.1 && low >= bounds.0 {
        return out.push(whole(0));
    }
    if low > bounds.1 {
        return out.push(whole(1));
    }
    if high < bounds.0 {
        return out.push(whole(-1));
    }
    let finite = [bounds.1, bounds.0].into_iter().filter(|b| b.is_finite());
    let mut zeros = in_order(u, finite, Vec::new());
    zeros.push(1.0);
    let mut start = 0.0;
    for end in zeros {
        if end <= start {
            continue;
        }
        let side = side_of(value_at(u, 0.5 * (start + end)), Some(bounds));
        match out.last_mut() {
            Some(last) if last.side == side => last.end = end,
            _ => out.push(Stretch { side, start, end }),
        }
        start = end;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Π (σ − root).
    fn with_roots(roots: &[f64]) -> Series {
        let mut out = vec![1.0];
        for root in roots {
            out.push(0.0);
            for i in (0..out.len()).rev() {
                out[i] = if i > 0 { out[i - 1] } else { 0.0 } - root * out[i];
            }
        }
        Series::of(&out)
    }

    fn found(u: &Series, limit: f64) -> Vec<Stretch> {
        let mut out = Vec::new();
        stretches(u, (-limit, limit), &mut out);
        out
    }

    #[test]
    fn a_line_through_both_limits_is_cut_at_both() {
        let modes = found(&Series::of(&[-4.0, 8.0]), 1.0);
        let expected = [(-1, 0.0, 0.375), (0, 0.375, 0.625), (1, 0.625, 1.0)];
        assert_eq!(modes.len(), 3);
        for (stretch, (side, start, end)) in modes.iter().zip(expected) {
            assert_eq!(stretch.side, side);
            assert!((stretch.start - start).abs() < 1e-16 && (stretch.end - end).abs() < 1e-16);
        }
    }

    #[test]
    fn touching_the_limit_is_no_crossing() {
        // 1 − (σ − 1/3)², up to rounding.
        let modes = found(&Series::of(&[1.0 - 1.0 / 9.0, 2.0 / 3.0, -1.0]), 1.0);
        assert!(
            modes
                .iter()
                .all(|stretch| stretch.side == 0 || stretch.end - stretch.start < 1e-7)
        );
    }

    #[test]
    fn a_peak_just_over_the_limit_is_found() {
        // 1 + 1e-12 − (σ − 1/3)² is over the limit for 2e-6 around 1/3.
        let modes = found(
            &Series::of(&[1.0 + 1e-12 - 1.0 / 9.0, 2.0 / 3.0, -1.0]),
            1.0,
        );
        assert_eq!(modes.len(), 3);
        assert!((modes[1].end - modes[1].start - 2e-6).abs() < 1e-9);
    }

    #[test]
    fn standing_on_the_limit_is_free() {
        assert_eq!(found(&Series::of(&[1.0]), 1.0).len(), 1);
        assert_eq!(found(&Series::of(&[1.0, 1e-17, -1e-17]), 1.0).len(), 1);
        assert_eq!(found(&Series::of(&[1.0, -0.5]), 1.0)[0].side, 0);
    }

    proptest! {
        /// Every root at some distance from its neighbours is found, to its conditioning.
        #[test]
        fn all_roots_are_cuts(mut roots in prop::collection::vec(0.0_f64..1.0, 1..9)) {
            roots.sort_by(f64::total_cmp);
            prop_assume!(roots.windows(2).all(|pair| pair[1] - pair[0] > 0.02));
            prop_assume!(roots[0] > 1e-3 && roots[roots.len() - 1] < 0.999);
            let u = with_roots(&roots);
            let mut shifted = u;
            shifted.coefficients[0] += 1e3;
            let modes = found(&shifted, 1e3);
            prop_assert_eq!(modes.len(), roots.len() + 1);
            for (stretch, root) in modes[1..].iter().zip(&roots) {
                let slope: f64 = roots
                    .iter()
                    .filter(|other| *other != root)
                    .map(|other| (root - other).abs())
                    .product();
                // The rounding error of the shift by 1000 over the slope at the root.
                prop_assert!((stretch.start - root).abs() < 1e-11 / slope);
            }
        }

        /// On either side of every crossing the mode is that of the polynomial.
        #[test]
        fn modes_are_those_of_the_values(
            coefficients in prop::collection::vec(-3.0..3.0, 1..12),
            sigmas in prop::collection::vec(0.0_f64..1.0, 40),
        ) {
            let u = Series::of(&coefficients);
            let modes = found(&u, 1.0);
            prop_assert_eq!(modes[0].start, 0.0);
            prop_assert_eq!(modes[modes.len() - 1].end, 1.0);
            prop_assert!(modes.windows(2).all(|p| p[0].end == p[1].start && p[0].side != p[1].side));
            for sigma in sigmas {
                let value = u.at(sigma);
                prop_assume!((value.abs() - 1.0).abs() > 1e-9);
                let here = modes.iter().find(|m| sigma <= m.end).map(|m| m.side);
                prop_assert_eq!(here, Some(side_of(value, Some((-1.0, 1.0)))));
            }
        }
    }
}
