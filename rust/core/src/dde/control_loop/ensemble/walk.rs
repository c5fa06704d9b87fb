//! Sample by sample through the loops of two vectors.

#![expect(
    clippy::manual_memcpy,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::dde::limits::DIVERGED;
use crate::simd::{Mask, Real, Simd, outlined};

use super::decay::Decay;
use super::loops::{Loops, Runs};
use super::piece::Piece;
use super::trace::{CHUNK, SAMPLES, Summary, Trace};
use super::transition::row;

/// Runs of loops with any number of states.
pub(super) trait Run<S: Simd> {
    /// Begin again.
    fn begin(&mut self, trace: &mut Trace<S>);

    /// Run on for as many samples as a trace holds. False, with the trace as it was, if the runs of all
    /// loops are over.
    fn advance(&mut self, trace: &mut Trace<S>) -> bool;

    /// The loops whose response exceeds all limits before its end.
    fn lost(&self) -> Mask<S>;

    /// The last time at which each command was at its limit; zero where it never was.
    fn limited_until(&self) -> Real<S>;

    /// The loops that this method cannot simulate, as it turned out.
    fn unfit(&self) -> Mask<S>;

    /// Make `piece` the output on one part of each loop; none is wanted where the number of the part
    /// is negative, and any polynomial is made there.
    fn piece(&self, trace: &Trace<S>, parts: Real<S>, piece: &mut Piece<S>);

    /// Are all poles of the loops without their limits within `radius` of zero?
    fn decay(&self, radius: Real<S>) -> Decay<S>;
}

/// A run from rest.
pub(super) struct Walk<'a, S: Simd, const N: usize> {
    loops: &'a Loops<S, N>,
    x: [Real<S>; N],
    output: Real<S>,
    /// The output at the last corner inside of the run.
    inside: Real<S>,
    /// Number of the next sample.
    number: usize,
    lost: Mask<S>,
    limited_until: Real<S>,
}

impl<'a, S: Simd, const N: usize> Walk<'a, S, N> {
    #[inline(always)]
    pub(super) fn new(loops: &'a Loops<S, N>) -> Self {
        let runs = &loops.runs;
        Self {
            loops,
            x: [runs.zero; N],
            output: runs.first_output,
            inside: runs.first_output,
            number: 0,
            lost: runs.no_lane,
            limited_until: runs.zero,
        }
    }

    /// Time of sample `number`.
    #[inline(always)]
    fn time(&self, number: usize) -> Real<S> {
        self.loops.runs.sample_time * number as f64
    }

    /// See [`Run::advance`].
    #[inline(always)]
    fn go_on(&mut self, trace: &mut Trace<S>) -> bool {
        let loops = &self.loops.runs;
        if loops.are_over(self.number) {
            return false;
        }
        let zero = loops.zero;
        if self.number > 0 {
            // The commands that have not arrived yet.
            let history = trace.samples..=trace.samples + loops.samples;
            trace.commands.copy_within(history, 0);
        }
        longer(
            &mut trace.outputs,
            1 + SAMPLES * trace.per_sample,
            zero.lanes(),
        );
        if loops.is_curved {
            longer(&mut trace.states, SAMPLES * N, zero);
            longer(&mut trace.bulges, SAMPLES, zero.lanes());
        }
        trace.restart(self.number, self.output);
        while trace.samples < SAMPLES && !loops.are_over(self.number) {
            let is_whole = self.time(self.number + CHUNK).le(loops.latest);
            if (!is_whole).any() || !self.chunk::<false>(trace) {
                self.chunk::<true>(trace);
            }
        }
        true
    }

