use std::f64::consts::{FRAC_PI_2, PI};

use super::candidates::Candidates;
use super::goal::{Decisive, Goal, Objective};
use super::search::{Within, best_within, least, worst_delay};
use super::simplices;
use crate::loops::{ControlLoop, Controller, Extras, Factors, Kind, Path, Place, Plant, Values};
use crate::{Task, between};

/// A loop around the plant gain/(s (lag s + 1)) with a gain of one.
fn around(lag: f64, kind: Kind, gains: &[f64], delay: f64) -> ControlLoop {
    let plant = Plant::Factors(Factors {
        num: vec![1.0],
        den: vec![1.0, 0.0],
        lags: 1,
        has_zero: false,
        has_pair: false,
    });
    let controller = Controller {
        kind,
        is_filtered: false,
        rule: None,
        extras: Extras::default(),
        stops: false,
    };
    let values = Values {
        plant: vec![1.0, lag],
        controller: gains.to_vec(),
        delay,
        sample_time: None,
        limit: None,
        low: None,
        rate: None,
        given: None,
    };
    let names = ["gain", "lag"].map(String::from).to_vec();
    ControlLoop::new(plant, names, controller, values, Path::Command).unwrap()
}

/// A loop around an integrator with a lag.
pub(super) fn loop_of(kind: Kind, gains: &[f64], delay: f64) -> ControlLoop {
    around(0.1, kind, gains, delay)
}

/// A loop with other numbers.
pub(super) fn with(of: &ControlLoop, change: impl Fn(&mut Values)) -> ControlLoop {
    let mut values = of.values().clone();
    change(&mut values);
    of.with(values)
}

/// 1/s under velocity control, in scenarios of the delay.
fn velocity_loops(delays: &[f64]) -> Candidates {
    let of = around(0.0, Kind::PV, &[0.0, 0.0], 0.0);
    let loops = delays
        .iter()
        .map(|late| of.with_number(Place::Delay, *late));
    Candidates::new(loops.collect(), vec![0, 1])
}

fn goal(required: [f64; 3]) -> Goal {
    Goal {
        objective: Objective::Abscissa,
        required,
        scale: 1.0,
    }
}

#[test]
fn margins_and_abscissae_of_proportional_control_are_the_closed_forms() {
    let (of, task) = (velocity_loops(&[0.36, 0.5]), Task::new());
    let exact = of.margins(&[1.2, 0.0], true, &task).unwrap();
    let first: Vec<[f64; 3]> = exact
        .iter()
        .map(|each| [each.gain_margin, each.phase_margin, each.delay_margin])
        .collect();
    for margins in [first, of.all_margins(&[&[1.2, 0.0]], &task).unwrap()] {
        for (delay, [gain, phase, late]) in [0.36, 0.5].into_iter().zip(margins) {
            assert!((gain - FRAC_PI_2 / (1.2 * delay)).abs() < 1e-12);
            assert!((phase - (90.0 - (1.2 * delay).to_degrees())).abs() < 1e-10);
            assert!((late - (FRAC_PI_2 / 1.2 - delay)).abs() < 1e-12);
        }
    }
    let worst = of
        .stable_abscissae(&[&[1.2, 0.0], &[4.0, 0.0]], &task)
        .unwrap();
    let each = of
        .costs(Objective::Abscissa, &[&[1.2, 0.0]], &task)
        .unwrap();
    assert_eq!(worst, [each[0].max(each[1]), f64::INFINITY]);
}

#[test]
fn the_best_gains_are_where_three_roots_meet() {
    let (of, task) = (velocity_loops(&[0.36]), Task::new());
    let within = Within {
        start: vec![1.0, 0.05],
        reach: vec![0.5, 0.1],
        bounds: vec![(0.0, 4.0), (-0.5, 0.9)],
    };
    let gains = best_within(&of, &goal([0.0; 3]), &within, &task).unwrap();
    assert!(
        (gains[0] * 0.36 / (4.0 * (-2.0f64).exp()) - 1.0).abs() < 2e-3,
        "{gains:?}"
    );
    assert!((gains[1] / (-2.0f64).exp() - 1.0).abs() < 2e-3, "{gains:?}");
    let slow = of.at(&[1.0, 0.0], &of.scenarios[0]);
    let found = worst_delay(&slow, Objective::Abscissa, (0.3, 0.4), &task).unwrap();
    assert!((found.0 - 0.3).abs() < 1e-3 || (found.0 - 0.4).abs() < 1e-3);
}

#[test]
fn the_best_point_is_that_of_all_totals() {
    let (of, task) = (velocity_loops(&[0.3, 0.4]), Task::new());
    let points: Vec<[f64; 2]> = (0..200)
        .map(|i| {
            [
                0.1 + 0.25 * f64::from(i % 20),
                -0.2 + 0.1 * f64::from(i / 20),
            ]
        })
        .collect();
    let points: Vec<&[f64]> = points.iter().map(|point| &point[..]).collect();
    for required in [[0.0; 3], [2.0, 50.0, 0.0], [4.0, 0.0, 0.5], [1e3, 0.0, 0.0]] {
        let goal = goal(required);
        let total = |gains: &[f64]| {
            let mut last = Decisive::default();
            goal.total(&of, gains, f64::INFINITY, &mut last, &task)
                .unwrap()
        };
        let (place, cost) = least(&of, &goal, &points, &task).unwrap();
        let late = of.stable_abscissae(&points, &task).unwrap();
        let stable = points
            .iter()
            .zip(&late)
            .filter(|(_, late)| late.is_finite());
        let best = stable
            .map(|(point, _)| total(point))
            .fold(f64::INFINITY, f64::min);
        assert_eq!(cost, best);
        assert_eq!(total(points[place]), best);
    }
}

#[test]
fn minima_with_kinks_are_found() {
    let (place, value) =
        between::minimum(|x| Ok((x - 1.0 / PI).abs()), (-1.0, 2.0), 1e-9, 200).unwrap();
    assert!((place - 1.0 / PI).abs() < 1e-7 && value < 1e-7);
    let valley = |x: &[f64], _: f64| Ok((x[0] - x[1]).abs() + 0.1 * (x[0] + x[1] - 1.0).abs());
    let bounds = [(-2.0, 2.0), (-2.0, 2.0)];
    let found = simplices::minimum(valley, &[-1.0, 1.5], &[0.5, 0.5], &bounds, 1e-7).unwrap();
    assert!(
        (found[0] - 0.5).abs() + (found[1] - 0.5).abs() < 1e-2,
        "{found:?}"
    );
    // A bound is kept to.
    let bounds = [(0.75, 2.0), (-2.0, 2.0)];
    let found = simplices::minimum(valley, &[1.0, 1.0], &[0.2, 0.2], &bounds, 1e-7).unwrap();
    assert!(
        found[0] >= 0.75 && (found[0] - 0.75).abs() < 1e-2,
        "{found:?}"
    );
}
