//! The number of real roots in an interval: proved.
//!
//! On an interval of midpoint m and half-length r, Taylor's formula bounds g from below where it
//! has no root, and g′ where it has at most one; the signs at the ends then decide. Otherwise the
//! interval is divided. A double root, or two roots that double-double arithmetic cannot separate,
//! cannot be decided this way and are reported as a root on the contour. Rounding: SHARE leaves a
//! thousandth of every value; moduli, products and sums have errors of 12 u.

use num_complex::Complex64;

use super::segment::{CLUSTER_SUSPECTED, Segment, TRIFLE};
use super::taylor_bound::TaylorBound;
use super::winding::{Walker, is_clear, is_finite};
use crate::Error;
use crate::quasipoly::{Jet, modulus};

/// Positions of a cut, as shares of an interval, in the order in which they are tried.
const CUTS: [f64; 7] = [0.4871, 0.5417, 0.4393, 0.6307, 0.3301, 0.75, 0.25];

/// Covers the rounding errors of the bound on the slope.
const ENLARGED: f64 = 1.0 + 1e-12;

/// Largest share of a value, or of a slope, that its change over the interval may take. The rest
/// covers rounding errors.
const SHARE: f64 = 0.999;

/// A part of the real axis with a proved number of roots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RealPart {
    /// No root.
    Empty(Segment),
    /// g′ has no zero, so the signs at the ends tell whether there is a root.
    Monotone {
        /// Where it begins.
        start: f64,
        /// Where it ends.
        end: f64,
        /// The point where g′ was evaluated.
        middle: f64,
        /// Index of the delay τ_c with which g = h e^(s τ_c).
        reference: usize,
        /// g′(middle), but for `error`.
        slope: f64,
        /// Bound on the error of `slope`.
        error: f64,
        /// Bound on |g″| in the disc about the middle that reaches to both ends.
        bend: f64,
    },
}

/// The number of roots of h on the real interval `re`, at whose ends h is known not to be zero.
/// `visit` receives the parts in ascending order. `curved` is the share of the bound on |g″| r that
/// is added to the slope: one half by Taylor's formula, all of it where the parts have to state a
/// bound on the slope in their disc. The survey gives up after `limit` evaluations, because next to
/// a multiple root the division does not end.
pub(crate) fn survey_real(
    walker: &mut Walker<'_>,
    re: (f64, f64),
    (curved, limit): (f64, u64),
    mut visit: impl FnMut(RealPart),
) -> Result<u64, Error> {
    let mut total = 0;
    walker.probe.refer_to_dominant(re.0.into());
    let mut parts = vec![((re.0, sign(walker, re.0)), (re.1, sign(walker, re.1)))];
    let begun = walker.probe.evaluations();
    while let Some(((low, at_low), (high, at_high))) = parts.pop() {
        walker.pause()?;
        let middle = Complex64::new(low + 0.5 * (high - low), 0.0);
        if walker.probe.evaluations() - begun > limit {
            return Err(Error::contour(middle, high - low));
        }
        // The middle is rounded, so that the halves differ in length.
        let r = (high - middle.re).max(middle.re - low);
        let jet = referred_jet(walker, middle.re);
        let reference = walker.probe.reference();
        let bend = walker.probe.curvature_around(modulus(middle) + r, r);
        let slope = modulus(jet.slope);
        let trifle = TRIFLE * modulus(jet.value) / r;
        let flat = slope + jet.slope_error;
        let mut steepest = (flat + curved * bend * r) * ENLARGED + trifle;
        let margin = SHARE * modulus(jet.value) - jet.value_error;
        // Where no parts have to be stated, the tests below end the survey with less work.
        let cluster_suspected =
            curved == 1.0 && bend * r > flat / CLUSTER_SUSPECTED && is_clear(&jet);
        if cluster_suspected && steepest * r >= margin {
            steepest = TaylorBound::new(&walker.probe, middle).slope(r) + trifle;
        }
        if steepest * r < margin {
            visit(RealPart::Empty(Segment {
                start: low.into(),
                end: high.into(),
                middle,
                reference,
                value: jet.value,
                error: jet.value_error,
                slope: steepest,
            }));
            continue;
        }
        if bend * r < SHARE * slope - jet.slope_error
            && let (Some(a), Some(b)) = (at_low, at_high)
        {
            total += u64::from(a != b);
            visit(RealPart::Monotone {
                start: low,
                end: high,
                middle: middle.re,
                reference,
                slope: jet.slope.re,
                error: jet.slope_error,
                bend: bend + TRIFLE * slope / r,
            });
            continue;
        }
        let Some(cut) = place_to_cut(walker, low, high) else {
            return Err(Error::contour(
                middle,
                2.0 * (high - low).max(f64::EPSILON * modulus(middle)),
            ));
        };
        parts.extend([(cut, (high, at_high)), ((low, at_low), cut)]);
    }
    Ok(total)
}

/// The jet at `x`, relative to a term that no other term exceeds by much.
fn referred_jet(walker: &mut Walker<'_>, x: f64) -> Jet {
    let s = Complex64::new(x, 0.0);
    let jet = walker.jet(s);
    if let Some(larger) = jet.overtaken_by {
        walker.probe.refer_to(larger);
    } else if is_finite(&jet) {
        return jet;
    } else {
        walker.probe.refer_to_dominant(s);
    }
    walker.jet(s)
}

/// Is h positive at `x`? `None` where rounding errors hide the sign.
fn sign(walker: &mut Walker<'_>, x: f64) -> Option<bool> {
    // e^(x τ) is positive, so that g has the sign of h for every reference.
    let jet = referred_jet(walker, x);
    is_clear(&jet).then_some(jet.value.re > 0.0)
}

/// A point between the ends at which the sign is known, with that sign.
fn place_to_cut(walker: &mut Walker<'_>, low: f64, high: f64) -> Option<(f64, Option<bool>)> {
    CUTS.into_iter().find_map(|share| {
        let cut = low + share * (high - low);
        let positive = (low < cut && cut < high).then(|| sign(walker, cut))?;
        positive.map(|_| (cut, positive))
    })
}
