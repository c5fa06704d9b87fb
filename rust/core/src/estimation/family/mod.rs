//! Plants by evidence: a family of plants and noises fitted to the same rows and compared by BIC.
//!
//! ```text
//! G(s) = k (1 + z s) e^(−T s) / (s^i (q s² + p s + 1)),  i = 0 or 1, with or without q, p and z,
//! y = G u + offset (+ trend where it integrates) + free responses of the lags + noise,
//! ```
//!
//! The state at the first row is unknown, and so is the command before it. `rows` says which rows
//! count, `response` is exact, `model` the likelihood of one class under one `noise`, `search` its
//! minimum from one of `starts`, `minima` those of all classes. `candidate` has errors and how many
//! numbers the input tells, `refine` follows them to more rows, `between` says what rows of a command
//! leave open, `along_zero` how far a zero may move, `causes` what a linear plant lacks,
//! `shape` what an actuator makes of a command,
//! `sensors` which readings are none, `series` the error of a class and `flexible` its search, `hull` intervals over all classes within reach, `verdict` what is claimed.

mod along_zero;
mod answer;
mod aside;
mod between;
mod candidate;
mod cause;
mod causes;
mod class;
mod dispersion;
mod excitation;
mod fit;
mod flexible;
mod hull;
mod information;
mod loop_view;
mod minima;
mod model;
mod noise;
mod projection;
mod random;
mod reach;
mod refine;
mod response;
mod rows;
mod search;
mod sensors;
mod series;
mod shape;
mod smoothing;
mod starts;
mod tolerances;
mod verdict;

pub use answer::Family;
pub use candidate::Candidate;
pub use cause::{Cause, CauseKind};
pub use class::{Class, Numbers};
pub use fit::{Between, Question, fit_family, refine_family};
pub use hull::{Named, Triple};
pub use noise::{Coefficients, Noise};
pub use rows::Record;
pub use sensors::{SensorFault, SensorKind};
pub use verdict::{Grade, Verdict};
