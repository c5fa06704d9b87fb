//! Crossings of the edge along a row whose family need not be affine in its parameter p.
//!
//! The row is divided as a `block` of one direction; cells that stay open are divided further, in
//! p, about the zeros (t, p) of h(s(t); p) on the edge that Newton's method finds there:
//!     (∂_t h, ∂_p h) (δt, δp) = −h, as two real equations.
//! All values further than CLOSE of a cell from such a zero are proved to have no roots on the
//! edge. The clear intervals between two gaps have one count, which is made at one member, and the
//! difference of two counts is the number of roots that cross in the gap between them. The list is
//! therefore complete except for gaps whose crossings cancel, or beyond which infinitely many roots
//! violate the specification; ω and p are those of the zero that was found within the gap.

use super::block::{Finding, Grid};
use crate::stability::boxes::{BoxExpansion, Claim, Examined, Range, Stretch, examine, tangent};
use crate::stability::crossings::Crossing;
use crate::status::CellStatus;
use crate::{Error, Task};

/// Half the width of a gap about a crossing, relative to the cell it lies in. A smaller gap
/// separates more crossings and needs more proofs.
const CLOSE: f64 = 1.0 / 1024.0;

/// Upper limit on Newton's steps for one zero.
const MAX_STEPS: u32 = 12;

/// Newton's iteration ends with a step of this size, relative to the frequency and to the cell.
const SMALL: f64 = 1e-10;

/// Stretches of a cell from which a zero is searched for.
const STARTS: usize = 3;

/// Relative difference of frequencies below which two zeros are the same.
const SAME_ZERO: f64 = 1e-6;

/// A zero of h on the edge.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Zero {
    gain: f64,
    omega: f64,
}

/// What is proved of an interval of the parameter.
#[derive(Debug, Clone, PartialEq)]
enum Known {
    /// No member has a root on the edge.
    Clear,
    /// Infinitely many roots violate the specification.
    Endless,
    /// Only that these zeros lie in it.
    Gap(Vec<Zero>),
}

#[derive(Debug, Clone, PartialEq)]
struct Interval {
    low: f64,
    high: f64,
    known: Known,
}

/// What remains to be done with an interval.
enum Todo {
    Look(Claim<1>),
    Keep(Interval),
}

