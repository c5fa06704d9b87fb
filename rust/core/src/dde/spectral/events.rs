//! Zeros of event functions along accepted elements.
//!
//! An event is looked for between neighbouring nodes and found by false position and bisection on
//! the polynomial, to rounding. A zero at a node counts when the function was not
//! zero before; a function that is zero at the start has no event there. Two zeros between
//! neighbouring nodes are missed.

use super::super::history::Piece;
use super::{Equation, Event};
use crate::Error;

/// A false position is close to an end of its bracket within this part of it.
const CLOSE: f64 = 0.01;

/// The event functions of a run and what was found.
#[derive(Debug, Default)]
pub(super) struct Watch {
    kinds: Vec<Event>,
    last: Vec<f64>,
    pub(super) times: Vec<Vec<f64>>,
    pub(super) values: Vec<Vec<f64>>,
}

/// A crossing in one element.
struct Crossing {
    time: f64,
    event: usize,
    value: Vec<f64>,
}

impl Watch {
    /// Watch events from the start of a run.
    pub(super) fn new<E: Equation + ?Sized>(
        kinds: &[Event],
        equation: &mut E,
        t: f64,
        y: &[f64],
    ) -> Result<Self, Error> {
        let mut watch = Self {
            kinds: kinds.to_vec(),
            last: Vec::new(),
            times: vec![Vec::new(); kinds.len()],
            values: vec![Vec::new(); kinds.len()],
        };
        watch.restart(equation, t, y)?;
        Ok(watch)
    }

    /// Evaluate anew where y was changed.
    pub(super) fn restart<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        t: f64,
        y: &[f64],
    ) -> Result<(), Error> {
        self.last = vec![0.0; self.kinds.len()];
        if self.kinds.is_empty() {
            return Ok(());
        }
        equation.events(t, y, &mut self.last)
    }

    /// Look at an element with nodes `t` and values `y` (component, node); the time of a terminal
    /// event ends the run.
    pub(super) fn scan<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        piece: &Piece,
        y: &[f64],
        t: &[f64],
    ) -> Result<Option<f64>, Error> {
        if self.kinds.is_empty() {
            return Ok(None);
        }
        let n = t.len();
        let mut found = Vec::new();
        let mut here = vec![0.0; self.kinds.len()];
        let mut column = vec![0.0; y.len() / n];
        for node in 1..n {
            for (value, row) in column.iter_mut().zip(y.chunks_exact(n)) {
                *value = row[node];
            }
            equation.events(t[node], &column, &mut here)?;
            for (event, &after) in here.iter().enumerate() {
                let before = self.last[event];
                if crosses(self.kinds[event].direction, before, after) {
                    let bracket = ((t[node - 1], before), (t[node], after));
                    let (time, value) = self.refine(equation, piece, event, bracket)?;
                    found.push(Crossing { time, event, value });
                }
            }
            self.last.copy_from_slice(&here);
        }
        found.sort_by(|a, b| a.time.total_cmp(&b.time));
        for crossing in found {
            self.times[crossing.event].push(crossing.time);
            self.values[crossing.event].extend(crossing.value);
            let terminal = self.kinds[crossing.event].terminal as usize;
            if terminal > 0 && self.times[crossing.event].len() >= terminal {
                return Ok(Some(crossing.time));
            }
        }
        Ok(None)
    }

    /// The zero of one event in a bracket.
    fn refine<E: Equation + ?Sized>(
        &self,
        equation: &mut E,
        piece: &Piece,
        event: usize,
        ((mut a, mut fa), (mut b, mut fb)): ((f64, f64), (f64, f64)),
    ) -> Result<(f64, Vec<f64>), Error> {
        let dim = piece.coefficients.len() / piece.terms;
        let mut y = vec![0.0; dim];
        let mut all = vec![0.0; self.kinds.len()];
        // A false position close to an end is pushed away from it to twice the distance: most often
        // beyond the zero, so that the bracket closes on it. Every fourth step bisects, so that it
        // shrinks whatever the function is.
        for round in 0..240 {
            let middle = 0.5 * (a + b);
            if fb == 0.0 || middle <= a || middle >= b {
                break;
            }
            let secant = a - fa * ((b - a) / (fb - fa));
            let (left, right) = (secant - a, b - secant);
            let rounding = f64::EPSILON * b.abs();
            let time = if round % 4 == 3 || !(left >= 0.0 && right >= 0.0) {
                middle
            } else if left < CLOSE * (b - a) {
                (a + 2.0 * left + rounding).clamp(a.next_up(), b.next_down())
            } else if right < CLOSE * (b - a) {
                (b - 2.0 * right - rounding).clamp(a.next_up(), b.next_down())
            } else {
                secant
            };
            piece.value(time, &mut y);
            equation.events(time, &y, &mut all)?;
            let value = all[event];
            if (value < 0.0) == (fa < 0.0) && value != 0.0 {
                (a, fa) = (time, value);
            } else {
                (b, fb) = (time, value);
            }
        }
        piece.value(b, &mut y);
        Ok((b, y))
    }
}

/// Whether a change from `before` to `after` is a crossing in a wanted direction.
fn crosses(direction: i8, before: f64, after: f64) -> bool {
    let up = before < 0.0 && after >= 0.0;
    let down = before > 0.0 && after <= 0.0;
    match direction {
        1 => up,
        -1 => down,
        _ => up || down,
    }
}
