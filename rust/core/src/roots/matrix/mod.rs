//! Roots of det M(s), M(s) = s E + Σ (s N_j − A_j) e^(−s τ_j), without expanding the determinant.
//!
//! `system` holds the matrices, `balance` scales them at a point, `factor` bounds the rounding errors
//! of their inverses, `local_enclosure` (`kernel`) is what is proved about det M around a point;
//! `walker` evaluates M, `line` follows arg det M along lines and `newton` iterates to its roots, so
//! that rectangles are counted, divided and searched as for one function (`counting::cell`,
//! `locating::isolate`).
//! `simple_root` encloses one root by Newton's method for a bordered matrix, `starts` guesses the
//! rightmost ones from a linearisation, `leading` proves that these are the rightmost.
//! `outer` bounds the roots of half planes by norms, `difference` bounds the chains of neutral
//! systems. `determinant` answers the questions. All statements are proved for the matrices as
//! given, however large or small their entries are. The accuracy of a root depends on how regular M
//! is next to it; where rounding errors hide on which side of a line it lies, the result is an
//! error.

mod balance;
mod determinant;
mod difference;
mod factor;
mod kernel;
mod leading;
mod line;
mod local_enclosure;
mod newton;
mod outer;
mod prepared;
mod simple_root;
mod starts;
mod system;
#[cfg(test)]
mod tests;
mod walker;

pub use determinant::{
    chain_abscissa, count, count_right_of, is_invertible, is_stable, rightmost,
    rightmost_from_guesses, roots, spectral_abscissa,
};
pub use system::CharacteristicMatrix;
