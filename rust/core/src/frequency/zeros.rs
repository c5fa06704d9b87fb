//! All zeros of a real function between two frequencies.
//!
//! On an interval of half width r about m, with |f^(K)| ≤ B there, Taylor's formula gives
//!     no zero            if |f(m)| > Σ_{0<k<K} |f^(k)(m)| r^k/k! + B r^K/K!,
//!     one zero at most   if |f′(m)| > Σ_{1<k<K} |f^(k)(m)| r^(k−1)/(k−1)! + B r^(K−1)/(K−1)!.
//! Intervals of which neither is known are halved, so that nothing is passed over; bounds on the
//! rounding of all values are added on the right of both tests. Where rounding hides the sign of f,
//! f touches zero to double precision: one point stands for each connected set of such intervals, but
//! none for one that begins at ω = 0. The zeros themselves carry the rounding of f divided by its
//! slope, which is not bounded here.

use crate::{Error, Task};

/// K: a zero of that order at ω = 0 still leaves few intervals next to it.
pub(super) const ORDER: usize = 6;

/// Halvings before an interval that starts at zero is dropped.
const HALVINGS: u32 = 400;

/// Intervals before the function is taken to vanish on a whole range.
const MOST: u32 = 1_000_000;

/// Steps of Newton's iteration, bisections included.
const STEPS: u32 = 200;

/// What is added to every sum of moduli for its own rounding.
const ROOM: f64 = 1.0 + 1e-9;

/// f and its derivatives below K at a point, with bounds on their errors.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Taylor {
    pub(super) values: [f64; ORDER],
    pub(super) errors: [f64; ORDER],
}

impl Taylor {
    /// How far f and f′ can change within r, where |f^(K)| ≤ `bound`.
    pub(super) fn change(&self, r: f64, bound: f64) -> (f64, f64) {
        // By Horner's rule, from the highest derivative down: r/k, r/(k − 1), …
        let size = |k: usize| self.values[k].abs() + self.errors[k];
        let mut of_slope = bound * r / (ORDER - 1) as f64;
        let mut of_value = bound * r / ORDER as f64;
        for k in (1..ORDER).rev() {
            if k > 1 {
                of_slope = (of_slope + size(k)) * r / (k - 1) as f64;
            }
            of_value = (of_value + size(k)) * r / k as f64;
        }
        (of_value * ROOM, of_slope * ROOM)
    }
}

/// A real function of the frequency.
pub(super) trait RealFunction {
    fn value(&mut self, omega: f64) -> f64;
    fn taylor(&mut self, omega: f64) -> Taylor;
    /// Bound on the modulus of the derivative of order K up to `omega`.
    fn bound(&self, omega: f64) -> f64;
}

/// All zeros in (`low`, `high`], ascending; those at which f only touches zero as well.
///
/// # Errors
/// [`Error::Argument`] where f vanishes, to rounding, on a whole range, or leaves the range of
/// doubles; [`Error::Interrupted`].
pub(super) fn zeros_between(
    f: &mut impl RealFunction,
    low: f64,
    high: f64,
    task: &Task,
) -> Result<Vec<f64>, Error> {
    let mut zeros = Vec::new();
    let mut hidden = Hidden::default();
    let mut open = vec![(low, high, 0)];
    let mut looked_at = 0;
    while let Some((a, b, halvings)) = open.pop() {
        looked_at += 1;
        if looked_at % 256 == 0 {
            task.check()?;
        }
        refuse_if!(
            looked_at > MOST,
            "between {low:e} and {high:e} rad/s there are too many crossings to list. Either the \
             delay is very long for such frequencies, or gain or phase cross over a whole range"
        );
        let (m, r) = (0.5 * (a + b), 0.5 * (b - a));
        let here = f.taylor(m);
        let (change, slope_change) = here.change(r, f.bound(b));
        let (value, error) = (here.values[0].abs(), here.errors[0]);
        refuse_if!(
            !change.is_finite() || !error.is_finite(),
            "at {b:e} rad/s, powers of the frequency exceed double precision: choose another unit \
             of time"
        );
        if value > change + error {
            continue;
        }
        if here.values[1].abs() > slope_change + here.errors[1] {
            let ends = (f.value(a), f.value(b));
            if ends.1 == 0.0 || ends.0 < 0.0 && ends.1 > 0.0 || ends.0 > 0.0 && ends.1 < 0.0 {
                zeros.push(refined(f, (a, b), ends));
            }
        } else if change <= error || r <= 2.0 * f64::EPSILON * m {
            if let Some(touched) = hidden.join(a, b, m, value) {
                zeros.push(touched);
            }
        } else if halvings < HALVINGS {
            open.push((m, b, halvings + 1));
            open.push((a, m, halvings + 1));
        }
    }
    zeros.extend(hidden.point());
    zeros.sort_by(f64::total_cmp);
    Ok(zeros)
}

/// A connected set of intervals in which rounding hides the sign, from the left to the right.
#[derive(Debug, Default)]
struct Hidden {
    /// Its ends, and where |f| is least in it.
    set: Option<(f64, f64, f64, f64)>,
}

impl Hidden {
    /// Add an interval; the point of the set before where it is not connected to that.
    fn join(&mut self, a: f64, b: f64, middle: f64, size: f64) -> Option<f64> {
        match &mut self.set {
            Some((_, end, best, least)) if a <= *end => {
                *end = b;
                if size < *least {
                    (*best, *least) = (middle, size);
                }
                None
            }
            _ => {
                let before = self.point();
                self.set = Some((a, b, middle, size));
                before
            }
        }
    }

    fn point(&self) -> Option<f64> {
        let (start, _, best, _) = self.set?;
        (start > 0.0).then_some(best)
    }
}

/// The zero between two points of different sign, by Newton's iteration, halving where that
/// leaves the bracket.
fn refined(f: &mut impl RealFunction, (mut a, mut b): (f64, f64), ends: (f64, f64)) -> f64 {
    if ends.1 == 0.0 {
        return b;
    }
    let rising = ends.1 > ends.0;
    let mut x = 0.5 * (a + b);
    for _ in 0..STEPS {
        let here = f.taylor(x);
        let value = here.values[0];
        if value == 0.0 {
            break;
        }
        if (value > 0.0) == rising {
            b = x;
        } else {
            a = x;
        }
        let newton = x - value / here.values[1];
        let next = if newton >= a && newton <= b {
            newton
        } else {
            0.5 * (a + b)
        };
        let done = (next - x).abs() <= 2.0 * f64::EPSILON * x;
        x = next;
        if done {
            break;
        }
    }
    x
}
