//! Loops whose command is at its limit at first.

use super::super::*;
use super::{columns, controller, plant, row};

/// The search for the end of the time at the limit went on for as long as a neighbour ran, and found
/// one long after the end of this run, which moved its parts.
#[test]
fn a_run_that_ends_at_its_limit_has_its_bits_beside_any_neighbour() -> Result<(), crate::Error> {
    let times: Vec<f64> = (0..=50).map(|i| 0.1 * f64::from(i)).collect();
    for limit in [0.01, 0.013] {
        let rows = [(0.3, 1.0), (1.0, 0.03)].map(|(kp, delay)| {
            let controller = controller(0, kp, 0.0);
            row(&plant(0, 1.0, 1.0), &controller, delay, 0.0, limit)
        });
        let mut found = Vec::new();
        for rows in [&rows[..1], &rows] {
            let columns = columns(rows);
            let entries: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            let sets = Sets::new(1, rows.len(), &entries, 1.0, false)?;
            found.push(in_lanes(&sets, &times)?.swap_remove(0));
        }
        assert!(found[0].is_some());
        assert_eq!(found[0], found[1]);
    }
    Ok(())
}

/// Responses of loops in lanes; none of those that have to run alone.
fn in_lanes(sets: &Sets<'_>, times: &[f64]) -> Result<Vec<Option<Vec<f64>>>, crate::Error> {
    let span = times.last().copied().unwrap_or(0.0);
    let (alike, _) = shape::Shapes::new(sets)?.sorted(span)?;
    let mut found = vec![None; sets.len()];
    for (shape, members) in &alike {
        let mut rows = Vec::new();
        let blocks = [(*shape, &members[..])];
        let job = responses::ResponsesJob { times };
        through::through(sets, 1, &blocks, (span, &job), &mut rows);
        for (&set, row) in members.iter().zip(rows.into_iter().flatten()) {
            found[set] = row.map(|(outputs, _)| outputs);
        }
    }
    Ok(found)
}

/// An integrator at gain g whose command is at its limit L at first moves by g L for each second
/// after the delay τ. The command K (r − y) leaves the limit at t₁, and the plant receives
/// L − K g L (t − t₁ − τ) from t₁ + τ to t₁ + 2 τ.
#[test]
fn commands_that_begin_at_their_limit_are_those_of_the_closed_form() -> Result<(), crate::Error> {
    for step in [1.0, -0.7] {
        let numbers = [
            (0.85, 1.6, 0.3, 0.6),
            (0.85, 2.4, 0.1, 1.0),
            (1.3, 1.1, 0.45, 0.25),
            (0.4, 4.0, 0.02, 0.69),
            (0.85, 1.2, 0.3, 5.0),
        ];
        let rows = numbers.map(|(gain, kp, delay, limit)| {
            let controller = controller(0, kp, 0.0);
            row(&plant(0, gain, 1.0), &controller, delay, 0.0, limit)
        });
        let columns = columns(&rows);
        let entries: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let mut expected = Vec::new();
        let mut times = Vec::new();
        for (gain, kp, delay, limit) in numbers {
            let size = f64::abs(step);
            let top = limit.min(kp * size);
            let leaves = (size - top / kp) / (gain * top);
            let leaves = if leaves > 0.0 { delay + leaves } else { 0.0 };
            let ends = leaves + 2.0 * delay;
            times.push(
                (0..40)
                    .map(|i| ends * f64::from(i) / 39.0)
                    .collect::<Vec<_>>(),
            );
            expected.push(move |t: f64| {
                let moved = gain * top * (t - delay).max(0.0);
                let late = (t - leaves - delay).max(0.0);
                // Nothing comes back in the first delay of a loop that is not at its limit.
                let late = if leaves > 0.0 { late } else { 0.0 };
                f64::signum(step) * (moved - kp * gain * gain * top * late * late / 2.0)
            });
        }
        let sets = Sets::new(1, rows.len(), &entries, step, false)?;
        for (set, (times, expected)) in times.iter().zip(expected).enumerate() {
            let found = in_lanes(&sets, times)?.swap_remove(set);
            assert!(found.is_some(), "set {set} had to run alone");
            let found = found.unwrap_or_default();
            for (&time, found) in times.iter().zip(found) {
                let truth = expected(time);
                assert!(
                    (found - truth).abs() < 1e-13,
                    "{found} at {time} is not {truth}"
                );
            }
        }
    }
    Ok(())
}
