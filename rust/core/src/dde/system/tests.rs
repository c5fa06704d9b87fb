use super::*;
use crate::{Error, Task};

fn term(delay: f64, matrix: &[f64]) -> Term {
    Term {
        delay,
        matrix: matrix.to_vec(),
    }
}

/// x′ + n x′(t − τ) = a x + a1 x(t − τ) + b u(t − τ), y = x.
fn scalar(delay: f64, a: f64, a1: f64, n: f64, b: f64) -> SystemEquations {
    SystemEquations {
        states: 1,
        inputs: 1,
        outputs: 1,
        state: vec![term(0.0, &[a]), term(delay, &[a1])],
        derivative: vec![term(delay, &[n])],
        input: vec![term(delay, &[b])],
        output: vec![term(0.0, &[1.0])],
        ..SystemEquations::default()
    }
}

fn at_rest(n: usize, value: f64) -> Past {
    Past {
        state: vec![value; n],
        history: Signal::constant(&vec![value; n]).unwrap_or_else(|_| unreachable!()),
        slopes: None,
    }
}

fn step_response(equations: SystemEquations, times: &[f64]) -> SystemResponse {
    let n = equations.states;
    let inputs = Signal::step(&[0.0], &[1.0]);
    let found = LinearSystem::new(equations)
        .and_then(|system| system.simulate(at_rest(n, 0.0), &inputs?, times, &Task::new()));
    match found {
        Ok(found) => found,
        Err(error) => unreachable!("{error}"),
    }
}

/// The same by exact polynomials between multiples of the delay: y′ = kp (1 − y) − kv y′, delayed.
fn drone_truth(kp: f64, kv: f64, delay: f64, t: f64) -> f64 {
    // Coefficients of (t − k τ)^j on [k τ, (k + 1) τ].
    let mut pieces: Vec<Vec<f64>> = vec![vec![0.0]];
    let mut end = 0.0;
    let mut k = 0;
    loop {
        let old = pieces.last().cloned().unwrap_or_default();
        let mut slope: Vec<f64> = old.iter().map(|c| -kp * c).collect();
        slope[0] += if k == 0 { 0.0 } else { kp };
        for j in 1..old.len() {
            slope[j - 1] -= kv * j as f64 * old[j];
        }
        let mut new = vec![end];
        new.extend(slope.iter().enumerate().map(|(j, c)| c / (j + 1) as f64));
        let value = |s: f64| new.iter().rev().fold(0.0, |sum, c| sum * s + c);
        let start = delay * k as f64;
        if t <= start + delay {
            return value(t - start);
        }
        end = value(delay);
        pieces.push(new);
        k += 1;
    }
}

#[test]
fn the_loop_is_the_exact_polynomial() {
    let (kp, delay) = (2.0, 0.36);
    let times: Vec<f64> = (1..=50).map(|i| 0.1 * f64::from(i)).collect();
    for kv in [0.0, 0.3] {
        let found = step_response(scalar(delay, 0.0, -kp, kv, kp), &times);
        for (t, y) in times.iter().zip(&found.outputs) {
            let truth = drone_truth(kp, kv, delay, *t);
            assert!((y - truth).abs() < 4e-15, "{kv} {t}: {y} is not {truth}");
        }
    }
}

#[test]
fn breaks_of_a_retarded_loop_fade_and_those_of_a_neutral_one_stay() {
    let times = [0.0, 40.0];
    let retarded = step_response(scalar(1.0, 0.0, -1.0, 0.0, 1.0), &times);
    assert_eq!(
        retarded.breaks,
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]
    );
    let neutral = step_response(scalar(1.0, 0.0, -1.0, 0.5, 1.0), &times);
    assert!(neutral.breaks.len() > 25, "{:?}", neutral.breaks);
}

#[test]
fn endless_work_is_refused_and_a_stop_heard() {
    let run = |delay: f64, task: &Task| {
        let system = LinearSystem::new(scalar(delay, 0.0, -1.0, 0.0, 1.0))?;
        let inputs = Signal::step(&[0.0], &[1.0])?;
        system.simulate(at_rest(1, 0.0), &inputs, &[10.0], task)
    };
    let refused = run(1e-8, &Task::new());
    assert!(matches!(refused, Err(Error::TooMuch { .. })), "{refused:?}");
    let task = Task::new();
    task.stop();
    assert_eq!(run(0.1, &task), Err(Error::Interrupted));
}

#[test]
fn what_does_not_fit_is_refused() {
    let mut equations = scalar(1.0, 0.0, -1.0, 0.0, 1.0);
    equations.state.push(term(0.5, &[1.0, 2.0]));
    assert!(LinearSystem::new(equations).is_err());
    assert!(LinearSystem::new(scalar(-1.0, 0.0, 1.0, 0.0, 1.0)).is_err());
    assert!(LinearSystem::new(scalar(0.0, 0.0, 1.0, 0.5, 1.0)).is_err());
    assert!(Signal::new(1, &[0.0, 0.0], 1, &[1.0], vec![]).is_err());
    assert!(Signal::new(1, &[0.0, f64::INFINITY], 2, &[1.0, 1.0], vec![]).is_err());
    assert!(Signal::constant(&[f64::NAN]).is_err());
}
