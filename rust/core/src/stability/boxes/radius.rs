//! How far may parameters move away from a point before stability is lost?
//!
//! The distance of p from the point is the largest |p_i − point_i| / scale_i: balls are boxes.
//! Boxes are judged in order of their distance. A stable box needs no more work; a box proved to be
//! unstable bounds the radius by its nearest point, a witness; any other box is halved. No unstable
//! member is nearer than the nearest box that is left, so the radius lies between its distance and
//! that of the witness. Witnesses are also searched for slightly beyond the nearest boxes, since
//! these shrink towards the boundary of stability. Lower bounds on distances are reduced by 8 u,
//! which exceeds their rounding errors.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::box_expansion::{BoxExpansion, Range};
use super::division::{check, reduce};
use super::prove::{Claim, Verdict, judge_box};
use super::reduced::Reduced;
use crate::stability::cell::{UNKNOWN, judge};
use crate::stability::family::Family;
use crate::stability::specification::Specification;
use crate::{Error, Task};

/// The first radius tried, the factor to the next one, and the number of radii.
const FIRST: f64 = 1.0 / 64.0;
const FACTOR: f64 = 4.0;
const TRIALS: usize = 11;

/// Upper limit on new boxes between two searches for a witness.
const TRY_EVERY: usize = 16;

/// Result of [`stability_radius`].
#[derive(Debug, Clone, PartialEq)]
pub struct Radius {
    /// Every member within this distance is proved to be stable.
    pub radius: f64,
    /// Upper bound on the radius: a witness lies at this distance, or the parameters cannot move
    /// further. Infinite where neither was found.
    pub upper: f64,
    /// The nearest member found that is not stable.
    pub witness: Option<Vec<f64>>,
}

/// A box on the heap, ordered so that the nearest one is on top.
struct Near<const D: usize> {
    distance: f64,
    order: usize,
    claim: Claim<D>,
}

impl<const D: usize> PartialEq for Near<D> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<const D: usize> Eq for Near<D> {}

impl<const D: usize> PartialOrd for Near<D> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<const D: usize> Ord for Near<D> {
    fn cmp(&self, other: &Self) -> Ordering {
        let nearer = other.distance.total_cmp(&self.distance);
        nearer.then(other.order.cmp(&self.order))
    }
}

