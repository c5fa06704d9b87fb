//! A straight line on which g is proved to have no zero, as a certificate states it.

use num_complex::Complex64;

/// Share of |v|/r added to the bound on the slope. A checker must compute values to this relative
/// accuracy.
pub(crate) const TRIFLE: f64 = 1e-20;

/// If the bound on g″ shortens a step to less than this share of what the slope alone would allow,
/// several roots may be close, and the Taylor bound is tried.
pub(crate) const CLUSTER_SUSPECTED: f64 = 0.02;

/// A straight line on which g has no zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Where it begins.
    pub start: Complex64,
    /// Where it ends.
    pub end: Complex64,
    /// The point where g was evaluated.
    pub middle: Complex64,
    /// Index of the delay τ_c with which g = h e^(s τ_c).
    pub reference: usize,
    /// g(middle), but for `error`.
    pub value: Complex64,
    /// Bound on the error of `value`.
    pub error: f64,
    /// Bound on |g′| in the disc about the middle that reaches to both ends.
    pub slope: f64,
}
