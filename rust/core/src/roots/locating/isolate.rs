//! All roots of a region: cells with proved counts, and Newton's iteration in each.
//!
//! In a cell Newton's iteration starts from the roots found just below, shifted by the spacing
//! 2π/(τ_max − τ_min) at which chains repeat, then from points of the golden-ratio sequence; every
//! limit becomes a disc proved to hold exactly its multiplicity. A cell is complete when its discs
//! add up to its count; otherwise it is cut. Where rounding errors exceed the values, a cluster is
//! enclosed in one disc. At the end the discs are disjoint, lie inside the region and add up to its
//! count. This proves that none is missing, independently of how the search went.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::along_chains::discs_along_chains;
use super::clusters::cluster;
use super::newton::{Outcome, newton};
use crate::Error;
use crate::order::sort_up;
use crate::roots::counting::{Cell, Walk, Walker};
use crate::roots::disc::{Disc, RESOLVED};

/// Cells with more missing roots than this are cut before Newton's iteration is tried in them.
const MOST_MISSING: u64 = 10;

/// Largest cell, in roots, in which those that chains left out are sought. In a larger one most
/// starts lead to known roots.
const FEW: u64 = 16;

/// Number of consecutive cuts that separate no roots after which a cluster is assumed.
const IDLE_CUTS: u32 = 8;

/// Fractional parts of multiples of these numbers (powers of the plastic number) fill a square
/// evenly.
const EVEN: (f64, f64) = (0.754_877_666_246_692_8, 0.569_840_290_998_053_3);

/// Starts around a cluster: angle of the first one in rad, distance as a share of the radius.
const AROUND: (f64, f64) = (0.3, 0.7);

/// Walks along lines and iterates towards roots.
pub(crate) trait Seek: Walk {
    /// Check for cancellation and for the limit on evaluations.
    fn pause(&mut self) -> Result<(), Error>;

    /// Newton's iteration from `start` as long as it stays in `window`.
    fn newton(
        &mut self,
        start: Complex64,
        window: &dyn Fn(Complex64) -> bool,
    ) -> Result<Outcome, Error>;

    /// The smallest disc about the cluster at `place`, at most `most` wide, in which the number of
    /// roots can be proved.
    fn cluster(&mut self, place: Complex64, most: f64) -> Result<Option<Disc>, Error>;

    /// The largest delay less the smallest, in s.
    fn delay_span(&self) -> f64;

    /// Disjoint discs about simple roots in the upper half of the cell, found along chains.
    fn along_chains(&self, _cell: &Cell) -> Result<Vec<Disc>, Error> {
        Ok(Vec::new())
    }

    /// The disc, shrunk to the point 0 where all its roots are known to be exactly there.
    fn at_zero_if_exact(&self, disc: Disc) -> Disc;
}

impl Seek for Walker<'_> {
    fn pause(&mut self) -> Result<(), Error> {
        Walker::pause(self)
    }

    fn newton(
        &mut self,
        start: Complex64,
        window: &dyn Fn(Complex64) -> bool,
    ) -> Result<Outcome, Error> {
        Ok(newton(&mut self.probe, start, window))
    }

    fn cluster(&mut self, place: Complex64, most: f64) -> Result<Option<Disc>, Error> {
        Ok(cluster(&mut self.probe, place, most))
    }

    fn delay_span(&self) -> f64 {
        let delays = self.probe.function().delays();
        delays.last().copied().unwrap_or(0.0) - delays.first().copied().unwrap_or(0.0)
    }

    fn along_chains(&self, cell: &Cell) -> Result<Vec<Disc>, Error> {
        discs_along_chains(self.probe.function(), cell, self.task)
    }

    fn at_zero_if_exact(&self, disc: Disc) -> Disc {
        disc.at_zero_if_exact(self.probe.function())
    }
}

