//! The number of real roots in an interval: proved.
//!
//! On an interval of midpoint m and half-length r, Taylor's formula bounds g from below where it
//! has no root, and g′ where it has at most one; the signs at the ends then decide. Otherwise the
//! interval is divided. A double root, or two roots closer than double precision can tell, cannot
//! be decided this way and are reported as a root on the contour. Rounding: the half-length is
//! enlarged by 1e-12, the bounds of values carry 2 per cent to spare, moduli are within 4u.

use num_complex::Complex64;

use super::winding::{Walker, is_clear};
use crate::Error;
use crate::quasipoly::modulus;

/// Roots of h on the real interval `re`, at whose ends h is known not to be zero.
pub(super) fn count_real(walker: &mut Walker<'_>, re: (f64, f64)) -> Result<u64, Error> {
    let mut total = 0;
    let mut parts = vec![re];
    while let Some((low, high)) = parts.pop() {
        walker.pause()?;
        let middle = Complex64::new(low + 0.5 * (high - low), 0.0);
        // The middle is rounded, so the halves differ.
        let r = (high - middle.re).max(middle.re - low);
        walker.probe.refer_to_dominant(middle);
        let jet = walker.probe.jet(middle);
        let bend = walker.probe.curvature_around(modulus(middle) + r, r);
        let r = r * (1.0 + 1e-12);
        let slope = modulus(jet.slope);
        if modulus(jet.value) - jet.value_error > (slope + jet.slope_error) * r + 0.5 * bend * r * r
        {
            continue;
        }
        if slope - jet.slope_error > bend * r
            && let (Some(a), Some(b)) = (sign(walker, low), sign(walker, high))
        {
            total += u64::from(a != b);
            continue;
        }
        let Some(cut) = place_to_cut(walker, low, high) else {
            return Err(Error::Contour {
                place: middle,
                distance: 2.0 * (high - low).max(f64::EPSILON * modulus(middle)),
            });
        };
        parts.extend([(cut, high), (low, cut)]);
    }
    Ok(total)
}

/// Is h positive at `x`? `None` where rounding hides it.
fn sign(walker: &mut Walker<'_>, x: f64) -> Option<bool> {
    let s = Complex64::new(x, 0.0);
    // e^(x τ) is positive: the sign of g is that of h, whatever the reference.
    walker.probe.refer_to_dominant(s);
    let jet = walker.probe.jet(s);
    is_clear(&jet).then_some(jet.value.re > 0.0)
}

fn place_to_cut(walker: &mut Walker<'_>, low: f64, high: f64) -> Option<f64> {
    [0.4871, 0.5417, 0.4393, 0.6307, 0.3301, 0.75, 0.25]
        .into_iter()
        .find_map(|share| {
            let cut = low + share * (high - low);
            (low < cut && cut < high && sign(walker, cut).is_some()).then_some(cut)
        })
}
