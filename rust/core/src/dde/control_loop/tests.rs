//! Loops through their public names: closed forms, and the methods of simulation against one
//! another.

use proptest::prelude::*;

use super::sampled;
use crate::dde::{Equations, LinearLoop, Reference, Start, Trajectory};
use crate::{Error, Task};

/// y′ = w, u = kp (r − y) − kv y′.
fn drone(kp: f64, kv: f64) -> Equations {
    Equations {
        a: vec![0.0],
        b: vec![1.0],
        e: vec![0.0],
        k: vec![-kp],
        l: -kv,
        m: kp,
        c: vec![1.0],
        ..Equations::default()
    }
}

/// A lag of time constant `lag` in front of the integrator.
fn lagged(kp: f64, lag: f64) -> Equations {
    Equations {
        a: vec![0.0, 1.0, 0.0, -1.0 / lag],
        b: vec![0.0, 1.0 / lag],
        e: vec![0.0; 2],
        k: vec![-kp, 0.0],
        l: 0.0,
        m: kp,
        c: vec![1.0, 0.0],
        ..Equations::default()
    }
}

fn at_rest(plant: &LinearLoop) -> Start {
    Start {
        state: vec![0.0; plant.equations().states()],
        ..Start::default()
    }
}

fn try_step(plant: &LinearLoop, times: &[f64], task: &Task) -> Result<Trajectory, Error> {
    let reference = Reference::step(0.0, 1.0)?;
    plant.simulate(&at_rest(plant), &reference, times, times, task)
}

fn step(plant: &LinearLoop, times: &[f64]) -> Trajectory {
    try_step(plant, times, &Task::new()).unwrap()
}

