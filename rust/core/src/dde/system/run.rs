//! The method of steps: elements from breaking point to breaking point.

use crate::dde::limits::DIVERGED;
use crate::{Error, Task};

use super::element::{Element, is_noise};
use super::equations::{Past, Signal, SystemEquations, SystemResponse};
use super::input_breaks::{first_break, passed_breaks};
use super::jumps::{Jumps, Scale};
use super::legendre::TERMS;
use super::outputs::Outputs;
use super::terms;
use super::terms::Feed;
use super::track::{KINDS, Piece, Track};
use crate::dde::limits::slack;

/// Elements between two checks for cancellation.
const CHECK_EVERY: u64 = 256;

/// Upper limit on the number of elements (bounds time and memory).
const MOST_ELEMENTS: u64 = 20_000_000;

pub(super) fn run(
    equations: &SystemEquations,
    past: Past,
    inputs: &Signal,
    times: &[f64],
    task: &Task,
) -> Result<SystemResponse, Error> {
    let n = equations.states;
    let (late, a) = split(equations);
    let feeds = [
        Feed::all(&late, n, 1.0),
        Feed::all(&equations.derivative, n, -1.0),
        Feed::all(&equations.input, equations.inputs, 1.0),
    ];
    let groups = [
        &equations.state,
        &equations.derivative,
        &equations.input,
        &equations.output,
        &equations.output_derivative,
        &equations.direct,
    ];
    let longest = groups
        .map(|group| terms::longest(group))
        .into_iter()
        .fold(0.0, f64::max);
    let mut outputs = Outputs::new(equations, times, longest)?;
    let last = outputs.last();
    let shortest = feeds[..2]
        .iter()
        .flatten()
        .map(|feed| feed.delay)
        .fold(f64::INFINITY, f64::min);
    if last / shortest >= MOST_ELEMENTS as f64 {
        return Err(endless());
    }
    let Past {
        state: mut x,
        history,
        slopes,
    } = past;
    let keeps_slopes = !(feeds[1].is_empty() && equations.output_derivative.is_empty());
    let slopes = slopes.map_or_else(|| still(n), |signal| signal.track);
    let unit = if longest > 0.0 {
        longest
    } else {
        last.max(f64::MIN_POSITIVE)
    };
    let input_breaks = passed_breaks(inputs, unit);
    for passed in &input_breaks {
        if passed.is_reported(equations.inputs) {
            outputs.input_break(passed.time)?;
        }
    }
    let before = passed_breaks(&history, unit);
    let mut jumps = Jumps::new(
        n,
        equations.inputs,
        &a,
        [&feeds[0], &feeds[1], &feeds[2]],
        input_breaks,
        unit,
        longest,
    );
    for passed in before {
        outputs.state_break(passed.time)?;
        jumps.push(passed)?;
    }
    let (mut states, mut slopes) = (history.track, slopes);
    states.close(0.0);
    slopes.close(0.0);
    let first = first_break(&jumps, &feeds, [&states, &slopes, &inputs.track], &x);
    if first.is_reported(n) {
        outputs.state_break(0.0)?;
    }
    jumps.push(first)?;

    let mut element = Element::new(&a, n, feeds);
    let mut suggested = f64::INFINITY;
    let (mut t, mut elements) = (0.0, 0_u64);
    loop {
        let tolerance = slack(t, longest);
        if let Some(mut passed) = jumps.arrived(t) {
            passed.time = t;
            for (x, leap) in x.iter_mut().zip(&passed.leap) {
                *x += leap;
            }
            if passed.is_reported(n) {
                outputs.state_break(t)?;
            }
            jumps.push(passed)?;
        }
        if t >= last - tolerance {
            break;
        }
        if elements.is_multiple_of(CHECK_EVERY) {
            task.check()?;
        }
        if elements >= MOST_ELEMENTS {
            return Err(endless());
        }
        elements += 1;
        let reach = shortest.min(last - t);
        let scale = Scale {
            state: element.state_size(),
            slope: element.slope_size(),
            length: suggested.min(reach),
        };
        let stop = jumps.next(t + reach + tolerance, &scale).min(last);
        let mut whole = reach.min(stop - t);
        let tracks = [&states, &slopes, &inputs.track];
        let mut tail = f64::INFINITY;
        let h = loop {
            // Equal parts: their delayed counterparts then lie on whole elements, and their factors
            // can be used again.
            let parts = (whole / suggested - 1e-9).ceil().max(1.0);
            let h = if parts > 1.0 { whole / parts } else { whole };
            if let Some(read) = element.solve(&x, t, h, tolerance, tracks) {
                (whole, suggested, tail) = (read, read.max(0.5 * h), f64::INFINITY);
                continue;
            }
            if element.is_resolved() || h <= 64.0 * tolerance {
                break h;
            }
            let before = std::mem::replace(&mut tail, element.tail());
            if is_noise(tail, before) {
                // Shorter than rounding errors need: the next one may be twice as long.
                suggested = 4.0 * h;
                break h;
            }
            suggested = 0.5 * h;
        };
        if element.has_room() {
            suggested = suggested.max(2.0 * h);
        }
        let next = if h < reach.min(stop - t) {
            t + h
        } else if stop - t <= reach {
            stop
        } else {
            t + h
        };
        element.store(
            t,
            next,
            &mut states,
            keeps_slopes.then_some(&mut slopes),
            &mut x,
        );
        check_growth(&x, next)?;
        let tracks = [&states, &slopes, &inputs.track];
        outputs.before(next - slack(next, longest), tracks);
        let old = t - longest - 2.0 * tolerance;
        states.forget(old);
        slopes.forget(old);
        jumps.forget(t);
        t = next;
    }
    // Only the last time itself remains, just after any break there.
    let mut f = vec![0.0; n];
    element.slope_at(t, longest, &x, [&states, &slopes, &inputs.track], &mut f);
    let sizes = vec![[0.0; KINDS]; n];
    states.push(t, f64::INFINITY, 0, &constants(&x), &sizes);
    slopes.push(t, f64::INFINITY, 0, &constants(&f), &sizes);
    outputs.before(f64::INFINITY, [&states, &slopes, &inputs.track]);
    Ok(outputs.finish())
}

