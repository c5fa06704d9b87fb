//! Where roots of A + k B cross the edge of the specification as k varies: all crossings, proved.
//!
//! They are the zeros of F (`pencil`) on its pieces, up to where no root lies. From a point on,
//! Taylor's formula with the bound on F‴ proves over some length that F keeps its sign ("clear"),
//! that F′ does ("monotone"), or that any crossing there has |k| beyond the range. Where the
//! lengths of two neighbouring points meet, the signs of F at both show whether there is exactly
//! one zero between them or none. On the real axis F vanishes, simply if F′ ≠ 0 there.
//!
//! At a simple zero k = −Re(A/B), and as k grows the root goes to the left where F′ > 0, to the
//! right where F′ < 0: with A/B + k = 0 and D = d(A/B)/ds, ds/dk = −1/D, whose part along the
//! normal −ic of the edge to the right has the sign of −Im(c D) = −F′/|B|². Two roots cross, s and
//! its mirror image, or one that is real. Where neither can be proved, next to a double zero of F,
//! the crossing is reported with an interval of k and without a direction; its effect on the count
//! is found by counting (`row`). Each k has an interval that is proved to contain it.

use num_complex::Complex64;

use super::pencil::{Bounds, Pencil, Point};
use super::positive::{cubic, quadratic};
use crate::quasipoly::modulus;
use crate::{Error, Task};

/// Upper limit on the points along one line.
const MAX_POINTS: u32 = 2_000_000;

/// Factor on proved lengths that covers the rounding errors of the inequalities.
pub(super) const SHARE: f64 = 1.0 - 1e-9;

/// First step, relative to ω and to one over the longest delay, past a point that cannot be
/// resolved. It is doubled until the next point can be.
const LEAST_STEP: f64 = 1e-9;

/// Upper limit on the doublings of that step.
const MAX_DOUBLINGS: u32 = 60;

/// Upper limit on Newton's steps for one zero.
const MAX_ITERATIONS: u32 = 30;

/// Upper limit on Newton's steps within its proved interval.
const MAX_POLISHING: u32 = 4;

/// Length of the next step tried, in lengths of the last one.
const STRIDE: f64 = 2.5;

/// First points tried off the real axis, as shares of a step.
pub(super) const STARTS: [f64; 5] = [1.0, 0.7, 0.4, 0.2, 0.1];

/// Length of a step, in reaches of its first point.
const STRETCH: f64 = 1.9;

/// Factor on t up to which bounds are taken next to a zero of higher order at t = 0.
const FLAT: f64 = 3.0;

/// Factors on the reach and on the length of a step that could not be proved.
const SHORTENED: (f64, f64) = (0.999, 0.6);

/// Step ahead of a point for bounds that hold at the point alone: relative to t, and at least to one
/// over the longest delay, from where on `hold` compares the errors of coefficients.
const ALONE: (f64, f64) = (1e-3, 1.0 / 16.0);

/// Covers the rounding errors of radii and bounds.
pub(super) const ENLARGED: f64 = 1.0 + 1e-9;

/// A point where roots cross the edge of a specification, or may cross it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// The imaginary part of the root, zero or positive, 1/s.
    pub omega: f64,
    /// The best value of the gain.
    pub gain: f64,
    /// An interval that holds it.
    pub low: f64,
    /// Its other end.
    pub high: f64,
    /// Roots that move to the right as the gain grows minus those that move to the left; `None`
    /// where it is not known whether any cross at all.
    pub jump: Option<i32>,
    /// The slope of the family in the gain at s = 0, where ω = 0.
    pub slope_at_zero: Option<f64>,
}

/// What varies along the row, and in which range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Varied {
    /// A real k.
    Gain((f64, f64)),
    /// The delay d of k = e^(−s d): see `one_delay`.
    Delay((f64, f64)),
}

/// What a point proves of its neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sense {
    Clear,
    /// The sign of F′.
    Monotone(f64),
    /// |A| > |k| |B| for all k of the range: a crossing here is outside the range.
    Beyond,
}

#[derive(Debug, Clone, Copy)]
struct Reach {
    length: f64,
    sense: Sense,
}