fn grid(end: f64, n: u32) -> Vec<f64> {
    (0..=n).map(|i| end * f64::from(i) / f64::from(n)).collect()
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

#[test]
fn the_first_two_delays_of_a_step_are_polynomials() {
    let (kp, td) = (1.31, 0.36);
    let plant = LinearLoop::new(drone(kp, 0.0), td, None, None).unwrap();
    let times = [0.0, 0.2, 0.36, 0.5, 0.72, 0.9, 1.08];
    let truth = times.map(|t: f64| {
        let (a, b) = ((t - td).max(0.0), (t - 2.0 * td).max(0.0));
        kp * a - kp * kp * b * b / 2.0
    });
    assert!(apart(&step(&plant, &times).outputs, &truth) < 4e-16);
}

#[test]
fn a_continuous_loop_without_delay_is_the_exponential() {
    let plant = LinearLoop::new(drone(2.0, 0.5), 0.0, None, None).unwrap();
    let times = grid(5.0, 50);
    // y′ (1 + kv) = kp (1 − y).
    let truth: Vec<f64> = times.iter().map(|t| -(-2.0 / 1.5 * t).exp_m1()).collect();
    assert!(apart(&step(&plant, &times).outputs, &truth) < 4e-16);
}

#[test]
fn a_limited_loop_without_delay_runs_at_the_limit_and_then_settles() {
    let plant = LinearLoop::new(drone(4.0, 0.0), 0.0, None, Some(1.0)).unwrap();
    let found = step(&plant, &grid(3.0, 60));
    // At the limit until 4 (1 − y) = 1, that is y = 3/4 at t = 3/4.
    let settling = |t: f64| 1.0 - 0.25 * (-4.0 * (t - 0.75)).exp();
    let truth = |t: f64| if t < 0.75 { t } else { settling(t) };
    let truth: Vec<f64> = grid(3.0, 60).into_iter().map(truth).collect();
    assert!(apart(&found.outputs, &truth) < 1e-15);
    assert_eq!(found.output_breaks.len(), 1);
    assert!((found.output_breaks[0] - 0.75).abs() < 1e-15);
}

#[test]
fn an_algebraic_loop_that_nothing_satisfies_is_refused() {
    let plant = LinearLoop::new(drone(1.0, -1.0), 0.0, None, None).unwrap();
    let error = try_step(&plant, &[1.0], &Task::new()).unwrap_err();
    assert!(error.to_string().contains("L = 1"), "{error}");
}

#[test]
fn a_vanishing_delay_tends_to_none() {
    let times = grid(3.0, 30);
    let none = LinearLoop::new(drone(2.0, 0.0), 0.0, None, Some(1.0)).unwrap();
    let some = LinearLoop::new(drone(2.0, 0.0), 1e-4, None, Some(1.0)).unwrap();
    // First order in the delay: slope at most 1.
    assert!(apart(&step(&none, &times).outputs, &step(&some, &times).outputs) < 3e-4);
}

#[test]
fn neutral_jumps_travel() {
    let (kp, kv, td) = (2.0, 0.3, 0.36);
    let plant = LinearLoop::new(drone(kp, kv), td, None, None).unwrap();
    let times: Vec<f64> = (0..6).map(|k| f64::from(k) * td + 1e-13).collect();
    let found = step(&plant, &times);
    // The slope of y jumps by kp (−kv)^k at (k + 1) td, and with it the command one delay later.
    let mut command = kp;
    let mut jump = kp;
    assert!((found.inputs[0] - command).abs() < 1e-12);
    let before = step(&plant, &[td - 1e-13, 2.0 * td - 1e-13]);
    jump *= -kv;
    command = before.inputs[0] + jump;
    assert!((found.inputs[1] - command).abs() < 1e-11);
    jump *= -kv;
    command = before.inputs[1] + jump;
    assert!((found.inputs[2] - command).abs() < 1e-11);
    assert_eq!(found.output_breaks.len(), 5);
}

#[test]
fn an_unstable_loop_says_when_it_left_the_numbers() {
    let plant = LinearLoop::new(drone(30.0, 0.0), 0.36, None, None).unwrap();
    let error = try_step(&plant, &[1e4], &Task::new()).unwrap_err();
    let told = error.to_string().contains("exceeds 1e150 at t =");
    assert!(told, "{error}");
}

#[test]
fn a_stopped_task_stops_the_run() {
    let plant = LinearLoop::new(drone(1.0, 0.0), 1e-6, None, None).unwrap();
    let task = Task::new();
    task.stop();
    assert_eq!(try_step(&plant, &[1.0], &task), Err(Error::Interrupted));
}

#[test]
fn references_that_jump_at_the_pace_of_the_delay_leave_no_dust() {
    let td = 0.36;
    let jumps: Vec<f64> = (0..200).map(|i| f64::from(i) * td).collect();
    let levels: Vec<f64> = (0..200).map(|i| f64::from(i % 2)).collect();
    let reference = Reference::new(0.0, jumps, levels).unwrap();
    let plant = LinearLoop::new(drone(1.31, 0.0), td, None, Some(1.0)).unwrap();
    let times = grid(72.0, 100);
    let found = plant
        .simulate(&at_rest(&plant), &reference, &times, &times, &Task::new())
        .unwrap();
    let gaps = found
        .output_breaks
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .fold(f64::INFINITY, f64::min);
    assert!(gaps > 1e-9, "two breaks {gaps} apart");
}

#[test]
fn bad_numbers_are_refused_by_name() {
    let build = |delay, sample_time, limit| {
        LinearLoop::new(drone(1.0, 0.0), delay, sample_time, limit)
            .unwrap_err()
            .to_string()
    };
    assert!(build(-0.1, None, None).starts_with("delay=-0.1"));
    assert!(build(f64::NAN, None, None).starts_with("delay=NaN"));
    assert!(build(0.1, Some(0.0), None).starts_with("sample_time=0"));
    assert!(build(0.1, None, Some(-1.0)).starts_with("limit=-1"));
    let mut uneven = drone(1.0, 0.0);
    uneven.k.push(1.0);
    assert!(LinearLoop::new(uneven, 0.1, None, None).is_err());
    assert!(Reference::new(0.0, vec![1.0, 0.5], vec![1.0, 2.0]).is_err());
}

proptest! {
    /// y at the samples equals the powers of the transition matrix times the initial state.
    #[test]
    fn the_transition_matrix_is_the_simulation(
        (kp, kv, lag) in (0.2..3.0, -0.4..0.4_f64, 0.05..1.0),
        (delay, sample_time) in (0.0..0.8, 0.03..0.4),
        state in prop::collection::vec(-1.0..1.0, 2),
    ) {
        let mut equations = lagged(kp, lag);
        equations.k[1] = -kv;
        let plant = LinearLoop::new(equations, delay, Some(sample_time), None).unwrap();
        let (matrix, size) = sampled::transition_matrix(&plant).unwrap();
        let times: Vec<f64> = (0..12).map(|k| f64::from(k) * sample_time).collect();
        let start = Start { state: state.clone(), ..Start::default() };
        let reference = Reference::new(0.0, vec![], vec![]).unwrap();
        let found = plant.simulate(&start, &reference, &times, &times, &Task::new()).unwrap();
        let mut z = vec![0.0; size];
        z[..2].copy_from_slice(&state);
        for y in &found.outputs {
            prop_assert!((z[0] - y).abs() < 1e-12 * (1.0 + y.abs()) * 10.0, "{} {}", z[0], y);
            z = matrix
                .chunks(size)
                .map(|row| row.iter().zip(&z).map(|(a, b)| a * b).sum())
                .collect();
        }
    }

    /// The response tends to that in continuous time as the sample time goes to zero.
    #[test]
    fn fast_sampling_tends_to_continuous_time(
        (kp, lag, delay) in (0.3..2.0, 0.05..0.5, 0.05..0.5),
        limit in prop::option::of(0.5..3.0),
    ) {
        let times = grid(4.0, 20);
        let smooth = LinearLoop::new(lagged(kp, lag), delay, None, limit).unwrap();
        let truth = step(&smooth, &times).outputs;
        let error = |sample_time: f64| {
            let held = LinearLoop::new(lagged(kp, lag), delay, Some(sample_time), limit).unwrap();
            apart(&step(&held, &times).outputs, &truth)
        };
        let (coarse, fine) = (error(2e-3), error(1e-3));
        prop_assert!(coarse < 0.02);
        // The hold delays by half a sample: the difference is of first order.
        prop_assert!(fine < 0.65 * coarse + 1e-9, "{coarse} {fine}");
    }

    /// The response does not depend on the output times.
    #[test]
    fn outputs_do_not_depend_on_their_neighbours(
        (kp, lag, delay) in (0.3..4.0, 0.02..0.5, 0.0..0.5),
        sample_time in prop::option::of(0.02..0.3),
        limit in prop::option::of(0.3..3.0),
        pick in 0_usize..60,
    ) {
        let plant = LinearLoop::new(lagged(kp, lag), delay, sample_time, limit).unwrap();
        let times = grid(3.0, 60);
        let all = step(&plant, &times);
        let one = step(&plant, &times[pick..=pick]);
        // Elements never end at output times, so that the same sums are computed.
        prop_assert_eq!(all.outputs[pick].to_bits(), one.outputs[0].to_bits());
        prop_assert_eq!(all.inputs[pick].to_bits(), one.inputs[0].to_bits());
    }
}
