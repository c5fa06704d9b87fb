//! The numbers of a class along its zero, where they are no straight lines.
//!
//! A short zero does what a change of the delay does: 1 + z s and e^(z s) differ by z² s²/2. So the record tells
//! both far better than slopes at one point say, and the interval is that of the likelihood with the zero given
//! (Venzon & Moolgavkar 1988).

use super::loop_view::Seen;
use super::minima::Minimum;
use super::model::Model;
use super::search::minimum;
use super::tolerances::{ALONG, RANGES};
use crate::{Error, Task};

/// A plant with a given zero, and the rise of −2 ln L to it.
#[derive(Debug, Clone, Copy)]
struct Beside {
    rise: f64,
    seen: Seen,
}

/// The likeliest plants with other zeros, on both sides of the best one.
#[derive(Debug, Clone)]
pub(super) struct Along {
    sides: [Vec<Beside>; 2],
}

impl Along {
    /// That of a minimum, up to a rise or to the end of the range of the zero.
    pub(super) fn new(
        found: &Minimum<'_>,
        start: Seen,
        rise: f64,
        task: &Task,
    ) -> Result<Self, Error> {
        let side = |direction: f64| one_side(found, start, direction, rise, task);
        Ok(Self {
            sides: [side(-1.0)?, side(1.0)?],
        })
    }

    /// The ends of a quantity up to a rise, with its half width at a rise below that beside a given zero.
    pub(super) fn ends(
        &self,
        most: f64,
        of: impl Fn(&Seen) -> f64,
        half_width: impl Fn(f64) -> f64,
    ) -> (f64, f64) {
        let mut out = (f64::INFINITY, f64::NEG_INFINITY);
        for side in &self.sides {
            for pair in side.windows(2) {
                let (inner, outer) = (pair[0], pair[1]);
                let (near, far) = (of(&inner.seen), of(&outer.seen));
                // −2 ln L rises with the square of a distance.
                let place = |rise: f64| {
                    let (from, to) = (inner.rise.sqrt(), outer.rise.sqrt());
                    ((rise.sqrt() - from) / (to - from)).clamp(0.0, 1.0)
                };
                let (value, rise) = if outer.rise <= most {
                    (far, outer.rise)
                } else {
                    (near + place(most) * (far - near), most)
                };
                let own = half_width(most - rise);
                out = (out.0.min(value - own), out.1.max(value + own));
                if outer.rise > most {
                    break;
                }
            }
        }
        out
    }
}

/// The plants on one side, the minimum first; the last one is beyond the rise, or its zero at the end of the range.
fn one_side(
    found: &Minimum<'_>,
    start: Seen,
    direction: f64,
    rise: f64,
    task: &Task,
) -> Result<Vec<Beside>, Error> {
    let at = 1 + found.model.class.order;
    let zero = found.point.x[at];
    let most = RANGES.slowest_zero * found.model.rows.span;
    let mut out = vec![Beside {
        rise: 0.0,
        seen: start,
    }];
    let mut x = found.point.x.clone();
    let mut distance = ALONG.first * start.numbers.zero.abs().max(start.numbers.sum);
    loop {
        let next = (zero + direction * distance).clamp(-most, most);
        let model = Model {
            zero: Some(next),
            ..found.model
        };
        // The delay moves with it.
        x[0] += next - x[at];
        model.clamp(&mut x);
        let point = minimum(&model, model.at(x), f64::INFINITY, task)?;
        let beside = Beside {
            rise: (model.deviance(&point) - found.deviance).max(0.0),
            seen: Seen {
                gain: model.gain(&point),
                numbers: model.numbers(&point.x),
                ..start
            },
        };
        x = point.x;
        out.push(beside);
        if beside.rise > rise || next.abs() >= most {
            return Ok(out);
        }
        distance *= ALONG.grow;
    }
}
