//! Regions whose open sides are closed by proved bounds.

use super::bounds;
use super::bounds::Bound;
use crate::Error;
use crate::quasipoly::{Kind, QuasiPolynomial};
use crate::roots::chains::chain_abscissa;
use crate::roots::region::Region;

/// Factor on a proved radius that keeps roots off the edge itself.
pub(crate) const EDGE_MARGIN: f64 = 1.01;

/// Least radius, for functions with all roots at 0.
pub(crate) const LEAST_RADIUS: f64 = 1e-100;

/// A region whose open sides are closed by proved bounds, reduced to the upper half plane as far as
/// symmetry allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Closed {
    pub(crate) re: (f64, f64),
    /// Height of the part that is symmetric about the real axis, if there is one.
    pub(crate) symmetric: Option<f64>,
    /// Imaginary parts of the part above it, if there is one.
    pub(crate) above: Option<(f64, f64)>,
    /// Is the lower edge the real axis? Roots below it then do not belong to the region.
    pub(crate) half: bool,
    /// Was the region mirrored at the real axis?
    pub(crate) mirrored: bool,
}

impl Closed {
    /// Split the ranges into parts; `None` when they are empty.
    pub(crate) fn of(re: (f64, f64), im: (f64, f64), mirrored: bool) -> Option<Self> {
        if re.0 >= re.1 || im.0 >= im.1 {
            return None;
        }
        let symmetric = (im.0 <= 0.0).then_some(if im.0 == 0.0 { im.1 } else { -im.0 });
        let above = match symmetric {
            None => Some(im),
            Some(height) => (height < im.1).then_some((height, im.1)),
        };
        Some(Self {
            re,
            symmetric,
            above,
            half: im.0 == 0.0,
            mirrored,
        })
    }
}

/// Close the open sides of `region`, after mirroring it at the real axis if most of it lies below.
/// The result may be empty.
///
/// # Errors
/// [`Error::Argument`] for a region that cannot be shown to hold finitely many roots.
pub(crate) fn closed_sides(
    h: &QuasiPolynomial,
    region: &Region,
    bound: Bound,
) -> Result<Region, Error> {
    let Region { mut re, mut im } = if is_low(region) {
        region.mirrored()
    } else {
        *region
    };
    if im.0.is_infinite() || im.1.is_infinite() {
        let radius = bound(h, re)
            .map(|d| d.radius)
            .ok_or_else(|| endless(h, re))?;
        // A margin keeps roots off the edge itself.
        let radius = EDGE_MARGIN * radius.max(LEAST_RADIUS);
        im = (im.0.max(-radius), im.1.min(radius));
        re = (re.0.max(-radius), re.1.min(radius));
    }
    let height = im.0.abs().max(im.1.abs());
    if re.1.is_infinite() || region.re.1.is_infinite() {
        // Usually closer than the radius, which chains at large |Im s| may make large.
        re.1 = re.1.min(bounds::right_edge(h, height));
    }
    if re.0.is_infinite() {
        re.0 = bounds::left_edge(h, height);
    }
    refuse_if!(
        !(re.0.is_finite() && re.1.is_finite()),
        "double precision cannot bound the roots on the open side: close the region"
    );
    Ok(Region { re, im })
}

/// Does the region lie more below the real axis than above it?
fn is_low(region: &Region) -> bool {
    region.im.1 + region.im.0 < 0.0
}

/// Close the open sides of `region`; `None` when it is proved to hold no roots.
///
/// # Errors
/// As [`closed_sides`].
pub(crate) fn close(
    h: &QuasiPolynomial,
    region: &Region,
    bound: Bound,
) -> Result<Option<Closed>, Error> {
    let Region { re, im } = closed_sides(h, region, bound)?;
    Ok(Closed::of(re, im, is_low(region)))
}

pub(crate) fn endless(h: &QuasiPolynomial, re: (f64, f64)) -> Error {
    let reason = match h.kind() {
        Kind::Polynomial => {
            "the sizes of its coefficients differ too much for double precision".to_owned()
        }
        Kind::Retarded if re.0 >= 0.0 => {
            "the sizes of its coefficients differ too much for double precision".to_owned()
        }
        Kind::Retarded => format!(
            "the real part is open to the left or reaches far left ({})",
            re.0
        ),
        Kind::Neutral | Kind::Difference => {
            format!(
                "a chain of roots lies at or left of Re s = {:.6}",
                chain_abscissa(h)
            )
        }
        Kind::Advanced => "the equation is advanced".to_owned(),
    };
    Error::argument(format!(
        "the region re=({}, {}) with an open imaginary part may contain infinitely many roots: \
         {reason}. Give both ends of im, or move re, or ask rightmost(n) for the n rightmost roots",
        re.0, re.1
    ))
}
