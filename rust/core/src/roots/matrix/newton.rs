//! Newton's iteration on det M.
//!
//! Newton's step is −1/tr(M⁻¹ M′). Where M is too close to a singular matrix for a proof, the roots
//! in a square about the iterate are counted, the smallest one around which arg det M can be
//! followed.

use num_complex::Complex64;

use super::cluster::cluster;
use super::simple_root::simple_root;
use super::walker::{LEAST_SIZE, MatrixWalker, NEAR_ROOT, RESOLUTION};
use crate::Error;
use crate::quasipoly::modulus;
use crate::roots::counting::Cell;
use crate::roots::disc::Disc;
use crate::roots::locating::{Outcome, Seek};

/// Upper limit on Newton's steps from one start.
const MAX_STEPS: usize = 40;

/// Evaluations spent on a small square before a larger one is tried.
const EAGER_LIMIT: u64 = 1000;

/// Factors from one square to the next, and to the next after one that took too many evaluations.
/// Larger: fewer squares, wider discs; smaller: the reverse.
const SQUARE_GROWTH: f64 = 3.0;
const FAST_GROWTH: f64 = 9.0;

/// Distance from the real axis, in halves of a side, up to which a square is made symmetric about
/// it. Larger: squares of pairs that could be told apart; smaller: edges next to the axis.
const NEAR_AXIS: f64 = 1.5;

/// Slightly above √2: the half-diagonal of a square, in halves of its side.
const HALF_DIAGONAL: f64 = 1.4143;

/// Rounding error of the corners of a square, relative to the modulus of its centre.
const CORNER_ROUNDING: f64 = 2.0 * f64::EPSILON;

/// Range of the ratio of two steps in which a multiple root is assumed.
const STEADY: std::ops::Range<f64> = 0.4..0.97;

/// Largest relative change of that ratio.
const STEADY_CHANGE: f64 = 0.05;

/// Largest relative distance of roots that are enclosed together.
const CLUSTER: f64 = 1e-6;

/// Largest relative length of a last step that is accepted.
const LAST_STEP: f64 = 1e-3;

impl MatrixWalker<'_> {
    /// The smallest square about `z` in which the number of roots can be proved, not 0.
    fn square(&mut self, z: Complex64, most: f64) -> Result<Option<Disc>, Error> {
        let size = self.system.size() as f64;
        let mut half = RESOLUTION * size.sqrt() * modulus(z).max(LEAST_SIZE * self.system.rate());
        let mut growth = SQUARE_GROWTH;
        while half < most {
            if self.enclosure(z + half)?.is_some() {
                // A square that would meet the real axis is made symmetric about it.
                let symmetric = z.im.abs() <= NEAR_AXIS * half;
                let (center, im) = if symmetric {
                    (Complex64::new(z.re, 0.0), (0.0, half))
                } else {
                    (z, (z.im - half, z.im + half))
                };
                // Next to a defective root the steps are as short as the square of the distance.
                self.eager_limit = self.evaluations + EAGER_LIMIT;
                let cell = Cell::new(self, (center.re - half, center.re + half), im, symmetric);
                growth = if self.evaluations > self.eager_limit {
                    FAST_GROWTH
                } else {
                    SQUARE_GROWTH
                };
                self.eager_limit = u64::MAX;
                match cell {
                    Ok(cell) if cell.count > 0 => {
                        return Ok(u32::try_from(cell.count).ok().map(|multiplicity| Disc {
                            center: Complex64::new(center.re, center.im.abs()),
                            // The half-diagonal, enlarged by the rounding errors of the corners.
                            radius: half * HALF_DIAGONAL + CORNER_ROUNDING * modulus(center),
                            isolation: half,
                            multiplicity,
                        }));
                    }
                    Ok(_) | Err(Error::Contour { .. }) => {}
                    Err(other) => return Err(other),
                }
            }
            half *= growth;
        }
        Ok(None)
    }

    /// The disc of the single root next to `z`, or of the cluster next to it.
    fn proved(&mut self, z: Complex64) -> Result<Outcome, Error> {
        let up = Complex64::new(z.re, z.im.abs());
        let holds = |disc: &&Disc| (disc.center - up).norm() <= disc.isolation;
        if let Some(disc) = self.known.iter().find(holds) {
            return Ok(Outcome::Simple(*disc));
        }
        let most = CLUSTER * modulus(z).max(LEAST_SIZE * self.system.rate());
        if self.stalled.iter().any(|place| (place - up).norm() < most) {
            return Ok(Outcome::Stalled(z));
        }
        self.spend()?;
        let system = self.system;
        let single = self
            .balanced(up, NEAR_ROOT)
            .and_then(|balanced| simple_root(system, balanced, up))
            .filter(|disc| disc.radius < most);
        let proved = single.or_else(|| {
            let balanced = self.balanced(up, NEAR_ROOT)?;
            cluster(system, balanced, up)
        });
        let found = match proved {
            Some(disc) => Some(disc),
            None => self.square(up, most)?,
        };
        Ok(match found {
            Some(disc) if proved.is_some() || disc.multiplicity == 1 => {
                self.known.push(disc);
                Outcome::Simple(disc)
            }
            _ => {
                self.stalled.push(up);
                Outcome::Stalled(z)
            }
        })
    }
}

impl Seek for MatrixWalker<'_> {
    fn pause(&mut self) -> Result<(), Error> {
        self.spend()
    }

    fn newton(
        &mut self,
        start: Complex64,
        window: &dyn Fn(Complex64) -> bool,
    ) -> Result<Outcome, Error> {
        // The scaling next to the root decides how accurate the root is.
        self.balanced = None;
        let mut z = start;
        let mut last = Complex64::ZERO;
        let mut slow = 0.0;
        for _ in 0..MAX_STEPS {
            self.spend()?;
            let Some(here) = self.tried(z, NEAR_ROOT) else {
                return self.proved(z);
            };
            let step = here.correction;
            if !step.is_finite() {
                return Ok(Outcome::Lost);
            }
            // Next to an m-fold root steps shrink only by 1 − 1/m, so that m of them are taken at
            // once.
            let ratio = modulus(step) / modulus(last);
            let settled = STEADY.contains(&ratio) && (ratio - slow).abs() < STEADY_CHANGE * ratio;
            let fold = if settled {
                (1.0 / (1.0 - ratio)).round()
            } else {
                1.0
            };
            slow = if fold > 1.0 { 0.0 } else { ratio };
            last = step;
            let next = z - step * fold;
            let small = modulus(step) <= RESOLUTION * modulus(z);
            if small || !here.is_resolved() {
                let end = if window(next) && modulus(step) < LAST_STEP * modulus(z) {
                    next
                } else {
                    z
                };
                return self.proved(end);
            }
            if !window(next) {
                return Ok(Outcome::Lost);
            }
            z = next;
        }
        Ok(Outcome::Lost)
    }

    fn cluster(&mut self, place: Complex64, most: f64) -> Result<Option<Disc>, Error> {
        self.square(Complex64::new(place.re, place.im.abs()), most)
    }

    fn delay_span(&self) -> f64 {
        self.system.longest()
    }

    fn at_zero_if_exact(&self, disc: Disc) -> Disc {
        // No sum of products is formed here that could be exactly zero.
        disc
    }
}
