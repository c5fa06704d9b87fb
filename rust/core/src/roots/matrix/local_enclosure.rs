//! Proved statements about det M around one point s.
//!
//! Row i of M is multiplied by e^(s τ_c(i)), rows and columns by powers of two (`balance`), so that
//! nothing overflows: arg det M = arg det G − T Im s with T = Σ τ_c(i). Let R be the computed
//! inverse of G(s), G(s) R = I − Y, |Y| ≤ α in the Frobenius norm, K a matrix and κ a number. With
//!     G(s + δ) R = (1 + κ δ)(I + Z),  Z = (−Y + δ (K − κ I) + (rest))/(1 + κ δ),
//! as long as f ≥ |Z| stays below 1 along the step, the argument of det G changes by n arg(1 + κ δ)
//! up to |arg det(I + Z)| ≤ |tr Z| + |tr Z²|/2 + … ≤ t − log(1 − f) − f. The trace t is bounded
//! apart, which makes the bound independent of n where delays touch few rows. Two choices of K:
//! G′(s) R with Taylor's second-order rest, |e^z − 1 − z| ≤ min(|z|²/2 g, 1 + g + |z|), g = max(1,
//! e^Re z), or only the part of G′ R that is free of exponentials, |e^z − 1| ≤ min(|z|, 2) g: where
//! sE dominates that reaches far. κ = tr K/n takes out the factor that all of G has in common.
//!
//! Rounding: an entry of G carries u (16 + m + 8 |d| (|x| + |y|)) Σ (|s| |N| + |A|) e^(−x d),
//! derived as in `quasipoly::probe` but for e^(−x d), from which a power of two is taken (3 u |d x|
//! in the exponent); a row of products with R at most as many u more as it has entries. Both are in
//! `loss`. Every statement here is about the same bound f and its rounding, so they share a file.

use std::f64::consts::LN_2;

use num_complex::Complex64;

use super::balance::{Balanced, balance, exponent};
use super::factor::{FLOOR, Factored, ROUNDING, factor};
use super::kernel::combine;
use super::system::{Irreducible, Term};
use crate::Error;
use crate::elementary::{angle, exp, sin_cos};
use crate::linear_algebra::rows::{Rows, norm};
use crate::quasipoly::modulus;

/// Largest bound on |Z| along a step. A larger one gives longer steps and wider angles.
const MOST: f64 = 0.8;

/// Largest bound on its trace. −log(1 − 0.8) − 0.8 + 0.35 < 1.17: both sides of a step stay below
/// 2.34.
const MOST_TRACE: f64 = 0.35;

/// √n α must be below this: the argument is then known within twice that, and 2.34 + 6 · 0.021 <
/// 3.14 · 0.8.
const CLEAR: f64 = 0.02;

/// Covers the rounding errors of the sums and products in a bound.
const MARGIN: f64 = 1.0 + 1e-9;

/// Covers the rounding errors of a bound from below.
const SHRUNK: f64 = 1.0 - 1e-9;

/// Rounding errors, for each row, of sums over all rows and of angles.
const ROW_ROUNDINGS: f64 = 16.0;

/// Lower limit that replaces a size lost in underflow, because the size may grow along the step.
const LEAST: f64 = 1e-150;

/// Upper limit on the lengths tried for one reach.
const MAX_ROUNDS: usize = 100;

/// Residual below which the inverse is accurate enough for a step of Newton's iteration.
const RESOLVED: f64 = 0.1;

/// Ratio of the bounds of a reach at which the search for it ends.
const CLOSE_LENGTHS: f64 = 0.9;

/// First length tried, in units of one over the spread. Close to `MOST`, because the spread often
/// decides; larger: it holds less often, smaller: it is farther below the reach.
const FIRST_LENGTH: f64 = 0.7;

/// Largest part of the upper bound that is doubled, like the lower bound, where the first length is
/// outside the bounds. Larger: it holds less often; smaller: it is farther below the reach.
const DOUBLED_PART: f64 = 0.4;

/// Factor on the upper bound while no length holds. Larger: more tries until one holds; smaller: more
/// tries back up to the reach.
const SHRINKAGE: f64 = 0.25;

/// Ratio of the bounds above which the lower one is doubled; below it, their mean is tried. Larger:
/// fewer tries if the reach is far above the lower bound; smaller: fewer if it is close to it.
const FAR_APART: f64 = 8.0;

