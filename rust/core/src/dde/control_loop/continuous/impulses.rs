//! Impulses of the command on their way to the plant.
//!
//! A jump of the reference under an ideal derivative makes one. On arrival x jumps by B times its
//! weight, and with L ≠ 0 the command answers with another impulse, L times as heavy.

use std::collections::VecDeque;

use crate::dde::scalar::{Scalar, is_reached};

/// An impulse lighter than this part of the heaviest one so far is let go.
const LIGHT: f64 = 1e-20;

/// Times of arrival and weights, in order of time.
#[derive(Debug, Default)]
pub(super) struct Impulses<S = f64> {
    waiting: VecDeque<(S, S)>,
    /// Of the values and of the slopes.
    heaviest: (f64, f64),
}

impl<S: Scalar> Impulses<S> {
    /// An impulse that arrives at `time`, after all those that wait.
    pub(super) fn push(&mut self, time: S, weight: S) {
        let (value, slope) = (weight.value().abs(), weight.slope().abs());
        self.heaviest = (self.heaviest.0.max(value), self.heaviest.1.max(slope));
        let heavy = |size: f64, most: f64| size != 0.0 && size > LIGHT * most;
        if heavy(value, self.heaviest.0) || heavy(slope, self.heaviest.1) {
            self.waiting.push_back((time, weight));
        }
    }

    /// Total weight of those that have arrived at `time` or within `slack` after it.
    pub(super) fn arrived(&mut self, time: S, slack: f64) -> S {
        let mut weight = S::default();
        while let Some(&(arrival, part)) = self.waiting.front() {
            if !is_reached(arrival, time, slack) {
                break;
            }
            weight += part;
            self.waiting.pop_front();
        }
        weight
    }

    /// Time of the next arrival, infinite if nothing waits.
    pub(super) fn next(&self) -> S {
        self.waiting
            .front()
            .map_or(S::from(f64::INFINITY), |&(arrival, _)| arrival)
    }
}
