//! Impulses of the command on their way to the plant.
//!
//! A jump of the reference under an ideal derivative makes one. On arrival x jumps by B times its
//! weight, and with L ≠ 0 the command answers with another impulse, L times as heavy.

use std::collections::VecDeque;

/// An impulse lighter than this part of the heaviest one so far is let go.
const LIGHT: f64 = 1e-20;

/// Times of arrival and weights, in order of time.
#[derive(Debug, Default)]
pub(super) struct Impulses {
    waiting: VecDeque<(f64, f64)>,
    heaviest: f64,
}

impl Impulses {
    /// An impulse that arrives at `time`, after all those that wait.
    pub(super) fn push(&mut self, time: f64, weight: f64) {
        self.heaviest = self.heaviest.max(weight.abs());
        if weight != 0.0 && weight.abs() > LIGHT * self.heaviest {
            self.waiting.push_back((time, weight));
        }
    }

    /// Total weight of those that have arrived at `time`.
    pub(super) fn arrived(&mut self, time: f64) -> f64 {
        let mut weight = 0.0;
        while let Some(&(arrival, part)) = self.waiting.front() {
            if arrival > time {
                break;
            }
            weight += part;
            self.waiting.pop_front();
        }
        weight
    }

    /// Time of the next arrival, infinite if nothing waits.
    pub(super) fn next(&self) -> f64 {
        self.waiting
            .front()
            .map_or(f64::INFINITY, |&(arrival, _)| arrival)
    }
}
