//! What the search by lines needs of a matrix system.

use num_complex::Complex64;

use super::outer::Leading;
use super::system::Irreducible;
use super::walker::MatrixWalker;
use crate::roots::counting::{Cell, EDGE_MARGIN};
use crate::roots::locating::{Effort, Spectrum};
use crate::{Error, Task};

/// Factorisations after which a line is abandoned: in general, and where roots are known to be too
/// close together to be enclosed. Larger: more of these are counted all the same; smaller: the
/// refusal takes less time.
pub(super) const EVALUATIONS_PER_LINE: u64 = 100_000;
pub(super) const EVALUATIONS_BESIDE_CLUSTERS: u64 = 5_000;

/// Least radius of a half plane, relative to the rate of the system, so that roots at 0 are inside.
pub(super) const LEAST_RADIUS: f64 = 1e-6;

/// A system with the bounds that a search needs.
pub(super) struct Prepared<'s> {
    pub(super) system: &'s Irreducible,
    pub(super) leading: Leading,
    /// Upper limit on the factorisations for a line.
    pub(super) limit: u64,
}

impl<'s> Prepared<'s> {
    pub(super) fn new(system: &'s Irreducible) -> Result<Self, Error> {
        Ok(Self {
            system,
            leading: Leading::new(system)?,
            limit: EVALUATIONS_PER_LINE,
        })
    }

    /// The upper half of a rectangle with all roots right of `sigma`; `None` where there is none.
    fn cell(&self, walker: &mut MatrixWalker<'_>, sigma: f64) -> Result<Option<Cell>, Error> {
        // A margin keeps roots off the edge itself.
        let least = LEAST_RADIUS * self.system.rate();
        let radius = EDGE_MARGIN * self.leading.radius(sigma, walker.task())?.max(least);
        if sigma >= radius {
            return Ok(None);
        }
        let re = (sigma.max(-radius), radius);
        Cell::new(walker, re, (0.0, radius), true).map(Some)
    }
}

impl Spectrum for Prepared<'_> {
    type Walker<'a>
        = MatrixWalker<'a>
    where
        Self: 'a;

    fn walker<'a>(&'a self, task: &'a Task, limit: u64) -> MatrixWalker<'a> {
        let whole = if self.limit < EVALUATIONS_PER_LINE {
            20 * self.limit
        } else {
            limit
        };
        MatrixWalker::new(self.system, task, limit.min(whole))
    }

    fn line(
        &self,
        sigma: f64,
        effort: Effort,
        task: &Task,
    ) -> Result<(u64, Vec<Complex64>), Error> {
        let mut walker = self.walker(task, effort.limit.min(self.limit));
        let cell = self.cell(&mut walker, sigma)?;
        Ok((cell.map_or(0, |cell| cell.count), walker.hints))
    }

    fn far_starts(&self) -> Vec<Complex64> {
        Vec::new()
    }

    fn cell_right_of<'a>(
        &'a self,
        walker: &mut MatrixWalker<'a>,
        sigma: f64,
    ) -> Result<Option<Cell>, Error> {
        self.cell(walker, sigma)
    }
}
