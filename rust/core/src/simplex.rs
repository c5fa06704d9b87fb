//! The simplex of Nelder and Mead (1965), for functions of a few variables with kinks.

use crate::Error;

/// A corner and its cost.
pub(crate) type Corner = (Vec<f64>, f64);

/// A simplex under a cost, which gives a place back as a corner: it may move it into bounds. The second
/// argument of the cost is the most that matters: a cost above it may be any other above it.
pub(crate) struct Simplex<F> {
    /// The best one first.
    corners: Vec<Corner>,
    cost: F,
    /// Evaluations that are left.
    left: usize,
}

impl<F: FnMut(Vec<f64>, f64) -> Result<Corner, Error>> Simplex<F> {
    /// The simplex of these corners, with the most evaluations of the cost, theirs among them.
    ///
    /// # Errors
    /// Those of the cost, here and below.
    pub(crate) fn around(corners: Vec<Vec<f64>>, most: usize, cost: F) -> Result<Self, Error> {
        let mut simplex = Self {
            corners: Vec::new(),
            cost,
            left: most,
        };
        for corner in corners {
            let found = simplex.at(corner, f64::INFINITY)?;
            simplex.corners.extend(found);
        }
        Ok(simplex)
    }

    /// The corner at a place; none where no evaluation is left.
    fn at(&mut self, place: Vec<f64>, most: f64) -> Result<Option<Corner>, Error> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        (self.cost)(place, most).map(Some)
    }

    /// The best corner when they are close enough, the best one first, or no evaluation is left.
    pub(crate) fn contracted(
        mut self,
        is_enough: impl Fn(&[Corner]) -> bool,
    ) -> Result<Corner, Error> {
        loop {
            self.corners.sort_by(|p, q| p.1.total_cmp(&q.1));
            if self.left == 0 || is_enough(&self.corners) {
                return Ok(self.corners.swap_remove(0));
            }
            self.step()?;
        }
    }

    /// Move the worst corner, or all but the best one towards that. A step without evaluations left is not
    /// taken.
    fn step(&mut self) -> Result<(), Error> {
        let worst = self.corners.len() - 1;
        let [best, second, last] = [0, worst - 1, worst].map(|i| self.corners[i].1);
        let Some(reflected) = self.beyond(1.0, last)? else {
            return Ok(());
        };
        if reflected.1 >= best && reflected.1 < second {
            self.corners[worst] = reflected;
            return Ok(());
        }
        let (factor, most) = if reflected.1 < best {
            (2.0, reflected.1)
        } else if reflected.1 < last {
            (0.5, reflected.1)
        } else {
            (-0.5, last)
        };
        let Some(further) = self.beyond(factor, most)? else {
            return Ok(());
        };
        let moved = if reflected.1 < best {
            let is_better = further.1 < reflected.1;
            Some(if is_better { further } else { reflected })
        } else if reflected.1 < last {
            Some(further).filter(|found| found.1 <= reflected.1)
        } else {
            Some(further).filter(|found| found.1 < last)
        };
        if let Some(moved) = moved {
            self.corners[worst] = moved;
            return Ok(());
        }
        let first = self.corners[0].0.clone();
        for i in 1..=worst {
            let corner = self.corners[i].0.iter().zip(&first);
            let place = corner.map(|(x, y)| y + 0.5 * (x - y)).collect();
            let Some(found) = self.at(place, f64::INFINITY)? else {
                break;
            };
            self.corners[i] = found;
        }
        Ok(())
    }

    /// The worst corner mirrored at the middle of the others, at this multiple of its distance.
    fn beyond(&mut self, factor: f64, most: f64) -> Result<Option<Corner>, Error> {
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

/// The place of least cost that a simplex around a start finds, with sides along the axes. It ends where
/// corners and costs are as close to the best as these, or after so many evaluations.
///
/// # Errors
/// Those of the cost.
pub(crate) fn least_around(
    start: &[f64],
    side: f64,
    (place, value): (f64, f64),
    most: usize,
    mut cost: impl FnMut(&[f64]) -> Result<f64, Error>,
) -> Result<Vec<f64>, Error> {
    if start.is_empty() {
        return Ok(Vec::new());
    }
    let mut corners = vec![start.to_vec()];
    for i in 0..start.len() {
        let mut corner = start.to_vec();
        corner[i] += side;
        corners.push(corner);
    }
    let costed = |at: Vec<f64>, _: f64| {
        let value = cost(&at)?;
        Ok((at, value))
    };
    let is_enough = |corners: &[Corner]| {
        let (best, least) = &corners[0];
        corners[1..].iter().all(|(corner, cost)| {
            let mut sides = corner.iter().zip(best);
            cost - least <= value && sides.all(|(x, y)| (x - y).abs() <= place)
        })
    };
    let found = Simplex::around(corners, most, costed)?.contracted(is_enough)?;
    Ok(found.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bottom_of_a_valley_with_a_kink_is_found() {
        let valley = |x: &[f64]| Ok((x[0] - x[1]).abs() + 0.1 * (x[0] + x[1] - 1.0).powi(2));
        let found = least_around(&[-1.0, 1.5], 0.3, (1e-9, 1e-12), 2000, valley).unwrap();
        assert!(found.iter().all(|x| (x - 0.5).abs() < 1e-4), "{found:?}");
    }

    #[test]
    fn no_more_is_evaluated_than_is_allowed() {
        let mut used = 0;
        let counted = |x: &[f64]| {
            used += 1;
            Ok(x[0] * x[0])
        };
        least_around(&[3.0], 0.1, (0.0, 0.0), 20, counted).unwrap();
        assert_eq!(used, 20);
    }
}
