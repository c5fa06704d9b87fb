//! The loops of a block in SIMD lanes: their equations, and the parts of their samples.

use crate::simd::{Mask, Real, Simd, outlined};

use super::block::{Block, Number};
use super::transition::{Held, Map, Matrix, row, scaled};

/// A part of a sample, on which the command that reaches the plant is constant.
#[derive(Clone, Copy)]
pub(super) struct Part<S: Simd> {
    /// Time from the sample to the start of the part.
    pub(super) offset: Real<S>,
    /// Zero for the jump of the output at the arrival of a command.
    pub(super) length: Real<S>,
    /// Has the command of the sample arrived?
    pub(super) is_after: bool,
    pub(super) is_jump: bool,
}

/// y = coefficients · x + …, at the end of a part.
#[derive(Clone, Copy)]
pub(super) struct Corner<S: Simd, const N: usize> {
    pub(super) states: [Real<S>; N],
    pub(super) before: Real<S>,
    pub(super) after: Real<S>,
    pub(super) constant: Real<S>,
    /// Has the command of the sample arrived?
    pub(super) is_after: bool,
    /// Time since the sample.
    pub(super) offset: Real<S>,
}

/// Loops in lanes.
pub(super) struct Loops<S: Simd, const N: usize> {
    pub(super) runs: Runs<S>,
    pub(super) plants: Plants<S, N>,
    pub(super) controllers: Controllers<S, N>,
}

/// What closes the loops.
pub(super) struct Controllers<S: Simd, const N: usize> {
    pub(super) k: [Real<S>; N],
    pub(super) l: Real<S>,
    /// Over one sample.
    pub(super) step: Map<S, N>,
}

/// What is the same for any number of states.
pub(super) struct Runs<S: Simd> {
    pub(super) samples: usize,
    /// Are the loops continuous, so that a sample is one delay?
    pub(super) is_continuous: bool,
    pub(super) is_curved: bool,
    /// Degree of the polynomials of the output.
    pub(super) degree: usize,
    /// Is the output before the first arrival of a command hidden, and jumps there? It is if it is
    /// read ahead by the delay.
    pub(super) hides: bool,
    pub(super) d: Real<S>,
    /// M r.
    pub(super) command: Real<S>,
    pub(super) limit: Real<S>,
    pub(super) is_limited: bool,
    pub(super) sample_time: Real<S>,
    /// The part of a sample that the second one takes (`saturated`); none if it takes a whole one.
    pub(super) share: Option<Real<S>>,
    /// Time by which the output is read ahead.
    pub(super) ahead: Real<S>,
    /// The time after which a loop reacts to its own output.
    pub(super) wait: Real<S>,
    /// Time at which the run ends.
    pub(super) end: Real<S>,
    /// The end and rounding errors: what happens up to this time belongs to the run.
    pub(super) latest: Real<S>,
    pub(super) parts: Vec<Part<S>>,
    /// The output at the start, after a jump at once.
    pub(super) first_output: Real<S>,
    pub(super) zero: Real<S>,
    pub(super) no_lane: Mask<S>,
    /// The number, within a sample, of the part that is the jump of the output; of no part if D = 0.
    pub(super) jump: usize,
}

/// Plants with their controllers. Outputs depend on the states of the plants alone.
pub(super) struct Plants<S: Simd, const N: usize> {
    /// A, B, E r, C.
    pub(super) a: Matrix<S, N>,
    pub(super) b: [Real<S>; N],
    pub(super) e: [Real<S>; N],
    pub(super) c: [Real<S>; N],
    /// From the sample to the start of each part; none of continuous loops.
    pub(super) starts: Vec<Map<S, N>>,
    /// All corners of a sample but the last one.
    pub(super) corners: Vec<Corner<S, N>>,
    /// The output exceeds its values at both ends of a part by at most bulge · |x′| at the sample,
    /// plus `bulge_of_jump` times the change of the command that reaches the plant.
    pub(super) bulge: [Real<S>; N],
    pub(super) bulge_of_jump: Real<S>,
}

