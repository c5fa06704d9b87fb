//! A bound on a response for all times after the end of a simulation.
//!
//! About its rest a loop is linear until its command meets the limit again. At the end of the simulation
//! the deviation is a vector z of sizes (the states, and the commands under way), and whatever follows is
//! bounded by matrices without negative elements:
//!
//!   |z| one period later ≤ Q |z|,   |output|, |command| within the period ≤ R |z|.
//!
//! With v = (I − Q)⁻¹ |z| ≥ 0 all later |z| are at most v, since v = |z| + Q v, and the outputs at most R v
//! (comparison with a positive linear system; Berman and Plemmons 1994, ch. 6). If R v stays in the band,
//! and the command within its limit, the response has settled for good. Between grid points, e^(|A| h)
//! bounds what states do. Rounding plays no part at these sizes.

use super::contraction::{Bounds, DOUBLINGS, Matrix, contracts, identity, later, moduli, times};
use super::lasting::{Fundamental, states_at};
use super::sampled_tail;
use super::steps::{Step, one_step};
use crate::dde::Equations;
use crate::dde::propagator::Propagator;
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::singular::Singular;
use crate::loops::{ControlLoop, Input};
use crate::{Error, Task};

/// Condition number from which on a loop has no unique rest.
const SINGULAR: f64 = 1e13;

/// Step of a loop without delay, in units of its fastest time constant.
const STEP: f64 = 0.25;

/// Deviation that may remain after the simulated time, as a part of the step: half of the overshoot that
/// counts as none.
const STILL: f64 = 5e-4;

/// Most doublings of the simulated time until the remaining deviation is that small.
const LONGER: i32 = 6;

/// A step, simulated until it is proved to rest; none where that fails.
///
/// # Errors
/// Those that end all work.
pub fn proved_step(of: &ControlLoop, amplitude: f64, task: &Task) -> Result<Option<Step>, Error> {
    match proved(of, amplitude, task) {
        Err(error) if error.ends_all() => Err(error),
        found => Ok(found.unwrap_or(None)),
    }
}

fn proved(of: &ControlLoop, amplitude: f64, task: &Task) -> Result<Option<Step>, Error> {
    if of.is_guarded() {
        return Ok(None);
    }
    let (first, end) = one_step(of, None, amplitude, task)?;
    let (output, _) = of.rest_gains()?;
    let rest = output * amplitude;
    if !first.settling_time.is_finite() || rest.is_nan() {
        return Ok(None);
    }
    for doubling in 0..LONGER {
        let later = end * 2.0_f64.powi(doubling);
        if tail_bound(of, amplitude, later, task)? <= STILL * rest.abs() {
            let step = if later > end {
                one_step(of, Some(later), amplitude, task)?.0
            } else {
                first
            };
            return Ok(step.settling_time.is_finite().then_some(step));
        }
    }
    Ok(None)
}

/// Largest deviation of the output from rest at all times after `end`, after a step from zero. Infinite
/// where nothing is proved, as where the command may still meet the limit.
///
/// # Errors
/// Those of a simulation.
pub(super) fn tail_bound(
    of: &ControlLoop,
    amplitude: f64,
    end: f64,
    task: &Task,
) -> Result<f64, Error> {
    let linear = of.linear(Input::Reference)?;
    let model = linear.equations();
    let n = model.states();
    let Some(rest) = at_rest(model, amplitude) else {
        return Ok(f64::INFINITY);
    };
    let (values, command) = (of.values(), rest[n]);
    let limit = values.limit.unwrap_or(f64::INFINITY);
    let found = if values.sample_time.is_some() {
        sampled_tail::bounds(&linear, &rest, limit, end)?
    } else if values.delay == 0.0 {
        let start = vec![0.0; n];
        let states = states_at(&linear, &[0.0, end], start, amplitude, values.limit, task)?;
        let ends = states.iter().skip(1).step_by(2);
        let away: Vec<f64> = ends.zip(&rest).map(|(x, rest)| x - rest).collect();
        without_delay(model, &away)
    } else {
        let known = Fundamental::new(&linear)?;
        match known.sizes_at(amplitude, &rest, values.limit, end, task)? {
            None => None,
            Some(sizes) => with_delay(&known, &sizes, task)?,
        }
    };
    let (output, most) = found.unwrap_or((f64::INFINITY, f64::INFINITY));
    Ok(if command.abs() + most <= limit {
        output
    } else {
        f64::INFINITY
    })
}

