//! Dense linear algebra: the one copy of each factorisation.
//!
//! * Real: `lu` solves and inverts, `cholesky` inverts what is positive definite, `triangle` is R of
//!   X = Q R, `singular` has singular values and `symmetric` eigenvalues of small matrices, `balance`
//!   scales a matrix to a small norm, `eigenvalues` finds those of the form of `hessenberg` by the
//!   double-shift QR algorithm.
//! * `block_triangular` splits a matrix by its pattern of zeros.
//! * Complex: `elimination` factors and inverts `rows`, `banded` has factors near the diagonal.
//!
//! Matrices are row-major. Only sums, products, quotients and roots are taken, so that results have
//! the same bits on every machine. The sizes of arguments are those that each function names; entries
//! may be anything, and lead to an error or to numbers that are not finite, never to a panic.

pub(crate) mod balance;
pub(crate) mod banded;
pub(crate) mod block_triangular;
pub(crate) mod cholesky;
pub(crate) mod eigenvalues;
pub(crate) mod elimination;
mod hessenberg;
pub(crate) mod lu;
pub(crate) mod rows;
pub(crate) mod singular;
pub(crate) mod symmetric;
pub(crate) mod triangle;
pub(crate) mod vectors;
