//! Rectangles with a proved number of roots, and their division.
//!
//! A cell stores the change of arg h along each of its edges. A cut then costs only the new line
//! and one part of each of the two edges that it meets. Coefficients are real, hence h(s̄) = h(s)‾:
//! a rectangle that is symmetric about the real axis is kept as its upper half, whose edge on the
//! axis contributes nothing to the winding number of the whole.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::turn::{Turn, Walk};
use crate::Error;

/// Positions of a cut, as shares of a side, in the order in which they are tried. The next one is
/// taken where a root lies on the cut.
const CUTS: [f64; 9] = [
    0.4871, 0.5417, 0.4393, 0.5823, 0.3911, 0.6307, 0.3301, 0.6907, 0.2703,
];

/// Distance stated in the error where the count is not decided, as a share of the width.
const UNDECIDED_SHARE: f64 = 1e-3;

/// A rectangle and the number of roots in it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    pub(crate) re: (f64, f64),
    /// For a symmetric cell the upper half, (0, height).
    pub(crate) im: (f64, f64),
    /// Does the cell represent itself together with its mirror image?
    pub(crate) symmetric: bool,
    /// Roots in the rectangle; in both halves of a symmetric one.
    pub(crate) count: u64,
    /// Along the lower, right, upper and left edge, anticlockwise.
    edges: [Turn; 4],
}

impl Cell {
    /// Count the roots of a rectangle by following arg h around it.
    ///
    /// # Errors
    /// Those of [`Walk::walk`].
    pub(crate) fn new(
        walker: &mut impl Walk,
        re: (f64, f64),
        im: (f64, f64),
        symmetric: bool,
    ) -> Result<Self, Error> {
        let corner = Complex64::new;
        let lower = if symmetric {
            Turn::default()
        } else {
            walker.walk(corner(re.0, im.0), corner(re.1, im.0))?
        };
        let right = walker.walk(corner(re.1, im.0), corner(re.1, im.1))?;
        let upper = walker.walk(corner(re.1, im.1), corner(re.0, im.1))?;
        let left = walker.walk(corner(re.0, im.1), corner(re.0, im.0))?;
        Self::from_edges(re, im, symmetric, [lower, right, upper, left])
    }

    fn from_edges(
        re: (f64, f64),
        im: (f64, f64),
        symmetric: bool,
        edges: [Turn; 4],
    ) -> Result<Self, Error> {
        let around = edges.into_iter().fold(Turn::default(), Turn::then);
        let unit = if symmetric { PI } else { TAU };
        let count = around.revolutions(unit).ok_or(Error::contour(
            Complex64::new(re.1, im.1),
            UNDECIDED_SHARE * (re.1 - re.0),
        ))?;
        Ok(Self {
            re,
            im,
            symmetric,
            count,
            edges,
        })
    }

    pub(crate) fn width(&self) -> f64 {
        self.re.1 - self.re.0
    }

    /// Height of the part above the real axis.
    pub(crate) fn height(&self) -> f64 {
        self.im.1 - self.im.0
    }

    /// Is `s`, its imaginary part not negative, in the (closed) rectangle?
    pub(crate) fn holds(&self, s: Complex64) -> bool {
        let (re, im) = (self.re, self.im);
        re.0 <= s.re && s.re <= re.1 && s.im <= im.1 && (s.im >= im.0 || self.symmetric)
    }

    /// Cut the cell across its longer side.
    ///
    /// # Errors
    /// Those of [`Walk::walk`]; [`Error::Contour`] when a root lies on every cut that was tried.
    pub(crate) fn halves(&self, walker: &mut impl Walk) -> Result<(Self, Self), Error> {
        let level = self.height() > self.width();
        self.first_cut(walker, CUTS.into_iter(), level)
    }

    /// Cut off about the lowest `share` of the height.
    ///
    /// # Errors
    /// As [`Cell::halves`].
    pub(crate) fn slice(&self, walker: &mut impl Walk, share: f64) -> Result<(Self, Self), Error> {
        self.first_cut(walker, CUTS.into_iter().map(|cut| 2.0 * cut * share), true)
    }

    fn first_cut(
        &self,
        walker: &mut impl Walk,
        shares: impl Iterator<Item = f64>,
        level: bool,
    ) -> Result<(Self, Self), Error> {
        let mut refused = Err(Error::argument("the region cannot be divided further"));
        for share in shares {
            let cut = if level {
                self.cut_level(walker, self.im.0 + share * self.height())
            } else {
                self.cut_upright(walker, self.re.0 + share * self.width())
            };
            match cut {
                Err(Error::Contour { .. }) => refused = cut,
                other => return other,
            }
        }
        refused
    }

    /// The parts below and above Im s = `y`.
    fn cut_level(&self, walker: &mut impl Walk, y: f64) -> Result<(Self, Self), Error> {
        let corner = Complex64::new;
        let (re, im) = (self.re, self.im);
        let [lower, right, upper, left] = self.edges;
        let cut = walker.walk(corner(re.1, y), corner(re.0, y))?;
        let right_part = walker.walk(corner(re.1, im.0), corner(re.1, y))?;
        let left_part = walker.walk(corner(re.0, y), corner(re.0, im.0))?;
        let below = Self::from_edges(
            re,
            (im.0, y),
            self.symmetric,
            [lower, right_part, cut, left_part],
        )?;
        let above = Self::from_edges(
            re,
            (y, im.1),
            false,
            [
                cut.reversed(),
                right.without(right_part),
                upper,
                left.without(left_part),
            ],
        )?;
        Ok((below, above))
    }

    /// The parts left and right of Re s = `x`.
    fn cut_upright(&self, walker: &mut impl Walk, x: f64) -> Result<(Self, Self), Error> {
        let corner = Complex64::new;
        let (re, im) = (self.re, self.im);
        let [lower, right, upper, left] = self.edges;
        let cut = walker.walk(corner(x, im.0), corner(x, im.1))?;
        let upper_part = walker.walk(corner(x, im.1), corner(re.0, im.1))?;
        let lower_part = if self.symmetric {
            Turn::default()
        } else {
            walker.walk(corner(re.0, im.0), corner(x, im.0))?
        };
        let west = Self::from_edges(
            (re.0, x),
            im,
            self.symmetric,
            [lower_part, cut, upper_part, left],
        )?;
        let east = Self::from_edges(
            (x, re.1),
            im,
            self.symmetric,
            [
                lower.without(lower_part),
                right,
                upper.without(upper_part),
                cut.reversed(),
            ],
        )?;
        Ok((west, east))
    }
}
