//! The loop in continuous time, exact to rounding, by the method of steps on Taylor elements.
//!
//! The command w that reaches the plant is the command of Td ago. It is stored as a queue of
//! pieces, each a polynomial or a constant. An element of time covers one piece, or part of one,
//! and no jump of the reference, so x and u are analytic on it: their Taylor coefficients follow
//! from x_{j+1} = h (A x_j + B w_j + E r_j)/(j + 1), u_j = K x_j + L w_j + M r_j, and the element
//! is shortened until the last ones are below rounding. u is cut exactly where it crosses ±limit,
//! and the cut pieces, shifted by Td, are added to the queue. Breaking points are therefore element
//! ends by construction. Without a delay, or where the command at a bound changes how the states move,
//! elements end where the mode of the command changes ([`modes`] does both). Without a limit, and under
//! a reference that stays constant after the start, breaking points lie at whole delays, and elements
//! are equal parts of one ([`aligned`]). Guaranteed: truncation below rounding, no crossing of the limit
//! missed, switching times to rounding. Not guaranteed: speed where the delay or a lag is tiny against the time
//! simulated (elements are no longer than either allows), or where many breaks accumulate.

mod aligned;
mod effort;
mod expansion;
mod field;
mod impulses;
mod modes;
mod motion;
mod pieces;
mod polynomial;
mod run;
mod saturation;
mod slopes;
mod transitions;
mod values_at_times;

pub(crate) use run::run;
