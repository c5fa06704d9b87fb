//! Rows of a recording whitened by one Kalman pass.
//!
//! The rows are y_i = μ_i + C x(t_i) + v_i with the disturbance x of `Joint` and white v of unit
//! variance. The filter turns any column z of n rows into its normalised innovations L⁻¹ z, where
//! L Lᵀ = V is the covariance of the rows: whitened columns have the inner products zᵀ V⁻¹ w, and
//! Σ ln S_i = ln det V (Harvey 1989, section 3.4). All columns see the same covariance, so the gains
//! are computed once. The work is linear in the rows; on rows of equal spacing the gain converges
//! and is kept.

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
        "{} times and columns of {} values in total are given: give each column one value for \
         each time",
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
        n => refuse!("plant and noise have {n} states, but the likelihood can use at most 8"),
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
        let length = time.len();
        // Registers that share the work on the covariance.
        let registers = match columns.len() {
            _ if S::IS_SCALAR => 4,
            few if few <= S::F64_LANES * length => 1,
            _ => 2,
        };
        for group in columns.chunks_mut(registers * S::F64_LANES * length) {
            log_det = if S::IS_SCALAR {
                pass::<S, N, 4>(simd, time, known, group, joint, kicks, task)?
            } else if registers == 1 {
                pass::<S, N, 1>(simd, time, known, group, joint, kicks, task)?
            } else {
                pass::<S, N, 2>(simd, time, known, group, joint, kicks, task)?
            };
        }
        Ok(log_det)
    }
}

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
            transposed::<S, K>(&mut block, columns, rows, row, Way::ToLanes);
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
                        moved[i][k] = simd.mul_add_f64s(phi, states[j][k], moved[i][k]);
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
                    innovation = simd.negate_mul_add_f64s(c, states[i][k], innovation);
                }
                for i in 0..N {
                    let gain = simd.splat_f64s(gain[i]);
                    states[i][k] = simd.mul_add_f64s(gain, innovation, states[i][k]);
                }
                block[place][k] = simd.mul_f64s(innovation, scale);
            }
        } else {
            block[place] = zero;
        }
        if place == BLOCK - 1 || row == rows - 1 {
            let first = row - place;
            transposed::<S, K>(&mut block, columns, rows, first, Way::ToColumns);
        }
    }
    Ok(log_det + large.ln())
}

/// Which way a block is copied.
#[derive(Clone, Copy)]
enum Way {
    ToLanes,
    ToColumns,
}

/// Copy between the columns, from a row on, and the lanes of a block.
#[cfg_attr(not(target_family = "wasm"), inline(always))]
fn transposed<S: Simd, const K: usize>(
    block: &mut [[S::f64s; K]; BLOCK],
    columns: &mut [f64],
    rows: usize,
    first: usize,
    way: Way,
) {
    let last = rows.min(first + BLOCK);
    let lanes = K * S::F64_LANES;
    let block = cast_slice_mut::<_, f64>(block.as_flattened_mut());
    for (column, entries) in columns.chunks_exact_mut(rows).enumerate() {
        let places = block.chunks_exact_mut(lanes);
        for (entry, lane) in entries[first..last].iter_mut().zip(places) {
            match way {
                Way::ToLanes => lane[column] = *entry,
                Way::ToColumns => *entry = lane[column],
            }
        }
    }
}

#[cfg(test)]
mod tests;
