//! Response of a plant to held and delayed inputs, and its rate, at the rows of a recording.
//!
//! Exact: the state is propagated from event to event, an event being a row or the arrival of an
//! input. Step lengths repeat on even rows, so that few propagators are made.

use crate::dde::propagator::Propagator;

use super::plant::PlantSpace;

/// Number of propagators that are kept.
const KEPT: usize = 6;

/// Step lengths that differ by less than this share of the time and of the step are one.
pub(super) const SAME: f64 = 1e-15;
pub(super) const SAME_STEP: f64 = 1e-12;

/// Inputs that hold from their times on; zero before the first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held<'a> {
    pub(super) time: &'a [f64],
    pub(super) value: &'a [f64],
}

/// The response to `inputs`, each `delay` later, at `times`; and its slope there, if asked for.
pub(super) fn respond(
    plant: &PlantSpace,
    inputs: Held<'_>,
    delay: f64,
    times: &[f64],
    out: &mut [f64],
    mut rate: Option<&mut [f64]>,
) {
    let n = plant.b.len();
    let mut kept: Vec<(f64, Propagator)> = Vec::with_capacity(KEPT);
    let mut next_kept = 0;
    let mut state = vec![0.0; n];
    let mut moved = vec![0.0; n];
    let mut next = 0;
    let mut input = 0.0;
    let mut now = inputs.time.first().map_or(0.0, |first| first + delay);
    for (row, &time) in times.iter().enumerate() {
        loop {
            let arrival = inputs.time.get(next).map_or(f64::INFINITY, |t| t + delay);
            let until = time.min(arrival);
            let step = until - now;
            if step > 0.0 {
                if n > 0 {
                    let tolerance = SAME * until.abs() + SAME_STEP * step;
                    let place = kept
                        .iter()
                        .position(|(key, _)| (key - step).abs() <= tolerance);
                    let place = place.unwrap_or_else(|| {
                        let made = (step, Propagator::new(&plant.a, &[&plant.b], step));
                        if kept.len() < KEPT {
                            kept.push(made);
                            kept.len() - 1
                        } else {
                            next_kept = (next_kept + 1) % KEPT;
                            kept[next_kept] = made;
                            next_kept
                        }
                    });
                    kept[place].1.apply(&state, &[input], &mut moved);
                    std::mem::swap(&mut state, &mut moved);
                }
                now = until;
            }
            if arrival > time {
                break;
            }
            input = inputs.value[next];
            next += 1;
            now = now.max(arrival);
        }
        out[row] = dot(&plant.c, &state) + plant.d * input;
        if let Some(rate) = rate.as_deref_mut() {
            rate[row] = (0..n)
                .map(|i| {
                    plant.c[i] * (dot(&plant.a[i * n..(i + 1) * n], &state) + plant.b[i] * input)
                })
                .sum();
        }
    }
}

/// Sums that a dot product is split into, so that they are computed side by side.
const SUMS: usize = 8;

pub(super) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; SUMS];
    let (left, right) = (x.chunks_exact(SUMS), y.chunks_exact(SUMS));
    let rest: f64 = left
        .remainder()
        .iter()
        .zip(right.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in left.zip(right) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    sums.iter().sum::<f64>() + rest
}
