//! Zeros of event functions along accepted elements.
//!
//! On the polynomial of an element an event is a function of time alone. It is sampled at the nodes
//! and interpolated; where the interpolant agrees with four further samples up to rounding errors,
//! its zeros are separated, so that no zero of an event that is linear in y is missed. Otherwise
//! the element is halved, up to 32 parts of 25 samples; a function that is not smooth even there is
//! searched between samples. An event occurs where the function reaches zero or changes its sign,
//! also through a change of y at a jump. A function that is zero at the start has no event there,
//! and one that only touches zero has none unless a sample lies on the contact. The time is found
//! by false position and bisection, to rounding.

use std::ops::Range;

use super::chebyshev;
use super::history::Piece;
use super::isolate::separators;
use super::nodes::{Nodes, nodes};
use super::problem::{Equation, Event};
use crate::Error;
use crate::order::sort_up;

/// A false position is close to an end of its bracket within this share of it.
const CLOSE: f64 = 0.01;
/// Points at which an interpolant is compared with the function.
const CHECKED: [f64; 4] = [-0.891_37, -0.314_59, 0.271_83, 0.857_21];
/// Difference there, relative to the coefficients, that counts as rounding error.
const ROUNDING: f64 = 1e-13;
/// Difference that counts as noise if halving does not reduce it.
const NOISE: f64 = 1e-6;
/// Share of a difference below which halving has reduced it.
const LESSENED: f64 = 0.25;
/// Upper limit on the halvings of an element.
const DEEPEST: u32 = 5;

/// The event functions of a run and the events found.
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

/// A time and the value of an event there.
type Mark = (f64, f64);

/// A part of an element.
struct Part {
    start: f64,
    end: f64,
    halvings: u32,
    /// Error of the interpolant of twice the part.
    before: f64,
}

impl Watch {
    /// Start to observe events.
    pub(super) fn new<E: Equation + ?Sized>(
        kinds: &[Event],
        equation: &mut E,
        t: f64,
        y: &[f64],
    ) -> Result<Self, Error> {
        let mut watch = Self {
            kinds: kinds.to_vec(),
            last: vec![0.0; kinds.len()],
            times: vec![Vec::new(); kinds.len()],
            values: vec![Vec::new(); kinds.len()],
        };
        if !kinds.is_empty() {
            equation.events(t, y, 0..kinds.len(), &mut watch.last)?;
        }
        Ok(watch)
    }

