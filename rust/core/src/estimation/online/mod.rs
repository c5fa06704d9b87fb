//! The delay while a loop runs: a bank of Kalman filters over delays and lags.
//!
//! Each cell of the bank holds the states of plant and noise if its delay and lags are the right
//! ones; given the command the output is linear in them, the gain included, so that each filter is
//! exact and the weights of the cells are the posterior. The states are physical and mean the same
//! in every cell. So the delay may walk from cell to cell (`walk`), and jump: a second bank holds
//! the states if it has jumped, and its weights are the sum over the times of the jump and the new
//! delays of the likelihood ratio (`Settings::alarm`). Both need information about the delay (`Bank`
//! gates them): while no command changes nothing is forgotten. Cells are closer together where the
//! posterior is narrow (`refine`).

mod answer;
mod bank;
mod cell;
mod cells;
mod change;
mod estimator;
mod history;
mod judge;
mod layer;
mod posterior;
mod refine;
mod response;
mod row_by_row;
mod settings;
mod walk;

pub use answer::Answer;
pub use estimator::online;
pub use posterior::Known;
pub use row_by_row::Online;
pub use settings::{Lags, Settings};
