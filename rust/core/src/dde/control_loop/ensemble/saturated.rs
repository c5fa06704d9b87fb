//! How long the commands of continuous loops are at their limit at first.
//!
//! The reference steps while the loop rests. If the command is beyond its limit then, the plant
//! receives a constant from one delay later on, until one delay after the command has left the
//! limit at t₁. From t₁ on the loop is one without a limit, whose command has been the same
//! constant for a delay, so that nothing cuts its parts. They only have to begin at t₁: of the
//! samples, each one delay long, the second one is shortened, through which the command does not
//! change.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::dde::limits::DIVERGED;
use crate::simd::{Mask, Real, Simd};

use super::loops::{Plants, Runs};
use super::piece::Piece;
use super::transition::row;

/// The time in which commands are at their limit.
pub(super) struct Saturated<S: Simd> {
    /// The command until then.
    pub(super) command: Real<S>,
    /// Samples until then; 0 of loops whose command begins within its limit.
    pub(super) samples: Real<S>,
    /// The part of a delay that the second sample takes.
    pub(super) share: Real<S>,
    /// Loops whose command leaves its limit before the plant moves, or not as simply as this.
    pub(super) unfit: Mask<S>,
}

impl<S: Simd> Saturated<S> {
    /// Of commands u = K x + L w + M r on parts of length `h`; none, if all begin within their limits.
    #[inline(always)]
    pub(super) fn of<const N: usize>(
        runs: &Runs<S>,
        plants: &Plants<S, N>,
        (k, l): (&[Real<S>; N], Real<S>),
        h: Real<S>,
    ) -> Option<Self> {
        let zero = runs.zero;
        let beyond = runs.command.abs().gt(runs.limit);
        if !beyond.any() {
            return None;
        }
        let one = zero.constant(1.0);
        let command = runs.command.lt(0.0).select(-runs.limit, runs.limit);
        // A command that depends on the one of a delay before does not stay constant.
        let mut open = beyond & l.eq(0.0) & runs.command.abs().le(DIVERGED);
        let (mut samples, mut share, mut unfit) = (zero, one, beyond & !open);
        let parts = runs.parts.len();
        let mut x = [zero; N];
        let mut number = 0;
        loop {
            // A run ends where its own loop does, not where its neighbours do.
            let begin = runs.time(zero.constant(number as f64), zero);
            let over = open & !begin.le(runs.latest);
            samples = over.select(f64::INFINITY, samples);
            open = open & !over;
            if !open.any() {
                break;
            }
            let held = if number == 0 { zero } else { command };
            for part in 0..parts {
                let excess = Excess::of(runs, plants, k, h, &mut x, held);
                let (stays, leaves) = excess.kinds(open);
                let known = if number == 0 { runs.no_lane } else { leaves };
                unfit = unfit | (open & !stays & !known);
                if known.any() {
                    let sigma = excess.0.zero(zero, zero, one, known);
                    let at = (sigma + part as f64) * (1.0 / parts as f64);
                    share = known.select(at.larger(f64::EPSILON), share);
                    samples = known.select((number + 1) as f64, samples);
                }
                open = open & stays;
            }
            number += 1;
        }
        Some(Self {
            command,
            samples,
            share,
            unfit,
        })
    }
}

/// By how much a command would exceed its limit without it, on a part, as a polynomial in σ.
struct Excess<S: Simd>(Piece<S>);

impl<S: Simd> Excess<S> {
    /// Go from `x` to the end of a part on which the plant receives a constant.
    #[inline(always)]
    fn of<const N: usize>(
        runs: &Runs<S>,
        plants: &Plants<S, N>,
        k: &[Real<S>; N],
        h: Real<S>,
        x: &mut [Real<S>; N],
        held: Real<S>,
    ) -> Self {
        let zero = runs.zero;
        let is_low = runs.command.lt(0.0);
        let mut piece = Piece::new(zero);
        piece.degree = runs.degree;
        let mut term = *x;
        for j in 0..=runs.degree {
            if j > 0 {
                for i in 0..N {
                    x[i] = x[i] + term[i];
                }
            }
            let mut u = row(k, &term, zero);
            if j == 0 {
                u = u + runs.command;
            }
            u = is_low.select(-u, u);
            piece.terms[j] = if j == 0 { u - runs.limit } else { u };
            let old = term;
            for i in 0..N {
                term[i] = row(&plants.a[i], &old, zero);
                if j == 0 {
                    term[i] = term[i] + plants.b[i] * held + plants.e[i];
                }
                term[i] = term[i] * (h * (1.0 / (j + 1) as f64));
            }
        }
        Self(piece)
    }

    /// The loops in `open` whose command is beyond its limit on all of the part, and those in which
    /// it comes back within it once, by partial sums of coefficients as in `piece`.
    #[inline(always)]
    fn kinds(&self, open: Mask<S>) -> (Mask<S>, Mask<S>) {
        let terms = &self.0.terms;
        let zero = terms[0].constant(0.0);
        let (mut sum, mut least) = (terms[0], terms[0]);
        let (mut slope, mut steepest) = (zero, zero);
        for j in 1..=self.0.degree {
            sum = sum + terms[j];
            least = least.min(sum);
            slope = terms[j].mul_add(j as f64, slope);
            steepest = steepest.max(slope);
        }
        let falls = steepest.le(0.0);
        let stays = open & (least.gt(0.0) | (falls & sum.gt(0.0)));
        (stays, open & falls & terms[0].gt(0.0) & sum.le(0.0))
    }
}
