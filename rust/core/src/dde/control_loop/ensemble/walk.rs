//! Sample by sample through the loops of two vectors.

#![expect(
    clippy::manual_memcpy,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::dde::limits::DIVERGED;
use crate::simd::{Mask, Outlined, Real, Simd, outlined};

use super::decay::{Decay, Within};
use super::loops::Loops;
use super::trace::{CHUNK, SAMPLES, Summary, Trace};
use super::transition::row;

/// Runs of loops with any number of states.
pub(super) trait Run<S: Simd> {
    /// Begin again, with a sample at the end of the run if that is closed.
    fn begin(&mut self, trace: &mut Trace<S>, is_closed: bool);

    /// Run on for as many samples as a trace holds. False, if the runs of all loops are over.
    fn advance(&mut self, trace: &mut Trace<S>) -> bool;

    /// Are the runs of all loops over?
    fn is_over(&self) -> bool;

    /// The loops whose response exceeds all limits before its end.
    fn lost(&self) -> Mask<S>;

    /// The loops that this method cannot simulate, as it turned out.
    fn unfit(&self) -> Mask<S>;

    /// Are all poles of the loops without their limits within `radius` of zero?
    fn decay(&self, radius: Real<S>) -> Decay<S>;
}

/// A run from rest.
pub(super) struct Walk<'a, S: Simd, const N: usize, const P: usize> {
    loops: &'a Loops<S, N, P>,
    x: [Real<S>; N],
    output: Real<S>,
    /// The output at the last corner inside of the run.
    inside: Real<S>,
    /// Number of the next sample.
    number: usize,
    /// Does the run include a sample at its end?
    is_closed: bool,
    lost: Mask<S>,
}

impl<'a, S: Simd, const N: usize, const P: usize> Walk<'a, S, N, P> {
    #[inline(always)]
    pub(super) fn new(loops: &'a Loops<S, N, P>) -> Self {
        let plants = &loops.plants;
        Self {
            loops,
            x: [plants.zero; N],
            output: plants.first_output,
            inside: plants.first_output,
            number: 0,
            is_closed: false,
            lost: plants.no_lane,
        }
    }

    /// Time of sample `number`.
    #[inline(always)]
    fn time(&self, number: usize) -> Real<S> {
        self.loops.plants.sample_time * number as f64
    }

    /// Are the runs of all loops over?
    #[inline(always)]
    fn ends(&self) -> bool {
        self.loops.plants.are_over(self.number, self.is_closed)
    }

