//! Formulas of the methods of the literature: what they read from a recording, and what follows.
//!
//! `extremes` reads peaks and valleys of a step response, `ringing` the delay and the gain from their
//! decay, `tail` the delay from a response that does not overshoot, `overshoot` that of the exact
//! response, `tangent` the straight part of a rise, `rise` its beginning, `relay` the crossings and switches of a limit cycle,
//! `arx` ARX models with every delay, `correlation`
//! correlations of commands and responses, `spectrum` the misfit at lines of a spectrum; `held` is the plant under a held command, over time and as H(z).

mod arx;
mod correlation;
mod extremes;
mod held;
mod overshoot;
mod relay;
mod ringing;
mod rise;
mod spectrum;
mod tail;
mod tangent;
mod zero;

pub use arx::{arx_losses, held_losses};
pub use correlation::{Weighting, coefficient, feedback, peak};
pub use extremes::{Extreme, decay, extremes};
pub use held::{HeldPath, PathAt};
pub use overshoot::exact_x;
pub use relay::{
    CyclePath, Cycles, Switch, crossings, cycle_path, cycles, delay_by_lag, peaks, switches,
};
pub use ringing::{Ringing, loop_with_ringing, ringing};
pub use rise::{first_movement, line_through};
pub use spectrum::{PeriodicLines, Plain, RecordLines};
pub use tail::{Tail, TailReading, delay_of_rate, step_tail, tail_rate};
pub use tangent::{Tangent, tangent};
