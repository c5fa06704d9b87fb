//! The change of arg h along a straight line, proved.
//!
//! With c the term that dominates, arg h = arg g − τ_c Im s. From a point z with computed value v
//! (error at most e) and slope w (error e′), Taylor's formula along the line gives for every point
//! within r: |g − v| ≤ (|w| + e′) r + B r²/2 + e, with B a bound on |g″| there. As long as this is
//! at most 0.95 |v|, g stays in a disc that does not hold 0 and arg g within 72° of arg v. Two
//! neighbouring points whose reaches meet therefore differ in argument by less than 144°, so that
//! their principal difference is the true one. Since each computed value serves both its
//! neighbours, the errors cancel in the sum except at the two ends and where c changes. `slack` is
//! the sum of these errors and of those of computing a difference: with u = 2⁻⁵³, the two
//! directions have errors of u each, their product √5 u, `angle` 8 u (together below 13 u), τ_c Δy
//! the relative error 3 u, the sum u. Terms that stay small along the step need no Taylor formula:
//! they change g by at most their moduli at both points, and the formula is applied to the other
//! terms. SHARE and the factors next to 1 leave far more margin than the rounding errors of the test
//! itself need: these are 20 u at most, and e is 2 per cent larger than necessary.
//!
//! Where |v| < 4e in double precision, the point is evaluated in double-double arithmetic. Where
//! this does not separate the value from zero either, the result is an error with the location.

use num_complex::Complex64;

use super::taylor_bound::TaylorBound;
use super::turn::{Turn, Walk};
use crate::elementary::angle;
use crate::quasipoly::{Jet, Probe, QuasiPolynomial, modulus};
use crate::{Error, Task};

/// Largest share of |v| by which g may change. A larger share gives longer steps and larger
/// differences of arguments; below 1 the argument stays within 90°.
const SHARE: f64 = 0.95;

/// Evaluations between two checks for cancellation.
const CHECK_EVERY: u64 = 1024;

/// Double-double evaluations after which a point that double precision cannot decide counts as a
/// root. Past a multiple root the steps become as short as a power of its distance.
const MAX_DOUBLE_DOUBLE: u32 = 500;

/// Evaluations after which a computation is given up.
pub(crate) const MAX_EVALUATIONS: u64 = 20_000_000;

/// Upper limit on the hints kept of one line; the first ones are kept.
const MAX_HINTS: usize = 1000;

/// Range of values in which underflow and overflow cannot matter. Values outside prove nothing.
const USABLE: std::ops::Range<f64> = 1e-270..1e290;

/// Error of one computed difference of arguments: 16 u and more than 3 u of τ_c Δy.
pub(crate) const STEP_ERROR: f64 = 8.0 * f64::EPSILON;

/// Largest error of the argument, in rad, at an end of a line. Some dozens of ends add up.
const MOST_UNCERTAIN: f64 = 0.01;

/// Lower limit on the slope relative to the value, so that it can be divided by.
const LEAST_SLOPE: f64 = 1e-100;

/// Steps shorter than this angle of the fastest exponential indicate several roots nearby.
const TIGHT: f64 = 1e-3;

/// Largest share of the value that terms may have that are bounded by their moduli alone. A larger
/// share lets more terms be bounded so and shortens the step of the others.
const PERTURBATION_SHARE: f64 = 0.3;

/// Evaluations along a line after which terms are bounded by their moduli. Before, steps are short
/// and find hints.
const EAGER_LIMIT: u64 = 500;

/// Upper limit on how much longer these bounds may make a step. No hints are found within a step.
const LONGEST_GAIN: f64 = 1e6;

/// Factor on a proved length that covers its rounding error.
const ROUNDED_DOWN: f64 = 1.0 - 1e-12;

/// Upper limit on the spans tried for one reach.
const MAX_REACH_ROUNDS: usize = 40;

/// The next span tried, as a multiple of the length proved with the last one.
const GROWN: f64 = 3.0;

/// Least factor between two spans.
const LEAST_SHRINKAGE: f64 = 0.125;

/// A reach below this share of what the slope alone allows indicates several roots nearby.
const FAR_BELOW_SLOPE: f64 = 0.02;

/// Spans tried with dominated terms; each is a quarter of the one before.
const DOMINATED_ROUNDS: usize = 4;

/// Length of a step, in reaches of its first point: the reach of its end has to cover the rest.
const STRETCH: f64 = 1.9;

/// Factor on the length of a step that could not be proved.
const SHORTENED: f64 = 0.999;

