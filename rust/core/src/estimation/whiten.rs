//! Rows of a recording whitened by one Kalman pass.
//!
//! The rows are y_i = μ_i + C x(t_i) + v_i with the disturbance x of `Joint` and white v of unit
//! variance. The filter turns any column z of n rows into its normalised innovations L⁻¹ z, where
//! L Lᵀ = V is the covariance of the rows: whitened columns have the inner products zᵀ V⁻¹ w, and
//! Σ ln S_i = ln det V (Harvey 1989, section 3.4). All columns see the same covariance, so the gains
//! are computed once. The work is linear in the rows; on rows of equal spacing the gain converges
//! and is kept.
//!
//! Nearly half of the file is its tests, which compare with dense matrices.

use pulp::bytemuck::cast_slice_mut;
use pulp::{Simd, WithSimd};

use super::disturbance::{Disturbance, Joint};
use super::kept::{Kept, SAME, SAME_STEP};
use super::path::{SETTLED, settled};
use super::plant::{MOST_STATES, Plant};
use super::propagation::{Propagation, Square};
use super::rows::check_times;
use crate::simd::Instructions;
use crate::{Error, Task};

/// Change of the covariance of the states from row to row, as a share of their deviations, below
/// which the gain has converged. All states count: weak air shows in the variance of a row long
/// after its start.
const CONVERGED: f64 = 1e-13;

/// Rows between two checks for a stop.
const CHECKED: usize = 4096;

/// Steps from row to row that differ by less than this share of the time and of the step are one.
pub(super) const SAME_ROWS: (f64, f64) = (SAME, SAME_STEP);

/// Largest product of variances of which the logarithm is taken together.
pub(super) const LARGE: f64 = 1e140;

/// Columns, one after the other and each as long as `time`, whitened by disturbances of a plant and
/// white noise of variance one.
///
/// # Errors
///
/// If sizes do not fit, times do not increase, or a number of a disturbance is out of its range.
pub fn whiten(
    time: &[f64],
    mut columns: Vec<f64>,
    plant: &Plant,
    disturbances: &[Disturbance],
    task: &Task,
) -> Result<Vec<f64>, Error> {
    refuse_if!(
        time.is_empty() || !columns.len().is_multiple_of(time.len()),
        "{} times and columns of {} values in all: give each column as many values as times",
        time.len(),
        columns.len()
    );
    check_times("time", time)?;
    let joint = Joint::new(&plant.space(&[], 0.0), disturbances)?;
    // Without any state the noise is white.
    if !joint.c.is_empty() {
        let used = crate::memory::filled("marks of use", true, time.len())?;
        let known = Known {
            used: &used,
            variances: &[],
        };
        whiten_in_place(time, known, &mut columns, &joint, &[], task)?;
    }
    Ok(columns)
}

/// A random change of the states of the plant just before a row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kick {
    pub(super) row: usize,
    /// Its standard deviation, state by state, zero beyond the last: one random number moves all.
    pub(super) state: [f64; MOST_STATES],
}

/// What is known of each row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known<'a> {
    /// Rows that are not used have no part.
    pub(super) used: &'a [bool],
    /// Variance of the white noise; empty where it is one.
    pub(super) variances: &'a [f64],
}

/// Rows whose columns are brought into lanes together.
const BLOCK: usize = 64;

/// Whiten the columns in place; rows that are not `used` become zero. Returns ln det V.
pub(super) fn whiten_in_place(
    time: &[f64],
    known: Known<'_>,
    columns: &mut [f64],
    joint: &Joint,
    kicks: &[Kick],
    task: &Task,
) -> Result<f64, Error> {
    let set = Instructions::chosen();
    macro_rules! run {
        ($states:literal) => {
            set.run(Passes::<$states> {
                time,
                known,
                columns,
                joint,
                kicks,
                task,
            })
        };
    }
    match joint.c.len() {
        0 => run!(0),
        1 => run!(1),
        2 => run!(2),
        3 => run!(3),
        4 => run!(4),
        5 => run!(5),
        6 => run!(6),
        7 => run!(7),
        8 => run!(8),
        n => refuse!("{n} states of plant and noise: the likelihood takes up to 8"),
    }
}

