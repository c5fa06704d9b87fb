use super::super::path::{Held, respond};
use super::super::tests::{gaussian, recorded};
use super::super::variables::MOST_DEVIATION;
use super::*;

const INTEGRATOR: (&[f64], &[f64]) = (&[1.0], &[1.0, 0.0]);
const NOTHING: (&[f64], &[f64]) = (&[1.0], &[1.0]);

fn free() -> Free {
    Free {
        delay: true,
        gain: true,
        lags: vec![true],
        zero: false,
    }
}

fn model(plant: (&[f64], &[f64]), runs: Vec<Rows>) -> Model {
    Model::new(Plant::new(plant.0, plant.1).unwrap(), runs, free(), 5.0).unwrap()
}

fn point(delay: f64, lag: f64, noise: Vec<Noise>) -> Point {
    Point {
        timing: Timing::Delay(delay),
        lags: vec![lag],
        zero: 0.0,
        gain: 1.0,
        noise,
    }
}

#[test]
fn commands_that_are_late_in_an_exact_record_leave_a_finite_scatter() {
    // Half of the commands arrive 10 ms late, and there is no other error.
    let mut rows = recorded(INTEGRATOR, (0.31, 1.0, 0.02), 0.0, 1);
    let late = |i: usize| if i.is_multiple_of(2) { 0.01 } else { 0.0 };
    let sent = &rows.commands;
    for (time, output) in rows.time.iter().zip(&mut rows.output) {
        let mut before = 0.0;
        *output = 0.0;
        for (i, (from, value)) in sent.time.iter().zip(&sent.value).enumerate() {
            *output += (value - before) * (time - from - 0.31 - late(i)).max(0.0);
            before = *value;
        }
    }
    let model = model(INTEGRATOR, vec![rows]);
    let noise = Noise {
        arrivals: 1e9,
        ..Noise::QUIET
    };
    let found = fitted(&model, point(0.31, 0.02, vec![noise]));
    assert!(found.objective.is_finite());
    let largest = model.runs[0].largest_jump();
    assert!(found.point.noise[0].arrivals <= 1.001 * MOST_DEVIATION / largest);
    for lag in [0.005, 0.05, 0.5] {
        let mut moved = found.point.clone();
        moved.lags = vec![lag];
        let at = model.at(0, &moved, &Task::new()).unwrap();
        assert!(at.residuals.iter().all(|e| e.is_finite()));
    }
}

fn fitted(model: &Model, start: Point) -> Fit {
    model
        .fit(&model.timed(start), None, Search::All, 1e-6, &Task::new())
        .unwrap()
}

#[test]
fn delay_gain_and_lag_are_recovered() {
    let model = model(
        INTEGRATOR,
        vec![recorded(INTEGRATOR, (0.31, 0.85, 0.17), 1e-5, 1)],
    );
    let found = fitted(&model, point(0.25, 0.3, vec![Noise::QUIET]));
    assert!((found.point.delay() - 0.31).abs() < 1e-4, "{found:?}");
    assert!((found.point.lags[0] - 0.17).abs() < 1e-4);
    let there = model.at(0, &found.point, &Task::new()).unwrap();
    assert!((there.gain - 0.85).abs() < 1e-5);
    assert!((there.variance.sqrt() / 1e-5 - 1.0).abs() < 0.2);
    assert_eq!(
        model.objective(&found.point, &Task::new()).unwrap(),
        found.objective
    );
}

#[test]
fn air_that_is_not_there_is_fitted_to_nothing() {
    let model = model(
        INTEGRATOR,
        vec![recorded(INTEGRATOR, (0.31, 0.85, 0.17), 5e-3, 2)],
    );
    let windy = Noise {
        air_time: 1.0,
        air: 3.0,
        ..Noise::QUIET
    };
    let found = fitted(&model, point(0.3, 0.2, vec![windy]));
    let white = fitted(&model, point(0.3, 0.2, vec![Noise::QUIET]));
    assert!(found.objective <= white.objective + 1e-3);
    assert!(
        white.objective - found.objective < 8.0,
        "{white:?} {found:?}"
    );
    assert!((found.point.total() - 0.48).abs() < 0.02);
}

/// A recording in air of this deviation that passes the lag and is held from row to row.
fn windy(plant: (&[f64], &[f64]), numbers: (f64, f64, f64), deviation: f64) -> Rows {
    let mut rows = recorded(plant, numbers, 1e-4, 6);
    let space = Plant::new(plant.0, plant.1).unwrap();
    let space = space.space(&[numbers.2], 0.0);
    let mut air = 0.0;
    let mut later = |gust: f64| {
        air = 0.9 * air + 0.44 * deviation * gust;
        air
    };
    let value: Vec<f64> = gaussian(7, 200).into_iter().map(&mut later).collect();
    let held = Held {
        time: &rows.time,
        value: &value,
    };
    let mut moved = vec![0.0; 200];
    let (times, task) = (&rows.time, Task::new());
    respond([&space], held, 0.0, times, [&mut moved], None, &task).unwrap();
    let outputs = rows.output.iter_mut().zip(moved);
    outputs.for_each(|(output, moved)| *output += moved);
    rows
}

