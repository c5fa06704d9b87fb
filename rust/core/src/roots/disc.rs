//! Discs in which the number of roots is proved.

use num_complex::Complex64;

use crate::quasipoly::{QuasiPolynomial, modulus};

/// Relative radius below which the roots of a disc count as one point: they agree to twelve digits.
pub(super) const RESOLVED: f64 = 1e-12;

/// A disc in which the number of roots is proved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Disc {
    pub(crate) center: Complex64,
    /// All `multiplicity` roots are within this distance of the centre.
    pub(crate) radius: f64,
    /// No other root is within this distance.
    pub(crate) isolation: f64,
    pub(crate) multiplicity: u32,
}

impl Disc {
    /// Does the disc meet the real axis? Its roots are then their own mirror images.
    pub(super) fn is_on_axis(&self) -> bool {
        self.center.im.abs() <= self.radius
    }

    /// Number of roots in the disc and its mirror image.
    pub(super) fn weight(&self) -> u64 {
        u64::from(self.multiplicity) * if self.is_on_axis() { 1 } else { 2 }
    }

    /// Shrink a disc about 0 to the point 0 if all its roots are exactly there.
    pub(super) fn at_zero_if_exact(self, h: &QuasiPolynomial) -> Self {
        let about_zero = modulus(self.center) <= self.radius;
        if about_zero && h.order_at_zero(self.multiplicity) == self.multiplicity {
            Self {
                center: Complex64::ZERO,
                radius: 0.0,
                isolation: (self.isolation - modulus(self.center)).max(0.0),
                ..self
            }
        } else {
            self
        }
    }

    pub(super) fn mirrored_up(mut self) -> Self {
        self.center.im = self.center.im.abs();
        self
    }
}

/// A disc and, unless it lies on the real axis, its mirror image.
pub(super) fn with_mirror_image(disc: Disc) -> impl Iterator<Item = Disc> {
    let image = Disc {
        center: disc.center.conj(),
        ..disc
    };
    std::iter::once(disc).chain((!disc.is_on_axis()).then_some(image))
}
