//! Runs against closed forms, limits of memory, difficult equations.

use proptest::prelude::*;

use super::breaks::BreakingPoint;
use super::history::{History, Piece};
use super::*;
use crate::{Error, Task};

/// The right-hand side of one equation, node by node: f(t, y, z).
struct Plain<F>(F);

impl<F: FnMut(f64, f64, f64) -> f64> Equation for Plain<F> {
    fn slope(&mut self, at: Columns<'_>, out: &mut [f64], _task: &Task) -> Result<(), Error> {
        assert_eq!([at.y.len(), at.z.len()], [at.t.len(); 2]);
        for (node, out) in out.iter_mut().enumerate() {
            *out = (self.0)(at.t[node], at.y[node], at.z[node]);
        }
        Ok(())
    }
}

/// y on [−`delay`, 0].
fn past(delay: f64, gap: f64, tolerance: f64, y: impl Fn(f64) -> f64) -> History {
    let write = |times: &[f64], out: &mut [f64]| {
        for (t, out) in times.iter().zip(out) {
            *out = y(*t);
        }
        Ok(())
    };
    let found = approximate((-delay, 0.0), gap, &[], 1, |_, _| tolerance, write);
    History::new(found.unwrap().pieces)
}

fn constant(value: f64, start: f64, memory: f64) -> History {
    History::new(vec![
        Piece::new(start - memory, start, 1, vec![value]).with_slopes(),
    ])
}

fn scalar(delay: f64, end: f64, rtol: f64) -> Problem {
    Problem {
        end,
        y0: vec![1.0],
        delays: vec![delay],
        history: constant(0.0, 0.0, delay),
        breaks: vec![BreakingPoint {
            time: 0.0,
            order: 0,
        }],
        rtol,
        atol: vec![1e-2 * rtol],
        max_step: f64::INFINITY,
        t_eval: Some(vec![end]),
        ..Problem::default()
    }
}

/// y′ = −y(t − 1) from y = 0 before and 1 at 0: Σ (−1)^k (t − k)^k / k!.
fn steps(t: f64) -> f64 {
    let mut sum = 1.0;
    let mut factorial = 1.0;
    for k in 1..100 {
        let base = t - f64::from(k);
        if base <= 0.0 {
            break;
        }
        factorial *= f64::from(k);
        sum += (-1.0_f64).powi(k) * base.powi(k) / factorial;
    }
    sum
}

fn linear_decay() -> impl Equation {
    Plain(|_, _, z: f64| -z)
}

#[test]
fn the_tolerance_is_kept() {
    for rtol in [1e-4, 1e-6, 1e-9, 1e-12] {
        for end in [0.7, 1.0, 3.3, 10.0] {
            let problem = scalar(1.0, end, rtol);
            let found = solve(&problem, &mut linear_decay(), &Task::new()).unwrap();
            let error = (found.y[0] - steps(end)).abs();
            assert!(error < rtol, "{rtol} {end}: {error}");
        }
    }
}

#[test]
fn a_breaking_point_within_rounding_of_the_end_is_the_end() {
    for ulps in 0..8 {
        let mut end = 3.0_f64;
        (0..ulps).for_each(|_| end = end.next_up());
        let found = solve(&scalar(1.0, end, 1e-8), &mut linear_decay(), &Task::new());
        assert_eq!(found.unwrap().outcome, Outcome::Finished);
    }
}

#[test]
fn memory_is_bounded_where_nobody_asks_for_the_past() {
    // At this gain the solution oscillates without end.
    let mut equation = Plain(|_, _, z: f64| -std::f64::consts::FRAC_PI_2 * z);
    let mut problem = scalar(1.0, 2000.0, 1e-8);
    let most = solve(&problem, &mut equation, &Task::new()).unwrap();
    assert!(most.n_elements > 300 && most.history.len() < 10);
    problem.dense_output = true;
    let all = solve(&problem, &mut equation, &Task::new()).unwrap();
    assert_eq!(all.y, most.y);
    assert_eq!(all.history.len() as u64, all.n_elements + 1);
}

#[test]
fn a_delay_far_shorter_than_the_elements_costs_no_more() {
    // y′ = −y(t − τ) decays like e^{st} with s = −e^{−sτ}; started on that solution.
    let delay = 1e-4;
    let mut s = -1.0_f64;
    for _ in 0..50 {
        s = -(-s * delay).exp();
    }
    let mut problem = scalar(delay, 10.0, 1e-9);
    problem.history = past(delay, 1e-3 * delay, 1e-14, |t| (s * t).exp());
    let found = solve(&problem, &mut linear_decay(), &Task::new()).unwrap();
    assert!((found.y[0] - (10.0 * s).exp()).abs() < 1e-9);
    assert!(found.n_elements < 100, "{}", found.n_elements);
}