/// Upper bound of a reach at which the search for it ends, because products would underflow.
const SHORTEST: f64 = 1e-300;

/// Least |1 + κ δ| along a step, because the bounds are divided by it. Larger: shorter steps;
/// smaller: its own rounding error counts.
const LEAST_COMMON: f64 = 1e-3;

/// Largest |κ δ|² of a step, because products would overflow.
const MOST_COMMON: f64 = 1e200;

/// Upper limit on the gaps whose parts are merged over rows. Larger: shorter steps where rows have
/// gaps of their own; smaller: more operations for each length tried.
const MOST_MERGED: usize = 2;

/// Points, in units of the rate. A matrix that is not singular everywhere is regular in double
/// precision at one of them.
const POINTS: [(f64, f64); 4] = [(0.737, 1.171), (2.313, 0.0), (0.113, 0.219), (31.7, 17.3)];

/// The part of one delay in one row of G, times R.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// τ − τ_c(i).
    gap: f64,
    /// Norm of the row of (s N − A) R e^(−s d), and of N R e^(−s d).
    size: f64,
    slope: f64,
    /// Moduli of their entries on the diagonal.
    own_size: f64,
    own_slope: f64,
}

/// A choice of K.
#[derive(Debug, Clone, Copy)]
struct Expansion {
    /// κ.
    common: Complex64,
    /// |K − κ I|.
    spread: f64,
    /// |tr K − n κ|, and bounds on errors of K's diagonal.
    trace: f64,
    /// Are the exponentials expanded to the first order, or not at all?
    with_delays: bool,
}

/// A point and what is proved around it.
#[derive(Debug, Clone)]
pub(super) struct LocalEnclosure {
    pub(super) s: Complex64,
    /// arg det G in (−π, π], within `error`.
    pub(super) angle: f64,
    pub(super) error: f64,
    /// T in s.
    pub(super) delay: f64,
    /// det M / det M′: Newton's step is minus that.
    pub(super) correction: Complex64,
    size: f64,
    /// √(size) times this is below `CLEAR` where the argument is proved.
    pub(super) residual: f64,
    expansions: [Expansion; 2],
    rows: Vec<Vec<Part>>,
}

/// The expansion that allows the longest step, and the length of that step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    pub(super) length: f64,
    expansion: usize,
}

impl LocalEnclosure {
    /// The enclosure at `s`; `None` where M(s) is too close to a singular matrix.
    fn new(system: &Irreducible, s: Complex64) -> Option<Self> {
        Self::tried(system, &balance(system, s)?, s).filter(Self::is_clear)
    }

    /// Is the argument proved?
    pub(super) fn is_clear(&self) -> bool {
        self.size.sqrt() * self.residual <= CLEAR && self.angle.is_finite()
    }

    /// Is the inverse accurate enough for a step of Newton's iteration?
    pub(super) fn is_resolved(&self) -> bool {
        self.residual < RESOLVED
    }

    /// What is known at `s` with M scaled by `balanced`, proved or not.
    pub(super) fn tried(system: &Irreducible, balanced: &Balanced, s: Complex64) -> Option<Self> {
        let n = system.size();
        let scaled = || balanced.rows.iter().zip(&balanced.references);
        let mut weights = Weights::new(system, balanced, s);
        let mut g = Rows::zeros(n);
        for (i, (terms, reference)) in scaled().enumerate() {
            for term in terms {
                let (_, _, factor) = weights.get(term.delay, *reference);
                for entry in &term.entries {
                    g.add(i, entry.column, (s * entry.slope + entry.value) * factor);
                }
            }
        }
        let Factored {
            inverse,
            norms,
            direction,
            residual,
        } = factor(g)?;
        let mut sums = Sums::new(n);
        let mut rows = Vec::with_capacity(n);
        for (i, (terms, reference)) in scaled().enumerate() {
            let mut parts = Vec::with_capacity(terms.len());
            sums.start_row();
            for term in terms {
                let weight = weights.get(term.delay, *reference);
                let loss = weights.loss(term, terms.len(), weight.0);
                let part = sums.add(term, (s, i), weight, loss, (&inverse, &norms));
                parts.extend(part);
            }
            sums.end_row(i);
            rows.push(parts);
        }
        let size = n as f64;
        let residual = (residual + sums.lost.sqrt()) * MARGIN;
        let delay: f64 = balanced
            .references
            .iter()
            .filter_map(|c| system.delays().get(*c))
            .sum();
        let error = 2.0 * (size.sqrt() * residual + residual * residual)
            + ROW_ROUNDINGS * (size + 2.0) * ROUNDING;
        Some(Self {
            s,
            angle: angle(direction.im, direction.re),
            error,
            delay,
            correction: (sums.first.trace - delay).inv(),
            size,
            residual,
            expansions: [
                sums.first.expansion(size, true),
                sums.zeroth.expansion(size, false),
            ],
            rows: merged(rows),
        })
    }