/// Upper limit on the lengths tried for one step.
const MAX_STEP_ATTEMPTS: usize = 8;

/// Relative rounding error of the ends of a line.
const PLACE_ROUNDING: f64 = 1e-15;

/// Upper limit on the doublings of the distance at which a line is proved to be free of roots.
const MAX_ASIDE: usize = 200;

/// Follows arg h along lines. Keeps the probe, the number of evaluations and the hints of roots
/// nearby.
pub(crate) struct Walker<'a> {
    pub(crate) probe: Probe<'a>,
    pub(crate) task: &'a Task,
    /// Ends of Newton's steps from the points closest to a root.
    pub(crate) hints: Vec<Complex64>,
    checked: u64,
    limit: u64,
    /// The largest delay less the smallest, in s.
    span: f64,
    double_doubles: u32,
    /// The last point that needed double-double arithmetic.
    double_double_at: Option<Complex64>,
    /// Number of evaluations from which on the line is followed in the longest steps that can be
    /// proved.
    eager_until: u64,
}

impl<'a> Walker<'a> {
    pub(crate) fn new(h: &'a QuasiPolynomial, task: &'a Task) -> Self {
        Self::with_limit(h, task, MAX_EVALUATIONS)
    }

    /// A walker that returns an error after `limit` evaluations.
    pub(crate) fn with_limit(h: &'a QuasiPolynomial, task: &'a Task, limit: u64) -> Self {
        Self {
            probe: Probe::new(h),
            task,
            hints: Vec::new(),
            checked: 0,
            limit,
            span: h.delays().last().unwrap_or(&0.0) - h.delays().first().unwrap_or(&0.0),
            double_doubles: 0,
            double_double_at: None,
            eager_until: EAGER_LIMIT,
        }
    }

    /// Treat points that double precision cannot separate from a root as roots.
    pub(crate) fn keep_to_doubles(&mut self) {
        self.double_doubles = MAX_DOUBLE_DOUBLE;
    }

    /// Check for cancellation and for the limit on evaluations.
    pub(crate) fn pause(&mut self) -> Result<(), Error> {
        let spent = self.probe.evaluations();
        if spent < self.checked + CHECK_EVERY {
            return Ok(());
        }
        self.checked = spent;
        self.task.check()?;
        if spent > self.limit {
            return Err(Error::TooMuch {
                what: "the search for roots",
                limit: self.limit,
                unit: "evaluations",
                advice: "give a smaller region, or edges that are far from chains of roots".into(),
            });
        }
        Ok(())
    }

    /// The jet at `s`, in double-double arithmetic where double precision does not separate the
    /// value from zero.
    pub(crate) fn jet(&mut self, s: Complex64) -> Jet {
        self.jet_unless(s, is_clear)
    }

    /// The jet at an end of a line, where the error of the argument counts: in double-double
    /// arithmetic also where this error would be larger than [`MOST_UNCERTAIN`].
    fn end_jet(&mut self, s: Complex64) -> Jet {
        self.jet_unless(s, |jet| is_clear(jet) && uncertainty(jet) < MOST_UNCERTAIN)
    }

    /// The jet at `s`, in double-double arithmetic unless the one in double precision is `good`.
    fn jet_unless(&mut self, s: Complex64, good: impl Fn(&Jet) -> bool) -> Jet {
        let jet = self.probe.jet(s);
        if good(&jet) || !is_finite(&jet) || self.double_doubles >= MAX_DOUBLE_DOUBLE {
            return jet;
        }
        self.double_doubles += 1;
        self.double_double_at = Some(s);
        Jet {
            overtaken_by: jet.overtaken_by,
            ..self.probe.double_double_jet(s)
        }
    }

    /// The jet at `s`, its value proved to be at least four times its error.
    fn clear_jet(&mut self, s: Complex64) -> Result<Jet, Error> {
        let mut jet = self.end_jet(s);
        if !is_finite(&jet) {
            self.probe.refer_to_dominant(s);
            jet = self.end_jet(s);
        }
        if !is_finite(&jet) {
            return Err(overflow(s));
        }
        if is_clear(&jet) {
            Ok(jet)
        } else {
            Err(self.blocked(s))
        }
    }

