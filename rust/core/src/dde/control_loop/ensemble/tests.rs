//! The vectorised code against the code for single loops.

use super::*;
use crate::Task;
use crate::dde::control_loop::linear_loop::Start;
use crate::dde::control_loop::metrics::{Criteria, Metrics};
use crate::dde::control_loop::reference::Reference;
use proptest::prelude::*;

const CRITERIA: Criteria = Criteria {
    rise: (0.1, 0.9),
    settling: 0.02,
};

/// An integrator under P control, or with the integral of the error as a second state.
fn row(kp: f64, ki: Option<f64>, delay: f64, limit: f64) -> Vec<f64> {
    let numbers = [0.0, kp, 0.0, 0.0, delay, 0.065, limit];
    let states = match ki {
        None => vec![0.0, 1.0, 0.0, -kp, 1.0],
        Some(ki) => vec![0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 1.0, -kp, ki, 1.0, 0.0],
    };
    states.into_iter().chain(numbers).collect()
}

/// Metrics of a set by the code for single loops.
fn alone(sets: &Sets<'_>, set: usize, span: f64) -> Metrics {
    let found = each::metrics(sets, set, f64::NAN, span, &CRITERIA, &Task::new());
    found.map_or(Metrics::UNKNOWN, |(metrics, _)| metrics)
}

proptest! {
    #[test]
    fn lanes_measure_as_the_single_engine_does(
        gains in prop::collection::vec((0.3..3.0, 0.0..0.6_f64), 1..40),
        (integrates, limit, span) in (any::<bool>(), 0.3..2.0, 0.5..12.0_f64),
        is_ahead in any::<bool>(),
    ) {
        let ki = |i: usize| integrates.then_some(0.02 * i as f64);
        let rows: Vec<f64> = gains
            .iter()
            .enumerate()
            .flat_map(|(i, &(kp, delay))| row(kp, ki(i), delay, limit))
            .collect();
        let sets = Sets {
            states: if integrates { 2 } else { 1 },
            rows: &rows,
            amplitude: 1.0,
            is_ahead,
        };
        let goals = vec![f64::NAN; gains.len()];
        let found = metrics(&sets, &goals, span, &CRITERIA, &Task::new());
        prop_assert!(found.is_ok());
        for (set, (found, _)) in found.into_iter().flatten().enumerate() {
            // After settling, rounding errors decide where the response is farthest from zero.
            let truth = Metrics { peak_time: found.peak_time, ..alone(&sets, set, span) };
            for (found, truth) in found.to_array().into_iter().zip(truth.to_array()) {
                prop_assert!(
                    (found - truth).abs() < 1e-9 || (found.is_nan() && truth.is_nan()),
                    "{found} is not {truth} in set {set}"
                );
            }
        }
    }

    #[test]
    fn lanes_respond_as_the_single_engine_does(
        (kp, delay, limit) in (0.3..3.0, 0.0..0.6_f64, 0.3..2.0),
        mut times in prop::collection::vec(0.0..8.0_f64, 1..20),
    ) {
        times.sort_by(f64::total_cmp);
        let row = row(kp, None, delay, limit);
        let sets = Sets { states: 1, rows: &row, amplitude: 1.0, is_ahead: false };
        let task = Task::new();
        let found = responses(&sets, &times, &task);
        let plant = sets.row(0).and_then(|row| row.checked());
        let start = Start { state: vec![0.0], ..Start::default() };
        let truth = plant.and_then(|plant| {
            plant.simulate(&start, &Reference::step(0.0, 1.0)?, &times, &[], &task)
        });
        let (Ok((found, _)), Ok(truth)) = (found, truth) else {
            return Err(TestCaseError::fail("a run failed"));
        };
        for (found, truth) in found.iter().zip(&truth.outputs) {
            prop_assert!((found - truth).abs() < 1e-13);
        }
    }
}

#[test]
fn a_set_is_refused_or_diverges_alone() {
    let mut rows = row(1.0, None, 0.1, f64::INFINITY);
    rows.extend(row(1.0, None, -0.1, 1.0));
    rows.extend(row(1e3, None, 0.1, f64::INFINITY));
    let sets = Sets {
        states: 1,
        rows: &rows,
        amplitude: 1.0,
        is_ahead: false,
    };
    let found = metrics(&sets, &[1.0; 3], 100.0, &CRITERIA, &Task::new());
    let outcomes: Vec<Outcome> = found.into_iter().flatten().map(|(_, o)| o).collect();
    assert_eq!(outcomes, [Outcome::Ok, Outcome::Refused, Outcome::Diverged]);
}
