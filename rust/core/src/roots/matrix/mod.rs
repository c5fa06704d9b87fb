//! Roots of det M(s), M(s) = s E + Σ (s N_j − A_j) e^(−s τ_j), without expanding the determinant.
//!
//! `system` holds the matrices, `balance` scales them at a point, `factor` their factors and inverses with rounding bounds, `local_enclosure`
//! what is proved about det M around a point; `walker` makes walks and Newton's iteration of that,
//! with which rectangles are counted, divided and searched as for one function (`roots::cell`,
//! `roots::isolate`). `outer` bounds roots of half planes by norms, `difference` knows the chains of
//! neutral systems. Nothing is lost to the size of coefficients: what is proved is proved for the
//! matrices as given. A root is as well determined as M is regular next to it; where rounding hides
//! which side of a line it is on, there is an error, never a guess.

mod balance;
mod determinant;
mod difference;
mod factor;
mod local_enclosure;
mod outer;
mod system;
#[cfg(test)]
mod tests;
mod walker;

pub use determinant::{
    chain_abscissa, count, count_right_of, is_invertible, is_stable, rightmost, roots,
    spectral_abscissa,
};
pub use system::CharacteristicMatrix;