/// The delayed terms of the state, and the delay-free matrix.
fn split(equations: &SystemEquations) -> (Vec<terms::Term>, Vec<f64>) {
    let n = equations.states;
    let mut a = vec![0.0; n * n];
    let mut late = Vec::new();
    for term in &equations.state {
        if term.delay == 0.0 {
            for (a, entry) in a.iter_mut().zip(&term.matrix) {
                *a += entry;
            }
        } else {
            late.push(term.clone());
        }
    }
    (late, a)
}

/// Zero at all times.
fn still(n: usize) -> Track {
    Track::new(
        n,
        vec![Piece::constant(
            f64::NEG_INFINITY,
            f64::INFINITY,
            vec![0.0; n],
        )],
    )
}

fn constants(values: &[f64]) -> Vec<f64> {
    let mut series = vec![0.0; values.len() * TERMS];
    for (series, value) in series.chunks_exact_mut(TERMS).zip(values) {
        series[0] = *value;
    }
    series
}

fn check_growth(x: &[f64], t: f64) -> Result<(), Error> {
    if x.iter().all(|x| x.abs() <= DIVERGED) {
        return Ok(());
    }
    refuse!(
        "the response exceeds {DIVERGED:e} at t = {t} s after the start, so the system is \
         unstable: end the run earlier"
    )
}

fn endless() -> Error {
    Error::TooMuch {
        what: "the response of the system",
        limit: MOST_ELEMENTS,
        unit: "elements of time",
        advice: "simulate a shorter time, and set delays close to zero to exactly zero".to_owned(),
    }
}
