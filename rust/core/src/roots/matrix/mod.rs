//! Roots of det M(s), M(s) = s E + Σ (s N_j − A_j) e^(−s τ_j), without expanding the determinant.
//!
//! `blocks` splits the matrices into blocks of one state, which are quasi-polynomials, and coupled ones;
//! `product` answers the questions from those of the blocks. For a coupled block `determinant` does.
//! `system` holds its matrices, `balance` scales them at a point, `factor` bounds the rounding errors
//! of their inverses, `local_enclosure` (`kernel`) is what is proved about det M around a point;
//! `walker` evaluates M, `line` follows arg det M along lines and `newton` iterates to its roots, so
//! that rectangles are counted, divided and searched as for one function (`counting::cell`,
//! `locating::isolate`).
//! `simple_root` encloses one root by Newton's method for a bordered matrix, `cluster` roots that lie
//! close together by its Taylor series, `starts` guesses the
//! rightmost ones from a linearisation, `laguerre` leads to one amid many, `leading` proves that these are the rightmost.
//! `outer` bounds the roots of half planes by norms, `difference` bounds the chains of neutral
//! systems, `quotient` the roots beside them. All statements are proved for the matrices as
//! given, however large or small their entries are. The accuracy of a root depends on how regular M
//! is next to it; where rounding errors hide on which side of a line it lies, the result is an
//! error.

mod balance;
mod blocks;
mod cluster;
mod determinant;
mod difference;
mod factor;
mod kernel;
mod laguerre;
mod leading;
mod line;
mod local_enclosure;
mod newton;
mod outer;
mod prepared;
mod product;
mod quotient;
mod simple_root;
mod starts;
mod system;
#[cfg(test)]
mod tests;
mod walker;

pub use blocks::CharacteristicMatrix;
pub use product::{
    chain_abscissa, count, count_right_of, is_invertible, is_stable, rightmost, roots,
    spectral_abscissa,
};
