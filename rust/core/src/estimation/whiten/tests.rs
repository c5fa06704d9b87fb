//! Compares with dense matrices.

use super::super::disturbance::Entry;
use super::super::tests::{cholesky, coloured, forward, gaussian, integrated, log_det};
use super::*;
use crate::linear_algebra::vectors::dot;

const AIR: Disturbance = Disturbance {
    entry: Entry::Input,
    time_constant: 0.8,
    deviation: 3.0,
};
const SENSOR: Disturbance = Disturbance {
    entry: Entry::Output,
    time_constant: 0.15,
    deviation: 0.7,
};

fn joint(den: &[f64], disturbances: &[Disturbance]) -> Joint {
    let space = Plant::new(&[1.0], den).unwrap().space(&[], 0.0);
    Joint::new(&space, disturbances).unwrap()
}

/// The covariance of an integrator that starts at the first row, behind air; and coloured noise.
fn covariance(time: &[f64], disturbances: &[Disturbance]) -> Vec<Vec<f64>> {
    let one = |s: f64, t: f64, part: &Disturbance| match part.entry {
        Entry::Input => integrated(part.deviation, part.time_constant, s - time[0], t - time[0]),
        Entry::Output => coloured(part.deviation, part.time_constant, s, t),
    };
    let row = |s: f64| -> Vec<f64> {
        time.iter()
            .map(|t| {
                f64::from(u8::from(s == *t))
                    + disturbances
                        .iter()
                        .map(|part| one(s, *t, part))
                        .sum::<f64>()
            })
            .collect()
    };
    time.iter().map(|s| row(*s)).collect()
}

/// Whitened columns have the inner products and the determinant of this covariance.
fn compare(time: &[f64], used: &[bool], joint: &Joint, kicks: &[Kick], v: &[Vec<f64>]) {
    let (rows, count) = (time.len(), 11);
    let columns: Vec<Vec<f64>> = (0..count).map(|j| gaussian(j + 1, rows)).collect();
    let mut flat = columns.concat();
    let known = Known {
        used,
        variances: &[],
    };
    let found = whiten_in_place(time, known, &mut flat, joint, kicks, &Task::new()).unwrap();
    let only = |x: &[f64]| -> Vec<f64> {
        x.iter()
            .zip(used)
            .filter(|(_, used)| **used)
            .map(|(x, _)| *x)
            .collect()
    };
    let kept: Vec<Vec<f64>> = v
        .iter()
        .zip(used)
        .filter(|(_, used)| **used)
        .map(|(row, _)| only(row))
        .collect();
    let l = cholesky(&kept);
    assert!((found - log_det(&l)).abs() < 1e-9 * log_det(&l).abs().max(1.0));
    let expected: Vec<Vec<f64>> = columns.iter().map(|z| forward(&l, &only(z))).collect();
    for (found, left) in flat.chunks_exact(rows).zip(&expected) {
        assert!(
            found
                .iter()
                .zip(used)
                .all(|(entry, used)| *used || *entry == 0.0)
        );
        for (other, right) in flat.chunks_exact(rows).zip(&expected) {
            let product = dot(left, right);
            assert!((dot(found, other) - product).abs() < 1e-9 * product.abs().max(1.0));
        }
        for (found, expected) in only(found).iter().zip(left) {
            assert!((found - expected).abs() < 1e-9);
        }
    }
}

fn even(rows: usize) -> Vec<f64> {
    (0..rows).map(|i| 5.0 + 0.065 * i as f64).collect()
}

fn irregular(rows: usize) -> Vec<f64> {
    let noise = gaussian(77, rows);
    (0..rows)
        .map(|i| 0.065 * i as f64 + 0.01 * noise[i].clamp(-3.0, 3.0))
        .collect()
}

/// Marks of use: a hole, single rows here and there, the first row.
fn lost(rows: usize) -> Vec<bool> {
    (0..rows)
        .map(|i| !(i == 0 || i % 17 == 5 || (60..75).contains(&i) || i == 170 || i == 171))
        .collect()
}

#[test]
fn whitened_columns_have_the_products_of_the_dense_covariance() {
    for time in [even(200), irregular(200)] {
        for used in [vec![true; 200], lost(200)] {
            for parts in [&[AIR] as &[_], &[SENSOR], &[AIR, SENSOR]] {
                let v = covariance(&time, parts);
                compare(&time, &used, &joint(&[1.0, 0.0], parts), &[], &v);
            }
        }
    }
}

#[test]
fn a_row_lost_after_the_gain_has_converged_is_predicted_over() {
    let time = even(200);
    let used: Vec<bool> = (0..200).map(|i| i != 150 && i != 180 && i != 181).collect();
    let parts = [AIR];
    compare(
        &time,
        &used,
        &joint(&[1.0, 0.0], &parts),
        &[],
        &covariance(&time, &parts),
    );
}