impl<S: Simd, const N: usize> Loops<S, N> {
    /// The loops of pair number `pair` of vectors, run for `span` seconds of their output.
    #[inline(always)]
    pub(super) fn new(simd: S, block: &Block, pair: usize, span: f64) -> Self {
        let zero = Real::splat(simd, 0.0);
        let sample_time = block.number(simd, Number::SampleTime, pair);
        let delay = block.number(simd, Number::Delay, pair);
        let shape = block.shape;
        let (late, early) = if shape.early == 0 {
            (sample_time, zero)
        } else {
            let whole = zero.constant(-f64::from(shape.samples));
            let early = whole.mul_add(sample_time, delay);
            let early = early.larger(zero).smaller(sample_time);
            (sample_time - early, early)
        };
        let mut runs = Runs::new(simd, block, pair, (sample_time, span));
        let mut plants = Plants::new(simd, block, pair);
        let mut step = Map::nothing(zero);
        let mut offset = zero;
        for (parts, length, is_after) in [(shape.early, early, false), (shape.late, late, true)] {
            let mut part = Part {
                offset,
                length: zero,
                is_after,
                is_jump: true,
            };
            if is_after && shape.jumps {
                runs.parts.push(part);
                plants.starts.push(step);
            }
            if parts == 0 {
                continue;
            }
            (part.length, part.is_jump) = (length / f64::from(parts), false);
            let held = outlined(
                simd,
                #[inline(always)]
                || Held::over(&plants.a, (&plants.b, &plants.e), part.length),
            );
            for _ in 0..parts {
                part.offset = offset;
                runs.parts.push(part);
                plants.starts.push(step);
                step = step.then(&held, !is_after);
                offset = offset + part.length;
            }
        }
        if runs.hides || (shape.jumps && shape.samples == 0 && shape.early == 0) {
            runs.first_output = runs.d * runs.command.min(runs.limit).max(-runs.limit);
        }
        for place in 1..runs.parts.len() {
            let corner = plants.corner(&runs, place - 1);
            plants.corners.push(corner);
        }
        if runs.is_curved {
            outlined(
                simd,
                #[inline(always)]
                || plants.bound(&runs),
            );
        }
        Self {
            runs,
            plants,
            controllers: Controllers {
                k: block.column(simd, N * N + 2 * N, pair),
                l: block.number(simd, Number::L, pair),
                step,
            },
        }
    }
}

impl<S: Simd, const N: usize> Plants<S, N> {
    /// Bound the bulges: a function with |y″| ≤ M stays within M h²/8 of its chord, and y″ =
    /// c A e^{A t} x′.
    #[inline(always)]
    fn bound(&mut self, runs: &Runs<S>) {
        let zero = runs.zero;
        let slope = along(&self.c, &self.a);
        let (mut most, mut longest) = ([zero; N], zero);
        for (part, start) in runs.parts.iter().zip(&self.starts) {
            if part.is_jump {
                continue;
            }
            longest = longest.larger(part.length);
            // c A e^{A t} at the start of the part, and the sum of its Taylor terms.
            let mut term = along(&slope, &start.growth);
            for (term, start) in term.iter_mut().zip(&slope) {
                *term = *term + *start;
            }
            let mut sum = absolute(&term);
            for j in 1..=runs.degree {
                let factor = part.length * (1.0 / j as f64);
                term = scaled(&along(&term, &self.a), factor);
                for (sum, term) in sum.iter_mut().zip(&term) {
                    *sum = *sum + term.abs();
                }
            }
            for (most, sum) in most.iter_mut().zip(&sum) {
                *most = most.larger(*sum);
            }
        }
        let share = longest * longest * 0.125;
        self.bulge = scaled(&most, share);
        self.bulge_of_jump = row(&self.bulge, &absolute(&self.b), zero);
    }
}

