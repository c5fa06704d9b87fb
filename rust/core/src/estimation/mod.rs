//! Likelihood of recordings under the noise of a flight: moving air, trim, coloured and white
//! sensor noise.
//!
//! ```text
//! y(t) = b + g F(t − T) + g_t R(t) + air through the plant + coloured noise + white noise,
//! ```
//!
//! F is the response of the plant of unit gain to the commands as they were held, R its response
//! to a constant input (trim). Gain, offset and trim are linear and eliminated exactly
//! (`likelihood`), the variance of the white noise too; delay, lags and the numbers of the noise are
//! searched (`search`, `fit`), and intervals are those of the profile (`profile`).
//!
//! `least_squares` fits simulated loops, `damped` is the step of its searches, and
//! `literature` has the formulas of other methods.

mod commanded;
mod damped;
mod disturbance;
mod family;
mod fit;
mod flight;
mod kept;
mod kicks;
mod least_squares;
mod likelihood;
mod literature;
mod mean;
mod noises;
mod online;
mod over_delays;
mod path;
mod plant;
mod point;
mod profile;
mod propagation;
mod quotients;
mod rows;
mod search;
pub mod statistics;
mod steps;
#[cfg(test)]
mod tests;
mod variables;
mod waves;
mod whiten;

pub use commanded::{Commanded, UnitPlant};
pub use disturbance::{Disturbance, Entry};
pub use family::{
    Between, Candidate, Cause as FamilyCause, CauseKind, Class, Coefficients, Family, Grade, Named,
    Noise as FamilyNoise, Numbers, Question, Record, SensorFault, SensorKind, Triple, Verdict,
    fit_family, refine_family,
};
pub use fit::{Fit, Model, Search};
pub use flight::{
    BetweenRows, Cause, Controlled, Ends, Finding, FlightFit, FlightPlant, FlightProfile,
    FlightRun, FreeNumbers, Judgement, KnownQuantity, LEVEL_OF_TESTS, LONGEST_DELAY, LoopNumbers,
    MOST_NUMBERS, RunCommands, SHORTEST_LAG, Scatter, Sent, Whiteness, WithNumbers, beside_noise,
    between_rows, colour_factors, first_numbers, fit_flight, fit_numbers, is_long, judge_profile,
    least_squares, scatter_of, unseen_lag, whiteness,
};
pub use least_squares::{
    Chebyshev, ClosedLoop, Fitted, Given, Joint, Minimum, Number as FittedNumber, Part, Peak,
    Readings, Rounded, Scan, Simulated, Vanishing, by_scatter, least_held, local_minima, refined,
    robust_covariance, scan, solve, white_covariance, without_vanishing,
};
pub use likelihood::{Evaluation, Noise};
pub use literature::{
    Cycles, Extreme, HeldPath, PathAt, PeriodicLines, Plain, RecordLines, Ringing, Switch, Tail,
    Tangent, Weighting, arx_losses, coefficient, crossings, cycles, decay, delay_by_lag,
    delay_of_rate, exact_x, extremes, feedback, held_losses, loop_with_ringing, peak, ringing,
    switches, tail_rate, tangent,
};
pub use online::{Answer, Known, Lags, Online, Settings, online};
pub use path::held_response;
pub use plant::Plant;
pub use point::{Point, Quantity, Timing};
pub use profile::Limits;
pub use rows::{Commands, Rows};
pub use variables::Free;
pub use waves::Waves;
pub use whiten::whiten;