/// Discs found so far, ordered by the imaginary part of their centre.
pub(crate) struct Search<'w, W: Seek> {
    walker: &'w mut W,
    found: Vec<Disc>,
    widest: f64,
    spacing: f64,
    /// Were most discs found along chains?
    along_chains: bool,
}

impl<'w, W: Seek> Search<'w, W> {
    pub(crate) fn new(walker: &'w mut W) -> Self {
        Self::with(walker, Vec::new())
    }

    /// A search that starts with disjoint discs that are already known.
    pub(crate) fn with(walker: &'w mut W, mut found: Vec<Disc>) -> Self {
        sort_up(&mut found, |disc| disc.center.im);
        let widest = found
            .iter()
            .map(|disc| disc.isolation.max(disc.radius))
            .fold(0.0, f64::max);
        let spacing = TAU / walker.delay_span();
        Self {
            walker,
            found,
            widest,
            spacing,
            along_chains: false,
        }
    }

    pub(crate) fn walker(&self) -> &W {
        self.walker
    }

    pub(crate) fn walker_mut(&mut self) -> &mut W {
        self.walker
    }

    /// A search for what is left of a cell after chains of roots have been followed.
    pub(crate) fn after_chains(walker: &'w mut W, cell: &Cell) -> Result<Self, Error> {
        let known = walker.along_chains(cell)?;
        let along_chains = !known.is_empty();
        Ok(Self {
            along_chains,
            ..Self::with(walker, known)
        })
    }

    /// Iterate from `starts` as long as the iterates stay in `window`, and keep the discs of simple
    /// roots.
    pub(crate) fn iterate_from(
        &mut self,
        starts: &[Complex64],
        window: impl Fn(Complex64) -> bool,
    ) -> Result<(), Error> {
        for start in starts {
            self.walker.pause()?;
            if let Outcome::Simple(disc) = self.walker.newton(*start, &window)? {
                self.insert(disc);
            }
        }
        Ok(())
    }

    /// Number of roots in the discs right of Re s = `sigma` and in their mirror images.
    pub(crate) fn weight_right_of(&self, sigma: f64) -> u64 {
        let right = |disc: &&Disc| disc.center.re - disc.radius > sigma;
        self.found.iter().filter(right).map(Disc::weight).sum()
    }

    /// Is `place`, or its mirror image, within the isolation radius of a known disc? Newton's
    /// iteration from there would lead to that root again.
    pub(crate) fn knows(&self, place: Complex64) -> bool {
        let place = Complex64::new(place.re, place.im.abs());
        let mut near = self.found.iter();
        near.any(|disc| (disc.center - place).norm() < disc.isolation)
    }

    /// The discs, ordered by the imaginary part of their centres.
    pub(crate) fn found(&self) -> &[Disc] {
        &self.found
    }

    /// The same, at the end of the search.
    pub(crate) fn into_found(self) -> Vec<Disc> {
        self.found
    }

    /// Number of roots located in the cell.
    fn located(&self, cell: &Cell) -> u64 {
        let from = if cell.symmetric { -1.0 } else { cell.im.0 };
        let start = self.found.partition_point(|disc| disc.center.im < from);
        self.found
            .iter()
            .skip(start)
            .take_while(|disc| disc.center.im <= cell.im.1)
            .filter(|disc| cell.holds(disc.center))
            .map(|disc| {
                if cell.symmetric {
                    disc.weight()
                } else {
                    disc.multiplicity.into()
                }
            })
            .sum()
    }

