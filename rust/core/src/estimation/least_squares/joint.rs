//! Several recordings as one problem, and the spaces in which its parameters move.

use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Misfit of one recording as a function of its parameters.
pub trait Part {
    /// Simulated minus recorded output.
    ///
    /// # Errors
    /// Where the work has to end.
    fn misfit(&self, point: &[f64], task: &Task) -> Result<Vec<f64>, Error>;

    /// Its derivatives, one column for each parameter.
    ///
    /// # Errors
    /// As the misfit.
    fn slopes(&self, point: &[f64], task: &Task) -> Result<Vec<Vec<f64>>, Error>;
}

/// One recording: the common parameters come first, then its own.
pub struct Fitted<'a> {
    /// The misfit.
    pub part: Box<dyn Part + 'a>,
    /// Number of rows.
    pub rows: usize,
    /// Lower bounds of its parameters.
    pub low: Vec<f64>,
    /// Upper bounds.
    pub high: Vec<f64>,
    /// Values of each parameter at which searches start: the points of a grid.
    pub axes: Vec<Vec<f64>>,
}

/// The recordings as one.
pub struct Joint<'a> {
    parts: Vec<Fitted<'a>>,
    /// Factor on the residuals of each.
    pub weights: Vec<f64>,
    /// The places of a delay and a lag, which trade.
    pub trade: Option<(usize, usize)>,
    common: usize,
    pub(super) low: Vec<f64>,
    pub(super) high: Vec<f64>,
}

impl<'a> Joint<'a> {
    /// Recordings with `common` parameters.
    pub fn new(parts: Vec<Fitted<'a>>, weights: Vec<f64>, common: usize) -> Self {
        let lows: Vec<&[f64]> = parts.iter().map(|part| &part.low[..]).collect();
        let highs: Vec<&[f64]> = parts.iter().map(|part| &part.high[..]).collect();
        let (low, high) = (
            joined(&lows, common, f64::max),
            joined(&highs, common, f64::min),
        );
        Self {
            parts,
            weights,
            trade: None,
            common,
            low,
            high,
        }
    }

