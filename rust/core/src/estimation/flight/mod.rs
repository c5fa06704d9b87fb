//! A whole fit of a named plant to recordings: starts, noise, outliers, and intervals.
//!
//! The likelihood has local minima over the delay, and others where air takes the place of what the
//! plant lacks. Least squares on a grid over delay and lag gives the first start (`start`); the same
//! grid in strong air gives others (`search`). Trim, air, coloured sensor noise and scattered times are
//! kept where Akaike's criterion asks for them, outliers are left out (`rounds`), and intervals are
//! those of the profile (`intervals`). Tests say whether the fit is adequate (`judge`).

mod covariance;
mod fit;
mod grid;
mod intervals;
mod judge;
mod noise_known;
mod outliers;
mod plant;
mod rounds;
mod search;
mod start;
#[cfg(test)]
mod tests;
mod tolerances;

pub use fit::{FlightFit, FlightRun};
pub use intervals::{FlightProfile, Known as KnownQuantity};
pub use judge::{
    Asked, Cause, Finding, Judgement, LEVEL_OF_TESTS, Whiteness, colour_factors, judge, unseen_lag,
    whiteness,
};
pub use plant::FlightPlant;
pub use rounds::{beside_noise, fit_flight};
pub use search::{Scatter, scatter_of};
pub use start::{excited_part, least_squares};

/// Longest delay of a search, as a share of the window.
pub const LONGEST_DELAY: f64 = tolerances::START.longest;

/// Factors of a time constant at which searches start.
pub const LAG_FACTORS: [f64; 3] = tolerances::START.factors;

/// The shortest lag of a search, in rows.
pub const SHORTEST_LAG: f64 = tolerances::SEARCH.shortest;

/// Most rows of a search.
pub const SEARCHED_ROWS: usize = tolerances::LONG.part;

/// Accuracy of −2 ln L where fits are compared.
pub const ROUGH: f64 = tolerances::SEARCH.rough;
