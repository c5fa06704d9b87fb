//! Sample by sample through a block, one set in each lane.
//!
//! Between a sample and the arrival of a command, and from there to the next sample, every output
//! of a block is a line; a [`Sink`] receives each of them once.

use crate::dde::limits::DIVERGED;
use crate::simd::{Mask, Real, Simd};

use super::block::{Block, Column, Hold};

/// A line from (`begin`, `first`) to (`end`, `last`).
#[derive(Clone, Copy)]
pub(super) struct Line<S: Simd> {
    pub(super) begin: Real<S>,
    pub(super) end: Real<S>,
    pub(super) first: Real<S>,
    pub(super) last: Real<S>,
}

impl<S: Simd> Line<S> {
    /// Remove the part after `end`.
    #[inline(always)]
    pub(super) fn until(self, end: Real<S>) -> Self {
        let beyond = self.end.gt(end);
        if !beyond.any() {
            return self;
        }
        let part = (end - self.begin) / (self.end - self.begin);
        let last = (self.last - self.first).mul_add(part, self.first);
        Self {
            end: beyond.select(end, self.end),
            last: beyond.select(last, self.last),
            ..self
        }
    }

    /// The time at which the line reaches `level`, which lies between its ends.
    #[inline(always)]
    pub(super) fn time_of(self, level: Real<S>) -> Real<S> {
        let part = (level - self.first) / (self.last - self.first);
        (self.end - self.begin).mul_add(part, self.begin)
    }
}

/// Receives the lines of a response.
pub(super) trait Sink<S: Simd> {
    fn line(&mut self, line: Line<S>);
}

/// Vector pair number `pair` of a column.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, column: &Column, pair: usize) -> Real<S> {
    match S::as_simd_f64s(column).0.as_chunks().0.get(pair) {
        Some([a, b]) => Real::new(simd, [*a, *b]),
        None => Real::splat(simd, 0.0),
    }
}

/// Store a vector pair in its place in a column.
#[inline(always)]
pub(super) fn store<S: Simd>(column: &mut Column, pair: usize, value: Real<S>) {
    if let Some(place) = S::as_mut_simd_f64s(column)
        .0
        .as_chunks_mut()
        .0
        .get_mut(pair)
    {
        *place = value.lanes();
    }
}

/// One part of a sample, in all lanes.
struct Step<S: Simd, const N: usize> {
    growth: [[Real<S>; N]; N],
    drive: [Real<S>; N],
    push: [Real<S>; N],
}

impl<S: Simd, const N: usize> Step<S, N> {
    #[inline(always)]
    fn new(simd: S, hold: &Hold, pair: usize) -> Self {
        let zero = Real::splat(simd, 0.0);
        let mut step = Self {
            growth: [[zero; N]; N],
            drive: [zero; N],
            push: [zero; N],
        };
        let rows = step.growth.iter_mut().flatten().zip(&hold.growth);
        rows.for_each(|(place, column)| *place = load(simd, column, pair));
        let drive = step.drive.iter_mut().zip(&hold.drive);
        drive.for_each(|(place, column)| *place = load(simd, column, pair));
        let push = step.push.iter_mut().zip(&hold.push);
        push.for_each(|(place, column)| *place = load(simd, column, pair));
        step
    }

    #[inline(always)]
    fn apply(&self, x: &mut [Real<S>; N], w: Real<S>) {
        let old = *x;
        for (i, x) in x.iter_mut().enumerate() {
            let mut change = self.drive[i].mul_add(w, self.push[i]);
            for (growth, x) in self.growth[i].iter().zip(&old) {
                change = growth.mul_add(*x, change);
            }
            *x = old[i] + change;
        }
    }
}

/// Run to `end`, a time for each lane. Returns the lanes whose response exceeds all limits before.
#[inline(always)]
pub(super) fn walk<S: Simd, const N: usize>(
    simd: S,
    block: &Block,
    pair: usize,
    end: Real<S>,
    sink: &mut impl Sink<S>,
) -> Mask<S> {
    let zero = Real::splat(simd, 0.0);
    let columns = |from: &[Column]| {
        let mut out = [zero; N];
        for (place, column) in out.iter_mut().zip(from) {
            *place = load(simd, column, pair);
        }
        out
    };
    let (k, c) = (columns(&block.k), columns(&block.c));
    let (l, command) = (load(simd, &block.l, pair), load(simd, &block.command, pair));
    let limit = load(simd, &block.limit, pair);
    let sample_time = load(simd, &block.sample_time, pair);
    let arrival = load(simd, &block.arrival, pair);
    let early = Step::<S, N>::new(simd, &block.early, pair);
    let late = Step::<S, N>::new(simd, &block.late, pair);
    let row = |row: &[Real<S>; N], x: &[Real<S>; N], start: Real<S>| {
        row.iter()
            .zip(x)
            .fold(start, |sum, (k, x)| k.mul_add(*x, sum))
    };

    // Commands by sample number, modulo the length; zero before the start.
    let length = block.samples + 2;
    let mut commands = vec![zero; length];
    let mut x = [zero; N];
    let mut lost = zero.lt(0.0);
    let mut number = 0_usize;
    let mut now = zero;
    let mut output = zero;
    loop {
        let running = now.lt(end);
        if !running.any() {
            return lost;
        }
        // Index of m + 1 samples ago: one place ahead in a ring of length m + 2.
        let place = number % length;
        let before = commands.get((place + 1) % length).copied().unwrap_or(zero);
        let u = row(&k, &x, l.mul_add(before, command));
        let mut largest = u.abs();
        for x in &x {
            largest = largest.larger(x.abs());
        }
        lost = lost | (running & !(largest.le(DIVERGED) & u.abs().le(DIVERGED)));
        let u = u.smaller(limit).larger(-limit);
        if let Some(place) = commands.get_mut(place) {
            *place = u;
        }
        let after = commands.get((place + 2) % length).copied().unwrap_or(u);
        let next = sample_time * (number + 1) as f64;
        let mut switch = now;
        if block.is_split {
            switch = now + arrival;
            early.apply(&mut x, before);
            let last = row(&c, &x, zero);
            sink.line(Line {
                begin: now,
                end: switch,
                first: output,
                last,
            });
            output = last;
        }
        late.apply(&mut x, after);
        let last = row(&c, &x, zero);
        sink.line(Line {
            begin: switch,
            end: next,
            first: output,
            last,
        });
        output = last;
        now = next;
        number += 1;
    }
}