/// Passes with N states over a column in each lane. The same operations in the same order whatever
/// the registers of the machine.
struct Passes<'a, const N: usize> {
    time: &'a [f64],
    known: Known<'a>,
    columns: &'a mut [f64],
    joint: &'a Joint,
    kicks: &'a [Kick],
    task: &'a Task,
}

impl<const N: usize> WithSimd for Passes<'_, N> {
    type Output = Result<f64, Error>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self {
            time,
            known,
            columns,
            joint,
            kicks,
            task,
        } = self;
        let mut log_det = 0.0;
        // Where registers are short two of them share the work on the covariance.
        let is_wide = S::F64_LANES >= WIDE || columns.len() <= S::F64_LANES * time.len();
        let lanes = if is_wide { 1 } else { 2 } * S::F64_LANES;
        for group in columns.chunks_mut(lanes * time.len()) {
            log_det = if is_wide {
                pass::<S, N, 1>(simd, time, known, group, joint, kicks, task)?
            } else {
                pass::<S, N, 2>(simd, time, known, group, joint, kicks, task)?
            };
        }
        Ok(log_det)
    }
}

/// Lanes of a register that are enough for the columns of a plant.
const WIDE: usize = 8;

fn square<const N: usize>(flat: &[f64]) -> Square<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| flat[i * N + j]))
}

/// Is the covariance of a row that of the row before, but for rounding?
fn has_converged<const N: usize>(p: &Square<N>, before: &Square<N>) -> bool {
    (0..N).all(|i| {
        (0..=i).all(|j| {
            let change = p[i][j] - before[i][j];
            change * change <= CONVERGED * CONVERGED * p[i][i] * p[j][j]
        })
    })
}