    /// The distance along the unit vector `along`, at most `most`, within which the argument is
    /// close to the expected one.
    pub(super) fn reach(&self, along: Complex64, most: f64) -> Reach {
        let mut best = Reach {
            length: 0.0,
            expansion: 0,
        };
        for (index, expansion) in self.expansions.iter().enumerate() {
            let holds = |length: f64| self.holds(expansion, along * length, length);
            if holds(most) {
                return Reach {
                    length: most,
                    expansion: index,
                };
            }
            let (mut low, mut high) = (best.length, most);
            if low > 0.0 && !holds(low) {
                continue;
            }
            let mut guess = most.min(FIRST_LENGTH / expansion.spread.max(1.0 / f64::MAX));
            if !(guess > low && guess < high) {
                guess = if low > 0.0 {
                    low.min(DOUBLED_PART * high) * 2.0
                } else {
                    0.5 * high
                };
            }
            for _ in 0..MAX_ROUNDS {
                if holds(guess) {
                    low = guess;
                } else {
                    high = guess;
                }
                if low > CLOSE_LENGTHS * high || high < SHORTEST {
                    break;
                }
                guess = if low == 0.0 {
                    SHRINKAGE * high
                } else if high > FAR_APART * low {
                    2.0 * low
                } else {
                    (low * high).sqrt()
                };
            }
            if low > best.length {
                best = Reach {
                    length: low,
                    expansion: index,
                };
            }
        }
        best
    }

    /// The expected change of arg det G over a step within a reach.
    pub(super) fn expected(&self, reach: Reach, step: Complex64) -> f64 {
        let common = self
            .expansions
            .get(reach.expansion)
            .map_or(Complex64::ZERO, |expansion| expansion.common);
        let factor = Complex64::ONE + common * step;
        self.size * angle(factor.im, factor.re)
    }

    /// Are |Z| and its trace small along a step?
    fn holds(&self, expansion: &Expansion, step: Complex64, length: f64) -> bool {
        let common = expansion.common * step;
        let square = common.norm_sqr();
        let place = if square > 0.0 {
            (-common.re / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let least = modulus(Complex64::ONE + common * place) * SHRUNK;
        if !(least > LEAST_COMMON && square < MOST_COMMON) {
            return false;
        }
        let (mut squares, mut trace) = (0.0, 0.0);
        for parts in &self.rows {
            let (mut row, mut own) = (0.0, 0.0);
            for part in parts {
                let z = (part.gap * length).abs();
                let rise = -part.gap * step.re;
                let grown = if rise > 0.0 { exp(rise) * MARGIN } else { 1.0 };
                let plain = z.min(2.0) * grown;
                let (on_size, on_slope) = if expansion.with_delays {
                    ((0.5 * z * z * grown).min(1.0 + grown + z), plain)
                } else {
                    (plain, grown)
                };
                row += part.size * on_size + length * part.slope * on_slope;
                own += part.own_size * on_size + length * part.own_slope * on_slope;
            }
            squares += row * row;
            trace += own;
        }
        let rounding = ROW_ROUNDINGS * self.size * ROUNDING * (1.0 + square.sqrt());
        let whole = self.residual + length * expansion.spread + squares.sqrt();
        let trace = self.size.sqrt() * self.residual + length * expansion.trace + trace + rounding;
        whole * MARGIN <= MOST * least && trace * MARGIN <= MOST_TRACE * least
    }
}

/// All rows as one where few gaps occur, each gap in one part: by Minkowski's inequality the root of
/// the sum of squares over rows is at most the sum of that over gaps.
fn merged(rows: Vec<Vec<Part>>) -> Vec<Vec<Part>> {
    let mut whole: Vec<Part> = Vec::new();
    for part in rows.iter().flatten() {
        if let Some(known) = whole.iter_mut().find(|known| known.gap == part.gap) {
            known.size += part.size * part.size;
            known.slope += part.slope * part.slope;
            known.own_size += part.own_size;
            known.own_slope += part.own_slope;
        } else if whole.len() == MOST_MERGED {
            return rows;
        } else {
            let (size, slope) = (part.size * part.size, part.slope * part.slope);
            whole.push(Part {
                size,
                slope,
                ..*part
            });
        }
    }
    for part in &mut whole {
        part.size = part.size.sqrt().max(LEAST) * MARGIN;
        part.slope = part.slope.sqrt().max(LEAST) * MARGIN;
    }
    vec![whole]
}

/// Gap, e^(−x d) and e^(−s d) without their power of two for pairs of delays, each computed once.
pub(super) struct Weights<'a> {
    delays: &'a [f64],
    s: Complex64,
    /// Re s of the point with whose powers of two the entries are scaled.
    scaled_at: f64,
    known: Vec<Option<(f64, f64, Complex64)>>,
}

impl<'a> Weights<'a> {
    pub(super) fn new(system: &'a Irreducible, balanced: &Balanced, s: Complex64) -> Self {
        let delays = system.delays();
        Self {
            delays,
            s,
            scaled_at: balanced.place.re,
            known: vec![None; delays.len() * delays.len()],
        }
    }

