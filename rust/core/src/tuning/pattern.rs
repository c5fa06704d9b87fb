//! The best gains for given scenarios: the best cells of the map, improved by a local search.
//!
//! Every cost here has kinks, where two poles are equally far right or two delays equally bad, and the
//! best gains lie on them; simulated ones also jump, where a peak leaves the settling band. So nothing is
//! differentiated:
//!
//! * one gain: golden section and parabolas between the neighbours of the cell, in `search`: the cost has
//!   one minimum there, kinked or not, if it does not jump;
//! * more: grids around the best point, each narrower than the one before (a sweep of hundreds of loops
//!   costs little more than one), and then, where nothing jumps, the simplices of `simplices`.
//!
//! Steps are simulated for the gains alone first, and in the last grids with gains half a percent beside
//! them. There a gain whose axis begins at zero stays a quarter of a cell away from it. Margins are
//! requirements, as in `goal`. None of this proves a global minimum: the map finds it as far as its cells
//! are close enough.

use super::candidates::Candidates;
use super::goal::{Decisive, Goal, NEVER, Objective};
use super::search::{Within, best_within, least};
use super::survey::{self, Survey, grid};
use crate::{Error, Task};

/// Upper limits on the cells whose cost is computed where the map does not hold it, from poles or by
/// simulation (bound time).
const CELLS_BY_POLES: usize = 150;
const CELLS_SIMULATED: usize = 450;

/// Cells from which the local search starts; fewer where loops are simulated, and up to the third number
/// where the neighbours of the gains cost much more than these themselves.
const STARTS: usize = 3;
const STARTS_SIMULATED: usize = 2;
const MOST_STARTS: usize = 6;

/// Ratio of the cost with neighbouring gains to that of the best cell above which further starts are
/// tried.
const MUCH: f64 = 1.15;

/// Points along each side of a grid, for one, two and three free gains, and half the width of the first
/// grid in cells of the map.
const SIDE: [usize; 3] = [21, 9, 5];
const REACH: f64 = 1.5;

/// Number of grids; of simulated loops, for the gains alone and then with their neighbours.
const GRIDS: usize = 3;
const GRIDS_SIMULATED: usize = 8;
const GRIDS_ROUNDED: usize = 4;

/// Ratio of the widths of two grids, and the part of the half width within which the best point must lie
/// for the grid to become narrower.
const NARROWER: f64 = 0.5;
const ARRIVED: f64 = 0.55;

/// Relative half width of the first grid around the best gains alone in which the best ones with their
/// neighbours are sought.
const NEAR: f64 = 0.03;

/// Cells whose margins are computed at once, the best ones first: more of them may be in vain.
const TOGETHER: usize = 64;

/// Shortfall of the margins that counts as none.
const MET: f64 = 1e-6;

/// A search for the gains that are best in some scenarios, with the required margins there.
#[derive(Debug, Clone)]
pub(super) struct Pattern<'a> {
    /// The loops.
    pub(super) of: Candidates,
    /// What is made best.
    pub(super) objective: Objective,
    /// The least margins, as of a [`Goal`].
    pub(super) required: [f64; 3],
    /// Where the search begins.
    pub(super) survey: Survey,
    /// Height of the step, where steps are simulated.
    pub(super) amplitude: f64,
    /// Its work.
    pub(super) task: &'a Task,
}

/// How points are judged: not by simulation, by the steps of the gains alone, or with their neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Judge {
    Poles,
    Coarse,
    Fine,
}

