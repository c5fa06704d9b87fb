//! What a linear plant lacks: a load, play, a dead zone and the like, fitted beside the plants.
//!
//! A cause changes the command that reaches the plant, by a size that is one number more:
//! ```text
//! u → play(u, b), stiction(u, b), dead zone(u, b), min(u, b), max(u, −b), |u′| ≤ b, |v′| ≤ b,
//! u → u + c w,  w = 1(t ≥ t₀), u (t − t̄)/span, u (y − ȳ)/range, −v |v|.
//! ```
//! `commands` puts the first kind before the plant, `asides` has the second, with a step of the output, which is a sensor's.
//! `screen` scores all sizes against what plants without a cause leave, `adopt` fits what may be one
//! with the whole family and compares it by BIC with the most flexible plant. `jitter` is that of the times of commands. `smoothed` finds the length of
//! a moving mean that the readings are.

mod adopt;
mod asides;
mod commands;
mod jitter;
mod screen;
mod smoothed;
mod suspected;

pub(super) use smoothed::with_smoothing;
