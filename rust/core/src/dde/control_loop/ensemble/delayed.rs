//! Continuous loops of two vectors, delay by delay, by the method of steps.
//!
//! Every delay is cut into the same equal parts. The command that reaches the plant on a part is
//! that of the same part of the delay before, so that its polynomial needs no shift: with the local
//! time σ ∈ [0, 1], x_{j+1} = h (A x_j + B w_j + E r_j)/(j + 1) and u_j = K x_j + L w_j + M r_j,
//! where only r₀ is not zero. Parts are short enough for terms after the last one to be below
//! rounding (`shape`). A command may be at its limit from the start on (`saturated`). A loop whose
//! command may exceed its limit later is left to the code for single loops, since every such crossing
//! cuts the parts anew.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::simd::{Mask, Real, Simd, flat, outlined};

use super::block::{Block, Number};
use super::decay::Decay;
use super::loops::{Part, Plants, Runs};
use super::piece::{LONG, Piece};
use super::saturated::Saturated;
use super::trace::{CHUNK, Summary, Trace, delays};
use super::transition::row;
use super::walk::{Ends, Run, are_sound, longer};

/// Upper bounds on σ − σ^j for j from 2 on: σ^j c stays within c times this of its chord.
const CHORDS: [f64; LONG - 1] = [
    0.25, 0.385, 0.4725, 0.535, 0.5824, 0.6198, 0.6502, 0.6755, 0.6969, 0.7153, 0.7314, 0.7455,
    0.758, 0.7692, 0.7793, 0.7885, 0.7968, 0.8045, 0.8115,
];

/// A command that comes from its limit is beyond it by rounding errors, this share of what it would
/// be without the limit.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Loops in lanes. A sample is one delay, but for the second one where the command is at its limit
/// at first.
pub(super) struct Delayed<S: Simd, const N: usize> {
    pub(super) runs: Runs<S>,
    plants: Plants<S, N>,
    k: [Real<S>; N],
    l: Real<S>,
    /// Length of a part.
    h: Real<S>,
    /// None, if no command begins beyond its limit.
    saturated: Option<Saturated<S>>,
}

impl<S: Simd, const N: usize> Delayed<S, N> {
    /// The loops of pair number `pair` of vectors, run for `span` seconds of their output.
    #[inline(always)]
    pub(super) fn new(simd: S, block: &Block, pair: usize, span: f64) -> Self {
        let delay = block.number(simd, Number::Delay, pair);
        let mut runs = Runs::new(simd, block, pair, (delay, span));
        let parts = block.shape.late;
        let h = delay / f64::from(parts);
        for number in 0..parts {
            runs.parts.push(Part {
                offset: h * f64::from(number),
                length: h,
                is_after: true,
                is_jump: false,
            });
        }
        let mut loops = Self {
            runs,
            plants: Plants::new(simd, block, pair),
            k: block.column(simd, N * N + 2 * N, pair),
            l: block.number(simd, Number::L, pair),
            h,
            saturated: None,
        };
        loops.saturated = Saturated::of(&loops.runs, &loops.plants, (&loops.k, loops.l), h);
        loops.runs.share = loops.saturated.as_ref().map(|saturated| saturated.share);
        loops
    }
}

/// A run from rest.
pub(super) struct Steps<'a, S: Simd, const N: usize> {
    loops: &'a Delayed<S, N>,
    x: [Real<S>; N],
    output: Real<S>,
    /// The output at the last corner inside of the run.
    inside: Real<S>,
    /// Number of the next sample.
    number: usize,
    lost: Mask<S>,
    /// The loops whose command may have exceeded its limit.
    limited: Mask<S>,
}

impl<'a, S: Simd, const N: usize> Steps<'a, S, N> {
    pub(super) fn new(loops: &'a Delayed<S, N>) -> Self {
        let (zero, no_lane) = (loops.runs.zero, loops.runs.no_lane);
        let saturated = loops.saturated.as_ref();
        Self {
            loops,
            x: [zero; N],
            output: zero,
            inside: zero,
            number: 0,
            lost: no_lane,
            limited: saturated.map_or(no_lane, |saturated| saturated.unfit),
        }
    }

