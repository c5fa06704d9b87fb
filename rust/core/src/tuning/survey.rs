//! The map from which a search begins: gains on a grid with their worst abscissa.

/// Further gains between zero and the first cell, as parts of it, and the points along each other gain
/// there for one, two and three gains: an integral gain that small gives steps that no cell shows. Loops
/// with still smaller ones take hundreds of settling times to come to rest.
const FRINGE: [f64; 2] = [0.25, 0.5];
const FRINGE_SIDES: [usize; 3] = [1, 31, 7];

/// Least distance between two points from which searches begin, in cells of the map.
const APART: f64 = 3.5;

/// See the head of this file.
#[derive(Debug, Clone)]
pub struct Survey {
    /// Values of each free gain, two at least.
    pub axes: Vec<Vec<f64>>,
    /// Worst spectral abscissa of each point in 1/s, the last axis fastest; infinite where a scenario is
    /// not stable.
    pub abscissa: Vec<f64>,
}

impl Survey {
    /// Points that are stable in every scenario, gains of zero left out, and their places.
    pub(super) fn stable(&self) -> Vec<(usize, Vec<f64>)> {
        let points = grid(&self.axes).into_iter().enumerate();
        let stable = points.filter(|(place, point)| {
            let late = self.abscissa.get(*place).copied();
            late.is_some_and(f64::is_finite) && point.iter().any(|gain| *gain != 0.0)
        });
        stable.collect()
    }

    /// Grids with one gain between zero and its first cell, where an axis begins at zero.
    pub(super) fn fringes(&self) -> Vec<Vec<Vec<f64>>> {
        let most = FRINGE_SIDES.get(self.axes.len() - 1).copied().unwrap_or(1);
        let mut found = Vec::new();
        for (i, (side, (low, high))) in self.spacing().into_iter().zip(self.bounds()).enumerate() {
            if low * high != 0.0 {
                continue;
            }
            let thinned = |axis: &Vec<f64>| {
                let each = axis.iter().step_by(axis.len().div_ceil(most));
                each.copied().collect::<Vec<f64>>()
            };
            let mut axes: Vec<Vec<f64>> = self.axes.iter().map(thinned).collect();
            axes[i] = FRINGE
                .map(|part| (low + high).signum() * side * part)
                .to_vec();
            axes[i].sort_by(f64::total_cmp);
            found.push(axes);
        }
        found
    }

    /// Bounds of a search by simulation: gains stay off zero.
    pub(super) fn off_zero(&self, start: &[f64]) -> Vec<(f64, f64)> {
        let sides = self.spacing().into_iter().zip(self.bounds()).zip(start);
        let off = |((side, (low, high)), start): ((f64, (f64, f64)), &f64)| {
            let away = |bound: f64, other: f64| {
                if bound == 0.0 && *start != 0.0 {
                    other
                } else {
                    bound
                }
            };
            let least = FRINGE[0] * side;
            (away(low, least), away(high, -least))
        };
        sides.map(off).collect()
    }

    /// Width of a cell along each gain.
    pub(super) fn spacing(&self) -> Vec<f64> {
        let axes = self.axes.iter().zip(self.bounds());
        axes.map(|(axis, (low, high))| (high - low) / (axis.len() - 1) as f64)
            .collect()
    }

    /// Ends of each gain.
    pub(super) fn bounds(&self) -> Vec<(f64, f64)> {
        let end = |x: Option<&f64>| x.copied().unwrap_or(0.0);
        let axes = self.axes.iter();
        axes.map(|axis| (end(axis.first()), end(axis.last())))
            .collect()
    }

    /// The points with the least finite costs that are no neighbours of one another.
    pub(super) fn chosen(&self, points: &[Vec<f64>], costs: &[f64], most: usize) -> Vec<Vec<f64>> {
        let spacing = self.spacing();
        let (mut found, mut left) = (Vec::new(), costs.to_vec());
        while found.len() < most {
            let Some((place, _)) = least(&left).filter(|(_, least)| least.is_finite()) else {
                break;
            };
            let best = &points[place];
            for (point, cost) in points.iter().zip(&mut left) {
                let mut sides = point.iter().zip(best).zip(&spacing);
                if sides.all(|((x, y), side)| (x - y).abs() <= APART * side) {
                    *cost = f64::INFINITY;
                }
            }
            found.push(best.clone());
        }
        found
    }
}

/// Place and value of the first least cost; none of no cost.
pub(super) fn least(costs: &[f64]) -> Option<(usize, f64)> {
    let each = costs.iter().copied().enumerate();
    each.reduce(|best, other| if other.1 < best.1 { other } else { best })
}

/// Every point of a grid, the last axis fastest.
pub(super) fn grid(axes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    axes.iter().fold(vec![Vec::new()], |points, axis| {
        let joined = points.iter().flat_map(|point| {
            let join = |x: &f64| [&point[..], &[*x]].concat();
            axis.iter().map(join).collect::<Vec<_>>()
        });
        joined.collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn survey(axes: &[(f64, f64, usize)]) -> Survey {
        let axes = axes.iter().map(|(low, high, count)| {
            let step = (high - low) / (*count - 1) as f64;
            (0..*count).map(|i| low + i as f64 * step).collect()
        });
        let axes: Vec<Vec<f64>> = axes.collect();
        let abscissa = vec![0.0; axes.iter().map(Vec::len).product()];
        Survey { axes, abscissa }
    }

    #[test]
    fn a_search_by_simulation_keeps_gains_off_zero() {
        // With an integral gain of zero the loop is another one, and may not settle.
        let survey = survey(&[(0.0, 4.0, 5), (-1.0, 0.0, 5), (-1.0, 1.0, 3)]);
        let bounds = survey.off_zero(&[2.0, -0.5, 0.5]);
        assert_eq!(bounds, [(0.25, 4.0), (-1.0, -0.0625), (-1.0, 1.0)]);
        // A gain that is to be zero may stay there.
        assert_eq!(survey.off_zero(&[0.0, -0.5, 0.5])[0].0, 0.0);
        let [first, second] = &survey.fringes()[..] else {
            panic!("two axes end at zero");
        };
        assert_eq!(first[0], [0.25, 0.5]);
        assert_eq!(second[1], [-0.125, -0.0625]);
    }

    #[test]
    fn starts_are_no_neighbours() {
        let survey = survey(&[(0.0, 10.0, 11)]);
        let points = grid(&survey.axes);
        let costs: Vec<f64> = points.iter().map(|point| point[0]).collect();
        assert_eq!(survey.chosen(&points, &costs, 3), [[0.0], [4.0], [8.0]]);
    }
}
