//! Evaluations of M for `line`, which follows arg det M, and `newton`, which finds its roots: their
//! number, the scaling kept from one point to the next, and the discs already proved.

use num_complex::Complex64;

use super::balance::{Balanced, balance};
use super::local_enclosure::LocalEnclosure;
use super::system::Irreducible;
use crate::roots::disc::Disc;
use crate::{Error, Task};

/// Factorisations after which a computation is given up.
pub(super) const MAX_EVALUATIONS: u64 = 1_000_000;

/// The same where roots were met that are too close together to be enclosed.
pub(super) const MOST_WITH_CLUSTERS: u64 = 20_000;

/// Approximate number of operations between two checks for cancellation.
const CHECK_EVERY: u64 = 1_000_000;

/// Shortest distance from a point that the arithmetic resolves, relative to its modulus. Larger:
/// wider discs, fewer attempts; smaller: attempts that cannot succeed.
pub(super) const RESOLUTION: f64 = 4.0 * f64::EPSILON;

/// Modulus that replaces that of points close to 0, in units of the rate of the system.
pub(super) const LEAST_SIZE: f64 = 1e-3;

/// Largest change of Re s, in units of one over the longest delay, up to which a scaling is kept: on
/// lines, where steps shorten if it does not suit, and in Newton's iteration. Larger: entries differ
/// more in size; smaller: it is chosen anew more often, which takes as long as an evaluation.
pub(super) const ON_LINE: f64 = 0.02;
pub(super) const NEAR_ROOT: f64 = 1.0;

/// Residual in units of the least one with a scaling at which it is chosen anew. Larger: shorter
/// steps until then; smaller: more scalings next to roots, where residuals are large anyway.
const MOST_RESIDUALS: f64 = 30.0;

/// Follows arg det M along lines. Keeps the number of evaluations, the hints of roots and the discs
/// already proved.
pub(super) struct MatrixWalker<'a> {
    pub(super) system: &'a Irreducible,
    task: &'a Task,
    /// The scaling of M at the last points, and the least residual met with it.
    pub(super) balanced: Option<Balanced>,
    least_residual: f64,
    /// The end of the last line, where the next one usually begins.
    pub(super) last: Option<LocalEnclosure>,
    /// Ends of Newton's steps from the points closest to a root.
    pub(super) hints: Vec<Complex64>,
    pub(super) known: Vec<Disc>,
    /// Points next to which no single root could be proved.
    pub(super) stalled: Vec<Complex64>,
    /// Number of evaluations at which a small square is replaced by a larger one.
    pub(super) eager_limit: u64,
    pub(super) evaluations: u64,
    work: u64,
    limit: u64,
}

impl<'a> MatrixWalker<'a> {
    pub(super) fn new(system: &'a Irreducible, task: &'a Task, limit: u64) -> Self {
        Self {
            system,
            task,
            balanced: None,
            least_residual: f64::INFINITY,
            last: None,
            hints: Vec::new(),
            known: Vec::new(),
            stalled: Vec::new(),
            eager_limit: u64::MAX,
            evaluations: 0,
            work: 0,
            limit: limit.min(MAX_EVALUATIONS),
        }
    }

    pub(super) fn task(&self) -> &'a Task {
        self.task
    }

    /// Count an evaluation; check for cancellation and for the limit on evaluations.
    pub(super) fn spend(&mut self) -> Result<(), Error> {
        let size = self.system.size() as u64;
        self.evaluations += 1;
        self.work += 20 * size * size * size + 1000;
        if self.evaluations > self.eager_limit {
            return Err(Error::contour(Complex64::ZERO, 0.0));
        }
        if self.work < CHECK_EVERY {
            return Ok(());
        }
        self.work = 0;
        self.task.check()?;
        let beside_clusters = !self.stalled.is_empty() && self.evaluations > MOST_WITH_CLUSTERS;
        if self.evaluations > self.limit || beside_clusters {
            return Err(Error::TooMuch {
                what: "the search for roots of a matrix",
                limit: self.limit.min(self.evaluations),
                unit: "factorisations",
                advice: "give a smaller region, or edges that are far from chains of roots".into(),
            });
        }
        Ok(())
    }

    /// A scaling of M that suits `s`, chosen within `farthest` of it.
    pub(super) fn balanced(&mut self, s: Complex64, farthest: f64) -> Option<&Balanced> {
        let known = self.balanced.take();
        self.balanced = known
            .filter(|known| known.suits(self.system, s, farthest))
            .or_else(|| balance(self.system, s));
        self.balanced.as_ref()
    }

    /// What is known at `s`, proved or not.
    ///
    /// Long chains of states grow exponentially with a scaling that does not suit them. The residual
    /// shows that, and the scaling is then chosen anew.
    pub(super) fn tried(&mut self, s: Complex64, farthest: f64) -> Option<LocalEnclosure> {
        let system = self.system;
        let fresh = |scaling: &Balanced| scaling.place == s;
        let mut found = LocalEnclosure::tried(system, self.balanced(s, farthest)?, s);
        let residual = found.as_ref().map_or(f64::INFINITY, |here| here.residual);
        let is_fresh = self.balanced.as_ref().is_some_and(fresh);
        let suits = residual <= MOST_RESIDUALS * self.least_residual;
        if !is_fresh && !suits {
            self.balanced = None;
            found = LocalEnclosure::tried(system, self.balanced(s, farthest)?, s);
        }
        let residual = found.as_ref().map_or(f64::INFINITY, |here| here.residual);
        let is_fresh = self.balanced.as_ref().is_some_and(fresh);
        self.least_residual = if is_fresh {
            residual
        } else {
            residual.min(self.least_residual)
        };
        found
    }

    pub(super) fn enclosure(&mut self, s: Complex64) -> Result<Option<LocalEnclosure>, Error> {
        self.spend()?;
        Ok(self.tried(s, ON_LINE).filter(LocalEnclosure::is_clear))
    }
}