impl Pattern<'_> {
    fn goal(&self) -> Goal {
        let lowest = self.survey.abscissa.iter().copied();
        let scale = match self.objective {
            Objective::Abscissa => lowest.fold(f64::INFINITY, f64::min).abs(),
            _ => 1.0,
        };
        Goal {
            objective: self.objective,
            required: self.required,
            scale,
        }
    }

    /// The best gains, from the map.
    ///
    /// # Errors
    /// As [`Candidates::all_dominant`] and a simulation.
    pub(super) fn globally(&self) -> Result<Vec<f64>, Error> {
        let (places, points): (Vec<usize>, Vec<Vec<f64>>) =
            self.survey.stable().into_iter().unzip();
        let mut costs = self.cell_costs(&places, &points)?;
        if self.objective.is_simulated() && costs.iter().any(|cost| cost.is_finite()) {
            return self.firmest(points, costs);
        }
        let mut starts = self.survey.chosen(&points, &costs, STARTS);
        if starts.is_empty() {
            // Perhaps the requirements are met between the cells.
            costs = self.shortfalls(&points, f64::INFINITY)?;
            starts = self.survey.chosen(&points, &costs, 1);
        }
        let mut found = Vec::new();
        for start in starts {
            let (gains, reach) = self.by_grids(&start)?;
            found.push((self.total(&gains)?, gains, reach));
        }
        found.sort_by(|one, other| one.0.total_cmp(&other.0));
        // With three gains a search may end on a kink far from the best.
        let most = if self.survey.axes.len() > 2 {
            found.len()
        } else {
            1
        };
        let mut best = (f64::INFINITY, Vec::new());
        for (_, gains, reach) in found.into_iter().take(most) {
            let gains = self.polished(gains, reach)?;
            let cost = self.total(&gains)?;
            if cost < best.0 || best.1.is_empty() {
                best = (cost, gains);
            }
        }
        Ok(best.1)
    }

    /// The best gains around a start.
    ///
    /// # Errors
    /// As [`globally`](Self::globally).
    pub(super) fn locally(&self, start: &[f64]) -> Result<Vec<f64>, Error> {
        let (gains, reach) = self.by_grids(start)?;
        self.polished(gains, reach)
    }

    /// Costs of stable cells that meet the margins, infinite of the others.
    ///
    /// Where the map holds the costs, only as many of the best cells as the search begins from.
    fn cell_costs(&self, places: &[usize], points: &[Vec<f64>]) -> Result<Vec<f64>, Error> {
        let mut costs = vec![f64::INFINITY; points.len()];
        let late: Vec<f64> = places
            .iter()
            .map(|place| self.survey.abscissa[*place])
            .collect();
        if self.objective != Objective::Abscissa {
            let met = self.met(&(0..points.len()).collect::<Vec<_>>(), points)?;
            for (cell, cost) in self.map_costs(met, &late, points)? {
                costs[cell] = cost;
            }
            return Ok(costs);
        }
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by(|i, j| late[*i].total_cmp(&late[*j]));
        for cells in order.chunks(TOGETHER) {
            let met = self.met(cells, points)?;
            for cell in &met {
                costs[*cell] = late[*cell];
            }
            if !met.is_empty() && self.survey.chosen(points, &costs, STARTS).len() == STARTS {
                break;
            }
        }
        Ok(costs)
    }

    /// Those of the cells that meet the margins.
    fn met(&self, cells: &[usize], points: &[Vec<f64>]) -> Result<Vec<usize>, Error> {
        let these: Vec<Vec<f64>> = cells.iter().map(|cell| points[*cell].clone()).collect();
        let short = self.shortfalls(&these, MET)?;
        let each = cells.iter().zip(short);
        Ok(each
            .filter(|(_, short)| *short <= MET)
            .map(|(cell, _)| *cell)
            .collect())
    }

    /// Costs of cells of the map; some are left out, since a cost takes long.
    fn map_costs(
        &self,
        mut cells: Vec<usize>,
        late: &[f64],
        points: &[Vec<f64>],
    ) -> Result<Vec<(usize, f64)>, Error> {
        let most = if self.objective.is_simulated() {
            CELLS_SIMULATED
        } else {
            CELLS_BY_POLES
        };
        // A third of them the most stable ones, the others at equal strides.
        cells.sort_by(|i, j| late[*i].total_cmp(&late[*j]));
        let rest = cells.split_off((most / 3).min(cells.len()));
        let stride = (3 * rest.len()).div_ceil(2 * most).max(1);
        cells.extend(rest.iter().step_by(stride));
        let these: Vec<Vec<f64>> = cells.iter().map(|cell| points[*cell].clone()).collect();
        let costs = self
            .of
            .worst_costs(self.objective, &these, self.amplitude, true, self.task)?;
        Ok(cells.into_iter().zip(costs).collect())
    }

    /// The best gains with their neighbours, from more starts where those lose much by them.
    fn firmest(&self, mut points: Vec<Vec<f64>>, mut costs: Vec<f64>) -> Result<Vec<f64>, Error> {
        for axes in self.survey.fringes() {
            let fringe = grid(&axes);
            costs.extend(self.simulated(&fringe, Judge::Coarse)?);
            points.extend(fringe);
        }
        let lowest = costs.iter().copied().fold(f64::INFINITY, f64::min);
        let starts = self.survey.chosen(&points, &costs, MOST_STARTS);
        let mut best = (starts.first().cloned().unwrap_or_default(), f64::INFINITY);
        for (i, start) in starts.into_iter().enumerate() {
            if i >= STARTS_SIMULATED && best.1 <= MUCH * lowest {
                break;
            }
            let (gains, _) = self.by_grids(&start)?;
            let cost = self.total(&gains)?;
            if cost < best.1 {
                best = (gains, cost);
            }
        }
        Ok(best.0)
    }

    /// A better point, and how far around it a better one may still be.
    fn by_grids(&self, start: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let reach: Vec<f64> = self
            .survey
            .spacing()
            .iter()
            .map(|side| REACH * side)
            .collect();
        if self.objective.is_simulated() {
            // Neighbours count many times as much as the gains themselves, and decide little.
            let bounds = self.survey.off_zero(start);
            let (start, _) = self.narrowed(
                Judge::Coarse,
                start,
                reach.clone(),
                &bounds,
                GRIDS_SIMULATED,
            )?;
            let near = start.iter().zip(&reach);
            let near = near
                .map(|(gain, side)| (NEAR * gain.abs()).min(*side))
                .collect();
            return self.narrowed(Judge::Fine, &start, near, &bounds, GRIDS_ROUNDED);
        }
        if start.len() == 1 || self.objective == Objective::Damping {
            return Ok((start.to_vec(), reach));
        }
        self.narrowed(Judge::Poles, start, reach, &self.survey.bounds(), GRIDS)
    }

    /// The best point of grids, each narrower than the one before, and half the width of the next grid.
    fn narrowed(
        &self,
        judge: Judge,
        start: &[f64],
        mut reach: Vec<f64>,
        bounds: &[(f64, f64)],
        grids: usize,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (mut best, mut least) = (start.to_vec(), f64::INFINITY);
        let side = SIDE.get(start.len() - 1).copied().unwrap_or(SIDE[2]);
        let offset = |k: usize| -1.0 + 2.0 * k as f64 / (side - 1) as f64;
        for _ in 0..grids {
            let axes = best.iter().zip(&reach).zip(bounds);
            let axes = axes.map(|((middle, reach), (low, high))| {
                let points = (0..side).map(|k| (middle + offset(k) * reach).max(*low).min(*high));
                let mut points: Vec<f64> = points.collect();
                points.sort_by(f64::total_cmp);
                points.dedup();
                points
            });
            let points = grid(&axes.collect::<Vec<_>>());
            let Some((place, cost)) = self.least(judge, &points)? else {
                break;
            };
            let moved: Vec<f64> = points[place]
                .iter()
                .zip(&best)
                .map(|(x, y)| x - y)
                .collect();
            if cost < least {
                least = cost;
                best = best.iter().zip(&moved).map(|(x, step)| x + step).collect();
            }
            // Along a kink the best point walks: the grid narrows where it has arrived.
            let mut sides = moved.iter().zip(&reach);
            if sides.all(|(step, side)| step.abs() <= ARRIVED * side) {
                reach.iter_mut().for_each(|side| *side *= NARROWER);
            }
        }
        Ok((best, reach))
    }

    /// The best point within reach, where costs are continuous.
    fn polished(&self, start: Vec<f64>, reach: Vec<f64>) -> Result<Vec<f64>, Error> {
        if self.objective.is_simulated() {
            return Ok(start);
        }
        let within = Within {
            start,
            reach,
            bounds: self.survey.bounds(),
        };
        best_within(&self.of, &self.goal(), &within, self.task)
    }

    /// By how much gains fall short of the required margins; infinite where not stable.
    ///
    /// # Errors
    /// As [`globally`](Self::globally).
    pub(super) fn short(&self, gains: &[f64]) -> Result<f64, Error> {
        let late = self.of.stable_abscissae(&[gains], self.task)?;
        if !late.iter().all(|late| late.is_finite()) {
            return Ok(f64::INFINITY);
        }
        let short = self.shortfalls(&[gains.to_vec()], f64::INFINITY)?;
        Ok(short.first().copied().unwrap_or(f64::INFINITY))
    }

    /// The same of rows of gains that are stable; where more than `most`, perhaps too small.
    pub(super) fn shortfalls(&self, points: &[Vec<f64>], most: f64) -> Result<Vec<f64>, Error> {
        let goal = Goal {
            scale: 1.0,
            ..self.goal()
        };
        let rows: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        self.of.shortfalls(&goal, &rows, most, self.task)
    }

    /// Cost of gains, shortfalls of margins included.
    fn total(&self, gains: &[f64]) -> Result<f64, Error> {
        if self.objective.is_simulated() {
            let costs = self.simulated(&[gains.to_vec()], Judge::Fine)?;
            return Ok(costs.first().copied().unwrap_or(f64::INFINITY));
        }
        let mut last = Decisive::default();
        self.goal()
            .total(&self.of, gains, f64::INFINITY, &mut last, self.task)
    }

    /// Place and cost of the best of the points.
    fn least(&self, judge: Judge, points: &[Vec<f64>]) -> Result<Option<(usize, f64)>, Error> {
        if judge == Judge::Poles {
            let rows: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
            return least(&self.of, &self.goal(), &rows, self.task).map(Some);
        }
        Ok(survey::least(&self.simulated(points, judge)?))
    }

    /// Costs of points, of which only those that may be taken are simulated.
    fn simulated(&self, points: &[Vec<f64>], judge: Judge) -> Result<Vec<f64>, Error> {
        let mut costs = vec![f64::INFINITY; points.len()];
        let rows: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        let late = self.of.stable_abscissae(&rows, self.task)?;
        let stable = late.iter().enumerate().filter(|(_, late)| late.is_finite());
        let stable: Vec<usize> = stable.map(|(place, _)| place).collect();
        let good = self.met(&stable, points)?;
        let is_coarse = judge == Judge::Coarse;
        let places = if good.is_empty() {
            stable
        } else {
            good.clone()
        };
        let these: Vec<Vec<f64>> = places.iter().map(|place| points[*place].clone()).collect();
        let found = if good.is_empty() {
            let short = self.shortfalls(&these, f64::INFINITY)?.into_iter();
            short.map(|short| NEVER * (1.0 + short)).collect()
        } else {
            let (objective, amplitude) = (self.objective, self.amplitude);
            self.of
                .worst_costs(objective, &these, amplitude, is_coarse, self.task)?
        };
        for (place, cost) in places.into_iter().zip(found) {
            costs[place] = cost;
        }
        Ok(costs)
    }
}