/// All crossings of one piece up to t = `top`, by increasing ω; does the piece begin on the real
/// axis?
///
/// `None` where the piece cannot be searched: A and B vanish together, or double precision does not
/// suffice.
///
/// # Errors
/// [`Error::Interrupted`] alone.
pub(crate) fn crossings(
    pencil: &Pencil,
    from_axis: bool,
    top: f64,
    varied: Varied,
    task: &Task,
) -> Result<Option<Vec<Crossing>>, Error> {
    let Some(mut search) = Search::new(pencil, varied, top) else {
        return Ok(None);
    };
    let Some(mut here) = (match varied {
        Varied::Gain(_) if from_axis => search.start(),
        Varied::Gain(_) => search.enter(),
        Varied::Delay((_, longest)) => search.start_at_rest(longest),
    }) else {
        return Ok(None);
    };
    let mut stride = f64::INFINITY;
    for step in 0..MAX_POINTS {
        if here.t >= top {
            return Ok(Some(search.found));
        }
        if step % 256 == 255 {
            task.check()?;
        }
        let Some(next) = search.advance(&here, stride) else {
            return Ok(None);
        };
        stride = STRIDE * (next.t - here.t);
        here = next;
    }
    Ok(None)
}

pub(super) struct Search<'a> {
    pub(super) pencil: &'a Pencil,
    /// A length over which the pencil changes little.
    step: f64,
    pub(super) bounds: Bounds,
    /// Does F vanish to a higher order where the piece begins? Bounds are then taken for short
    /// stretches there.
    is_flat: bool,
    varied: Varied,
    pub(super) top: f64,
    pub(super) found: Vec<Crossing>,
}

impl<'a> Search<'a> {
    fn new(pencil: &'a Pencil, varied: Varied, top: f64) -> Option<Self> {
        let step = pencil.step().min(top / 16.0);
        Some(Self {
            pencil,
            step,
            bounds: pencil.bounds(0.0, step, step)?,
            is_flat: false,
            varied,
            top,
            found: Vec::new(),
        })
    }

    /// Bounds that hold from `low`, up to which everything is known, to `high`.
    fn bounds_to(&mut self, low: f64, high: f64) -> Option<Bounds> {
        if high > self.bounds.reach {
            let step = if self.is_flat {
                self.step.min(high)
            } else {
                self.step
            };
            self.bounds = self.pencil.bounds(low, high, step)?;
        }
        Some(self.bounds)
    }

    /// How far bounds are needed from t on.
    fn horizon(&self, t: f64) -> f64 {
        let usual = self.pencil.horizon(t, self.step);
        if self.is_flat {
            usual.min(FLAT * t)
        } else {
            usual
        }
    }

    /// The first point of a piece that begins off the real axis, or one beyond it where the sign of
    /// F is known.
    fn enter(&mut self) -> Option<Point> {
        let first = self.pencil.at(0.0);
        if self.is_clear(&first) {
            Some(first)
        } else {
            self.skip(&first)
        }
    }

    /// Treat the start on the real axis and return a point beyond it where the sign of F is known.
    fn start(&mut self) -> Option<Point> {
        let zero = self.pencil.at(0.0);
        let slope = zero.f[1];
        let margin = slope.abs() - self.bounds.error[1];
        if margin > 0.0 {
            self.record(&zero, 0.0, Some(if slope > 0.0 { -1 } else { 1 }))?;
            // With bounds of a usual step, then with those of the length that they prove.
            for is_second in [false, true] {
                // F(0) = 0, and up to here F′ keeps its sign.
                let margin = slope.abs() - self.bounds.error[1];
                let bend = zero.f[2].abs() + self.bounds.error[2];
                let length = quadratic(margin, -bend, -0.5 * self.bounds.third) * SHARE;
                let limit = self.top.min(self.bounds.reach);
                for share in STARTS {
                    let next = self.pencil.at((share * length).min(limit));
                    if self.is_clear(&next) {
                        return Some(next);
                    }
                }
                if !is_second {
                    self.is_flat = true;
                    let length = length.min(limit);
                    self.bounds = self.pencil.bounds(0.0, length, length)?;
                }
            }
        }
        self.is_flat = true;
        self.skip(&zero)
    }

    pub(super) fn is_clear(&self, point: &Point) -> bool {
        point.f[0].abs() > self.bounds.error[0]
    }