/// One pass with N states over a column in each lane of K registers.
#[expect(
    clippy::needless_range_loop,
    reason = "entries of two matrices by the same numbers"
)]
#[inline(always)]
fn pass<S: Simd, const N: usize, const K: usize>(
    simd: S,
    time: &[f64],
    known: Known<'_>,
    columns: &mut [f64],
    joint: &Joint,
    kicks: &[Kick],
    task: &Task,
) -> Result<f64, Error> {
    let rows = time.len();
    let zero = [simd.splat_f64s(0.0); K];
    let mut block = [zero; BLOCK];
    let mut c = [0.0; N];
    c.copy_from_slice(&joint.c);
    let mut states = [zero; N];
    let mut p = square::<N>(&joint.start);
    let (a, noise) = (square::<N>(&joint.a), square::<N>(&joint.noise));
    let mut steps = Kept::new();
    let mut gain = [0.0; N];
    let (mut step, mut steady) = (f64::NAN, false);
    // The covariance of the row before, if that was used and as far away as this one.
    let mut before = None;
    let (mut factor, mut variance, mut large, mut log_det) = (0.0, 1.0, 1.0, 0.0);
    let mut kicks = kicks.iter().peekable();
    for row in 0..rows {
        if row % CHECKED == CHECKED - 1 {
            task.check()?;
        }
        if row % SETTLED as usize == 0 {
            for state in cast_slice_mut::<_, f64>(states.as_flattened_mut()) {
                *state = settled(*state);
            }
        }
        if row % BLOCK == 0 {
            transposed::<S, K>(&mut block, columns, rows, row, |lane, entry| *lane = *entry);
        }
        let place = row % BLOCK;
        if row > 0 {
            let between = time[row] - time[row - 1];
            let tolerance = SAME_ROWS.0 * time[row].abs() + SAME_ROWS.1 * between;
            // No step is known before the first.
            if step.is_nan() || (between - step).abs() > tolerance {
                (step, steady, before) = (between, false, None);
            }
            if !known.used[row] || kicks.peek().is_some_and(|kick| kick.row <= row) {
                (steady, before) = (false, None);
            }
            let by_step = steps.at(step, time[row], || Propagation::new(&a, &noise, step));
            if !steady {
                p = by_step.predicted(&p);
            }
            while let Some(kick) = kicks.next_if(|kick| kick.row <= row) {
                for (p, left) in p.iter_mut().zip(&kick.state) {
                    for (p, right) in p.iter_mut().zip(&kick.state) {
                        *p += left * right;
                    }
                }
            }
            let mut moved = [zero; N];
            for i in 0..N {
                for j in 0..N {
                    let phi = simd.splat_f64s(by_step.phi[i][j]);
                    for k in 0..K {
                        moved[i][k] = simd.mul_add_e_f64s(phi, states[j][k], moved[i][k]);
                    }
                }
            }
            states = moved;
        }
        if known.used[row] {
            let white = known.variances.get(row).copied().unwrap_or(1.0);
            if !steady {
                steady = known.variances.is_empty()
                    && before.is_some_and(|before| has_converged(&p, &before));
                before = Some(p);
                let mut pc = [0.0; N];
                variance = white;
                for i in 0..N {
                    for j in 0..N {
                        pc[i] += p[i][j] * c[j];
                    }
                    variance += pc[i] * c[i];
                }
                let inverse = 1.0 / variance;
                factor = inverse.sqrt();
                gain = pc.map(|pc| pc * inverse);
                for i in 0..N {
                    for j in 0..N {
                        p[i][j] -= pc[i] * gain[j];
                    }
                }
            }
            if large * variance < LARGE {
                large *= variance;
            } else {
                log_det += large.ln() + variance.ln();
                large = 1.0;
            }
            let scale = simd.splat_f64s(factor);
            for k in 0..K {
                let mut innovation = block[place][k];
                for i in 0..N {
                    let c = simd.splat_f64s(c[i]);
                    innovation = simd.negate_mul_add_e_f64s(c, states[i][k], innovation);
                }
                for i in 0..N {
                    let gain = simd.splat_f64s(gain[i]);
                    states[i][k] = simd.mul_add_e_f64s(gain, innovation, states[i][k]);
                }
                block[place][k] = simd.mul_f64s(innovation, scale);
            }
        } else {
            block[place] = zero;
        }
        if place == BLOCK - 1 || row == rows - 1 {
            let first = row - place;
            transposed::<S, K>(&mut block, columns, rows, first, |lane, entry| {
                *entry = *lane
            });
        }
    }
    Ok(log_det + large.ln())
}

/// Copy between the columns, from a row on, and the lanes of a block.
#[inline(always)]
fn transposed<S: Simd, const K: usize>(
    block: &mut [[S::f64s; K]; BLOCK],
    columns: &mut [f64],
    rows: usize,
    first: usize,
    copy: impl Fn(&mut f64, &mut f64),
) {
    let last = rows.min(first + BLOCK);
    let lanes = K * S::F64_LANES;
    let block = cast_slice_mut::<_, f64>(block.as_flattened_mut());
    for (column, entries) in columns.chunks_exact_mut(rows).enumerate() {
        let places = block.chunks_exact_mut(lanes);
        for (entry, lane) in entries[first..last].iter_mut().zip(places) {
            copy(&mut lane[column], entry);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::disturbance::Entry;
    use super::super::path::dot;
    use super::super::tests::{cholesky, coloured, forward, gaussian, integrated, log_det};
    use super::*;

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
            Entry::Input => {
                integrated(part.deviation, part.time_constant, s - time[0], t - time[0])
            }
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
                    .map(|t| {
                        f64::from(u8::from(s == t)) + start - drift * drift * (t - s).abs() / 2.0
                    })
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
}
