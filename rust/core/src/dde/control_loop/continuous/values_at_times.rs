//! Values at increasing times, several at once.

use crate::Error;
use crate::dde::limits::RESPONSE;
use crate::memory::filled;

use super::polynomial::LANES;

type Block = [f64; LANES];

/// Times of values, and those found so far.
#[derive(Debug)]
pub(super) struct ValuesAtTimes<'t> {
    times: &'t [f64],
    /// With memory for a whole block behind the last time.
    found: Vec<f64>,
    done: usize,
}

impl<'t> ValuesAtTimes<'t> {
    pub(super) fn new(times: &'t [f64]) -> Result<Self, Error> {
        Ok(Self {
            times,
            found: filled(RESPONSE, 0.0, times.len() + LANES)?,
            done: 0,
        })
    }

    #[inline(always)]
    pub(super) fn times(&self) -> &'t [f64] {
        self.times
    }

    #[inline(always)]
    pub(super) fn is_done(&self) -> bool {
        self.done == self.times.len()
    }

    /// Is `t` not after the last time?
    #[inline(always)]
    pub(super) fn reaches(&self, t: f64) -> bool {
        self.times.last().is_some_and(|&last| t <= last)
    }

    /// Store the values at all times before `end`; they are `values` of
    /// (time − `start`) `inverse`, `inverse` that of the length of the element.
    #[inline(always)]
    pub(super) fn fill(
        &mut self,
        start: f64,
        inverse: f64,
        end: f64,
        values: impl Fn(&Block) -> Block,
    ) {
        while self.times.get(self.done).is_some_and(|time| *time < end) {
            let (sigmas, count) = self.block(start, inverse, end);
            self.put(values(&sigmas), count);
        }
    }

    /// [`ValuesAtTimes::fill`] for two that have the same times.
    #[inline(always)]
    pub(super) fn fill_both(
        &mut self,
        other: &mut Self,
        start: f64,
        inverse: f64,
        end: f64,
        values: impl Fn(&Block) -> (Block, Block),
    ) {
        while self.times.get(self.done).is_some_and(|time| *time < end) {
            let (sigmas, count) = self.block(start, inverse, end);
            let (mine, others) = values(&sigmas);
            self.put(mine, count);
            other.put(others, count);
        }
    }

    /// The local coordinates of the next times, and how many are before `end`.
    #[inline(always)]
    fn block(&self, start: f64, inverse: f64, end: f64) -> (Block, usize) {
        let left = &self.times[self.done..];
        let mut block = [f64::INFINITY; LANES];
        match left.first_chunk() {
            Some(times) => block = *times,
            None => block[..left.len()].copy_from_slice(left),
        }
        let mut count = 0;
        for time in &mut block {
            count += usize::from(*time < end);
            *time = (*time - start) * inverse;
        }
        (block, count)
    }

    /// Store a block, of which so many values count.
    #[inline(always)]
    fn put(&mut self, block: Block, count: usize) {
        if let Some(place) = self.found[self.done..].first_chunk_mut() {
            *place = block;
        }
        self.done += count;
    }

    /// The values.
    pub(super) fn found(mut self) -> Vec<f64> {
        self.found.truncate(self.times.len());
        self.found
    }
}
