use super::*;

fn variable(start: f64, low: f64, high: f64) -> Variable {
    Variable {
        start,
        low,
        high,
        step: 1e-3,
        longest: 0.06,
    }
}

/// A function of which no slope is known.
fn unknown(value: f64) -> Result<Value, Error> {
    Ok(Value::new(value, 0))
}

#[test]
fn a_curved_valley_is_followed_to_its_minimum() {
    let rosenbrock =
        |x: &[f64], _| unknown((1.0 - x[0]).powi(2) + 10.0 * (x[1] - x[0] * x[0]).powi(2));
    let around = [variable(-0.5, -9.0, 9.0), variable(0.5, -9.0, 9.0)];
    let found = minimise(&around, Accuracy::of(1e-12), &mut None, rosenbrock);
    assert!(found.is_ok_and(|found| (found.place[0] - 1.0).abs() < 1e-3 && found.value < 1e-6));
}

#[test]
fn the_inverse_of_a_search_near_by_saves_evaluations_and_changes_no_minimum() {
    // Two variables that almost have the same effect.
    let evaluations = std::cell::Cell::new(0);
    let valley = |place: f64, from: f64, near: &mut Option<Vec<f64>>| {
        evaluations.set(0);
        let around = [variable(from, -9.0, 9.0), variable(from + 0.4, -9.0, 9.0)];
        let around = around.map(|one| Variable {
            longest: 1.0,
            ..one
        });
        minimise(&around, Accuracy::of(1e-9), near, |x: &[f64], _| {
            evaluations.set(evaluations.get() + 1);
            let (a, b) = (x[0] + x[1] - place, x[0] - x[1] + 0.3);
            unknown(50.0 * a * a + 0.5 * b * b + 0.01 * a.powi(4))
        })
        .unwrap()
    };
    let mut near = None;
    let first = valley(1.0, 0.0, &mut near);
    let after_first = valley(1.2, first.place[0], &mut near);
    let with_it = evaluations.get();
    let alone = valley(1.2, first.place[0], &mut None);
    assert!(
        with_it < evaluations.get(),
        "{with_it} of {}",
        evaluations.get()
    );
    assert!((after_first.value - alone.value).abs() < 1e-8);
}

#[test]
fn a_minimum_beyond_a_bound_is_found_on_it() {
    let bowl = |x: &[f64], _| unknown((x[0] + 1.0).powi(2) + (x[1] - x[0] - 2.0).powi(2));
    let found = minimise(
        &[variable(1.0, 0.0, 9.0), variable(1.5, -9.0, 9.0)],
        Accuracy::of(1e-12),
        &mut None,
        bowl,
    );
    assert!(found.is_ok_and(|found| found.place[0] == 0.0 && (found.place[1] - 2.0).abs() < 1e-4));
}

#[test]
fn a_variable_that_stays_at_its_bound_shortens_no_step_of_others() {
    // The least of the quadratic model is beyond the bound of the second variable.
    let around = [variable(0.0, -9.0, 9.0), variable(1.0, 1.0, 9.0)];
    let (inverse, gradient) = ([1.0, -50.0, -50.0, 3000.0], [-0.05, -1e-4]);
    let step = direction(&around, &[0.0, 1.0], &inverse, &gradient, None);
    // Of the Hessian, which is the inverse of that, the first entry is 3000/500.
    assert!((step[0] - 0.05 / 6.0).abs() < 1e-15, "{step:?}");
    assert_eq!(step[1], 0.0);
    // One that reaches its bound within the longest step does not either.
    let step = direction(&around, &[0.0, 1.05], &inverse, &gradient, None);
    assert!((step[0] - 0.045).abs() < 1e-15, "{step:?}");
}

/// A function of a sum and the logarithm of a part of it, the rest of which is not below zero.
struct Parts<F: Fn(f64, f64) -> f64>(F);

impl<F: Fn(f64, f64) -> f64> Function for Parts<F> {
    fn slack(&self, place: &[f64]) -> Option<Slack> {
        let part = place[1].exp();
        Some(Slack {
            value: place[0] - part,
            slope: vec![1.0, -part],
        })
    }

