//! The response in elements that are equal parts of the delay.

use super::super::modes;
use super::*;
use crate::dde::Equations;
use proptest::prelude::*;

const DELAY: f64 = 0.3;

fn found(
    plant: &LinearLoop,
    start: &Start,
    reference: &Reference,
    times: [&[f64]; 2],
    instructions: Option<Instructions>,
) -> Option<Trajectory> {
    let task = Task::new();
    let mut requested = RequestedOutput::new(times[0], times[1], 0.0).unwrap();
    let Some(instructions) = instructions else {
        return Some(modes::run(plant, start, reference, requested, &task).unwrap());
    };
    let is_stored = run(instructions, plant, start, reference, &mut requested, &task);
    is_stored.unwrap().then_some(requested.trajectory)
}

/// Largest of the values and one.
fn size(values: &[f64]) -> f64 {
    values.iter().fold(1.0, |most, value| most.max(value.abs()))
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()))
}

proptest! {
    /// The general method gives the same response, and every instruction set the same bits.
    #[test]
    fn it_is_the_response_of_the_general_method(
        n in 1_usize..=3,
        numbers in prop::collection::vec(-2.0..2.0_f64, 32),
        (is_integrator, is_direct, is_same, parts) in (any::<bool>(), any::<bool>(), any::<bool>(), 0.5..4.0),
    ) {
        let at = |first: usize, count: usize| numbers[first..first + count].to_vec();
        let mut a: Vec<f64> = at(0, n * n).iter().map(|a| a * parts).collect();
        if is_integrator && n == 1 {
            a[0] = 0.0;
        }
        let equations = Equations {
            a,
            b: at(9, n),
            e: at(12, n),
            k: at(15, n),
            c: at(18, n),
            l: if is_direct { 0.4 * numbers[21] } else { 0.0 },
            m: numbers[22],
            d: if is_direct { numbers[23] } else { 0.0 },
            ..Equations::default()
        };
        let plant = LinearLoop::new(equations, DELAY, None, None).unwrap();
        let start = Start { state: at(24, n), command: numbers[27], ..Start::default() };
        let times: Vec<f64> = (0..=40).map(|i| 0.05 * f64::from(i)).collect();
        let later: Vec<f64> = times.iter().map(|t| t + DELAY).collect();
        let times = [if is_same { &times[..] } else { &later[..] }, &times[..]];
        let reference = Reference::step(0.2, 1.0).unwrap();
            let truth = found(&plant, &start, &reference, times, None).unwrap();
        // What is rounded grows like a state that starts elsewhere, though the response need not.
        let mut rounding = [1e-14 * size(&truth.outputs), 1e-14 * size(&truth.inputs)];
        for i in 0..n {
            let mut moved = start.clone();
            moved.state[i] += 1e-14;
            let moved = found(&plant, &moved, &reference, times, None).unwrap();
            rounding[0] += apart(&moved.outputs, &truth.outputs);
            rounding[1] += apart(&moved.inputs, &truth.inputs);
        }
        let mut bits = None;
        for instructions in Instructions::available() {
            let Some(here) = found(&plant, &start, &reference, times, Some(instructions)) else {
                prop_assert!(bits.is_none());
                continue;
            };
            prop_assert!(apart(&here.outputs, &truth.outputs) < 10.0 * rounding[0]);
            prop_assert!(apart(&here.inputs, &truth.inputs) < 10.0 * rounding[1]);
            prop_assert_eq!(here.output_breaks.len(), truth.output_breaks.len());
            prop_assert_eq!(here.input_breaks.len(), truth.input_breaks.len());
            let breaks = apart(&here.output_breaks, &truth.output_breaks);
            prop_assert!(breaks < 1e-14 * size(&truth.output_breaks));
            let found = [here.outputs, here.inputs].map(|values| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
            let first = bits.get_or_insert(found.clone());
            prop_assert_eq!(&found, first);
        }
    }
}

#[test]
fn what_moves_or_jumps_later_is_left_to_the_general_method() {
    let equations = |impulse| Equations {
        a: vec![0.0],
        b: vec![1.0],
        e: vec![0.0],
        k: vec![-1.3],
        m: 1.3,
        c: vec![1.0],
        impulse,
        ..Equations::default()
    };
    let start = Start {
        state: vec![0.0],
        ..Start::default()
    };
    let is_stored = |impulse, limit, reference: Reference| {
        let plant = LinearLoop::new(equations(impulse), DELAY, None, limit).unwrap();
        let mut requested = RequestedOutput::new(&[0.0, 1.0], &[], 0.0).unwrap();
        let chosen = Instructions::chosen();
        run(
            chosen,
            &plant,
            &start,
            &reference,
            &mut requested,
            &Task::new(),
        )
        .unwrap()
    };
    let jump = |time| Reference::new(0.0, vec![time], vec![1.0]).unwrap();
    assert!(is_stored(0.0, None, jump(0.0)));
    assert!(!is_stored(0.0, None, jump(0.5)));
    assert!(!is_stored(0.1, None, jump(0.0)));
    assert!(!is_stored(0.0, Some(1.0), jump(0.0)));
}

fn regulated(gain: f64) -> LinearLoop {
    let equations = Equations {
        a: vec![0.0],
        b: vec![1.0],
        e: vec![0.0],
        k: vec![-gain],
        m: gain,
        c: vec![1.0],
        ..Equations::default()
    };
    LinearLoop::new(equations, DELAY, None, None).unwrap()
}

#[test]
fn a_step_of_an_integrator_is_its_series_for_a_hundred_delays() {
    // 1 − y = Σ_n (−k (t − n Td))^n / n! over all n with t ≥ n Td.
    let gain = 0.2;
    let times: Vec<f64> = (0..=500).map(|i| 0.06 * f64::from(i)).collect();
    let start = Start {
        state: vec![0.0],
        ..Start::default()
    };
    let plant = regulated(gain);
    let requested = [&times[..], &times[..]];
    let reference = Reference::step(0.0, 1.0).unwrap();
    let found = found(
        &plant,
        &start,
        &reference,
        requested,
        Some(Instructions::chosen()),
    );
    for (t, y) in times.iter().zip(found.unwrap().outputs) {
        let (mut sum, mut factorial) = (0.0, 1.0);
        for n in 0..=120 {
            let left = t - f64::from(n) * DELAY;
            if left < 0.0 {
                break;
            }
            factorial *= f64::from(n.max(1));
            sum += (-gain * left).powi(n) / factorial;
        }
        assert!((1.0 - y - sum).abs() < 1e-13, "{t}: {y}, not {}", 1.0 - sum);
    }
}

#[test]
fn what_dies_away_keeps_its_digits() {
    // k Td = 1/e: the response loses a factor of e in each delay.
    let plant = regulated((-1.0_f64).exp() / DELAY);
    let start = Start {
        state: vec![1.0],
        ..Start::default()
    };
    let times: Vec<f64> = (0..=400).map(|i| 0.03 * f64::from(i)).collect();
    let reference = Reference::step(0.0, 0.0).unwrap();
    let by = |instructions| {
        let requested = [&times[..], &times[..]];
        found(&plant, &start, &reference, requested, instructions).unwrap()
    };
    let (found, truth) = (by(Some(Instructions::chosen())), by(None));
    assert!(truth.outputs[400].abs() < 1e-15);
    for (y, truth) in found.outputs.iter().zip(&truth.outputs) {
        assert!((y - truth).abs() < 1e-12 * truth.abs(), "{y}, not {truth}");
    }
}