    pub(super) fn get(&mut self, delay: usize, reference: usize) -> (f64, f64, Complex64) {
        let at = delay * self.delays.len() + reference;
        if let Some(Some(known)) = self.known.get(at) {
            return *known;
        }
        let time = |index: usize| self.delays.get(index).copied().unwrap_or(0.0);
        let gap = time(delay) - time(reference);
        let found = if gap == 0.0 {
            (0.0, 1.0, Complex64::ONE)
        } else {
            // The rest of e^(−x d) without its power of two, which is in the entries.
            let weight = exp(-gap * self.s.re - exponent(gap, self.scaled_at) * LN_2);
            let (sine, cosine) = sin_cos(gap * self.s.im);
            (gap, weight, Complex64::new(weight * cosine, -weight * sine))
        };
        if let Some(place) = self.known.get_mut(at) {
            *place = Some(found);
        }
        found
    }

    /// The rounding error of the products of a term with R, relative to the sum of moduli.
    pub(super) fn loss(&self, term: &Term, terms: usize, gap: f64) -> f64 {
        let reach = self.s.re.abs() + self.s.im.abs() + self.scaled_at.abs();
        ROUNDING * ((16 + terms + term.entries.len()) as f64 + 8.0 * gap.abs() * reach)
    }
}

/// Sums over the rows of G′ R: all of it, and the part that is free of exponentials.
struct Sums {
    first: Sum,
    zeroth: Sum,
    /// Squares of the norms of errors of the rows of G R.
    lost: f64,
    row_lost: f64,
    /// Rows of products of a term with R.
    on_slope: Rows,
    on_value: Rows,
}

/// A choice of K, row by row. Of K − κ I only norms are needed.
struct Sum {
    row: (Vec<f64>, Vec<f64>),
    /// Σ of squares off the diagonal, the diagonal, the trace.
    off: f64,
    diagonal: Vec<Complex64>,
    trace: Complex64,
    row_lost: f64,
    lost: f64,
    lost_trace: f64,
}

impl Sum {
    fn new(n: usize) -> Self {
        Self {
            row: (vec![0.0; n], vec![0.0; n]),
            off: 0.0,
            diagonal: Vec::with_capacity(n),
            trace: Complex64::ZERO,
            row_lost: 0.0,
            lost: 0.0,
            lost_trace: 0.0,
        }
    }

    fn end_row(&mut self, i: usize) {
        let at = |row: &mut Vec<f64>| row.get_mut(i).map(std::mem::take).unwrap_or(0.0);
        let own = Complex64::new(at(&mut self.row.0), at(&mut self.row.1));
        let off = norm((&self.row.0, &self.row.1));
        self.off += off * off;
        self.diagonal.push(own);
        self.trace += own;
        self.lost += self.row_lost * self.row_lost;
        self.lost_trace += self.row_lost;
        self.row_lost = 0.0;
        self.row.0.fill(0.0);
        self.row.1.fill(0.0);
    }

