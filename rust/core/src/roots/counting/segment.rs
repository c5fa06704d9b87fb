//! A straight line on which g is proved to have no zero, as a certificate states it.

use num_complex::Complex64;

/// What a checker's digits must be good for, relative to the value.
pub(crate) const TRIFLE: f64 = 1e-20;

/// Several roots may be near where the bound on g″ allows less than this share of what the slope would.
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