#[test]
fn a_search_in_air_ends_where_another_one_stays() {
    let air = Noise {
        air_time: 0.2,
        air: 30.0,
        ..Noise::QUIET
    };
    for plant in [INTEGRATOR, NOTHING] {
        for (lag, deviation) in [(0.05, 0.3), (0.2, 0.1), (0.2, 1.0), (0.6, 0.3)] {
            let model = model(plant, vec![windy(plant, (0.31, 0.85, lag), deviation)]);
            for start in [0.3 * lag, 3.0 * lag] {
                let found = fitted(&model, point(0.25, start, vec![air]));
                let again = fitted(&model, found.point.clone());
                let left = found.objective - again.objective;
                assert!(left < 2e-3, "{lag} {deviation} {start}: {left}");
            }
        }
    }
}

#[test]
fn an_unstable_plant_of_first_order_has_a_negative_lag() {
    let unstable = recorded(NOTHING, (0.31, 0.85, -4.0), 1e-3, 3);
    let model = model(NOTHING, vec![unstable]);
    let found = fitted(&model, point(0.25, -3.7, vec![Noise::QUIET]));
    assert!((found.point.delay() - 0.31).abs() < 0.01, "{found:?}");
    assert!((found.point.lags[0] + 4.0).abs() < 0.01);
}

#[test]
fn recordings_share_the_plant_and_keep_their_noise() {
    let numbers = (0.31, 0.85, 0.17);
    let runs = vec![
        recorded(INTEGRATOR, numbers, 1e-4, 4),
        recorded(INTEGRATOR, numbers, 1e-2, 5),
    ];
    let model = model(INTEGRATOR, runs);
    let found = fitted(&model, point(0.25, 0.3, vec![Noise::QUIET; 2]));
    assert!((found.point.delay() - 0.31).abs() < 1e-3, "{found:?}");
    assert!((found.point.gain - 0.85).abs() < 1e-3);
    for (run, deviation) in [1e-4, 1e-2].into_iter().enumerate() {
        let there = model.at(run, &found.point, &Task::new()).unwrap();
        assert_eq!(there.gain, found.point.gain);
        assert!((there.variance.sqrt() / deviation - 1.0).abs() < 0.2);
    }
    assert!(model.at(2, &found.point, &Task::new()).is_err());
}

#[test]
fn a_known_delay_stays() {
    let runs = vec![recorded(INTEGRATOR, (0.31, 0.85, 0.17), 1e-5, 6)];
    let free = Free {
        delay: false,
        ..free()
    };
    let plant = Plant::new(INTEGRATOR.0, INTEGRATOR.1).unwrap();
    let model = Model::new(plant, runs, free, 5.0).unwrap();
    let found = fitted(&model, point(0.31, 0.5, vec![Noise::QUIET]));
    assert_eq!(found.point.delay(), 0.31);
    assert!((found.point.lags[0] - 0.17).abs() < 1e-4);
}

#[test]
fn numbers_out_of_range_are_refused_by_value() {
    let runs = vec![recorded(INTEGRATOR, (0.31, 0.85, 0.17), 1e-5, 7)];
    let plant = || Plant::new(INTEGRATOR.0, INTEGRATOR.1).unwrap();
    let refusal = |model: Result<Model, Error>| model.unwrap_err().to_string();
    let many = Free {
        lags: vec![true; 9],
        ..free()
    };
    let zero = Free {
        lags: Vec::new(),
        zero: true,
        ..free()
    };
    for (found, expected) in [
        (
            refusal(Model::new(plant(), Vec::new(), free(), 5.0)),
            "no recording",
        ),
        (
            refusal(Model::new(plant(), runs.clone(), free(), f64::NAN)),
            "longest delay is NaN",
        ),
        (
            refusal(Model::new(plant(), runs.clone(), free(), -1.0)),
            "longest delay is -1",
        ),
        (
            refusal(Model::new(plant(), runs.clone(), many, 5.0)),
            "10 states",
        ),
        (
            refusal(Model::new(plant(), runs.clone(), zero, 5.0)),
            "without a lag",
        ),
    ] {
        assert!(found.contains(expected), "{found}");
    }
    let model = model(INTEGRATOR, runs);
    let noise = |air_time, air| {
        vec![Noise {
            air_time,
            air,
            ..Noise::QUIET
        }]
    };
    for (point, expected) in [
        (point(f64::NAN, 0.2, vec![Noise::QUIET]), "the delay is NaN"),
        (
            point(0.2, f64::INFINITY, vec![Noise::QUIET]),
            "the delay is",
        ),
        (
            point(0.2, 0.2, vec![Noise::QUIET; 2]),
            "noise of 2 recordings",
        ),
        (
            point(0.2, 0.2, noise(1.0, -2.0)),
            "standard deviation of -2",
        ),
        (point(0.2, 0.2, noise(-3.0, 2.0)), "time constant of -3"),
    ] {
        let point = Point { gain: 1.0, ..point };
        for found in [
            model.at(0, &point, &Task::new()).map(|_| ()),
            model.objective(&point, &Task::new()).map(|_| ()),
            model
                .fit(&point, None, Search::All, 1e-6, &Task::new())
                .map(|_| ()),
        ] {
            let found = found.unwrap_err().to_string();
            assert!(
                found.contains(expected) || found.contains("lag is inf"),
                "{found}"
            );
        }
    }
    let found = model.fit(
        &point(0.2, 0.2, vec![Noise::QUIET]),
        None,
        Search::All,
        0.0,
        &Task::new(),
    );
    assert!(found.unwrap_err().to_string().contains("a tolerance of 0"));
}