    fn expansion(&self, size: f64, with_delays: bool) -> Expansion {
        let common = self.trace / size;
        let apart = |x: &Complex64| (x - common).norm_sqr();
        let diagonal: f64 = self.diagonal.iter().map(apart).sum();
        let sums: f64 = self.diagonal.iter().map(|x| modulus(*x)).sum();
        let rounding = ROW_ROUNDINGS * size * ROUNDING * (sums + size * modulus(common));
        Expansion {
            common,
            spread: ((self.off + diagonal).sqrt() + self.lost.sqrt() + rounding) * MARGIN,
            trace: (self.lost_trace + rounding) * MARGIN,
            with_delays,
        }
    }
}

impl Sums {
    fn new(n: usize) -> Self {
        Self {
            first: Sum::new(n),
            zeroth: Sum::new(n),
            lost: 0.0,
            row_lost: 0.0,
            on_slope: Rows::one(n),
            on_value: Rows::one(n),
        }
    }

    fn start_row(&mut self) {
        self.row_lost = FLOOR;
    }

    fn end_row(&mut self, i: usize) {
        self.first.end_row(i);
        self.zeroth.end_row(i);
        self.lost += self.row_lost * self.row_lost;
    }

    /// Add what one term contributes to row i; the part of it that changes along a step.
    fn add(
        &mut self,
        term: &Term,
        (s, i): (Complex64, usize),
        (gap, weight, factor): (f64, f64, Complex64),
        loss: f64,
        (inverse, norms): (&Rows, &[f64]),
    ) -> Option<Part> {
        let (mut slopes, mut values) = (0.0, 0.0);
        for entry in &term.entries {
            let size = norms.get(entry.column).copied().unwrap_or(f64::NAN);
            slopes += entry.slope.abs() * size;
            values += entry.value.abs() * size;
        }
        // Without a gap values do not change along a step.
        let rows = [&mut self.on_slope, &mut self.on_value];
        combine(&term.entries, gap != 0.0, inverse, rows);
        let sizes = modulus(s) * slopes + values;
        let (lost, lost_slope) = (loss * weight * sizes, loss * weight * slopes);
        self.row_lost += lost;
        self.first.row_lost += lost_slope + gap.abs() * lost;
        if gap == 0.0 {
            self.zeroth.row_lost += lost_slope;
            // The factor is 1.
            let (re, im) = self.on_slope.row(0);
            for row in [&mut self.first.row, &mut self.zeroth.row] {
                for (sum, x) in row.0.iter_mut().zip(re) {
                    *sum += x;
                }
                for (sum, x) in row.1.iter_mut().zip(im) {
                    *sum += x;
                }
            }
            return None;
        }
        let own_slope = self.on_slope.get(0, i);
        let own_size = own_slope * s + self.on_value.get(0, i);
        let slope_norm = norm(self.on_slope.row(0));
        let rows = self.on_slope.re.iter().zip(&self.on_slope.im);
        let values = self.on_value.re.iter_mut().zip(&mut self.on_value.im);
        let sums = self.first.row.0.iter_mut().zip(&mut self.first.row.1);
        for (((pr, pi), (vr, vi)), (kr, ki)) in rows.zip(values).zip(sums) {
            (*vr, *vi) = (s.re * pr - s.im * pi + *vr, s.re * pi + s.im * pr + *vi);
            let (dr, di) = (pr - gap * *vr, pi - gap * *vi);
            *kr += factor.re * dr - factor.im * di;
            *ki += factor.re * di + factor.im * dr;
        }
        let size_norm = norm(self.on_value.row(0));
        Some(Part {
            gap,
            size: weight * size_norm * MARGIN + lost + LEAST,
            slope: weight * slope_norm * MARGIN + lost_slope + LEAST,
            own_size: weight * modulus(own_size) * MARGIN + lost + LEAST,
            own_slope: weight * modulus(own_slope) * MARGIN + lost_slope + LEAST,
        })
    }
}

/// # Errors
/// [`Error::Argument`] where M is singular at several points, hence probably everywhere.
pub(super) fn check_regular(system: &Irreducible) -> Result<(), Error> {
    let rate = system.rate();
    let regular = |(x, y): &(f64, f64)| {
        LocalEnclosure::new(system, Complex64::new(x * rate, y * rate)).is_some()
    };
    if POINTS.iter().any(regular) {
        return Ok(());
    }
    Err(Error::argument(
        "the determinant of the characteristic matrix is zero for every s, or too close to zero \
         to decide. So the equations do not determine the state. Look for rows of E, N and A that \
         depend on one another, or for entries that differ too much in size",
    ))
}
