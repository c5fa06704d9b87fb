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
//! `literature` has the formulas of other methods. `shared` searches ends of intervals and numbers that
//! several recordings share, `felt` is what a loop feels of a plant, and `screen` asks whether other plants
//! may explain what a fit leaves. `known_filter` undoes a filter of the output, `stamps` finds the regular
//! times of scattered ones, and `polynomial` has the roots that these need.

mod columns;
mod commanded;
mod damped;
mod disturbance;
mod family;
mod felt;
mod fit;
mod flight;
mod kept;
mod kicks;
mod known_filter;
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
mod polynomial;
mod profile;
mod propagation;
mod quotients;
mod rows;
mod screen;
mod search;
mod shared;
mod stamps;
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
pub use felt::{Felt, felt};
pub use fit::{Fit, Model, Search};
pub use flight::{
    BetweenRows, Cause, Controlled, Ends, Finding, FlightFit, FlightPlant, FlightProfile,
    FlightRun, FreeNumbers, Judgement, KnownQuantity, LEVEL_OF_TESTS, LONGEST_DELAY, LoopNumbers,
    MOST_NUMBERS, NoiseInUnits, RunCommands, Scatter, Sent, Whiteness, WithNumbers, beside_noise,
    between_rows, coarse_step, colour_factors, first_numbers, fit_flight, fit_numbers, is_long,
    judge_profile, least_squares, scatter_of, unseen_lag, whiteness,
};
pub use known_filter::{KnownFilter, NoInverse};
pub use least_squares::{
    Chebyshev, ClosedLoop, Fitted, Given, Joint, Minimum, Number as FittedNumber, Part, Peak,
    Readings, Rounded, Scan, Simulated, Vanishing, by_scatter, embedded, least_held, local_minima,
    refined, robust_covariance, scan, solve, white_covariance, without_vanishing,
};
pub use likelihood::{Evaluation, Noise};
pub use literature::{
    CyclePath, Cycles, Extreme, HeldPath, PathAt, PeriodicLines, Plain, RecordLines, Ringing,
    Switch, Tail, TailReading, Tangent, Weighting, arx_losses, coefficient, crossings, cycle_path,
    cycles, decay, delay_by_lag, delay_of_rate, exact_x, extremes, feedback, first_movement,
    held_losses, line_through, loop_with_ringing, peak, peaks, ringing, step_tail, switches,
    tail_rate, tangent,
};
pub use online::{Answer, Known, Lags, Online, Settings, online};
pub use path::held_response;
pub use plant::Plant;
pub use point::{Point, Quantity, Timing};
pub use profile::Limits;
pub use rows::{Commands, Rows};
pub use screen::{Left, follows_command, most_moved};
pub use shared::{
    Part as MixturePart, Search as EndSearch, Shared, interval_end, mixture_interval, secant_ends,
    shared_number,
};
pub use stamps::regular_times;
pub use variables::Free;
pub use waves::Waves;
pub use whiten::whiten;