    /// Bounds of all parameters.
    pub fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        (self.low.clone(), self.high.clone())
    }

    /// Number of parameters.
    pub fn count(&self) -> usize {
        self.low.len()
    }

    /// Each recording with its weight, its point, and the place of its own parameters.
    fn places<'b>(
        &'b self,
        point: &'b [f64],
    ) -> impl Iterator<Item = (&'b Fitted<'a>, f64, Vec<f64>, usize)> {
        let mut after = self.common;
        self.parts
            .iter()
            .zip(&self.weights)
            .map(move |(part, weight)| {
                let own = part.low.len() - self.common;
                let mut at = point[..self.common].to_vec();
                at.extend(&point[after..after + own]);
                after += own;
                (part, *weight, at, after - own)
            })
    }

    /// Weighted residuals, one recording after the other.
    ///
    /// # Errors
    /// As those of the parts.
    pub fn misfit(&self, point: &[f64], task: &Task) -> Result<Vec<f64>, Error> {
        let mut all = Vec::new();
        for (part, weight, at, _) in self.places(point) {
            task.check()?;
            all.extend(part.part.misfit(&at, task)?.iter().map(|x| weight * x));
        }
        Ok(all)
    }

    /// Derivatives of the weighted residuals, a column a parameter.
    ///
    /// # Errors
    /// As those of the parts.
    pub fn slopes(&self, point: &[f64], task: &Task) -> Result<Vec<Vec<f64>>, Error> {
        let mut columns = vec![Vec::new(); self.count()];
        for (part, weight, at, own) in self.places(point) {
            task.check()?;
            let found = part.part.slopes(&at, task)?;
            let rows = found.first().map_or(0, Vec::len);
            for (place, column) in columns.iter_mut().enumerate() {
                let own = place.checked_sub(own).map(|after| self.common + after);
                let index = if place < self.common {
                    Some(place)
                } else {
                    own
                };
                match index.and_then(|index| found.get(index)) {
                    Some(slopes) => column.extend(slopes.iter().map(|slope| weight * slope)),
                    None => column.resize(column.len() + rows, 0.0),
                }
            }
        }
        Ok(columns)
    }

    /// Sum of squares.
    ///
    /// # Errors
    /// As the misfit.
    pub fn cost(&self, point: &[f64], task: &Task) -> Result<f64, Error> {
        let misfit = self.misfit(point, task)?;
        Ok(dot(&misfit, &misfit))
    }

    /// Residuals by recording.
    pub(super) fn pieces<'b>(&'b self, misfit: &'b [f64]) -> impl Iterator<Item = &'b [f64]> {
        let mut first = 0;
        self.parts.iter().map(move |part| {
            first += part.rows;
            &misfit[first - part.rows..first]
        })
    }

    /// Base and directions in which the sum of the parameters at these places is `value`, near a point.
    pub(super) fn held(
        &self,
        point: &[f64],
        places: &[usize],
        mut value: f64,
    ) -> (Vec<f64>, Vec<Vec<f64>>) {
        let (count, fixed) = (self.count(), places.first().copied().unwrap_or(0));
        if places.len() == 1 && value != point[fixed] {
            // Values between zero and the lower bound of the search are not simulated.
            value = value.max(self.low[fixed]);
        }
        let mut base = vec![0.0; count];
        base[fixed] = value;
        let direction = |place: usize| {
            let mut one = vec![0.0; count];
            one[place] = 1.0;
            if places.contains(&place) {
                one[fixed] = -1.0;
            }
            one
        };
        let free = (0..count).filter(|place| *place != fixed);
        (base, free.map(direction).collect())
    }

    /// Starting points of every recording, the best first; of several, completed by the best ones of
    /// the others.
    pub(super) fn starts(&self, most: usize, task: &Task) -> Result<Vec<Vec<f64>>, Error> {
        let mut of_parts = Vec::new();
        for part in &self.parts {
            let cost = |point: &[f64]| {
                task.check()?;
                let misfit = part.part.misfit(point, task)?;
                Ok(dot(&misfit, &misfit))
            };
            of_parts.push(sorted(grid(&part.axes), most, cost)?);
        }
        if self.parts.len() == 1 {
            return Ok(of_parts.swap_remove(0));
        }
        let own: Vec<f64> = of_parts
            .iter()
            .flat_map(|points| points[0][self.common..].to_vec())
            .collect();
        let mut points = Vec::new();
        for point in of_parts.iter().flatten() {
            let mut whole = point[..self.common].to_vec();
            whole.extend(&own);
            self.clamp(&mut whole);
            points.push(whole);
        }
        sorted(points, most, |point| self.cost(point, task))
    }

    fn clamp(&self, point: &mut [f64]) {
        for (x, (low, high)) in point.iter_mut().zip(self.low.iter().zip(&self.high)) {
            *x = x.max(*low).min(*high);
        }
    }
}

/// The tightest of the common bounds, then those of each recording.
fn joined(bounds: &[&[f64]], common: usize, tighter: fn(f64, f64) -> f64) -> Vec<f64> {
    let of = |place: usize| bounds.iter().map(move |bound| bound[place]).reduce(tighter);
    let shared = (0..common).filter_map(of);
    let own = bounds
        .iter()
        .flat_map(|bound| bound[common..].iter().copied());
    shared.chain(own).collect()
}

/// All points of a grid.
fn grid(axes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    axes.iter().fold(vec![Vec::new()], |points, axis| {
        let with = |point: Vec<f64>| {
            axis.iter().map(move |x| {
                let mut longer = point.clone();
                longer.push(*x);
                longer
            })
        };
        points.into_iter().flat_map(with).collect()
    })
}

/// The best of some points, in order.
fn sorted(
    points: Vec<Vec<f64>>,
    most: usize,
    cost: impl Fn(&[f64]) -> Result<f64, Error>,
) -> Result<Vec<Vec<f64>>, Error> {
    if points.len() < 2 {
        return Ok(points);
    }
    let mut costed = Vec::new();
    for point in points {
        costed.push((cost(&point)?, point));
    }
    costed.sort_by(|one, other| one.0.total_cmp(&other.0));
    Ok(costed
        .into_iter()
        .take(most)
        .map(|(_, point)| point)
        .collect())
}

