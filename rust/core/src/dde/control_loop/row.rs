//! A loop as one row of numbers: the form of many loops, or of a loop with its slopes, in arrays.

use crate::Error;

use super::linear_loop::{Equations, LinearLoop};
use crate::dde::scalar::Scalar;

/// Length of the row of a loop with `n` states.
pub(crate) const fn width(n: usize) -> usize {
    n * n + 4 * n + 7
}

/// The parts of one row, in their order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row<'a, S = f64> {
    pub(crate) a: &'a [S],
    pub(crate) b: &'a [S],
    pub(crate) e: &'a [S],
    pub(crate) k: &'a [S],
    pub(crate) c: &'a [S],
    pub(crate) l: S,
    pub(crate) m: S,
    pub(crate) d: S,
    pub(crate) impulse: S,
    pub(crate) delay: S,
    /// 0 for none.
    pub(crate) sample_time: S,
    /// Infinite for none.
    pub(crate) limit: S,
}

impl<'a, S: Scalar> Row<'a, S> {
    /// The row of a loop with `n` states.
    pub(crate) fn new(n: usize, row: &'a [S]) -> Result<Self, Error> {
        let (states, numbers) = row.split_at(row.len().saturating_sub(7));
        match (states.len() == n * n + 4 * n, numbers) {
            (true, &[l, m, d, impulse, delay, sample_time, limit]) => {
                let (a, columns) = states.split_at(n * n);
                let part = |i: usize| columns.get(i * n..(i + 1) * n).unwrap_or_default();
                Ok(Self {
                    a,
                    b: part(0),
                    e: part(1),
                    k: part(2),
                    c: part(3),
                    l,
                    m,
                    d,
                    impulse,
                    delay,
                    sample_time,
                    limit,
                })
            }
            _ => refuse!(
                "a row has {} numbers, but a loop with {n} states needs {}",
                row.len(),
                width(n)
            ),
        }
    }

    /// Is the loop sampled?
    pub(crate) fn is_sampled(&self) -> bool {
        self.sample_time.value() != 0.0
    }

    /// The loop, after a check.
    pub(crate) fn checked(&self) -> Result<LinearLoop<S>, Error> {
        let equations = Equations {
            a: self.a.to_vec(),
            b: self.b.to_vec(),
            e: self.e.to_vec(),
            k: self.k.to_vec(),
            l: self.l,
            m: self.m,
            c: self.c.to_vec(),
            d: self.d,
            impulse: self.impulse,
            ..Equations::default()
        };
        let sample_time = self.is_sampled().then_some(self.sample_time);
        LinearLoop::new(equations, self.delay, sample_time, Some(self.limit))
    }
}