/// States and command at rest; none where there is no unique rest.
fn at_rest(model: &Equations, amplitude: f64) -> Option<Vec<f64>> {
    let n = model.states();
    let mut matrix = Vec::new();
    for (row, b) in model.a.chunks_exact(n).zip(&model.b) {
        matrix.extend_from_slice(row);
        matrix.push(*b);
    }
    matrix.extend_from_slice(&model.k);
    matrix.push(model.l - 1.0);
    let values = Singular::new(&matrix, n + 1).values;
    let least = values.last().copied().unwrap_or(0.0);
    if values.first().copied().unwrap_or(0.0) > SINGULAR * least || least.is_nan() {
        return None;
    }
    let mut rest: Vec<f64> = model.e.iter().map(|e| -amplitude * e).collect();
    rest.push(-amplitude * model.m);
    Lu::regular(matrix, n + 1)?.solve(&mut rest);
    Some(rest)
}

/// The largest modulus of an eigenvalue; infinite where that is not found.
fn radius(matrix: &[f64], n: usize) -> f64 {
    let found = eigenvalues(matrix, n).map(|found| {
        let sizes = found.iter().map(|value| value.norm());
        sizes.fold(0.0, f64::max)
    });
    found.unwrap_or(f64::INFINITY)
}

/// The moduli of a power of a matrix that contract, and which power.
fn power(z: &[f64], n: usize) -> Option<(Matrix, usize)> {
    let mut power = z.to_vec();
    for doubling in 0..DOUBLINGS {
        let sizes = moduli(&power);
        if contracts(&sizes, n) {
            return Some((sizes, 1 << doubling));
        }
        power = times(&power, &power, n);
    }
    None
}

/// Largest moduli of the elements of rows Zᵏ, k below `count`.
fn swept(mut rows: Matrix, z: &[f64], n: usize, count: usize) -> Matrix {
    let mut most = moduli(&rows);
    for _ in 1..count {
        rows = times(&rows, z, n);
        for (most, x) in most.iter_mut().zip(&rows) {
            *most = most.max(x.abs());
        }
    }
    most
}

/// Of a continuous loop without delay: z are the states, at the ends of short steps.
fn without_delay(model: &Equations, away: &[f64]) -> Option<Bounds> {
    let n = away.len();
    let feedback: Vec<f64> = model.k.iter().map(|k| k / (1.0 - model.l)).collect();
    let mut closed = model.a.clone();
    for (row, b) in closed.chunks_exact_mut(n).zip(&model.b) {
        row.iter_mut().zip(&feedback).for_each(|(x, k)| *x += b * k);
    }
    let h = STEP / radius(&closed, n).max(f64::MIN_POSITIVE);
    let z = Propagator::new(&closed, &[], h).phi();
    let (contracted, count) = power(&z, n)?;
    let most = later(&contracted, &moduli(away))?;
    let within = Propagator::new(&moduli(&closed), &[], h).phi();
    let states = times(&swept(identity(n), &z, n, count), &most, n);
    let states = times(&within, &states, n);
    let row = |weights: &mut dyn Iterator<Item = f64>| -> f64 {
        weights.zip(&states).map(|(w, x)| w.abs() * x).sum()
    };
    let mut output = model.c.iter().zip(&feedback).map(|(c, k)| c + model.d * k);
    Some((row(&mut output), row(&mut feedback.iter().copied())))
}

