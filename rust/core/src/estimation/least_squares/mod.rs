//! Least squares over named numbers of one recording or several: minima, and minima with one
//! quantity held.
//!
//! A part gives the misfit (simulated minus recorded output) of its recording and its derivatives.
//! Numbers of the vehicle are common to all parts; each part may have an initial output of its own.
//! The cost has several local minima over the delay, so the best points of a grid are refined
//! (`search`). Recordings are weighted by the inverse of their excitation, or of what is left of
//! them, iterated (`weights`). `closed_loop` is the simulated loop, `chebyshev` the loop with a
//! polynomial for the delay, `quotients` derivatives where there are no others, `scan` the least
//! cost over a range of delays, `rounded` the likelihood of rounded rows, `vanishing` sets lags and delays
//! to zero that do not matter, `covariance` is for white and coloured residuals.

mod chebyshev;
mod closed_loop;
mod covariance;
mod held;
mod joint;
mod quotients;
mod rounded;
mod scan;
mod search;
mod tolerances;
mod vanishing;
mod weights;

pub use chebyshev::Chebyshev;
pub use closed_loop::{ClosedLoop, Given, Number, Simulated};
pub use covariance::{embedded, robust_covariance, white_covariance};
pub use held::least_held;
pub use joint::{Fitted, Joint, Part};
pub(super) use quotients::quotients;
pub use rounded::{Peak, Readings, Rounded};
pub use scan::{Scan, local_minima, refined, scan};
pub use search::{Minimum, solve};
pub use vanishing::{Vanishing, without_vanishing};
pub use weights::by_scatter;