    /// Are the runs of all loops over?
    #[inline(always)]
    fn is_over(&self) -> bool {
        self.loops.runs.are_over(self.number) || !(!self.limited).any()
    }

    /// See [`Run::advance`].
    #[inline(always)]
    fn go_on(&mut self, trace: &mut Trace<S>) -> bool {
        if self.is_over() {
            return false;
        }
        trace.restart(self.number, self.output);
        let most = delays(trace.per_sample);
        while trace.samples < most && !self.is_over() {
            self.chunk(trace);
        }
        true
    }

    /// Advance by [`CHUNK`] samples.
    #[inline(always)]
    fn chunk(&mut self, trace: &mut Trace<S>) {
        let loops = &self.loops.runs;
        let zero = loops.zero;
        let (terms, per_sample) = (loops.degree + 1, trace.per_sample);
        let mut part = trace.samples * per_sample;
        let after = part + CHUNK * per_sample;
        longer(&mut trace.outputs, after + 1, zero.lanes());
        longer(&mut trace.bulges, after, zero.lanes());
        longer(&mut trace.pieces, after * terms, zero.lanes());
        let mut summary = Summary {
            most: self.inside,
            least: self.inside,
            bulge: zero,
        };
        let mut ends = Ends {
            count: trace.count,
            is_cut: trace.is_cut,
            inside: self.inside,
            run_end: loops.end,
            latest: loops.latest,
        };
        let highest = (loops.command.abs() + loops.limit).mul_add(ROUNDING, loops.limit);
        for _ in 0..CHUNK {
            let sample = zero.constant(self.number as f64);
            let mut begin = loops.time(sample, zero);
            for number in 1..=per_sample {
                let (bulge, command) = if loops.is_limited {
                    self.element::<true>(trace, part, number - 1, terms)
                } else {
                    self.element::<false>(trace, part, number - 1, terms)
                };
                self.limited = self.limited | (begin.lt(loops.end) & command.gt(highest));
                summary.bulge = summary.bulge.max(bulge);
                let end = match loops.parts.get(number) {
                    Some(next) => loops.time(sample, next.offset),
                    None => loops.time(sample + 1.0, zero),
                };
                // The first coefficient of the new polynomial of the command is its value there.
                let u = trace.commands.get((number - 1) * terms).copied();
                let sound = are_sound(&self.x) & are_sound(&[u.unwrap_or(zero)]);
                self.lost = self.lost | (begin.lt(loops.end) & !sound);
                self.output = row(&self.loops.plants.c, &self.x, zero);
                if let (Some(output), Some(place)) =
                    (trace.outputs.get_mut(part + 1), trace.bulges.get_mut(part))
                {
                    (*output, *place) = (self.output.lanes(), bulge.lanes());
                }
                ends.corner(&mut summary, self.output, begin, end);
                begin = end;
                part += 1;
            }
            self.number += 1;
        }
        (trace.count, trace.is_cut) = (ends.count, ends.is_cut);
        self.inside = ends.inside;
        trace.samples += CHUNK;
        trace.chunks.push(summary);
    }