/// The distance from `point`, in units of `scales`, within which every member is stable.
///
/// One scale for each parameter, 0 for those that do not move. `tol` is the relative width of the
/// interval from `radius` to `upper`, `boxes` the upper limit on the boxes of each trial.
/// Parameters that delays depend on stay at or above 0.
///
/// # Errors
/// [`Error::Argument`] where the member at `point` is not stable or cannot be judged, for scales
/// that are not finite or negative, or more than three above 0; [`Error::Interrupted`].
pub fn stability_radius(
    family: &Family,
    point: &[f64],
    scales: &[f64],
    (tol, boxes): (f64, usize),
    task: &Task,
) -> Result<Radius, Error> {
    refuse_if!(
        scales.len() != point.len(),
        "{} scales are given for {} parameters: give one scale for each parameter",
        scales.len(),
        point.len()
    );
    if let Some(scale) = scales.iter().find(|s| !(s.is_finite() && **s >= 0.0)) {
        refuse!("a scale is {scale}, but scales must be finite and not negative");
    }
    let cell = judge(&family.at(point)?, Specification::default(), false, task)?;
    refuse_if!(
        cell.unstable != 0,
        "at this point the equation is not stable, or too close to the stability boundary to \
         decide: start from a stable point"
    );
    refuse_if!(
        scales.iter().all(|scale| *scale == 0.0),
        "all scales are 0: give each parameter that may change a scale above 0"
    );
    let floored = |index: usize| {
        let slope = |delay: &crate::stability::family::Affine| delay.slopes.get(index).copied();
        family
            .rows()
            .any(|(delay, _)| slope(delay).unwrap_or(0.0) != 0.0)
    };
    let ranges = |radius: f64| -> Vec<(f64, f64)> {
        let ends = point.iter().zip(scales).enumerate();
        ends.map(|(index, (value, scale))| {
            // Rounded outwards by the errors of the products and sums.
            let reach = radius * scale * (1.0 + 4.0 * f64::EPSILON);
            let margin = if *scale == 0.0 {
                0.0
            } else {
                f64::EPSILON * value.abs()
            };
            let low = value - reach - margin;
            let low = if floored(index) {
                low.max(0.0).min(*value)
            } else {
                low
            };
            (low, value + reach + margin)
        })
        .collect()
    };
    let mut best = Radius {
        radius: 0.0,
        upper: f64::INFINITY,
        witness: None,
    };
    let mut radius = FIRST;
    for _ in 0..TRIALS {
        let mut wanted = ranges(radius);
        let mut last = false;
        if family.check_delays(&wanted).is_err() {
            // A delay would become negative: only up to there.
            let (mut low, mut high) = (best.radius, radius);
            for _ in 0..50 {
                let middle = 0.5 * (low + high);
                if family.check_delays(&ranges(middle)).is_ok() {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            (radius, wanted, last) = (low, ranges(low), true);
        }
        let Ok(varying) = check(family, &wanted) else {
            if radius == FIRST {
                check(family, &wanted)?;
            }
            break;
        };
        let place = Place {
            point,
            scales,
            varying: &varying,
            radius,
            tol,
            boxes,
        };
        best = match varying.len() {
            0 | 1 => place.search::<1>(family, &wanted, task)?,
            2 => place.search::<2>(family, &wanted, task)?,
            _ => place.search::<3>(family, &wanted, task)?,
        };
        if best.radius < radius {
            break;
        }
        if last {
            best.upper = radius;
            break;
        }
        radius *= FACTOR;
    }
    Ok(best)
}

/// The point, the scales and the limits of a search.
struct Place<'a> {
    point: &'a [f64],
    scales: &'a [f64],
    varying: &'a [usize],
    radius: f64,
    tol: f64,
    boxes: usize,
}

impl Place<'_> {
    /// The point, and the nearest point to it of a box with its distance.
    fn nearest<const D: usize>(&self, range: &Range<D>) -> ([f64; D], f64) {
        let mut nearest = range.low;
        let mut distance = 0.0f64;
        for (slot, (index, (low, high))) in nearest
            .iter_mut()
            .zip(self.varying.iter().zip(range.low.iter().zip(&range.high)))
        {
            let value = self.point.get(*index).copied().unwrap_or(0.0);
            let scale = self.scales.get(*index).copied().unwrap_or(1.0);
            *slot = value.max(*low).min(*high);
            distance = distance.max((*slot - value).abs() / scale);
        }
        (nearest, distance)
    }

    /// The nearest point of a box, moved away from the point by a share of the tolerance.
    fn moved_outwards<const D: usize>(&self, range: &Range<D>) -> [f64; D] {
        let mut place = self.nearest(range).0;
        for (slot, index) in place.iter_mut().zip(self.varying) {
            let value = self.point.get(*index).copied().unwrap_or(0.0);
            *slot += 0.5 * self.tol.min(1.0) * (*slot - value);
        }
        place
    }

    fn distance(&self, values: &[f64]) -> f64 {
        let ends = values.iter().zip(self.point).zip(self.scales);
        let distances = ends.filter(|(_, scale)| **scale > 0.0);
        distances.fold(0.0, |most: f64, ((to, from), scale)| {
            most.max((to - from).abs() / scale)
        })
    }

    fn search<const D: usize>(
        &self,
        family: &Family,
        ranges: &[(f64, f64)],
        task: &Task,
    ) -> Result<Radius, Error> {
        let (reduced, whole): (Reduced<'_, D>, _) = reduce(family, ranges, self.varying)?;
        let mut expansion = BoxExpansion::new(&reduced);
        let mut heap = BinaryHeap::from([Near {
            distance: 0.0,
            order: 0,
            claim: Claim::new(whole),
        }]);
        let mut order = 0;
        // The nearest box that cannot be judged.
        let mut barrier = self.radius;
        let (mut upper, mut witness) = (f64::INFINITY, None);
        let mut tried = (0.0, 0);
        while let Some(near) = heap.peek() {
            let bound = near.distance;
            if bound >= upper * (1.0 - self.tol) || bound >= barrier || order >= self.boxes {
                break;
            }
            let Some(Near { claim, .. }) = heap.pop() else {
                break;
            };
            task.advance(1);
            if bound > tried.0 * (1.0 + 0.25 * self.tol) || order >= tried.1 + TRY_EVERY {
                tried = (bound, order);
                let values = reduced.values_at(&self.moved_outwards(&claim.range));
                let known = family
                    .at(&values)
                    .map(|h| judge(&h, Specification::default(), false, task));
                if let Ok(cell) = known
                    && !matches!(cell?.unstable, 0 | UNKNOWN)
                {
                    let distance = self.distance(&values);
                    if distance < upper {
                        (upper, witness) = (distance, Some(values));
                    }
                }
            }
            let (parameter, stretches) = match judge_box(&reduced, &claim, &mut expansion, task)? {
                Verdict::Proved(0) => continue,
                Verdict::Proved(_) => {
                    let (place, distance) = self.nearest(&claim.range);
                    if distance < upper {
                        upper = distance;
                        witness = Some(reduced.values_at(&place));
                    }
                    continue;
                }
                Verdict::Stuck => {
                    barrier = barrier.min(self.nearest(&claim.range).1);
                    continue;
                }
                Verdict::Halve(parameter, stretches) => (parameter, stretches),
            };
            let Some((_, halves)) = claim.range.halves(parameter) else {
                barrier = barrier.min(self.nearest(&claim.range).1);
                continue;
            };
            for range in halves {
                order += 1;
                heap.push(Near {
                    distance: self.nearest(&range).1,
                    order,
                    claim: Claim {
                        range,
                        stretches: stretches.clone(),
                    },
                });
            }
        }
        let left = heap.peek().map_or(f64::INFINITY, |near| near.distance);
        let below = left.min(upper).min(barrier);
        // The whole box is proved stable: return exactly the radius that was requested.
        let radius = if below >= self.radius && upper == f64::INFINITY {
            self.radius
        } else {
            below * (1.0 - 4.0 * f64::EPSILON)
        };
        Ok(Radius {
            radius,
            upper,
            witness,
        })
    }
}
