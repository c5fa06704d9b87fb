//! The change of arg h along a line, and the interface of everything that measures it.

use num_complex::Complex64;

use crate::Error;

/// Change of arg h along a line, in rad, and a bound on its error.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Turn {
    pub(crate) angle: f64,
    pub(crate) slack: f64,
}

impl Turn {
    /// The same line in the opposite direction.
    pub(crate) fn reversed(self) -> Self {
        Self {
            angle: -self.angle,
            slack: self.slack,
        }
    }

    /// This line followed by `next`.
    pub(crate) fn then(self, next: Self) -> Self {
        Self {
            angle: self.angle + next.angle,
            slack: self.slack + next.slack,
        }
    }

    /// The rest of this line after `part` is removed.
    pub(crate) fn without(self, part: Self) -> Self {
        self.then(part.reversed())
    }

    /// The number of `unit`s in a closed path; `None` where the slack allows more than one number.
    /// The true number is within 1/4 + 1/4 of the sum; the sums of a few edges have errors of u
    /// each.
    pub(crate) fn revolutions(self, unit: f64) -> Option<u64> {
        let number = (self.angle / unit).round();
        let off = (self.angle - number * unit).abs();
        (self.slack < 0.24 * unit && off <= 0.25 * unit && number >= 0.0).then_some(number as u64)
    }
}

/// Computes the change of arg h along lines parallel to an axis.
pub(crate) trait Walk {
    /// Change of arg h from `from` to `to`.
    ///
    /// # Errors
    /// [`Error::Contour`] where a root lies on the line or too close to it; [`Error::TooMuch`],
    /// [`Error::Interrupted`].
    fn walk(&mut self, from: Complex64, to: Complex64) -> Result<Turn, Error>;
}