/// The points base + free q.
#[derive(Debug, Clone)]
pub(super) struct Space {
    base: Vec<f64>,
    /// Directions, each with an entry of 1 where the others have 0.
    free: Vec<Vec<f64>>,
    /// The parameter that each direction moves by one.
    moving: Vec<usize>,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Space {
    /// The space of these directions through a point, within the bounds of the parameters.
    pub(super) fn new(joint: &Joint<'_>, base: Vec<f64>, free: Vec<Vec<f64>>) -> Self {
        let one = |direction: &Vec<f64>| direction.iter().position(|x| *x > 0.0).unwrap_or(0);
        let moving: Vec<usize> = free.iter().map(one).collect();
        let low: Vec<f64> = moving.iter().map(|place| joint.low[*place]).collect();
        let mut high: Vec<f64> = moving.iter().map(|place| joint.high[*place]).collect();
        for (column, direction) in free.iter().enumerate() {
            if let Some(row) = direction.iter().position(|x| *x < 0.0) {
                // base − q has to stay within its own bounds.
                high[column] = high[column].min(base[row] - joint.low[row]);
            }
        }
        for (high, low) in high.iter_mut().zip(&low).filter(|(_, low)| low.is_finite()) {
            *high = high.max(low + 1e-12 * (1.0 + low.abs()));
        }
        Self {
            base,
            free,
            moving,
            low,
            high,
        }
    }

    /// The space of all points but for parameters that are held at their values in `base`.
    pub(super) fn without(joint: &Joint<'_>, mut base: Vec<f64>, held: &[usize]) -> Self {
        let loose = (0..base.len()).filter(|place| !held.contains(place));
        let unit = |place: usize| {
            let mut direction = vec![0.0; joint.count()];
            direction[place] = 1.0;
            direction
        };
        let places: Vec<usize> = loose.collect();
        for place in &places {
            base[*place] = 0.0;
        }
        Self::new(joint, base, places.into_iter().map(unit).collect())
    }

    /// Does a parameter move here?
    pub(super) fn moves(&self, place: usize) -> bool {
        self.moving.contains(&place)
    }

    /// Does a step end on a bound that it was not on?
    pub(super) fn cuts(&self, from: &[f64], to: &[f64]) -> bool {
        let ends = self.low.iter().zip(&self.high);
        let pairs = from.iter().zip(to).zip(ends);
        pairs
            .into_iter()
            .any(|((from, to), (low, high))| from != to && (to == low || to == high))
    }

    pub(super) fn clamp(&self, q: &mut [f64]) {
        for (x, (low, high)) in q.iter_mut().zip(self.low.iter().zip(&self.high)) {
            *x = x.max(*low).min(*high);
        }
    }

    /// Where a point of the parameters lies in the space, within its bounds.
    pub(super) fn place(&self, point: &[f64]) -> Vec<f64> {
        let mut q: Vec<f64> = self.moving.iter().map(|place| point[*place]).collect();
        self.clamp(&mut q);
        q
    }

    /// base + free q.
    pub(super) fn point(&self, q: &[f64]) -> Vec<f64> {
        let mut point = self.base.clone();
        for (q, direction) in q.iter().zip(&self.free) {
            for (x, d) in point.iter_mut().zip(direction) {
                *x += q * d;
            }
        }
        point
    }

    /// Derivatives along the directions.
    pub(super) fn along(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let rows = columns.first().map_or(0, Vec::len);
        let one = |direction: &Vec<f64>| {
            let mut sum = vec![0.0; rows];
            for (column, d) in columns.iter().zip(direction).filter(|(_, d)| **d != 0.0) {
                for (sum, x) in sum.iter_mut().zip(column) {
                    *sum += d * x;
                }
            }
            sum
        };
        self.free.iter().map(one).collect()
    }
}