impl Grid<'_, 1> {
    /// The crossings along the row, by the parameter.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn crossings(&self, task: &Task) -> Result<Vec<Crossing>, Error> {
        let mut expansion = BoxExpansion::new(&self.reduced);
        let mut intervals = Vec::new();
        for part in self.divide(self.whole(), task)? {
            let range = self.range(&part.block);
            let (low, high) = (range.low[0], range.high[0]);
            let known = match part.finding {
                Finding::Clear => Known::Clear,
                Finding::Endless => Known::Endless,
                Finding::Open(stretches) => {
                    let claim = Claim { range, stretches };
                    self.isolate(claim, &mut expansion, &mut intervals, task)?;
                    continue;
                }
            };
            intervals.push(Interval { low, high, known });
        }
        self.counted(&united(intervals), task)
    }

    /// Divide a cell about its zeros, in order.
    fn isolate(
        &self,
        claim: Claim<1>,
        expansion: &mut BoxExpansion<1>,
        intervals: &mut Vec<Interval>,
        task: &Task,
    ) -> Result<(), Error> {
        let near = CLOSE * (claim.range.high[0] - claim.range.low[0]);
        let mut waiting = vec![Todo::Look(claim)];
        while let Some(next) = waiting.pop() {
            let claim = match next {
                Todo::Look(claim) => claim,
                Todo::Keep(interval) => {
                    intervals.push(interval);
                    continue;
                }
            };
            let (low, high) = (claim.range.low[0], claim.range.high[0]);
            let keep = |low, high, known| Interval { low, high, known };
            let stretches = match examine(&self.reduced, &claim, expansion, task)? {
                Examined::Clear => {
                    intervals.push(keep(low, high, Known::Clear));
                    continue;
                }
                Examined::Endless => {
                    intervals.push(keep(low, high, Known::Endless));
                    continue;
                }
                Examined::Open(_, stretches) => stretches,
            };
            let zero = stretches
                .as_ref()
                .and_then(|stretches| self.zero(&claim.range, stretches, near, expansion));
            // Numbers too close to each other cannot be separated.
            let parts =
                high - low > 2.0 * near && near > 4.0 * f64::EPSILON * low.abs().max(high.abs());
            let Some(stretches) = stretches.filter(|_| parts) else {
                intervals.push(keep(low, high, Known::Gap(zero.into_iter().collect())));
                continue;
            };
            let look = |low: f64, high: f64| {
                Todo::Look(Claim {
                    range: Range {
                        low: [low],
                        high: [high],
                    },
                    stretches: Some(stretches.clone()),
                })
            };
            match zero {
                Some(zero) => {
                    let (from, to) = ((zero.gain - near).max(low), (zero.gain + near).min(high));
                    if to < high {
                        waiting.push(look(to, high));
                    }
                    waiting.push(Todo::Keep(keep(from, to, Known::Gap(vec![zero]))));
                    if low < from {
                        waiting.push(look(low, from));
                    }
                }
                None => {
                    let middle = low + 0.5 * (high - low);
                    waiting.push(look(middle, high));
                    waiting.push(look(low, middle));
                }
            }
        }
        Ok(())
    }

    /// A zero in a range or next to it, by Newton's method from the middle of the stretches.
    fn zero(
        &self,
        range: &Range<1>,
        stretches: &[Stretch],
        near: f64,
        expansion: &mut BoxExpansion<1>,
    ) -> Option<Zero> {
        let (low, high) = (range.low[0], range.high[0]);
        stretches.iter().rev().take(STARTS).find_map(|stretch| {
            let piece = self.reduced.edge.get(stretch.piece)?;
            let mut t = stretch.from + 0.5 * (stretch.to - stretch.from);
            let mut gain = low + 0.5 * (high - low);
            for _ in 0..MAX_STEPS {
                let place = [gain];
                let at = Range {
                    low: place,
                    high: place,
                };
                expansion.adopt(&self.reduced, &at);
                let (value, slopes, turn) = tangent(expansion, piece, t);
                let slope = slopes[0];
                let area = turn.re * slope.im - turn.im * slope.re;
                let dt = (slope.re * value.im - slope.im * value.re) / area;
                let dp = (turn.im * value.re - turn.re * value.im) / area;
                t += dt;
                gain += dp;
                // Roots come in pairs, and the edge begins on the real axis; a zero far away is
                // another one. (A zero at an end of the gap of another zero must not be found
                // again.)
                let within = gain >= low - 0.5 * near && gain <= high + 0.5 * near;
                if !(within && t.abs() <= 2.0 * stretch.to) {
                    return None;
                }
                if dt.abs() <= SMALL * stretch.to && dp.abs() <= SMALL * (high - low).max(near) {
                    let t = if stretch.piece == 0 { t.abs() } else { t };
                    let omega = piece.from.im + piece.along.im * t;
                    return (t >= 0.0 && t <= piece.length).then_some(Zero { gain, omega });
                }
            }
            None
        })
    }

    /// The number of roots that cross in each gap, from the counts on both sides.
    fn counted(&self, intervals: &[Interval], task: &Task) -> Result<Vec<Crossing>, Error> {
        let mut crossings = Vec::new();
        let mut before: Option<i32> = None;
        let mut gap: Option<&Interval> = None;
        let gaps = intervals
            .iter()
            .filter(|i| matches!(i.known, Known::Gap(_)));
        if gaps.count() == 0 {
            return Ok(crossings);
        }
        for interval in intervals {
            match &interval.known {
                Known::Gap(_) => gap = Some(interval),
                Known::Endless => (before, gap) = (None, None),
                Known::Clear => {
                    let middle = interval.low + 0.5 * (interval.high - interval.low);
                    let cell = self.judge_at([middle], task)?;
                    let after = (cell.status == CellStatus::Ok).then_some(cell.unstable);
                    if let (Some(gap), Some((before, after))) = (gap, before.zip(after)) {
                        crossings.extend(shared(gap, after - before));
                    }
                    (before, gap) = (after, None);
                }
            }
        }
        Ok(crossings)
    }
}

