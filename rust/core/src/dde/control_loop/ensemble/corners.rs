//! Outputs of the loops of a block at given times, interpolated on the lines of their responses.

use crate::Error;
use crate::memory::{collected, room};
use crate::simd::{Real, Simd};

use super::block::{Block, Column, SETS};
use super::sets::Outcome;
use super::through::{Visitor, through};
use super::walk::{Line, Sink, store};

/// What memory is requested for, in errors.
const RESPONSES: &str = "the sweep";

/// Outputs of the first `count` sets at `times` after the start.
///
/// # Errors
/// [`Error::Memory`] alone.
pub(super) fn responses(
    block: &Block,
    count: usize,
    times: &[f64],
) -> Result<Vec<(Vec<f64>, Outcome)>, Error> {
    let span = times.last().copied().unwrap_or(0.0);
    room::<[Column; 4]>(RESPONSES, block.most_samples(span))?;
    let found = through(block, span, Corners::default());
    (0..count)
        .map(|lane| {
            if found.lost[lane] != 0.0 {
                return Ok((Vec::new(), Outcome::Diverged));
            }
            let outputs = times
                .iter()
                .map(|t| found.at(block, lane, t + block.ahead[lane]));
            Ok((collected(RESPONSES, outputs)?, Outcome::Ok))
        })
        .collect()
}

/// Outputs where lines meet: at every sample, and at every arrival in between.
#[derive(Default)]
struct Corners {
    outputs: Vec<Column>,
    lost: Column,
}

impl Corners {
    /// The output of a set at `time`.
    fn at(&self, block: &Block, lane: usize, time: f64) -> f64 {
        let corner = |i: usize| self.outputs.get(i).map_or(f64::NAN, |column| column[lane]);
        let sample_time = block.sample_time[lane];
        let mut sample = (time / sample_time).floor();
        // The quotient may be rounded to the next whole number, or down from it.
        if sample * sample_time > time {
            sample -= 1.0;
        } else if (sample + 1.0) * sample_time <= time {
            sample += 1.0;
        }
        let (mut begin, mut end) = (sample * sample_time, (sample + 1.0) * sample_time);
        let mut place = sample as usize;
        if block.is_split {
            let arrival = begin + block.arrival[lane];
            place *= 2;
            if time < arrival {
                end = arrival;
            } else {
                begin = arrival;
                place += 1;
            }
        }
        let first = corner(place);
        if time <= begin {
            return first;
        }
        (corner(place + 1) - first).mul_add((time - begin) / (end - begin), first)
    }
}

struct Listed<S: Simd> {
    first: Vec<Real<S>>,
    last: Real<S>,
}

impl<S: Simd> Sink<S> for Listed<S> {
    #[inline(always)]
    fn line(&mut self, line: Line<S>) {
        self.first.push(line.first);
        self.last = line.last;
    }
}

impl Visitor for Corners {
    type Kept = Self;

    type Sink<S: Simd> = Listed<S>;

    #[inline(always)]
    fn begin<S: Simd>(&mut self, simd: S, _: usize, _: Real<S>) -> Listed<S> {
        Listed {
            first: Vec::new(),
            last: Real::splat(simd, 0.0),
        }
    }

    #[inline(always)]
    fn finish<S: Simd>(&mut self, pair: usize, sink: Listed<S>, lost: Real<S>) {
        let corners = sink.first.iter().chain([&sink.last]);
        for (i, corner) in corners.enumerate() {
            if self.outputs.len() <= i {
                self.outputs.push([f64::NAN; SETS]);
            }
            if let Some(column) = self.outputs.get_mut(i) {
                store(column, pair, *corner);
            }
        }
        store(&mut self.lost, pair, lost);
    }

    fn kept(self) -> Self {
        self
    }
}
