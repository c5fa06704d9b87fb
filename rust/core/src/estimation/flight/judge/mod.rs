//! Does a fit hold? Tests under the noise of a flight, at the 1 % level by default.
//!
//! Beside the whiteness of the whitened residuals, these are tested:
//!
//! * a further lag beside the noise, and one with a zero, and a delay at its bound (`lag`);
//! * a delay that is constant over the window (`change`);
//! * air that is slower than the rows, and as large while the vehicle rests (`air`);
//! * where the residuals are not white, a colour that is the same while the vehicle rests (`colour`);
//! * noise that does not grow with the speed of the output (`speed`);
//! * recordings that agree about gain, and delay and lag together (`agreement`).
//!
//! `power` is what the test for a lag would have seen.

mod agreement;
mod air;
mod change;
mod colour;
mod draws;
mod finding;
mod judgement;
mod lag;
mod motion;
mod pairs;
mod power;
mod speed;
mod tolerances;
mod whiteness;

pub use colour::colour_factors;
pub use finding::{Cause, Finding};
pub use judgement::{Judgement, judge_profile};
pub use power::unseen_lag;
pub use tolerances::LEVEL_OF_TESTS;
pub use whiteness::{Whiteness, whiteness};