    /// Expand one part, store its polynomial and go to its end. Returns by how much the output may
    /// exceed its chord and, if `IS_LIMITED`, a bound on the modulus of the command.
    #[inline(always)]
    fn element<const IS_LIMITED: bool>(
        &mut self,
        trace: &mut Trace<S>,
        part: usize,
        number: usize,
        terms: usize,
    ) -> (Real<S>, Real<S>) {
        let loops = self.loops;
        let (runs, plants) = (&loops.runs, &loops.plants);
        let zero = runs.zero;
        let (mut x, mut change, mut bulge) = (self.x, [zero; N], zero);
        // Partial sums of the coefficients of the command, of which each of its values is a mean.
        let (mut sum, mut most, mut least) = (zero, zero, zero);
        let sample = zero.constant(self.number as f64);
        let h = runs.length(sample, loops.h);
        let commands = trace.commands.get_mut(number * terms..(number + 1) * terms);
        let outputs = trace.pieces.get_mut(part * terms..(part + 1) * terms);
        let (Some(commands), Some(outputs)) = (commands, outputs) else {
            return (zero, zero);
        };
        for j in 0..terms {
            if j > 0 {
                for i in 0..N {
                    change[i] = change[i] + x[i];
                }
            }
            let w = commands[j];
            let y = row(&plants.c, &x, zero);
            outputs[j] = y.lanes();
            let mut u = row(&loops.k, &x, loops.l * w);
            let old = x;
            let factor = h * (1.0 / (j + 1) as f64);
            for i in 0..N {
                x[i] = row(&plants.a[i], &old, plants.b[i] * w);
            }
            if j == 0 {
                u = u + runs.command;
                for i in 0..N {
                    x[i] = x[i] + plants.e[i];
                }
            } else if j > 1 {
                bulge = y.abs().mul_add(CHORDS[j - 2], bulge);
            }
            for i in 0..N {
                x[i] = x[i] * factor;
            }
            if IS_LIMITED {
                if let Some(saturated) = &loops.saturated {
                    let held = if j == 0 { saturated.command } else { zero };
                    u = saturated.samples.gt(sample).select(held, u);
                }
                sum = sum + u;
                (most, least) = if j == 0 {
                    (sum, sum)
                } else {
                    (most.max(sum), least.min(sum))
                };
            }
            commands[j] = u;
        }
        for i in 0..N {
            self.x[i] = self.x[i] + change[i];
        }
        (bulge, most.max(-least))
    }
}

impl<S: Simd, const N: usize> Run<S> for Steps<'_, S, N> {
    fn begin(&mut self, trace: &mut Trace<S>) {
        let loops = self.loops;
        *self = Self::new(loops);
        let runs = &loops.runs;
        trace.per_sample = runs.parts.len();
        (trace.jump, trace.is_curved) = (runs.jump, true);
        trace.is_continuous = true;
        trace.commands.clear();
        let numbers = trace.per_sample * (runs.degree + 1);
        longer(&mut trace.commands, numbers, runs.zero);
    }

    fn advance(&mut self, trace: &mut Trace<S>) -> bool {
        outlined(
            self.output.simd(),
            #[inline(always)]
            || self.go_on(trace),
        )
    }

    /// Such a command is at its limit at first alone.
    fn limited_until(&self) -> Real<S> {
        let runs = &self.loops.runs;
        let saturated = self.loops.saturated.as_ref();
        saturated.map_or(runs.zero, |at_first| {
            // A command that never leaves its limit is there to the end.
            runs.time(at_first.samples, runs.zero).smaller(runs.end)
        })
    }

    fn unfit(&self) -> Mask<S> {
        self.limited
    }

    fn lost(&self) -> Mask<S> {
        self.lost
    }

    fn piece(&self, trace: &Trace<S>, parts: Real<S>, piece: &mut Piece<S>) {
        stored(trace, parts, piece);
    }

    /// The poles of loops with a delay are not tested here.
    fn decay(&self, _: Real<S>) -> Decay<S> {
        let none = self.loops.runs.no_lane;
        Decay {
            yes: none,
            no: none,
        }
    }
}

/// The polynomials that continuous loops leave in their trace.
fn stored<S: Simd>(trace: &Trace<S>, parts: Real<S>, piece: &mut Piece<S>) {
    for (lane, &part) in parts.numbers().iter().enumerate() {
        if part < 0.0 {
            continue;
        }
        let stored = trace.polynomial(part as usize, piece.degree + 1);
        let numbers = flat::<S>(stored)
            .iter()
            .skip(lane)
            .step_by(Trace::<S>::WIDTH);
        for (term, &number) in piece.terms.iter_mut().zip(numbers) {
            if let Some(place) = term.numbers_mut().get_mut(lane) {
                *place = number;
            }
        }
    }
}
