//! Roots on the edge of a region, or so close to it that arg h cannot be followed along the edge.
//!
//! The edge is never moved silently. The region is widened slightly and all roots of the wider one
//! are located, each in a disc proved to hold it. Every disc then lies inside the region, outside
//! it, or meets an edge. If none meets an edge, those inside are the proved answer. Otherwise
//! double precision cannot decide: the caller states to which side such roots belong, or receives
//! an error with their locations. An edge on the real axis is no obstacle for simple real roots,
//! which lie exactly on it and belong to the region; several roots in a disc may be pairs beside
//! it.

use super::all_roots::roots;
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::counting::count;
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;
use crate::{Error, Task};

/// Relative widths by which a region is widened, tried in this order until its edges are free of
/// roots.
const MARGINS: [f64; 7] = [1e-6, 8e-6, 6e-5, 5e-4, 4e-3, 3e-2, 0.1];

/// To which side roots on an edge belong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Edge {
    /// To neither side: such roots are an error that names them.
    #[default]
    Refused,
    /// To the inside: the region is closed.
    Inside,
    /// To the outside: the region is open.
    Outside,
}

/// As [`count`], roots on the edge being treated as `edge` says.
///
/// # Errors
/// As [`count`], but [`Error::OnEdge`] for roots on the edge, where they are refused and can be
/// located.
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::{Edge, Region, count_with_edge}};
/// // s² + 4 has roots at ±2i.
/// let h = QuasiPolynomial::new(vec![vec![4.0, 0.0, 1.0]], vec![0.0])?;
/// let region = Region::new((0.0, 1.0), (-3.0, 3.0))?;
/// assert_eq!(count_with_edge(&h, &region, Edge::Inside, &Task::new())?, 2);
/// assert!(count_with_edge(&h, &region, Edge::Refused, &Task::new()).is_err());
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn count_with_edge(
    h: &QuasiPolynomial,
    region: &Region,
    edge: Edge,
    task: &Task,
) -> Result<u64, Error> {
    match count(h, region, task) {
        Err(error @ Error::Contour { .. }) => {
            sorted(h, region, edge, error, task).map(|set| set.counted)
        }
        known => known,
    }
}

/// As [`roots`], roots on the edge being treated as `edge` says.
///
/// # Errors
/// As [`roots`], but [`Error::OnEdge`] for roots on the edge, where they are refused and can be
/// located.
pub fn roots_with_edge(
    h: &QuasiPolynomial,
    region: &Region,
    edge: Edge,
    task: &Task,
) -> Result<RootSet, Error> {
    match roots(h, region, task) {
        Err(error @ Error::Contour { .. }) => sorted(h, region, edge, error, task),
        known => known,
    }
}

/// Where a disc lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Inside,
    OnEdge,
    Outside,
}

/// The roots of `region`, selected from those of a wider one; `refusal` where that fails.
fn sorted(
    h: &QuasiPolynomial,
    region: &Region,
    edge: Edge,
    refusal: Error,
    task: &Task,
) -> Result<RootSet, Error> {
    for margin in MARGINS {
        let set = match roots(h, &widened(h, region, margin), task) {
            Ok(set) => set,
            Err(Error::Contour { .. }) => continue,
            Err(error) if error.ends_all() => return Err(error),
            // For example, a chain of roots within the margin.
            Err(_) => return Err(refusal),
        };
        return within(&set, region, edge);
    }
    Err(refusal)
}

/// The roots of `region` among those of a set that has them all.
///
/// # Errors
/// [`Error::OnEdge`] for roots on the edge where they are refused.
pub(crate) fn within(set: &RootSet, region: &Region, edge: Edge) -> Result<RootSet, Error> {
    let sides: Vec<Side> = (0..set.roots.len()).map(|i| side(set, i, region)).collect();
    let wanted =
        |side: &Side| *side == Side::Inside || (*side == Side::OnEdge && edge == Edge::Inside);
    if edge == Edge::Refused && sides.contains(&Side::OnEdge) {
        let listed = set.roots.iter().zip(&set.radii).zip(&set.multiplicities);
        let on_edge = listed
            .zip(&sides)
            .filter(|(_, side)| **side == Side::OnEdge)
            .map(|(((root, radius), multiplicity), _)| (*root, *radius, *multiplicity));
        return Err(Error::OnEdge {
            inside: set
                .part(*region, |i| sides.get(i) == Some(&Side::Inside))
                .counted,
            roots: on_edge.collect(),
        });
    }
    Ok(set.part(*region, |i| sides.get(i).is_some_and(wanted)))
}

/// The region with its finite edges moved out by `margin` times the smaller of its shorter side and
/// the spacing of chains. An edge on the real axis stays where it is.
fn widened(h: &QuasiPolynomial, region: &Region, margin: f64) -> Region {
    let Region { re, im } = *region;
    let delays = h.delays();
    let span = delays.last().copied().unwrap_or(0.0) - delays.first().copied().unwrap_or(0.0);
    let spacing = std::f64::consts::TAU / span;
    let size = (re.1 - re.0).min(im.1 - im.0).min(spacing);
    let size = if size.is_finite() {
        size
    } else {
        // The region is a half plane or a quarter plane.
        [re.0, re.1, im.0, im.1]
            .into_iter()
            .filter(|end| end.is_finite())
            .fold(1.0, |most: f64, end| most.max(end.abs()))
    };
    let out = margin * size;
    let level = |end: f64, way: f64| if end == 0.0 { end } else { end + way * out };
    Region {
        re: (re.0 - out, re.1 + out),
        im: (level(im.0, -1.0), level(im.1, 1.0)),
    }
}

/// Where the `i`-th disc lies relative to `region`.
fn side(set: &RootSet, i: usize, region: &Region) -> Side {
    let (Some(center), Some(radius), Some(multiplicity)) = (
        set.roots.get(i),
        set.radii.get(i),
        set.multiplicities.get(i),
    ) else {
        return Side::Outside;
    };
    let Region { re, im } = *region;
    let half = im.0 == 0.0 || im.1 == 0.0;
    let several = *multiplicity > 1 && *radius > 0.0;
    let (low, high) = if center.im == 0.0 && half && !several {
        (f64::INFINITY, f64::INFINITY)
    } else {
        (center.im - im.0, im.1 - center.im)
    };
    // The rounding error of a difference that decides is less than u times the larger number.
    let slack = radius + f64::EPSILON * modulus(*center);
    let slack = if *radius == 0.0 { 0.0 } else { slack };
    let gaps = [center.re - re.0, re.1 - center.re, low, high];
    if gaps.iter().any(|gap| *gap < -slack) {
        Side::Outside
    } else if gaps.iter().any(|gap| *gap <= slack) {
        Side::OnEdge
    } else {
        Side::Inside
    }
}