impl<S: Simd> Runs<S> {
    /// Runs without the parts of their samples. A sample takes `sample_time`; the output is read for
    /// `span` seconds.
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        block: &Block,
        pair: usize,
        (sample_time, span): (Real<S>, f64),
    ) -> Self {
        let zero = Real::splat(simd, 0.0);
        let shape = block.shape;
        let limit = block.number(simd, Number::Limit, pair);
        let delay = block.number(simd, Number::Delay, pair);
        let ahead = if block.is_ahead { delay } else { zero };
        let end = ahead + span;
        Self {
            samples: shape.samples as usize,
            is_continuous: shape.is_continuous,
            is_curved: shape.is_curved,
            degree: usize::from(shape.degree),
            hides: shape.jumps && block.is_ahead,
            d: block.number(simd, Number::D, pair),
            command: block.number(simd, Number::M, pair) * block.amplitude,
            limit,
            is_limited: limit.lt(f64::INFINITY).any(),
            sample_time,
            share: None,
            ahead,
            wait: delay + block.number(simd, Number::SampleTime, pair),
            end,
            latest: (end + sample_time).mul_add(32.0 * f64::EPSILON, end),
            parts: Vec::with_capacity(shape.corners()),
            first_output: zero,
            zero,
            no_lane: zero.lt(0.0),
            jump: if shape.jumps {
                usize::from(shape.early)
            } else {
                usize::MAX
            },
        }
    }

    /// Are the runs of all loops over before sample `number`? One at the end belongs to the run.
    #[inline(always)]
    pub(super) fn are_over(&self, number: usize) -> bool {
        let number = self.zero.constant(number as f64);
        !self.time(number, self.zero).le(self.latest).any()
    }

    /// The time `offset` after a sample; in the second sample its share of `offset`.
    #[inline(always)]
    pub(super) fn time(&self, sample: Real<S>, offset: Real<S>) -> Real<S> {
        let time = self.sample_time * sample;
        let Some(share) = self.share else {
            return time + offset;
        };
        let lacks = self.sample_time - self.sample_time * share;
        let time = sample.gt(1.0).select(time - lacks, time);
        time + self.length(sample, offset)
    }

    /// The length of a part of a sample; in the second sample its share of `length`.
    #[inline(always)]
    pub(super) fn length(&self, sample: Real<S>, length: Real<S>) -> Real<S> {
        match self.share {
            Some(share) => sample.eq(1.0).select(length * share, length),
            None => length,
        }
    }
}

impl<S: Simd, const N: usize> Plants<S, N> {
    /// The plants of loops, without the parts of their samples.
    #[inline(always)]
    pub(super) fn new(simd: S, block: &Block, pair: usize) -> Self {
        let zero = Real::splat(simd, 0.0);
        let push = block.column(simd, N * N + N, pair);
        let corners = block.shape.corners();
        Self {
            a: block.matrix(simd, pair),
            b: block.column(simd, N * N, pair),
            e: scaled(&push, zero.constant(block.amplitude)),
            c: block.column(simd, N * N + 3 * N, pair),
            starts: Vec::with_capacity(corners),
            corners: Vec::with_capacity(corners),
            bulge: [zero; N],
            bulge_of_jump: zero,
        }
    }

    /// The output at the end of a part other than the last one.
    #[inline(always)]
    fn corner(&self, runs: &Runs<S>, place: usize) -> Corner<S, N> {
        let (part, next) = (&runs.parts[place], &runs.parts[place + 1]);
        let (map, zero) = (&self.starts[place + 1], runs.zero);
        let mut states = self.c;
        for (j, state) in states.iter_mut().enumerate() {
            for i in 0..N {
                *state = self.c[i].mul_add(map.growth[i][j], *state);
            }
        }
        let mut before = row(&self.c, &map.before, zero);
        let mut after = row(&self.c, &map.after, zero);
        let direct = if part.is_after {
            &mut after
        } else {
            &mut before
        };
        *direct = *direct + runs.d;
        Corner {
            states,
            before,
            after,
            constant: row(&self.c, &map.push, zero),
            is_after: part.is_after,
            offset: next.offset,
        }
    }
}

#[inline(always)]
fn absolute<S: Simd, const N: usize>(column: &[Real<S>; N]) -> [Real<S>; N] {
    let mut out = *column;
    for entry in &mut out {
        *entry = entry.abs();
    }
    out
}

/// row · A.
#[inline(always)]
fn along<S: Simd, const N: usize>(row: &[Real<S>; N], a: &Matrix<S, N>) -> [Real<S>; N] {
    let mut out = *row;
    for (j, out) in out.iter_mut().enumerate() {
        let mut sum = row[0] * a[0][j];
        for i in 1..N {
            sum = row[i].mul_add(a[i][j], sum);
        }
        *out = sum;
    }
    out
}