    /// The error for a line that cannot be proved to be free of roots at `place`.
    pub(crate) fn blocked(&mut self, place: Complex64) -> Error {
        self.probe.jet(place);
        if self.probe.largest_term() < USABLE.start {
            return overflow(place);
        }
        let mut distance =
            4.0 * f64::EPSILON * modulus(place).max(f64::MIN_POSITIVE / f64::EPSILON);
        for _ in 0..MAX_ASIDE {
            let aside = [1.0, -1.0].map(|sign| Complex64::new(sign * distance, 0.0));
            let up = aside.map(|step| step * Complex64::I);
            if [aside, up]
                .concat()
                .iter()
                .all(|step| is_clear(&self.jet(place + step)))
            {
                break;
            }
            distance *= 2.0;
        }
        Error::Contour { place, distance }
    }

    /// The distance from `s` along the line (unit vector `along`), at most `most`, within which arg
    /// g is bounded.
    fn reach(&self, jet: &Jet, s: Complex64, along: Complex64, most: f64) -> f64 {
        // Relative to the value, so that no square leaves the range.
        let unit = modulus(jet.value);
        let margin = SHARE - jet.value_error / unit;
        let slope = ((modulus(jet.slope) + jet.slope_error) / unit).max(LEAST_SLOPE);
        let size = modulus(s);
        let mut span = most.min(margin / slope);
        let mut best = 0.0f64;
        for _ in 0..MAX_REACH_ROUNDS {
            let bend = self.probe.curvature(size + span, along.re * span) / unit;
            let r = within(margin, slope, bend);
            // Where the bound overflows nothing is known: `min` would return the span.
            if !r.is_nan() {
                best = best.max(r.min(span) * ROUNDED_DOWN);
            }
            if best >= 0.25 * span {
                break;
            }
            // The bound grows exponentially with the span, so that the span is reduced in steps.
            span = (GROWN * best).max(LEAST_SHRINKAGE * span);
        }
        // Not where the slope alone limits the step.
        let farthest = margin / slope;
        let cluster_suspected = if self.double_double_at == Some(s) {
            best < 0.5 * most.min(farthest)
        } else {
            best * self.span < TIGHT && best < FAR_BELOW_SLOPE * farthest
        };
        if cluster_suspected {
            best = best.max(TaylorBound::new(&self.probe, s).reach(SHARE, most));
        }
        if self.probe.evaluations() < self.eager_until {
            return best;
        }
        best.max(self.reach_by_dominated_terms(jet, s, along, most.min(LONGEST_GAIN * best)))
    }

    /// The same where fast terms are so small that their moduli are a sufficient bound.
    fn reach_by_dominated_terms(
        &self,
        jet: &Jet,
        s: Complex64,
        along: Complex64,
        most: f64,
    ) -> f64 {
        let unit = modulus(jet.value);
        let size = modulus(s);
        let mut span = most;
        for _ in 0..DOMINATED_ROUNDS {
            let place = (size + span, along.re * span);
            let Some(dominated) = self
                .probe
                .dominated_terms(s, place, PERTURBATION_SHARE * unit)
            else {
                return 0.0;
            };
            let margin = SHARE - (jet.value_error + dominated.perturbation) / unit;
            let slope = ((modulus(dominated.slope) + jet.slope_error) / unit).max(LEAST_SLOPE);
            let r = within(margin, slope, dominated.bend / unit);
            if r >= 0.25 * span {
                return r.min(span) * ROUNDED_DOWN;
            }
            span *= 0.25;
        }
        0.0
    }

    /// Change of arg h along the line parallel to an axis from `from` to `to`.
    ///
    /// # Errors
    /// [`Error::Contour`] where a root lies on the line or too close to it, [`Error::TooMuch`],
    /// [`Error::Interrupted`].
    pub(crate) fn walk(&mut self, from: Complex64, to: Complex64) -> Result<Turn, Error> {
        let whole = (to - from).re.abs() + (to - from).im.abs();
        if whole == 0.0 {
            return Ok(Turn::default());
        }
        let along = (to - from) / whole;
        self.eager_until = self.probe.evaluations() + EAGER_LIMIT;
        self.probe.refer_to_dominant(from);
        let mut here = from;
        let mut jet = self.clear_jet(here)?;
        let mut turn = Turn {
            angle: 0.0,
            slack: uncertainty(&jet),
        };
        let mut guess = f64::INFINITY;
        // Newton's corrections at the last two points: a local minimum indicates a root.
        let mut before = (f64::INFINITY, f64::INFINITY);
        while here != to {
            self.pause()?;
            if let Some(larger) = jet.overtaken_by {
                turn.slack += uncertainty(&jet);
                self.probe.refer_to(larger);
                jet = self.clear_jet(here)?;
                turn.slack += uncertainty(&jet);
            }
            let rest = (to - here).re.abs() + (to - here).im.abs();
            let reach = self.reach(&jet, here, along, rest.min(guess));
            let (next, ahead) = self.step(here, to, along, (reach, rest))?;
            let ratio = unit(jet.value).conj() * unit(ahead.value);
            let turned = self.probe.delay() * (next - here).im;
            turn.angle += angle(ratio.im, ratio.re) - turned;
            turn.slack += STEP_ERROR * (1.0 + turned.abs()) + f64::EPSILON * turn.angle.abs();
            let correction = modulus(jet.value) / modulus(jet.slope);
            if before.1 < before.0 && before.1 < correction && self.hints.len() < MAX_HINTS {
                self.hints.push(here - newton_step(&jet));
            }
            before = (before.1, correction);
            guess = 4.0 * ((next - here).re.abs() + (next - here).im.abs());
            here = next;
            jet = ahead;
        }
        turn.slack += uncertainty(&jet);
        // Rounding errors of the points themselves, times the delay by which they are multiplied.
        turn.slack += PLACE_ROUNDING * self.probe.delay() * (from.im.abs() + to.im.abs());
        Ok(turn)
    }

