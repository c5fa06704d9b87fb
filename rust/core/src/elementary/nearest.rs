//! Rounding to the nearest integer by two sums.

/// Adding and subtracting 1.5 · 2⁵² rounds to the nearest integer, for |x| < 2⁵¹.
pub(super) const ROUNDER: f64 = 6_755_399_441_055_744.0;

#[inline(always)]
pub(super) fn nearest(x: f64) -> f64 {
    (x + ROUNDER) - ROUNDER
}