    /// The length, forwards or backwards from `point`, over which one of the statements holds; the
    /// longest of them.
    fn reach(&self, point: &Point, direction: f64, most: f64, bounds: &Bounds) -> Reach {
        let [value, slope, bend] = point.f;
        let (slope, error) = (direction * slope, bounds.error);
        let sign = value.signum();
        let clear = cubic(
            value.abs() - error[0],
            sign * slope - error[1],
            0.5 * (sign * bend - error[2]),
            bounds.third / 6.0,
            most,
        );
        let sign = slope.signum();
        let monotone = quadratic(
            slope.abs() - error[1],
            sign * bend - error[2],
            -0.5 * bounds.third,
        )
        .min(most);
        let beyond = match self.varied {
            Varied::Gain(range) => {
                let largest = largest_of(range);
                let excess = modulus(point.a)
                    - bounds.rounding * bounds.a[0]
                    - largest * (modulus(point.b) + bounds.rounding * bounds.b[0]) * ENLARGED;
                (excess / (bounds.modulus[0] + largest * bounds.modulus[1])).min(most)
            }
            Varied::Delay(_) => 0.0,
        };
        let (length, sense) = if beyond > clear && beyond > monotone {
            (beyond, Sense::Beyond)
        } else if clear >= monotone {
            (clear, Sense::Clear)
        } else {
            (monotone, Sense::Monotone(sign * direction))
        };
        Reach {
            length: SHARE * length,
            sense,
        }
    }

    /// The next point: at most as far as both points prove what lies between, or past what cannot
    /// be resolved.
    fn advance(&mut self, here: &Point, stride: f64) -> Option<Point> {
        let rest = self.top - here.t;
        let bounds = self.bounds_to(here.t, self.horizon(here.t))?;
        let most = rest.min(stride).min(bounds.reach - here.t);
        let own = self.reach(here, 1.0, most, &bounds);
        let mut length = (STRETCH * own.length).min(most);
        for attempt in 0..6 {
            if here.t + length <= here.t {
                break;
            }
            let end = if length >= rest {
                self.top
            } else {
                here.t + length
            };
            let next = self.pencil.at(end);
            if self.is_clear(&next) {
                let back = self.reach(&next, -1.0, end - here.t, &bounds);
                if let Some(zero) = between(here, own, &next, back) {
                    if zero {
                        self.refine(here, &next)?;
                    }
                    return Some(next);
                }
            }
            // One reach suffices if only the sign at its end is known.
            length = if attempt == 0 {
                SHORTENED.0 * own.length
            } else {
                SHORTENED.1 * length
            };
        }
        self.skip(here)
    }

    /// Step past a point where neither F nor F′ is known to keep its sign.
    fn skip(&mut self, here: &Point) -> Option<Point> {
        let mut step = LEAST_STEP * here.t.max(self.step);
        for _ in 0..MAX_DOUBLINGS {
            let end = (here.t + step).min(self.top);
            if self.is_flat {
                self.bounds = self.pencil.bounds(here.t, FLAT * end, self.step.min(end))?;
            }
            let bounds = self.bounds_to(here.t, end)?;
            let next = self.pencil.at(end);
            let ahead = self.reach(&next, 1.0, step, &bounds);
            if end >= self.top || (self.is_clear(&next) && ahead.length > 0.25 * step) {
                let half = 0.5 * (end - here.t);
                let middle = self.pencil.at(here.t + half);
                self.record(&middle, half * ENLARGED, None)?;
                return Some(next);
            }
            step *= 2.0;
        }
        None
    }

    /// The one zero between two points.
    fn refine(&mut self, left: &Point, right: &Point) -> Option<()> {
        let rising = right.f[0] > 0.0;
        // As a gain grows roots go to the left where F′ > 0, as a delay grows to the right.
        let goes_left = rising == matches!(self.varied, Varied::Gain(_));
        let jump = Some(if goes_left { -2 } else { 2 });
        let (mut low, mut high) = (left.t, right.t);
        let quotient = |point: &Point| (point.f[0] / point.f[1]).abs();
        let mut best = if quotient(left) < quotient(right) {
            *left
        } else {
            *right
        };
        for _ in 0..MAX_ITERATIONS {
            let [value, slope, bend] = best.f;
            let error = self.bounds.error;
            if value.abs() <= 4.0 * error[0] && slope != 0.0 {
                // Within this distance F changes its sign if |F′| stays above half of its value
                // here.
                let radius = 2.0 * (value.abs() + error[0]) / slope.abs() * ENLARGED;
                let loss = error[1] + radius * (bend.abs() + error[2] + radius * self.bounds.third);
                if loss < 0.5 * slope.abs() {
                    let before = self.found.len();
                    self.record(&best, radius, jump)?;
                    self.polish(before, &best, radius);
                    return Some(());
                }
                break;
            }
            // Halley's step.
            let newton = value / slope;
            let halley = newton / (1.0 - 0.5 * newton * bend / slope);
            if (best.f[0] > 0.0) == rising {
                high = best.t;
            } else {
                low = best.t;
            }
            let mut t = best.t - halley;
            if !(low < t && t < high) {
                t = 0.5 * (low + high);
            }
            if !(low < t && t < high) {
                break;
            }
            best = self.pencil.at(t);
        }
        let half = 0.5 * (high - low);
        let middle = self.pencil.at(low + half);
        self.record(&middle, half * ENLARGED, jump)
    }