/// The jump of a gap, distributed over its zeros.
fn shared(gap: &Interval, jump: i32) -> Vec<Crossing> {
    let Known::Gap(zeros) = &gap.known else {
        return Vec::new();
    };
    let number = zeros.len() as i32;
    if jump == 0 || number == 0 {
        return Vec::new();
    }
    let own = (jump % number == 0).then_some(jump / number);
    let crossing = |zero: &Zero| Crossing {
        // A single root that crosses is real.
        omega: if jump % 2 == 0 { zero.omega } else { 0.0 },
        gain: zero.gain,
        low: gap.low,
        high: gap.high,
        jump: own,
        slope_at_zero: None,
    };
    zeros.iter().map(crossing).collect()
}

/// Merge touching intervals of one kind; a zero in both counts once.
fn united(intervals: Vec<Interval>) -> Vec<Interval> {
    let mut united: Vec<Interval> = Vec::with_capacity(intervals.len());
    for next in intervals {
        match (united.last_mut(), next.known) {
            (Some(last), Known::Clear) if last.known == Known::Clear => last.high = next.high,
            (
                Some(Interval {
                    high,
                    known: Known::Gap(own),
                    ..
                }),
                Known::Gap(zeros),
            ) => {
                for zero in zeros {
                    let same = |other: &Zero| {
                        let off = (other.omega - zero.omega).abs();
                        off <= SAME_ZERO * other.omega.max(zero.omega)
                    };
                    if !own.iter().any(same) {
                        own.push(zero);
                    }
                }
                *high = next.high;
            }
            (_, known) => united.push(Interval {
                low: next.low,
                high: next.high,
                known,
            }),
        }
    }
    united
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::stability::boxes::Reduced;
    use crate::stability::family::{Affine, Family, Term};
    use crate::stability::specification::Specification;

    /// s + K² e^(−0.5 s)
    fn square() -> Family {
        let term = |exponent, power, constant| Term {
            coefficient: 1.0,
            exponents: vec![exponent],
            power,
            delay: Affine {
                constant,
                slopes: vec![0.0],
            },
        };
        Family::new(vec!["K".into()], vec![term(0, 1, 0.0), term(2, 0, 0.5)]).unwrap()
    }

    fn along(points: &[f64], decay: f64) -> Vec<Crossing> {
        let specification = Specification {
            decay,
            damping: None,
        };
        let family = square();
        let grid = Grid {
            reduced: Reduced::new(&family, &[0.0], &[0]).with_specification(specification),
            points: [points],
        };
        grid.crossings(&Task::new()).unwrap()
    }

    #[test]
    fn crossings_of_a_square_are_the_closed_form() {
        let points: Vec<f64> = (0..50).map(|i| -3.03 + 0.15 * f64::from(i)).collect();
        let found = along(&points, 0.0);
        // w = K², w/2 = π/2 + 2πn; at K = 0 a real root reaches 0 and returns.
        let mut expected = Vec::new();
        for n in 0..3 {
            let omega = PI + 4.0 * PI * f64::from(n);
            expected.push((-omega.sqrt(), omega, -2));
            expected.push((omega.sqrt(), omega, 2));
        }
        expected.retain(|(gain, ..)| (-3.03..4.32).contains(gain));
        expected.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(found.len(), expected.len());
        for (own, (gain, omega, jump)) in found.iter().zip(expected) {
            assert!((own.gain - gain).abs() < 1e-11 && (own.omega - omega).abs() < 1e-10);
            assert!(own.low <= gain && gain <= own.high && own.jump == Some(jump));
        }
    }

    #[test]
    fn a_real_root_crosses_at_no_frequency() {
        // −0.3 + K² e^0.15 = 0
        let found = along(&[0.1, 0.4, 0.7, 1.0], 0.3);
        let gain = (0.3 * (-0.15_f64).exp()).sqrt();
        assert_eq!(found.len(), 1);
        assert!((found[0].gain - gain).abs() < 1e-11);
        assert_eq!((found[0].omega, found[0].jump), (0.0, Some(-1)));
    }
}