    /// See [`Run::advance`].
    #[inline(always)]
    fn go_on(&mut self, trace: &mut Trace<S>) -> bool {
        let loops = &self.loops.plants;
        if self.ends() {
            return false;
        }
        let zero = loops.d.constant(0.0);
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
            longer(&mut trace.states, SAMPLES * P, zero);
            longer(&mut trace.bulges, SAMPLES, zero.lanes());
        }
        trace.restart(self.number, self.output);
        while trace.samples < SAMPLES && !self.ends() {
            let is_whole = self.time(self.number + CHUNK).le(loops.end);
            if (!is_whole).any() {
                self.chunk::<true>(trace);
            } else {
                self.chunk::<false>(trace);
            }
        }
        true
    }

    /// Advance by [`CHUNK`] samples; if `ENDS`, some run ends within them.
    #[inline(always)]
    fn chunk<const ENDS: bool>(&mut self, trace: &mut Trace<S>) {
        let feedback = self.loops;
        let loops = &feedback.plants;
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
        };
        let is_late = loops.parts.first().is_some_and(|part| part.is_after);
        let (mut x, mut output, mut number) = (self.x, self.output, self.number);
        let mut lost = self.lost;
        // Copies of few numbers stay in registers while the trace is written; more are read faster
        // where they are.
        let copies = (feedback.k, feedback.step);
        let (k, step) = if N == 1 {
            (&copies.0, &copies.1)
        } else {
            (&feedback.k, &feedback.step)
        };
        let (limit, lowest) = (loops.limit, -loops.limit);
        let first_sample = trace.samples;
        for sample in first_sample..first_sample + CHUNK {
            let now = loops.sample_time * number as f64;
            let Some(commands) = trace.commands.get_mut(sample..=sample + loops.samples + 1) else {
                break;
            };
            let before = commands.first().copied().unwrap_or(loops.zero);
            let u = row(k, &x, feedback.l.mul_add(before, loops.command));
            let w = u.min(limit).max(lowest);
            if let Some(place) = commands.last_mut() {
                *place = w;
            }
            let after = commands.get(1).copied().unwrap_or(w);
            if loops.is_curved {
                let held = if is_late { after } else { before };
                let mut bulge = (after - before).abs() * loops.bulge_of_jump;
                for i in 0..P {
                    let forced = loops.b[i].mul_add(held, loops.e[i]);
                    let slope = row(&loops.a[i], &first(&x), forced);
                    bulge = slope.abs().mul_add(loops.bulge[i], bulge);
                }
                summary.bulge = summary.bulge.max(bulge);
                if let Some(place) = trace.bulges.get_mut(sample) {
                    *place = bulge.lanes();
                }
                if let Some(places) = trace.states.get_mut(sample * P..(sample + 1) * P) {
                    for i in 0..P {
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
            for (corner, place) in loops.corners.iter().zip(places) {
                let mut forced = corner.before * before;
                if corner.is_after {
                    forced = corner.after.mul_add(after, forced);
                }
                if loops.is_pushed {
                    forced = forced + corner.constant;
                }
                output = row(&corner.states, &first(&x), forced);
                if is_hidden && !(corner.is_after && number == loops.samples) {
                    output = loops.first_output;
                }
                *place = output.lanes();
                if ENDS {
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
            let (mut u_sound, mut x_sound) = (are_sound(&[u]), are_sound(&x));
            if ENDS {
                // Nothing after the end counts.
                u_sound = u_sound | now.ge(loops.end);
                x_sound = x_sound | next.gt(loops.end);
            }
            lost = lost | !(u_sound & x_sound);
            output = loops.seen(&first(&x));
            if loops.is_direct {
                output = loops.d.mul_add(after, output);
            }
            if is_hidden && number < loops.samples {
                output = loops.first_output;
            }
            *last = output.lanes();
            number += 1;
            if ENDS {
                ends.corner(&mut summary, output, begin, next);
            } else {
                summary.most = summary.most.max(output);
                summary.least = summary.least.min(output);
            }
        }
        if ENDS {
            (trace.count, trace.is_cut) = (ends.count, ends.is_cut);
            self.inside = ends.inside;
        } else {
            trace.count = trace.count + (CHUNK * trace.per_sample) as f64;
            self.inside = output;
        }
        (self.x, self.output, self.number, self.lost) = (x, output, number, lost);
        trace.samples = first_sample + CHUNK;
        trace.chunks.push(summary);
    }
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
        let running = begin.lt(self.run_end);
        let inside = running & end.le(self.run_end);
        self.count = inside.select(self.count + 1.0, self.count);
        self.is_cut = self.is_cut | (running & !inside);
        summary.most = inside.select(summary.most.max(output), summary.most);
        summary.least = inside.select(summary.least.min(output), summary.least);
        self.inside = inside.select(output, self.inside);
    }
}

impl<S: Simd, const N: usize, const P: usize> Run<S> for Walk<'_, S, N, P> {
    fn begin(&mut self, trace: &mut Trace<S>, is_closed: bool) {
        let plants = &self.loops.plants;
        let zero = plants.zero;
        self.x = [zero; N];
        (self.output, self.inside) = (plants.first_output, plants.first_output);
        self.number = 0;
        self.is_closed = is_closed;
        self.lost = plants.no_lane;
        let history = plants.samples + 1;
        longer(&mut trace.commands, history + SAMPLES, zero);
        trace
            .commands
            .iter_mut()
            .take(history)
            .for_each(|u| *u = zero);
        trace.per_sample = plants.parts.len();
        (trace.jump, trace.is_curved) = (plants.jump, plants.is_curved);
        trace.is_continuous = false;
    }

    fn advance(&mut self, trace: &mut Trace<S>) -> bool {
        let simd = self.output.simd();
        outlined(simd, Advance { walk: self, trace })
    }

    fn is_over(&self) -> bool {
        self.ends()
    }

    fn lost(&self) -> Mask<S> {
        self.lost
    }

    fn unfit(&self) -> Mask<S> {
        self.loops.plants.no_lane
    }

    fn decay(&self, radius: Real<S>) -> Decay<S> {
        let loops = self.loops;
        outlined(radius.simd(), Within { loops, radius })
    }
}

/// See [`Run::advance`].
struct Advance<'a, 'b, S: Simd, const N: usize, const P: usize> {
    walk: &'a mut Walk<'b, S, N, P>,
    trace: &'a mut Trace<S>,
}

impl<S: Simd, const N: usize, const P: usize> Outlined for Advance<'_, '_, S, N, P> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        self.walk.go_on(self.trace)
    }
}

/// Bring `numbers` to at least `length`.
pub(super) fn longer<T: Clone>(numbers: &mut Vec<T>, length: usize, zero: T) {
    if numbers.len() < length {
        numbers.resize(length, zero);
    }
}

/// The states of the plant.
#[inline(always)]
fn first<S: Simd, const N: usize, const P: usize>(x: &[Real<S>; N]) -> [Real<S>; P] {
    let mut out = [x[0]; P];
    for i in 0..P.min(N) {
        out[i] = x[i];
    }
    out
}