    /// Keep a disc unless its root is known. A cluster replaces the discs inside it.
    fn insert(&mut self, disc: Disc) -> bool {
        let disc = self.walker.at_zero_if_exact(disc);
        let reach = self.widest + disc.radius;
        let first = self
            .found
            .partition_point(|d| d.center.im < disc.center.im - reach);
        let last = self
            .found
            .partition_point(|d| d.center.im <= disc.center.im + reach);
        let mut swallowed = Vec::new();
        for index in first..last {
            let Some(other) = self.found.get(index) else {
                break;
            };
            let apart = (disc.center - other.center).norm() * (1.0 + 1e-12);
            let inside = apart + other.radius <= disc.radius;
            if inside && disc.multiplicity > other.multiplicity {
                swallowed.push(index);
            } else if apart + disc.radius <= other.isolation || apart <= disc.radius + other.radius
            {
                return false;
            }
        }
        for index in swallowed.into_iter().rev() {
            self.found.remove(index);
        }
        self.widest = self.widest.max(disc.isolation).max(disc.radius);
        let place = self.found.partition_point(|d| d.center.im < disc.center.im);
        self.found.insert(place, disc);
        true
    }

    /// Locate every root of `cell`.
    ///
    /// # Errors
    /// [`Error::CountMismatch`] where double precision does not suffice; those of the walks.
    pub(crate) fn locate_all(&mut self, cell: Cell) -> Result<(), Error> {
        let mut cells = vec![(cell, 0)];
        while let Some((cell, idle)) = cells.pop() {
            self.walker.pause()?;
            let missing = cell.count.saturating_sub(self.located(&cell));
            if missing == 0 {
                continue;
            }
            let few = missing <= MOST_MISSING && (!self.along_chains || cell.count <= FEW);
            if (few || idle >= IDLE_CUTS) && self.try_here(&cell)? {
                continue;
            }
            let tall = cell.height() > cell.width();
            // Chains leave out roots next to 0, and here and there another one.
            let scattered = self.along_chains && 2 * missing < cell.count && !cell.symmetric;
            let parts = if cell.count > MOST_MISSING && tall && !scattered {
                cell.slice(self.walker, 4.0 / cell.count as f64)
            } else if self.is_divisible(&cell) {
                cell.halves(self.walker)
            } else {
                return Err(self.mismatch(cell.count, &cell));
            };
            match parts {
                Ok((first, second)) => {
                    let parted = first.count > 0 && second.count > 0;
                    let idle = if parted { 0 } else { idle + 1 };
                    cells.extend([(second, idle), (first, idle)]);
                }
                Err(Error::Contour { .. }) => return Err(self.mismatch(cell.count, &cell)),
                Err(other) => return Err(other),
            }
        }
        Ok(())
    }

    fn is_divisible(&self, cell: &Cell) -> bool {
        let size = cell.im.1.abs().max(cell.re.0.abs()).max(cell.re.1.abs());
        cell.width().max(cell.height()) > 64.0 * f64::EPSILON * size
    }

    /// Iterate within the cell. Are all its roots found?
    fn try_here(&mut self, cell: &Cell) -> Result<bool, Error> {
        let margin = cell.width() + cell.height();
        let (re, im) = (cell.re, cell.im);
        let window = move |s: Complex64| {
            s.re > re.0 - margin && s.re < re.1 + margin && s.im.abs() < im.1 + margin
        };
        let mut stalled = Vec::new();
        let tries = 8 + 3 * cell.count as usize;
        let starts = self
            .shifted(cell)
            .into_iter()
            .chain((0..tries).map(|k| even(cell, k)));
        for start in starts {
            self.walker.pause()?;
            match self.walker.newton(start, &window)? {
                Outcome::Simple(disc) => {
                    if self.insert(disc) && self.located(cell) >= cell.count {
                        return Ok(self.located(cell) == cell.count);
                    }
                }
                Outcome::Stalled(place) => {
                    let place = Complex64::new(place.re, place.im.abs());
                    let known = |d: &Disc| (d.center - place).norm() <= d.radius;
                    if cell.holds(place) && stalled.len() < 4 && !self.found.iter().any(known) {
                        stalled.push(place);
                    }
                }
                Outcome::Lost => {}
            }
        }
        let most = 0.5 * cell.width().min(cell.height());
        for place in stalled {
            if self
                .found
                .iter()
                .any(|d| (d.center - place).norm() <= d.radius)
            {
                continue;
            }
            if let Some(disc) = self.walker.cluster(place, most)?
                && !self.parted(&disc)?
            {
                self.insert(disc);
            }
        }
        Ok(self.located(cell) == cell.count)
    }

