//! Minima of functions of a few variables with kinks, by the simplices of Nelder and Mead (1965).
//!
//! A simplex that has collapsed on a kink is freed: the search begins again around what it found,
//! with a smaller simplex turned the other way.

use crate::Error;

/// Most simplices in sequence, the ratio of their sizes, and the evaluations of each for every
/// variable but one: more find a minimum at the end of a long kink and take time in proportion.
const SIMPLICES: usize = 6;
const SMALLER: f64 = 0.35;
const EVALUATIONS: usize = 150;

/// Improvement, relative to the cost, that counts as none: after two such simplices the search ends.
const IDLE: f64 = 1e-4;

/// A corner and its cost.
type Corner = (Vec<f64>, f64);

/// A place near `start` with the least cost that simplices of the sides `size` find within bounds;
/// each ends when its corners are as close as `tolerance`, as a part of the bounds. The second argument of `cost` is the most
/// that matters: a cost above it may be any other above it.
///
/// # Errors
/// Those of `cost`.
pub(super) fn minimum(
    mut cost: impl FnMut(&[f64], f64) -> Result<f64, Error>,
    start: &[f64],
    size: &[f64],
    bounds: &[(f64, f64)],
    tolerance: f64,
) -> Result<Vec<f64>, Error> {
    let mut best = (start.to_vec(), cost(start, f64::INFINITY)?);
    let (mut scale, mut idle) = (1.0, 0);
    for _ in 0..SIMPLICES {
        let mut corners = vec![best.0.clone()];
        for (i, side) in size.iter().enumerate() {
            let mut corner = best.0.clone();
            corner[i] += scale * side;
            corners.push(corner);
        }
        let found = Simplex::around(corners, bounds, &mut cost)?.contracted(tolerance)?;
        let gained = best.1 - found.1;
        if gained > 0.0 {
            best = found;
        }
        idle = if gained < IDLE * best.1.abs() {
            idle + 1
        } else {
            0
        };
        if idle == 2 {
            break;
        }
        scale *= -SMALLER;
    }
    Ok(best.0)
}

struct Simplex<'a, F> {
    /// The best one first.
    corners: Vec<Corner>,
    bounds: &'a [(f64, f64)],
    cost: &'a mut F,
    evaluations: usize,
}

impl<'a, F: FnMut(&[f64], f64) -> Result<f64, Error>> Simplex<'a, F> {
    fn around(
        corners: Vec<Vec<f64>>,
        bounds: &'a [(f64, f64)],
        cost: &'a mut F,
    ) -> Result<Self, Error> {
        let mut simplex = Self {
            corners: Vec::new(),
            bounds,
            cost,
            evaluations: 0,
        };
        for corner in corners {
            let found = simplex.at(corner, f64::INFINITY)?;
            simplex.corners.push(found);
        }
        Ok(simplex)
    }

    /// A place moved into the bounds, with its cost, which may be any above `most`.
    fn at(&mut self, mut place: Vec<f64>, most: f64) -> Result<Corner, Error> {
        for (x, (low, high)) in place.iter_mut().zip(self.bounds) {
            *x = x.max(*low).min(*high);
        }
        self.evaluations += 1;
        let cost = (self.cost)(&place, most)?;
        Ok((place, cost))
    }

    /// The best corner when all are this close, or the evaluations are used.
    fn contracted(mut self, tolerance: f64) -> Result<Corner, Error> {
        let most = EVALUATIONS * (self.bounds.len().max(2) - 1);
        loop {
            self.corners.sort_by(|p, q| p.1.total_cmp(&q.1));
            if self.evaluations >= most || self.width() <= tolerance {
                return Ok(self.corners.swap_remove(0));
            }
            self.step()?;
        }
    }

    /// The largest distance of the others from the best corner, as a part of the bounds.
    fn width(&self) -> f64 {
        let (first, others) = (&self.corners[0].0, &self.corners[1..]);
        let away = |corner: &Corner| {
            let sides = corner.0.iter().zip(first).zip(self.bounds);
            let parts = sides.map(|((x, y), (low, high))| (x - y).abs() / (high - low));
            parts.fold(0.0, f64::max)
        };
        others.iter().map(away).fold(0.0, f64::max)
    }

    /// Move the worst corner, or all but the best one towards that.
    fn step(&mut self) -> Result<(), Error> {
        let worst = self.corners.len() - 1;
        let [best, second, last] = [0, worst - 1, worst].map(|i| self.corners[i].1);
        let reflected = self.beyond(1.0, last)?;
        let moved = if reflected.1 < best {
            let expanded = self.beyond(2.0, reflected.1)?;
            let is_better = expanded.1 < reflected.1;
            Some(if is_better { expanded } else { reflected })
        } else if reflected.1 < second {
            Some(reflected)
        } else if reflected.1 < last {
            Some(self.beyond(0.5, reflected.1)?).filter(|found| found.1 <= reflected.1)
        } else {
            Some(self.beyond(-0.5, last)?).filter(|found| found.1 < last)
        };
        if let Some(moved) = moved {
            self.corners[worst] = moved;
            return Ok(());
        }
        let first = self.corners[0].0.clone();
        for i in 1..=worst {
            let corner = self.corners[i].0.iter().zip(&first);
            let place = corner.map(|(x, y)| y + 0.5 * (x - y)).collect();
            self.corners[i] = self.at(place, f64::INFINITY)?;
        }
        Ok(())
    }

    /// The worst corner mirrored at the middle of the others, at this multiple of its distance.
    fn beyond(&mut self, factor: f64, most: f64) -> Result<Corner, Error> {
        let worst = self.corners.len() - 1;
        let middle = |i: usize| {
            let others = self.corners[..worst].iter();
            others.fold(0.0, |sum, corner| sum + corner.0[i]) / worst as f64
        };
        let last = &self.corners[worst].0;
        let place = last.iter().enumerate();
        let place = place.map(|(i, x)| (1.0 + factor) * middle(i) - factor * x);
        let place = place.collect();
        self.at(place, most)
    }
}
