//! A whole fit of a named plant to recordings: starts, noise, outliers, and intervals.
//!
//! The likelihood has local minima over the delay, and others where air takes the place of what the
//! plant lacks. Least squares on a grid over delay and lag gives the first start (`start`); the same
//! grid in strong air gives others (`search`). Trim, air, coloured sensor noise and scattered times are
//! kept where Akaike's criterion asks for them, outliers are left out (`rounds`), and intervals are
//! those of the profile (`intervals`). Tests say whether the fit holds (`judge`).

mod between;
mod covariance;
mod fit;
mod grid;
mod intervals;
mod judge;
mod median;
mod noise_known;
mod numbers;
mod outliers;
mod plant;
mod rounded_rows;
mod rounds;
mod search;
mod start;
#[cfg(test)]
mod tests;
mod tolerances;

pub use between::{BetweenRows, Controlled, RunCommands, Sent, between_rows};
pub use fit::{FlightFit, FlightRun, LoopNumbers, NoiseInUnits};
pub use intervals::{Ends, FlightProfile, Known as KnownQuantity};
pub use judge::{
    Cause, Finding, Judgement, LEVEL_OF_TESTS, Whiteness, colour_factors, judge_profile,
    unseen_lag, whiteness,
};
pub use numbers::{FreeNumbers, WithNumbers, first_numbers, fit_numbers};
pub use plant::FlightPlant;
pub use rounded_rows::coarse_step;
pub use rounds::{beside_noise, fit_flight};
pub use search::{Scatter, scatter_of};
pub use start::{is_long, least_squares};
pub use tolerances::{LONGEST_DELAY, MOST_NUMBERS};
