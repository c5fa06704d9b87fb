//! Delays of a bank that follow noise and command: closer together where the posterior is narrow.
//!
//! Between two delays of a bank no cell is right. Where rows tell the delay to less than the distance
//! of the cells, the innovations of the nearest one follow the command, and the test of the model
//! would blame the plant. So cells are halved around the posterior mean until they are as narrow as
//! the posterior, and the new ones begin from their neighbours: by the derivative of the mean by the
//! delay, and by the density between the weights.

use super::cell::Cell;
use super::posterior::Density;

/// Distance of delays at the mean, in posterior deviations. Larger ones leave an error of the plant
/// that the test of the innovations sees; smaller ones cost time.
const NARROW: f64 = 1.0;

/// Distance of delays, as a share of their distance from the mean. Larger ones forget what lies beside
/// the mean when that moves; smaller ones cost time.
const GRADE: f64 = 0.5;

/// Most halvings of a distance. More follow noise that is less than rounding.
const MOST: u32 = 8;

/// The mean may move by so many of the smallest distances before delays follow it.
const MOVES: f64 = 1.5;

/// The posterior may widen by this factor before delays go apart again.
const WIDENS: f64 = 4.0;

/// Where the delays of a bank are close together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Focus {
    mean: f64,
    /// The distance that is asked for there; infinite for the delays that were given.
    distance: f64,
}

impl Focus {
    pub(super) const NONE: Self = Self {
        mean: 0.0,
        distance: f64::INFINITY,
    };

    /// Where they are to be for this posterior; None if they may stay.
    pub(super) fn follow(self, mean: f64, deviation: f64) -> Option<Self> {
        let distance = NARROW * deviation;
        let is_narrower = distance < self.distance;
        let is_wider = distance > WIDENS * self.distance;
        let has_moved = (mean - self.mean).abs() > MOVES * self.distance;
        // Half of what is asked for, so that a posterior that narrows slowly is not followed each row.
        (is_narrower || is_wider || has_moved).then_some(Self {
            mean,
            distance: if is_narrower || is_wider {
                0.5 * distance
            } else {
                self.distance
            },
        })
    }

    /// The delays that were given, and those between them.
    pub(super) fn delays(self, given: &[f64]) -> Vec<f64> {
        let mut found = Vec::with_capacity(2 * given.len());
        for pair in given.windows(2) {
            self.split(pair[0], pair[1], MOST, &mut found);
        }
        found.extend(given.last());
        found
    }

    /// Push the delays from `low` on and below `high`.
    fn split(self, low: f64, high: f64, left: u32, found: &mut Vec<f64>) {
        let away = (low - self.mean).max(self.mean - high).max(0.0);
        let middle = 0.5 * (low + high);
        if left == 0 || high - low <= (2.0 * self.distance).max(GRADE * away) {
            found.push(low);
            return;
        }
        self.split(low, middle, left - 1, found);
        self.split(middle, high, left - 1, found);
    }
}

/// Cells and weights of one set of lags at other delays.
pub(super) fn moved<const N: usize>(
    from: &[f64],
    cells: &[Cell<N>],
    weights: &[f64],
    to: &[f64],
) -> (Vec<Cell<N>>, Vec<f64>) {
    let density = Density::of(from, weights);
    let mut found = Vec::with_capacity(to.len());
    for delay in to {
        let after = from.partition_point(|one| one < delay).min(from.len() - 1);
        let before = after.saturating_sub(1);
        found.push(if from[after] <= *delay {
            cells[after].clone()
        } else {
            between(
                &cells[before],
                &cells[after],
                from[before],
                from[after],
                *delay,
            )
        });
    }
    (found, density.weights(to))
}

/// A cell between two: what both say by their slopes, the nearer one more; the covariance of the nearer.
fn between<const N: usize>(
    low: &Cell<N>,
    high: &Cell<N>,
    from: f64,
    to: f64,
    delay: f64,
) -> Cell<N> {
    let share = (delay - from) / (to - from);
    let nearer = if share < 0.5 { low } else { high };
    let mix = |a: f64, b: f64| (1.0 - share) * a + share * b;
    let said = |cell: &Cell<N>, at: f64, i: usize| cell.mean[i] + (delay - at) * cell.slope[i];
    Cell {
        mean: std::array::from_fn(|i| mix(said(low, from, i), said(high, to, i))),
        slope: std::array::from_fn(|i| mix(low.slope[i], high.slope[i])),
        cov: nearer.cov,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_are_close_at_the_mean_and_keep_those_that_were_given() {
        let given: Vec<f64> = (0..50).map(|i| 0.6 * f64::from(i) / 49.0).collect();
        let focus = Focus::NONE.follow(0.3137, 0.0008).unwrap();
        let delays = focus.delays(&given);
        assert!(given.iter().all(|one| delays.contains(one)));
        assert!(delays.windows(2).all(|pair| pair[0] < pair[1]));
        let near = delays
            .windows(2)
            .filter(|pair| (pair[0] - 0.3137).abs() < 0.001);
        assert!(
            near.map(|pair| pair[1] - pair[0])
                .all(|apart| apart <= 0.0008)
        );
        assert!(delays.len() < 90, "{}", delays.len());
        assert!(focus.follow(0.3139, 0.0007).is_none());
        assert!(focus.follow(0.3150, 0.0007).is_some());
        assert_eq!(Focus::NONE.delays(&given), given);
    }

    #[test]
    fn a_gaussian_stays_where_it_is_on_other_delays() {
        let from: Vec<f64> = (0..30).map(|i| 0.02 * f64::from(i)).collect();
        let log = |x: f64| -0.5 * ((x - 0.3137) / 0.011).powi(2);
        let cell = |x: f64| Cell {
            mean: [3.0 * x],
            cov: [[1.0]],
            slope: [3.0],
        };
        let cells: Vec<Cell<1>> = from.iter().map(|x| cell(*x)).collect();
        let weights: Vec<f64> = from.iter().map(|x| log(*x).exp()).collect();
        let to = Focus::NONE.follow(0.3137, 0.011).unwrap().delays(&from);
        assert!(to.len() > from.len());
        let before: f64 = weights.iter().sum();
        let (cells, weights) = moved(&from, &cells, &weights, &to);
        let total: f64 = weights.iter().sum();
        let mean: f64 = weights.iter().zip(&to).map(|(w, x)| w * x).sum::<f64>() / total;
        assert!(
            (total - before).abs() < 1e-12 && (mean - 0.3137).abs() < 3e-4,
            "{mean}"
        );
        assert!(
            cells
                .iter()
                .zip(&to)
                .all(|(c, x)| (c.mean[0] - 3.0 * x).abs() < 1e-12)
        );
    }
}