    /// Advance by [`CHUNK`] samples. Unless `EXACT`, no run may end within them, and this is false
    /// and does nothing where some response may have exceeded all limits.
    #[inline(always)]
    fn chunk<const EXACT: bool>(&mut self, trace: &mut Trace<S>) -> bool {
        let (loops, plants) = (&self.loops.runs, &self.loops.plants);
        let controllers = &self.loops.controllers;
        let mut summary = Summary {
            most: self.inside,
            least: self.inside,
            bulge: loops.zero,
        };
        let mut ends = Ends {
            count: trace.count,
            is_cut: trace.is_cut,
            inside: self.inside,
            run_end: loops.end,
            latest: loops.latest,
        };
        let is_late = loops.parts.first().is_some_and(|part| part.is_after);
        let (mut x, mut output, mut number) = (self.x, self.output, self.number);
        // The sum of the squares of all states and commands.
        let (mut lost, mut size) = (self.lost, loops.zero);
        let mut limited_until = self.limited_until;
        // Copies of few numbers stay in registers while the trace is written; more are read faster
        // where they are.
        let copies = (controllers.k, controllers.step);
        let (k, step) = if N == 1 {
            (&copies.0, &copies.1)
        } else {
            (&controllers.k, &controllers.step)
        };
        let (limit, lowest) = (loops.limit, -loops.limit);
        let first_sample = trace.samples;
        for sample in first_sample..first_sample + CHUNK {
            let now = loops.sample_time * number as f64;
            let Some(commands) = trace.commands.get_mut(sample..=sample + loops.samples + 1) else {
                break;
            };
            let before = commands.first().copied().unwrap_or(loops.zero);
            let u = row(k, &x, controllers.l.mul_add(before, loops.command));
            let w = u.min(limit).max(lowest);
            if let Some(place) = commands.last_mut() {
                *place = w;
            }
            let after = commands.get(1).copied().unwrap_or(w);
            if loops.is_curved {
                let held = if is_late { after } else { before };
                let mut bulge = (after - before).abs() * plants.bulge_of_jump;
                for i in 0..N {
                    let forced = plants.b[i].mul_add(held, plants.e[i]);
                    let slope = row(&plants.a[i], &x, forced);
                    bulge = slope.abs().mul_add(plants.bulge[i], bulge);
                }
                summary.bulge = summary.bulge.max(bulge);
                if let Some(place) = trace.bulges.get_mut(sample) {
                    *place = bulge.lanes();
                }
                if let Some(places) = trace.states.get_mut(sample * N..(sample + 1) * N) {
                    for i in 0..N {
                        places[i] = x[i];
                    }
                }
            }
            let first_corner = 1 + sample * trace.per_sample;
            let corners = first_corner..first_corner + trace.per_sample;
            let Some((last, places)) = trace
                .outputs
                .get_mut(corners)
                .and_then(<[_]>::split_last_mut)
            else {
                break;
            };
            let is_hidden = loops.hides && number <= loops.samples;
            let mut begin = now;
            for (corner, place) in plants.corners.iter().zip(places) {
                let mut forced = corner.before * before;
                if corner.is_after {
                    forced = corner.after.mul_add(after, forced);
                }
                output = row(&corner.states, &x, forced + corner.constant);
                if is_hidden && !(corner.is_after && number == loops.samples) {
                    output = loops.first_output;
                }
                *place = output.lanes();
                if EXACT {
                    let end = now + corner.offset;
                    ends.corner(&mut summary, output, begin, end);
                    begin = end;
                } else {
                    summary.most = summary.most.max(output);
                    summary.least = summary.least.min(output);
                }
            }
            x = step.apply(&x, before, after);
            let next = loops.sample_time * (number + 1) as f64;
            // A command is held to the next sample.
            let mut limited = u.abs().gt(limit);
            if EXACT {
                limited = limited & now.le(loops.latest);
            }
            limited_until = limited.select(next, limited_until);
            if EXACT {
                let sound = are_sound(&[u]) & (are_sound(&x) | next.gt(loops.latest));
                lost = lost | (now.le(loops.latest) & !sound);
            } else {
                size = row(&x, &x, u.mul_add(u, size));
            }
            output = row(&plants.c, &x, loops.zero);
            if loops.jump != usize::MAX {
                output = loops.d.mul_add(after, output);
            }
            if is_hidden && number < loops.samples {
                output = loops.first_output;
            }
            *last = output.lanes();
            number += 1;
            if EXACT {
                ends.corner(&mut summary, output, begin, next);
            } else {
                summary.most = summary.most.max(output);
                summary.least = summary.least.min(output);
            }
        }
        if EXACT {
            (trace.count, trace.is_cut) = (ends.count, ends.is_cut);
            self.inside = ends.inside;
        } else {
            if (!size.le(DIVERGED)).any() {
                return false;
            }
            trace.count = trace.count + (CHUNK * trace.per_sample) as f64;
            self.inside = output;
        }
        (self.x, self.output, self.number, self.lost) = (x, output, number, lost);
        self.limited_until = limited_until;
        trace.samples = first_sample + CHUNK;
        trace.chunks.push(summary);
        true
    }
}