    /// Process a change of y; does it end the run?
    pub(super) fn change<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        t: f64,
        y: &[f64],
    ) -> Result<bool, Error> {
        if self.kinds.is_empty() {
            return Ok(false);
        }
        let mut here = vec![0.0; self.kinds.len()];
        equation.events(t, y, 0..self.kinds.len(), &mut here)?;
        let pairs = self.last.iter().zip(&here).zip(&self.kinds).enumerate();
        let crossings = pairs
            .filter(|(_, ((before, after), kind))| crosses(kind.direction, **before, **after))
            .map(|(event, _)| Crossing {
                time: t,
                event,
                value: y.to_vec(),
            });
        let found = crossings.collect();
        self.last = here;
        Ok(self.take(found).is_some())
    }

    /// Store crossings in the order of time; returns the time of a terminal one.
    fn take(&mut self, mut found: Vec<Crossing>) -> Option<f64> {
        sort_up(&mut found, |crossing| crossing.time);
        let mut stop = None;
        for crossing in found {
            if stop.is_some_and(|stop| crossing.time > stop) {
                break;
            }
            self.times[crossing.event].push(crossing.time);
            self.values[crossing.event].extend(crossing.value);
            let terminal = self.kinds[crossing.event].terminal as usize;
            if terminal > 0 && self.times[crossing.event].len() >= terminal {
                stop = Some(crossing.time);
            }
        }
        stop
    }

    /// Search an element with values `y` (component, node); the time of a terminal event ends the
    /// run.
    pub(super) fn scan<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        piece: &Piece,
        nodes: &Nodes,
        y: &[f64],
    ) -> Result<Option<f64>, Error> {
        let (count, n) = (self.kinds.len(), nodes.order + 1);
        if count == 0 {
            return Ok(None);
        }
        // Row by row: the samples at the nodes, then those that check them.
        let mut samples = self.last.clone();
        let mut sample = |time: f64, y: &[f64]| {
            let first = samples.len();
            samples.resize(first + count, 0.0);
            equation.events(time, y, 0..count, &mut samples[first..])
        };
        let mut column = vec![0.0; y.len() / n];
        for node in 1..n {
            for (value, row) in column.iter_mut().zip(y.chunks_exact(n)) {
                *value = row[node];
            }
            sample(time_at(piece.start, piece.end, nodes.points[node]), &column)?;
        }
        for x in CHECKED {
            let time = time_at(piece.start, piece.end, x);
            piece.value(time, &mut column);
            sample(time, &column)?;
        }
        let mut found = Vec::new();
        for event in 0..count {
            let own: Vec<f64> = samples[event..].iter().step_by(count).copied().collect();
            let part = Part {
                start: piece.start,
                end: piece.end,
                halvings: 0,
                before: f64::INFINITY,
            };
            let mut seen = vec![(piece.start, self.last[event])];
            self.divide(equation, piece, event, (part, nodes, own), &mut seen)?;
            for pair in seen.windows(2) {
                if crosses(self.kinds[event].direction, pair[0].1, pair[1].1) {
                    let (time, value) = refine(equation, piece, event, (pair[0], pair[1]))?;
                    found.push(Crossing { time, event, value });
                }
            }
            self.last[event] = samples[(n - 1) * count + event];
        }
        Ok(self.take(found))
    }

    /// Append times between which the event has at most one zero, as far as it is smooth.
    fn divide<E: Equation + ?Sized>(
        &self,
        equation: &mut E,
        piece: &Piece,
        event: usize,
        (whole, own, first): (Part, &Nodes, Vec<f64>),
        seen: &mut Vec<Mark>,
    ) -> Result<(), Error> {
        let mut sampler = Sampler {
            piece,
            event,
            y: vec![0.0; piece.coefficients.len() / piece.terms],
        };
        let mut open = vec![(whole, Some(first))];
        let mut coefficients = Vec::new();
        let mut places = Vec::new();
        while let Some((part, given)) = open.pop() {
            let table = if given.is_some() { own } else { nodes(24) };
            let n = table.order + 1;
            let samples = match given {
                Some(samples) => samples,
                None => {
                    let places = table.points.iter().chain(&CHECKED);
                    places
                        .map(|x| sampler.at(equation, time_at(part.start, part.end, *x)))
                        .collect::<Result<Vec<f64>, Error>>()?
                }
            };
            coefficients.resize(n, 0.0);
            table.coefficients(&samples[..n], &mut coefficients);
            let size: f64 = coefficients.iter().map(|c| c.abs()).sum();
            let pairs = CHECKED.iter().zip(&samples[n..]);
            let wrong = pairs.fold(0.0_f64, |worst, (x, value)| {
                worst.max((chebyshev::value(&coefficients, *x) - value).abs())
            });
            let noise = wrong <= NOISE * size && wrong > LESSENED * part.before;
            if wrong <= ROUNDING * size || noise {
                places.clear();
                separators(&coefficients, &mut places);
                for x in places.iter().filter(|x| x.abs() < 1.0) {
                    let time = time_at(part.start, part.end, *x);
                    seen.push((time, sampler.at(equation, time)?));
                }
                seen.push((part.end, samples[n - 1]));
            } else if part.halvings < DEEPEST {
                let middle = 0.5 * (part.start + part.end);
                for (start, end) in [(middle, part.end), (part.start, middle)] {
                    let (halvings, before) = (part.halvings + 1, wrong);
                    let half = Part {
                        start,
                        end,
                        halvings,
                        before,
                    };
                    open.push((half, None));
                }
            } else {
                let times = table.points.iter().skip(1);
                let marks = times.map(|x| time_at(part.start, part.end, *x));
                seen.extend(marks.zip(samples[1..n].iter().copied()));
            }
        }
        Ok(())
    }
}

/// One event along one element.
struct Sampler<'a> {
    piece: &'a Piece,
    event: usize,
    y: Vec<f64>,
}

impl Sampler<'_> {
    fn at<E: Equation + ?Sized>(&mut self, equation: &mut E, time: f64) -> Result<f64, Error> {
        let mut value = [0.0];
        self.piece.value(time, &mut self.y);
        equation.events(time, &self.y, only(self.event), &mut value)?;
        Ok(value[0])
    }
}

fn only(event: usize) -> Range<usize> {
    event..event + 1
}

/// The time at a coordinate in [−1, 1], exact at its ends.
fn time_at(start: f64, end: f64, x: f64) -> f64 {
    if x <= 0.0 {
        start + 0.5 * (end - start) * (1.0 + x)
    } else {
        end - 0.5 * (end - start) * (1.0 - x)
    }
}

/// The zero of one event in a bracket.
fn refine<E: Equation + ?Sized>(
    equation: &mut E,
    piece: &Piece,
    event: usize,
    ((mut a, mut fa), (mut b, mut fb)): ((f64, f64), (f64, f64)),
) -> Result<(f64, Vec<f64>), Error> {
    let y = vec![0.0; piece.coefficients.len() / piece.terms];
    let mut sampler = Sampler { piece, event, y };
    // A false position close to an end is moved to twice its distance from it, usually beyond the
    // zero, so that the bracket closes on the zero. Every fourth step bisects, so that the bracket
    // shrinks for every function.
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
        let value = sampler.at(equation, time)?;
        if (value < 0.0) == (fa < 0.0) && value != 0.0 {
            (a, fa) = (time, value);
        } else {
            (b, fb) = (time, value);
        }
    }
    piece.value(b, &mut sampler.y);
    Ok((b, sampler.y))
}

/// Is a change from `before` to `after` a crossing in a direction that counts?
fn crosses(direction: i8, before: f64, after: f64) -> bool {
    let up = before < 0.0 && after >= 0.0;
    let down = before > 0.0 && after <= 0.0;
    match direction {
        1 => up,
        -1 => down,
        _ => up || down,
    }
}