#[test]
fn slow_air_is_a_random_walk_of_the_rate() {
    // With τ beyond all rows the air is a constant of its own deviation and a random walk.
    let (tau, drift) = (1e7, 1e-2);
    let time = irregular(60);
    let slow = Disturbance {
        time_constant: tau,
        deviation: drift * (tau / 2.0_f64).sqrt(),
        entry: Entry::Output,
    };
    let v: Vec<Vec<f64>> = time
        .iter()
        .map(|s| {
            let start = slow.deviation * slow.deviation;
            // e^{−|t − s|/τ} is 1 − |t − s|/τ to 1e-14.
            time.iter()
                .map(|t| f64::from(u8::from(s == t)) + start - drift * drift * (t - s).abs() / 2.0)
                .collect()
        })
        .collect();
    compare(&time, &[true; 60], &joint(&[1.0], &[slow]), &[], &v);
}

#[test]
fn weak_air_counts_from_the_first_row_to_the_last() {
    // ln det (1 + K) is the trace of a small K. Each row adds 1e-14 at first and 1e-7 at last.
    let time = even(3000);
    let weak = Disturbance {
        time_constant: 1e4,
        deviation: 1.5e-6,
        entry: Entry::Input,
    };
    let trace: f64 = time
        .iter()
        .map(|t| integrated(1.5e-6, 1e4, t - time[0], t - time[0]))
        .sum();
    let mut column = gaussian(1, 3000);
    let found = whiten_in_place(
        &time,
        Known {
            used: &[true; 3000],
            variances: &[],
        },
        &mut column,
        &joint(&[1.0, 0.0], &[weak]),
        &[],
        &Task::new(),
    );
    assert!((found.unwrap() / trace - 1.0).abs() < 1e-4);
}

#[test]
fn the_error_of_a_command_moves_all_later_rows() {
    let time = even(150);
    let kick = |row, size| {
        let mut state = [0.0; MOST_STATES];
        state[0] = size;
        Kick { row, state }
    };
    let kicks = [kick(40, 0.6), kick(40, 0.8), kick(120, 2.0)];
    for parts in [&[] as &[_], &[AIR]] {
        let mut v = covariance(&time, parts);
        for kick in &kicks {
            for row in &mut v[kick.row..] {
                for entry in &mut row[kick.row..] {
                    *entry += kick.state[0] * kick.state[0];
                }
            }
        }
        for used in [vec![true; 150], lost(150)] {
            compare(&time, &used, &joint(&[1.0, 0.0], parts), &kicks, &v);
        }
    }
}

#[test]
fn a_column_that_the_air_explains_decays_to_zero() {
    let joint = joint(&[1.0, 0.0], &[AIR]);
    let mut column = vec![0.0; 5000];
    column[0] = 1.0;
    whiten_in_place(
        &even(5000),
        Known {
            used: &[true; 5000],
            variances: &[],
        },
        &mut column,
        &joint,
        &[],
        &Task::new(),
    )
    .unwrap();
    assert!(column.iter().all(|x| !x.is_subnormal()));
    assert_eq!(column[4999], 0.0);
}

#[test]
fn columns_of_another_length_and_times_that_do_not_increase_are_refused() {
    let plant = Plant::new(&[1.0], &[1.0, 0.0]).unwrap();
    let refusal = |time: &[f64], columns: Vec<f64>| {
        whiten(time, columns, &plant, &[AIR], &Task::new())
            .unwrap_err()
            .to_string()
    };
    assert!(refusal(&[0.0, 1.0], vec![1.0; 3]).starts_with("2 times and columns of 3"));
    assert!(refusal(&[], Vec::new()).starts_with("0 times"));
    assert!(refusal(&[0.0, f64::NAN], vec![1.0; 2]).contains("a time is NaN"));
    assert!(refusal(&[1.0, 1.0], vec![1.0; 2]).contains("the time 1 follows 1"));
    let none = Plant::new(&[1.0], &[1.0]).unwrap();
    let white = whiten(&[0.0, 1.0], vec![2.0, 3.0], &none, &[], &Task::new());
    assert_eq!(white, Ok(vec![2.0, 3.0]));
}

#[test]
fn more_states_than_the_kernel_takes_are_refused() {
    let joint = joint(&[1.0; 9], &[AIR]);
    let found = whiten_in_place(
        &[0.0, 1.0],
        Known {
            used: &[true; 2],
            variances: &[],
        },
        &mut [1.0, 2.0],
        &joint,
        &[],
        &Task::new(),
    );
    assert!(found.is_err_and(|error| error.to_string().contains("9 states")));
}