/// A trace at the begin of runs, with no commands before.
#[inline(never)]
fn begun<S: Simd>(runs: &Runs<S>, trace: &mut Trace<S>) {
    let history = runs.samples + 1;
    longer(&mut trace.commands, history + SAMPLES, runs.zero);
    let commands = trace.commands.iter_mut();
    commands.take(history).for_each(|u| *u = runs.zero);
    trace.per_sample = runs.parts.len();
    (trace.jump, trace.is_curved) = (runs.jump, runs.is_curved);
    trace.is_continuous = false;
}

/// Are all numbers within the limit on those of a response?
#[inline(always)]
pub(super) fn are_sound<S: Simd, const N: usize>(numbers: &[Real<S>; N]) -> Mask<S> {
    let mut sound = numbers[0].abs().le(DIVERGED);
    for number in numbers.iter().skip(1) {
        sound = sound & number.abs().le(DIVERGED);
    }
    sound
}

/// Corners of runs that end.
pub(super) struct Ends<S: Simd> {
    pub(super) count: Real<S>,
    pub(super) is_cut: Mask<S>,
    pub(super) inside: Real<S>,
    pub(super) run_end: Real<S>,
    pub(super) latest: Real<S>,
}

impl<S: Simd> Ends<S> {
    /// The output at the end of a part between two times.
    #[inline(always)]
    pub(super) fn corner(
        &mut self,
        summary: &mut Summary<S>,
        output: Real<S>,
        begin: Real<S>,
        end: Real<S>,
    ) {
        let inside = end.le(self.latest);
        self.count = inside.select(self.count + 1.0, self.count);
        self.is_cut = self.is_cut | (begin.lt(self.run_end) & !inside);
        summary.most = inside.select(summary.most.max(output), summary.most);
        summary.least = inside.select(summary.least.min(output), summary.least);
        self.inside = inside.select(output, self.inside);
    }
}

impl<S: Simd, const N: usize> Run<S> for Walk<'_, S, N> {
    fn begin(&mut self, trace: &mut Trace<S>) {
        *self = Self::new(self.loops);
        begun(&self.loops.runs, trace);
    }

    fn advance(&mut self, trace: &mut Trace<S>) -> bool {
        outlined(
            self.output.simd(),
            #[inline(always)]
            || self.go_on(trace),
        )
    }

    fn lost(&self) -> Mask<S> {
        self.lost
    }

    fn limited_until(&self) -> Real<S> {
        self.limited_until
    }

    fn unfit(&self) -> Mask<S> {
        self.loops.runs.no_lane
    }

    fn piece(&self, trace: &Trace<S>, parts: Real<S>, piece: &mut Piece<S>) {
        let Loops { runs, plants, .. } = self.loops;
        outlined(
            parts.simd(),
            #[inline(always)]
            || plants.expand(runs, trace, parts, piece),
        );
    }

    fn decay(&self, radius: Real<S>) -> Decay<S> {
        let Loops {
            runs, controllers, ..
        } = self.loops;
        outlined(
            radius.simd(),
            #[inline(always)]
            || controllers.decay(runs, radius),
        )
    }
}

/// Bring `numbers` to at least `length`.
pub(super) fn longer<T: Clone>(numbers: &mut Vec<T>, length: usize, zero: T) {
    if numbers.len() < length {
        numbers.resize(length, zero);
    }
}