    /// Improve the gain stored last, whose interval is kept, by the zero to the rounding of F, which
    /// is far less than its bound.
    fn polish(&mut self, before: usize, at: &Point, radius: f64) {
        let mut best = *at;
        for _ in 0..MAX_POLISHING {
            let next = self.pencil.at(best.t - best.f[0] / best.f[1]);
            if (next.t - at.t).abs() > radius || next.f[0].abs() >= best.f[0].abs() {
                break;
            }
            best = next;
        }
        if let (Varied::Gain(_), Some(crossing)) = (self.varied, self.found.get_mut(before)) {
            let (a, b) = (best.a, best.b);
            let gain = -(a.re * b.re + a.im * b.im) / b.norm_sqr();
            if gain >= crossing.low && gain <= crossing.high {
                crossing.gain = gain;
                crossing.omega = best.s.im;
            }
        }
    }

    /// Store the crossing within `radius` of `point`, if its k may lie in the range.
    fn record(&mut self, point: &Point, radius: f64, jump: Option<i32>) -> Option<()> {
        // Of the point alone: further ahead the moduli of a polynomial of high degree are far larger.
        let (from, to) = (point.t - radius, point.t + radius);
        let step = (ALONE.1 * self.pencil.step())
            .min(self.step)
            .max(ALONE.0 * to);
        let bounds = match self.pencil.bounds(from, to, step) {
            Some(bounds) => bounds,
            None => self.bounds_to(from, to)?,
        };
        let (a, b) = (modulus(point.a), modulus(point.b));
        let spread = |i: usize| {
            bounds.rounding * [bounds.a, bounds.b][i][0] + radius * [bounds.a, bounds.b][i][1]
        };
        let (off_a, off_b) = (spread(0), spread(1));
        let range = match self.varied {
            Varied::Gain(range) => range,
            Varied::Delay(range) => {
                return self.record_delays(point, radius, (off_a, off_b), range, jump);
            }
        };
        if (a - off_a) * SHARE > largest_of(range) * (b + off_b) {
            return Some(());
        }
        if b * SHARE <= off_b {
            return None;
        }
        // −Re(A/B), and |A/B − Â/B̂| ≤ (δA + |Â/B̂| δB)/(|B̂| − δB).
        let gain = -(point.a.re * point.b.re + point.a.im * point.b.im) / (b * b);
        let error = (off_a + a / b * off_b) / (b - off_b) * ENLARGED + 8.0 * f64::EPSILON * a / b;
        let (low, high) = (gain - error, gain + error);
        if high >= range.0 && low <= range.1 {
            self.found.push(Crossing {
                omega: point.s.im,
                gain,
                low,
                high,
                jump,
                slope_at_zero: (point.s == Complex64::ZERO && radius == 0.0).then_some(point.b.re),
            });
        }
        Some(())
    }
}

/// The largest |k|.
fn largest_of(range: (f64, f64)) -> f64 {
    range.0.abs().max(range.1.abs())
}

/// Is there exactly one zero between two points, or none? `None` where their reaches do not decide.
fn between(left: &Point, right_of: Reach, right: &Point, left_of: Reach) -> Option<bool> {
    let gap = right.t - left.t;
    let differ = (left.f[0] > 0.0) != (right.f[0] > 0.0);
    // One of them alone may reach the whole way.
    if right_of.length >= gap {
        return settled(right_of.sense, differ);
    }
    if left_of.length >= gap {
        return settled(left_of.sense, differ);
    }
    if right_of.length + left_of.length < gap {
        return None;
    }
    match (right_of.sense, left_of.sense) {
        (Sense::Monotone(a), Sense::Monotone(b)) if a != b => None,
        (Sense::Clear, Sense::Clear) => (!differ).then_some(false),
        (Sense::Beyond, Sense::Beyond | Sense::Clear) | (Sense::Clear, Sense::Beyond) => {
            Some(false)
        }
        (Sense::Beyond, Sense::Monotone(_)) | (Sense::Monotone(_), Sense::Beyond) => None,
        _ => Some(differ),
    }
}

fn settled(sense: Sense, differ: bool) -> Option<bool> {
    match sense {
        Sense::Clear => (!differ).then_some(false),
        Sense::Monotone(_) => Some(differ),
        Sense::Beyond => Some(false),
    }
}
