//! Quasi-polynomials on the imaginary axis: margins, crossings, stable ranges and phases.
//!
//! `two_sided` are products of quasi-polynomials with conjugates, `waves` real functions of the
//! frequency made of them, `squares` the difference of two moduli; `zeros` finds all their zeros up
//! to the frequencies of `bounds`. From these are `margins` of a loop, and of an `equation` in which
//! one number varies the `crossings`, those of `delays` and `multiples` of one, and stable `ranges`.
//! `peaks` finds the largest modulus of a ratio, `norms` those of quasi-polynomials and of the
//! sensitivities of a loop.
//! Of loops with a hold `gain_crossovers` has those, `circle` counts poles by them, `held_gain_range` has
//! the stable gains, `held_range` follows another number, `further_delay` the delay, `held` has the margins,
//! `held_peaks` the sensitivities, and `held_gain` values and phases. `chains` says where roots may come from infinity. `ratio` has values of loop gains, `argument`
//! their phases; `polynomial` finds roots of small polynomials.

mod argument;
mod bounds;
mod chains;
mod circle;
mod crossings;
mod delays;
mod equation;
mod further_delay;
mod gain_crossovers;
mod held;
mod held_gain;
mod held_gain_range;
mod held_peaks;
mod held_range;
mod margins;
mod multiples;
mod norms;
mod passage;
mod peaks;
mod polynomial;
mod ranges;
mod ratio;
mod squares;
mod two_sided;
mod waves;
mod zeros;

pub use argument::argument;
pub use bounds::end_of_gain;
pub use crossings::{Crossings, crossings};
pub use delays::{delay_margin, delay_range};
pub use further_delay::{further_delay, held_delay_range};
pub use held::{held_margins, held_margins_of_stable, held_sensitivity};
pub use held_gain::{held_gain, held_phase};
pub use held_gain_range::gain_range_held;
pub use held_range::{Members, Number, held_range};
pub use margins::{Margins, margins, margins_of_ratio, margins_of_stable};
pub use norms::{Peaks, hinf_norm, peak, peak_to, peaks};
pub use passage::Crossing;
pub use peaks::{Peak, Sought};
pub(crate) use polynomial::roots as small_roots;
pub use ranges::{corner_range, damping_range, gain_range};
pub use ratio::{first_term, ratio};

#[cfg(test)]
mod tests;