#[test]
fn stiff_equations_take_long_elements() {
    let mut equation = Plain(|t: f64, y: f64, z: f64| {
        -1e6 * (y - t.cos()) - t.sin() + 5e5 * (z - (t - 1.0).cos())
    });
    let mut problem = scalar(1.0, 5.0, 1e-8);
    problem.history = past(1.0, 1e-3, 1e-13, f64::cos);
    let found = solve(&problem, &mut equation, &Task::new()).unwrap();
    assert!((found.y[0] - 5.0_f64.cos()).abs() < 1e-8);
    assert!(found.n_elements < 150, "{}", found.n_elements);
}

#[test]
fn what_cannot_go_on_says_where() {
    // y′ = y² + z ends at a finite time; the square root leaves its domain.
    let mut explosive = Plain(|_, y: f64, _| y * y);
    let found = solve(&scalar(1.0, 3.0, 1e-6), &mut explosive, &Task::new()).unwrap();
    assert!(found.outcome != Outcome::Finished && (found.end - 1.0).abs() < 1e-3);
    let mut root = Plain(|t: f64, _, _| (0.5 - t).sqrt());
    let found = solve(&scalar(1.0, 3.0, 1e-6), &mut root, &Task::new()).unwrap();
    assert!(found.outcome != Outcome::Finished && (found.end - 0.5).abs() < 1e-3);
}

#[test]
fn bad_problems_are_refused() {
    let spoilt: [fn(&mut Problem); 12] = [
        |problem| problem.delays = vec![0.0],
        |problem| problem.delays = vec![-1.0],
        |problem| problem.delays = vec![f64::NAN],
        |problem| problem.delays = vec![1e-20],
        |problem| problem.end = -1.0,
        |problem| problem.y0 = vec![f64::NAN],
        |problem| problem.rtol = 0.0,
        |problem| problem.atol = vec![-1.0],
        |problem| problem.max_step = 0.0,
        |problem| problem.t_eval = Some(vec![4.0]),
        |problem| problem.history = constant(0.0, 0.0, 0.5),
        |problem| problem.history = History::default(),
    ];
    for spoil in spoilt {
        let mut problem = scalar(1.0, 3.0, 1e-6);
        spoil(&mut problem);
        let refused = solve(&problem, &mut linear_decay(), &Task::new());
        assert!(matches!(refused, Err(Error::Argument(_))), "{problem:?}");
    }
}

#[test]
fn elements_have_the_order_of_radau_collocation() {
    // y′ = cos(t) y z with z = 1: one element of four nodes, at its end and within.
    let errors = |length: f64| {
        let mut equation = Plain(|t: f64, y: f64, z: f64| t.cos() * y * z);
        let mut problem = scalar(10.0, 8.0, 1e-13);
        problem.history = constant(1.0, 0.0, 10.0);
        let mut element = element::Element::default();
        let begin = element::Begin {
            initial: &problem.y0,
            history: &problem.history,
            smooth: false,
            jumps: (false, false),
        };
        let nodes = nodes::nodes(4);
        element.set(&problem, nodes, (0.0, length), begin).unwrap();
        let task = Task::new();
        let ended = element.sweep(&problem, nodes, &mut equation, &task);
        assert!(matches!(ended, Ok(element::Sweeps::Converged(_))));
        nodes.coefficients(&element.y, &mut element.coefficients);
        let piece = Piece::new(0.0, length, 5, element.coefficients.clone());
        let error = |time: f64| {
            let mut value = [0.0];
            piece.value(time, &mut value);
            (value[0] - time.sin().exp()).abs()
        };
        let within = (1..20).map(|i| error(0.05 * f64::from(i) * length));
        (error(length), within.fold(0.0, f64::max))
    };
    let (long, short) = (errors(0.8), errors(0.2));
    // Two halvings of one element: 2N = 8 orders at its end, N + 1 = 5 within, the last one not
    // fully reached.
    assert!((long.0 / short.0).log2() > 14.0, "{long:?} {short:?}");
    assert!((long.1 / short.1).log2() > 8.0, "{long:?} {short:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn exponentials_are_solutions(delay in 0.01..3.0_f64, rate in -1.5..0.5_f64) {
        // y′ = r e^{rτ} y(t − τ) has the solution e^{rt}.
        let factor = rate * (rate * delay).exp();
        let mut equation = Plain(|_, _, z: f64| factor * z);
        let mut problem = scalar(delay, 4.0, 1e-9);
        problem.history = past(delay, 1e-3 * delay, 1e-13, |t| (rate * t).exp());
        let found = solve(&problem, &mut equation, &Task::new()).unwrap();
        prop_assert!((found.y[0] - (4.0 * rate).exp()).abs() < 1e-8 * (1.0 + (4.0 * rate).exp()));
    }

    #[test]
    fn a_shift_of_time_changes_nothing(shift in -1e4..1e4_f64, delay in 0.1..2.0_f64) {
        let run = |start: f64| {
            let mut problem = scalar(delay, start + 5.0, 1e-8);
            problem.start = start;
            problem.history = constant(0.3, start, delay);
            problem.breaks = vec![BreakingPoint { time: start, order: 0 }];
            solve(&problem, &mut linear_decay(), &Task::new()).unwrap().y[0]
        };
        prop_assert!((run(shift) - run(0.0)).abs() < 1e-7);
    }
}