    fn at(&mut self, places: &[Vec<f64>], _: Wanted) -> Result<Vec<Value>, Error> {
        let value = |place: &Vec<f64>| {
            let rest = self.slack(place).map_or(0.0, |slack| slack.value);
            assert!(rest > -1e-12, "{place:?}");
            unknown(self.0(rest, place[1].exp()))
        };
        places.iter().map(value).collect()
    }
}

/// Where it is least: the rest, and the part.
fn parts(start: (f64, f64), function: impl Fn(f64, f64) -> f64) -> (f64, f64) {
    let (rest, part) = start;
    let logarithm = Variable {
        step: 0.02,
        longest: 1.2,
        ..variable(part.ln(), -9.0, 9.0)
    };
    let around = [variable(rest + part, 0.0, 9.0), logarithm];
    let found = minimise(&around, Accuracy::of(1e-12), &mut None, Parts(function)).unwrap();
    let part = found.place[1].exp();
    (found.place[0] - part, part)
}

#[test]
fn a_minimum_beyond_a_bound_on_two_variables_is_found_on_it() {
    // Known best is the sum, and without the bound the rest would be −0.02 or −0.3.
    for far in [0.02, 0.3] {
        let valley = |rest: f64, part: f64| {
            let (sum, rest) = (rest + part - 0.5, rest + far);
            1e4 * sum * sum + rest * rest
        };
        for start in [(0.4, 0.1), (0.1, 0.1), (0.0, 0.9), (0.2, 0.05), (-0.3, 0.5)] {
            let (rest, part) = parts(start, valley);
            // The slope by the part is zero on the bound.
            assert!(rest.abs() < 1e-12, "{start:?} {rest}");
            assert!((part - 0.5).abs() < 1e-5, "{start:?} {part}");
        }
    }
}

#[test]
fn a_bound_on_two_variables_is_left_where_the_function_falls_inwards() {
    let bowl =
        |rest: f64, part: f64| 100.0 * (rest - 0.2).powi(2) + 400.0 * (rest + part - 0.7).powi(2);
    for start in [(0.0, 0.1), (0.0, 0.9), (0.01, 0.3)] {
        let (rest, part) = parts(start, bowl);
        assert!((rest - 0.2).abs() < 1e-3, "{start:?} {rest}");
        assert!((part - 0.5).abs() < 1e-3, "{start:?} {part}");
    }
}

#[test]
fn a_known_slope_saves_evaluations_and_what_it_lacks_is_found() {
    // The sum of squares of a line and a curve, and a part whose slope is not known.
    let mut evaluations = 0;
    let function = |x: &[f64], _| {
        evaluations += 1;
        let (line, curve) = (x[0] + 2.0 * x[1] - 3.0, 10.0 * (x[1] - 0.1 * x[0] * x[0]));
        let by = [[1.0, -2.0 * x[0]], [2.0, 10.0]];
        let mut found = Value::new(line * line + curve * curve + 0.1 * x[0], 2);
        for i in 0..2 {
            found.slope[i] = 2.0 * (by[i][0] * line + by[i][1] * curve);
            for j in 0..2 {
                found.curvature[2 * i + j] = 2.0 * (by[i][0] * by[j][0] + by[i][1] * by[j][1]);
            }
        }
        Ok(found)
    };
    let free = |start| Variable {
        longest: 10.0,
        ..variable(start, -9.0, 9.0)
    };
    let found = minimise(
        &[free(0.0), free(2.0)],
        Accuracy::of(1e-10),
        &mut None,
        function,
    );
    let from_nothing = minimise(
        &[free(0.0), free(2.0)],
        Accuracy::of(1e-10),
        &mut None,
        |x: &[f64], _| {
            let (line, curve) = (x[0] + 2.0 * x[1] - 3.0, 10.0 * (x[1] - 0.1 * x[0] * x[0]));
            unknown(line * line + curve * curve + 0.1 * x[0])
        },
    );
    let (Ok(found), Ok(expected)) = (found, from_nothing) else {
        unreachable!("the function has a value everywhere")
    };
    assert!((found.value - expected.value).abs() < 1e-8);
    assert!(evaluations < 25, "{evaluations} evaluations");
}
