//! Stability over two parameters.
//!
//! `axes` holds what is asked. `grid` chooses the method: `rows`, where one parameter enters as a
//! gain or as one delay, or `blocks`, which `block` divides by the proofs of boxes. `one_row` does
//! so with one row, whose crossings `row_search` finds. `chart` holds the arrays, `curves` joins
//! crossings to boundaries, and `robust` maps what holds over an interval of a third parameter.

mod axes;
mod block;
mod blocks;
mod chart;
mod curves;
mod grid;
mod one_row;
mod robust;
mod row_search;
mod rows;

pub use axes::{Axis, Proof, Question};
pub use chart::Chart;
pub use curves::Vertex;
pub(crate) use curves::{Lines, join_both};
pub use grid::{Boundaries, boundaries, chains, map};
pub use robust::robust_map;