/// Of a continuous loop: z are the states, and integral and size of the command under way.
fn with_delay(known: &Fundamental, sizes: &[f64], task: &Task) -> Result<Option<Bounds>, Error> {
    for doubling in 0..DOUBLINGS {
        let Some(bounds) = known.bounds(1 << doubling, task)? else {
            return Ok(None);
        };
        if contracts(&bounds.period, sizes.len()) {
            let row = |weights: &[f64], most: &[f64]| {
                weights.iter().zip(most).map(|(w, x)| w * x).sum::<f64>()
            };
            return Ok(later(&bounds.period, sizes)
                .map(|most| (row(&bounds.output, &most), row(&bounds.command, &most))));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dde::{Request, Start};
    use crate::loops::Kind;
    use crate::tuning::tests::{loop_of, with};

    /// The largest deviation from rest after `end` in a long simulation.
    fn after(of: &ControlLoop, rest: f64, end: f64) -> f64 {
        let time: Vec<f64> = (0..=6000)
            .map(|k| end + 2.0 * end * f64::from(k) / 6000.0)
            .collect();
        let every: Vec<f64> = [0.0].into_iter().chain(time).collect();
        let linear = of.linear(Input::Reference).unwrap();
        let start = Start {
            state: vec![0.0; linear.equations().states()],
            ..Start::default()
        };
        let asked = Request {
            time: &every,
            output_lead: 0.0,
            reference_before: 0.0,
            reference_time: &[0.0],
            reference: &[1.0],
        };
        let found = linear.respond(&start, &asked, &Task::new()).unwrap();
        let away = found.outputs[1..].iter().map(|y| (y - rest).abs());
        away.fold(0.0, f64::max)
    }

    #[test]
    fn the_tail_is_bounded_and_the_bound_is_of_use() {
        let task = Task::new();
        for (kind, gains) in [
            (Kind::P, vec![1.5]),
            (Kind::PI, vec![1.0, 0.2]),
            (Kind::PV, vec![1.5, 0.2]),
        ] {
            for sample_time in [None, Some(0.05), Some(0.1)] {
                for delay in [0.0, 0.3] {
                    let of = loop_of(kind, &gains, delay);
                    let of = with(&of, |values| values.sample_time = sample_time);
                    let end = 8.0 / -of.abscissa(&task).unwrap();
                    let bound = tail_bound(&of, 1.0, end, &task).unwrap();
                    let had = after(&of, 1.0, end);
                    assert!(
                        had <= bound * (1.0 + 1e-6) + 1e-11,
                        "{kind:?} {had} {bound}"
                    );
                    assert!(
                        bound < 12.0 * had + 1e-9,
                        "{kind:?} {sample_time:?} {delay}: {bound}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_tail_that_may_meet_the_limit_is_not_proved() {
        let task = Task::new();
        for sample_time in [None, Some(0.05)] {
            let of = loop_of(Kind::PI, &[1.0, 0.2], 0.3);
            let limited = |limit: f64| {
                with(&of, |values| {
                    (values.limit, values.sample_time) = (Some(limit), sample_time);
                })
            };
            assert!(tail_bound(&limited(0.5), 1.0, 60.0, &task).unwrap() < 1e-3);
            // What is left of the response needs more than this.
            assert_eq!(
                tail_bound(&limited(1e-9), 1.0, 60.0, &task),
                Ok(f64::INFINITY)
            );
        }
    }

    #[test]
    fn a_step_is_proved_where_it_settles() {
        let task = Task::new();
        let of = loop_of(Kind::P, &[1.5], 0.3);
        let step = proved_step(&of, 1.0, &task).unwrap().unwrap();
        let inside = after(&of, 1.0, step.settling_time * (1.0 + 1e-9));
        assert!(inside <= 0.02 + 1e-9, "{inside}");
        let before = after(&of, 1.0, 0.98 * step.settling_time);
        assert!(before > 0.02, "{before}");
        // An unstable loop never rests.
        assert_eq!(
            proved_step(&loop_of(Kind::P, &[9.0], 0.3), 1.0, &task),
            Ok(None)
        );
    }
}
