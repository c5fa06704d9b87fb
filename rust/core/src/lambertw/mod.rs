//! The Lambert W function: all solutions of w e^w = z, and the delay system behind it.
//!
//! Branch k is fixed by w + log w = log z + 2 pi i k with principal logarithms. Every finite z and
//! every integer k needs the same fixed amount of work: a starting value with an error of a few
//! 1e-4 and one step of fourth order whose residual is formed in double-double arithmetic. The
//! error |w - W|/|W| stays near that of a correctly rounded result (0.5 ulp in each component),
//! also next to -1/e. Signed zeros count as in C99: Im z = +0 is the upper side of the cut, -0 the
//! lower, so that W_k(conj z) = conj W_-k(z) without exception, and a real answer has an imaginary
//! part of zero with the sign of its limit. Bits do not depend on machine, threads or position. Not
//! guaranteed: the relative accuracy of a component much smaller than the other.
//!
//! # Edge cases
//!
//! ```
//! use deadtime::lambertw::lambertw;
//! use num_complex::Complex64;
//!
//! let w = |re, im, k| lambertw(Complex64::new(re, im), k);
//! let nearest = -0.36787944117144233; // the double next to -1/e, and below it
//!
//! // So the two sheets there are complex, and join across the cut.
//! assert_eq!(w(nearest, 0.0, 0).re, -1.0);
//! assert!((w(nearest, 0.0, 0).im - 8.22008e-9).abs() < 1e-14);
//! assert_eq!(w(nearest, 0.0, -1), w(nearest, 0.0, 0).conj());
//! assert_eq!(w(nearest, -0.0, 0), w(nearest, 0.0, 0).conj());
//!
//! // One ulp up they are real and a little apart.
//! let above = f64::from_bits(nearest.to_bits() - 1);
//! assert!(w(above, 0.0, 0).re > -1.0 && w(above, 0.0, 0).im == 0.0);
//! assert!(w(above, 0.0, -1).re < -1.0 && w(above, 0.0, -1).im.to_bits() == (-0.0_f64).to_bits());
//! assert!(w(above, -0.0, 1).re < -1.0 && w(above, -0.0, 1).im.to_bits() == 0);
//!
//! // Zero is kept by branch 0, sign included, and a logarithmic pole of the others.
//! assert!(w(-0.0, 0.0, 0).re.is_sign_negative());
//! assert_eq!(w(-0.0, 0.0, -1), Complex64::new(f64::NEG_INFINITY, 0.0));
//! assert_eq!(w(0.0, 0.0, 1), Complex64::new(f64::NEG_INFINITY, std::f64::consts::PI));
//!
//! // At infinity the argument survives, on its branch.
//! assert_eq!(w(f64::INFINITY, -0.0, 0), Complex64::new(f64::INFINITY, -0.0));
//! assert_eq!(w(f64::NEG_INFINITY, -0.0, 1), Complex64::new(f64::INFINITY, std::f64::consts::PI));
//!
//! // NaN anywhere is NaN everywhere.
//! assert!(w(f64::NAN, 0.0, 0).im.is_nan() && w(f64::INFINITY, f64::NAN, 0).re.is_nan());
//!
//! // No finite argument overflows, no branch is too far.
//! assert!(w(f64::MAX, f64::MAX, i64::MIN).im.is_finite());
//! assert!(w(5e-324, 0.0, -1).re < -700.0);
//! ```

#![deny(clippy::indexing_slicing)]
#![cfg_attr(test, allow(clippy::indexing_slicing))]

pub mod block;
mod branch_point;
mod branch_sort;
mod coefficients;
mod delay;
mod elementary;
mod guess;
mod huge_branch;
mod kernel;
mod log_form;
mod real;
mod real_coefficients;
mod refine;
mod scalar;
mod special_values;
#[cfg(test)]
mod tests;

pub(crate) use elementary::{rough_angle, rough_log};
pub use scalar::{dde_root, lambertw, lambertw_log};