    /// Iterate from points around a cluster. Are its roots found one by one?
    fn parted(&mut self, cluster: &Disc) -> Result<bool, Error> {
        let Disc {
            center,
            radius,
            multiplicity,
            ..
        } = *cluster;
        if radius <= RESOLVED * center.norm() {
            return Ok(false);
        }
        let window = move |s: Complex64| (s - center).norm() <= 4.0 * radius;
        let inside = |found: &[Disc]| {
            let near = found
                .iter()
                .filter(|disc| (disc.center - center).norm() + disc.radius <= radius);
            // Discs off the axis stand for their mirror images, if these are inside as well.
            let weight = |disc: &Disc| {
                if cluster.is_on_axis() {
                    disc.weight()
                } else {
                    disc.multiplicity.into()
                }
            };
            near.map(weight).sum::<u64>()
        };
        let starts = 3 * multiplicity;
        for k in 0..starts {
            self.walker.pause()?;
            let angle = AROUND.0 + TAU * f64::from(k) / f64::from(starts);
            let start = center + Complex64::from_polar(AROUND.1 * radius, angle);
            if let Outcome::Simple(disc) = self.walker.newton(start, &window)? {
                self.insert(disc);
            }
            if inside(&self.found) == u64::from(multiplicity) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Roots just below the cell, shifted into it.
    fn shifted(&self, cell: &Cell) -> Vec<Complex64> {
        if !self.spacing.is_finite() || cell.symmetric {
            return Vec::new();
        }
        let bottom = cell.im.0;
        let start = self
            .found
            .partition_point(|disc| disc.center.im < bottom - self.spacing);
        let below = self
            .found
            .iter()
            .skip(start)
            .take_while(|disc| disc.center.im < bottom);
        let rows = (cell.height() / self.spacing).min(MOST_MISSING as f64) as u32 + 1;
        below
            .take(4 * MOST_MISSING as usize)
            .flat_map(|disc| {
                let center = disc.center;
                (1..=rows).map(move |k| center + Complex64::I * (f64::from(k) * self.spacing))
            })
            .filter(|s| cell.holds(*s))
            .collect()
    }

    fn mismatch(&self, counted: u64, cell: &Cell) -> Error {
        // A root counted on one side of an edge may have the centre of its disc on the other side.
        let beyond = |from: f64, to: f64, x: f64| (from - x).max(x - to).max(0.0);
        let reaches = |disc: &&Disc| {
            let Disc { center, radius, .. } = **disc;
            let across = beyond(cell.re.0, cell.re.1, center.re);
            let along = beyond(cell.im.0, cell.im.1, center.im);
            across.hypot(along) <= radius + 4.0 * f64::EPSILON * center.norm()
        };
        if let Some(disc) = self.found.iter().find(reaches) {
            return Error::contour(
                disc.center,
                4.0 * (disc.radius + f64::EPSILON * disc.center.norm()),
            );
        }
        let found = self.found.iter().filter(|disc| cell.holds(disc.center));
        Error::CountMismatch {
            counted,
            found: found.map(|disc| (disc.center, disc.multiplicity)).collect(),
            advice: format!(
                "near {:e}{:+e}i, double precision cannot separate the roots. Try another unit of \
                 time, or an equation that is expanded less",
                0.5 * (cell.re.0 + cell.re.1),
                cell.im.1
            ),
        }
    }
}

/// The k-th point of a sequence that fills the cell evenly.
fn even(cell: &Cell, k: usize) -> Complex64 {
    let part = |share: f64| (0.5 + (k as f64 + 1.0) * share).fract();
    Complex64::new(
        cell.re.0 + part(EVEN.0) * cell.width(),
        cell.im.0 + part(EVEN.1) * cell.height(),
    )
}
