//! Impulses of the command on their way to the plant.
//!
//! A jump of the reference under an ideal derivative causes an impulse. On its arrival x jumps by B
//! times its weight, and with L ≠ 0 the command has another impulse of L times that weight.

use std::collections::VecDeque;

use crate::dde::scalar::{Scalar, is_reached};

/// Impulses lighter than this share of the heaviest one so far are dropped.
const LIGHT: f64 = 1e-20;

/// Times of arrival and weights, in order of time.
#[derive(Debug, Default)]
pub(super) struct Impulses<S = f64> {
    waiting: VecDeque<(S, S)>,
    /// The heaviest weight so far, and the largest slope of one.
    heaviest: (f64, f64),
}

impl<S: Scalar> Impulses<S> {
    /// Add an impulse that arrives at `time`, after all those in the queue.
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

    /// Time of the next arrival, infinite if the queue is empty.
    pub(super) fn next(&self) -> S {
        self.waiting
            .front()
            .map_or(S::from(f64::INFINITY), |&(arrival, _)| arrival)
    }
}
