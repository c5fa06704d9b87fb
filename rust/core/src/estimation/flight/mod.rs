//! A whole fit of a named plant to recordings: starts, noise, outliers, and intervals.
//!
//! The likelihood has local minima over the delay, and others where air takes the place of what the
//! plant lacks. Least squares on a grid over delay and lag gives the first start; the same grid in
//! strong air gives others. Trim, air, coloured sensor noise and scattered times are kept where
//! Akaike's criterion asks for them.

mod fit;
mod judge;
mod plant;
mod tolerances;

pub use fit::{FlightFit, FlightRun};
pub use judge::{
    Asked, Cause, Finding, Judgement, Whiteness, colour_factors, judge, unseen_lag, whiteness,
};
pub use plant::FlightPlant;
