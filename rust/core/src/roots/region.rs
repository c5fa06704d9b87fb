//! Rectangles of the complex plane, with open sides.

use crate::Error;

/// The points whose real and imaginary parts lie in the two ranges. An infinite end is an open
/// side.
///
///
/// ```
/// use deadtime::roots::Region;
/// let right_half_plane = Region::new((0.0, f64::INFINITY), (f64::NEG_INFINITY, f64::INFINITY))?;
/// assert!(Region::new((1.0, 0.0), (0.0, 1.0)).is_err());
/// # Ok::<(), deadtime::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Range of the real part, 1/s.
    pub re: (f64, f64),
    /// Range of the imaginary part, rad/s.
    pub im: (f64, f64),
}

impl Region {
    /// A region with increasing ranges.
    ///
    /// # Errors
    /// [`Error::Argument`] where an end is NaN or a range does not increase.
    pub fn new(re: (f64, f64), im: (f64, f64)) -> Result<Self, Error> {
        let region = Self { re, im };
        region.check()?;
        Ok(region)
    }

    /// The half plane right of Re s = `sigma`.
    pub const fn right_of(sigma: f64) -> Self {
        Self {
            re: (sigma, f64::INFINITY),
            im: (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        for (name, (low, high)) in [("re", self.re), ("im", self.im)] {
            let increasing = low < high && low < f64::INFINITY && high > f64::NEG_INFINITY;
            refuse_if!(
                !increasing,
                "{name}=({low}, {high}): give a range whose lower end is below its upper end"
            );
        }
        Ok(())
    }

    /// The same region mirrored at the real axis.
    pub(super) fn mirrored(&self) -> Self {
        Self {
            re: self.re,
            im: (-self.im.1, -self.im.0),
        }
    }
}