    /// The next point and its jet: as far as both reaches cover the step, or else as far as the
    /// reach of `here` alone.
    fn step(
        &mut self,
        here: Complex64,
        to: Complex64,
        along: Complex64,
        (reach, rest): (f64, f64),
    ) -> Result<(Complex64, Jet), Error> {
        let mut length = if reach >= rest {
            rest
        } else {
            rest.min(STRETCH * reach)
        };
        let mut overflows = false;
        for attempt in 0..MAX_STEP_ATTEMPTS {
            let next = if length >= rest {
                to
            } else {
                here + along * length
            };
            if next == here {
                break;
            }
            overflows = false;
            let ahead = if next == to {
                self.end_jet(next)
            } else {
                self.jet(next)
            };
            if !is_finite(&ahead) {
                overflows = true;
                length *= 0.25;
                continue;
            }
            let gone = (next - here).re.abs() + (next - here).im.abs();
            let covered = if gone <= reach {
                is_clear(&ahead)
            } else {
                is_clear(&ahead) && gone <= reach + self.reach(&ahead, next, -along, gone)
            };
            if covered {
                return Ok((next, ahead));
            }
            if gone <= reach && attempt > 0 {
                // The reach of `here` covers the step; only rounding errors remain.
                return Err(self.blocked(next));
            }
            length = (SHORTENED * reach).min(length * SHORTENED);
        }
        Err(if overflows {
            overflow(here)
        } else {
            self.blocked(here)
        })
    }
}

/// The largest r with `slope` r + `bend` r²/2 at most `margin`.
fn within(margin: f64, slope: f64, bend: f64) -> f64 {
    // Relative to the slope, whose square may leave the range.
    let bent = 2.0 * (bend / slope) * (margin / slope);
    2.0 * (margin / slope) / (1.0 + (1.0 + bent).sqrt())
}

impl Walk for Walker<'_> {
    fn walk(&mut self, from: Complex64, to: Complex64) -> Result<Turn, Error> {
        Walker::walk(self, from, to)
    }
}

pub(crate) fn is_finite(jet: &Jet) -> bool {
    jet.value.is_finite()
        && jet.slope.is_finite()
        && jet.value_error.is_finite()
        && jet.slope_error.is_finite()
}

/// Is the error at most a quarter of the value?
pub(crate) fn is_clear(jet: &Jet) -> bool {
    let size = modulus(jet.value);
    size >= 4.0 * jet.value_error && USABLE.contains(&size)
}

/// Bound on the error of arg g.
fn uncertainty(jet: &Jet) -> f64 {
    angle_error(jet.value_error, modulus(jet.value))
}

/// Bound on the error of the angle of a number of modulus `size` that is known to within `error`:
/// asin t ≤ (π/2) t.
pub(crate) fn angle_error(error: f64, size: f64) -> f64 {
    1.58 * error / size
}

fn unit(value: Complex64) -> Complex64 {
    value / modulus(value)
}

/// g/g′, in steps that do not overflow.
pub(crate) fn newton_step(jet: &Jet) -> Complex64 {
    let size = modulus(jet.slope);
    let direction = jet.slope.conj() / size;
    (jet.value / size) * direction
}

pub(crate) fn overflow(s: Complex64) -> Error {
    Error::argument(format!(
        "the function cannot be evaluated at {s:e}, because a power of s exceeds double \
         precision: choose another unit of time or another region"
    ))
}
