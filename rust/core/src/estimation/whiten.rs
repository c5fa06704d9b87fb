//! Rows of a recording whitened by one Kalman pass.
//!
//! The rows are y_i = μ_i + C x(t_i) + v_i with the disturbance x of `Joint` and white v of unit
//! variance. The filter turns any column z of n rows into its normalised innovations L⁻¹ z, where
//! L Lᵀ = V is the covariance of the rows: whitened columns have the inner products zᵀ V⁻¹ w, and
//! Σ ln S_i = ln det V (Harvey 1989, section 3.4). All columns see the same covariance, so the gains
//! are computed once. The work is linear in the rows; on rows of equal spacing the gain converges
//! and is kept.

use super::disturbance::{Disturbance, Joint};
use super::path::{SAME, SAME_STEP, dot};
use super::plant::PlantSpace;
use super::propagation::Propagation;
use crate::{Error, Task};

/// Relative change of the variance of a row below which the gain has converged.
const CONVERGED: f64 = 1e-14;

/// Rows between two checks for a stop.
const CHECKED: usize = 4096;

/// Whitened columns and the log determinant.
#[derive(Debug, Clone, PartialEq)]
pub struct Whitened {
    /// One column after the other.
    pub columns: Vec<f64>,
    /// ln det V for white noise of unit variance.
    pub log_det: f64,
}

/// Whiten `columns`, each as long as `time`, one after the other.
///
/// # Errors
///
/// If sizes do not fit, times do not increase, or a number of a disturbance is out of its range.
pub fn whiten(
    time: &[f64],
    columns: &[f64],
    plant: &PlantSpace,
    disturbances: &[Disturbance],
    task: &Task,
) -> Result<Whitened, Error> {
    refuse_if!(
        time.is_empty() || columns.len() % time.len() != 0,
        "{} times and columns of {} values in all: give each column as many values as times",
        time.len(),
        columns.len()
    );
    let wrong = time.windows(2).find(|pair| !(pair[1] > pair[0]));
    if let Some(pair) = wrong {
        refuse!(
            "the time {} follows {}: give increasing times",
            pair[1],
            pair[0]
        );
    }
    let mut columns = crate::memory::copied("the whitened columns", columns)?;
    let joint = Joint::new(plant, disturbances)?;
    let used = vec![true; time.len()];
    let log_det = whiten_in_place(time, &used, &mut columns, &joint, &[], task)?;
    Ok(Whitened { columns, log_det })
}

/// A random change of the states of the plant just before a row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kick {
    pub(super) row: usize,
    /// Its standard deviation, state by state: one random number moves all.
    pub(super) state: Vec<f64>,
}

/// Columns that are whitened together.
const LANES: usize = 8;

/// Whiten the columns in place; rows that are not `used` become zero. Returns ln det V.
pub(super) fn whiten_in_place(
    time: &[f64],
    used: &[bool],
    columns: &mut [f64],
    joint: &Joint,
    kicks: &[Kick],
    task: &Task,
) -> Result<f64, Error> {
    let mut log_det = 0.0;
    for group in columns.chunks_mut(LANES * time.len()) {
        log_det = match joint.c.len() {
            1 => pass::<1>(time, used, group, joint, kicks, task)?,
            2 => pass::<2>(time, used, group, joint, kicks, task)?,
            3 => pass::<3>(time, used, group, joint, kicks, task)?,
            4 => pass::<4>(time, used, group, joint, kicks, task)?,
            5 => pass::<5>(time, used, group, joint, kicks, task)?,
            6 => pass::<6>(time, used, group, joint, kicks, task)?,
            7 => pass::<7>(time, used, group, joint, kicks, task)?,
            8 => pass::<8>(time, used, group, joint, kicks, task)?,
            n => refuse!("{n} states of plant and noise: the likelihood takes up to 8"),
        };
    }
    Ok(log_det)
}

type Square<const N: usize> = [[f64; N]; N];

fn square<const N: usize>(flat: &[f64]) -> Square<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| flat[i * N + j]))
}

/// Φ P Φᵀ + Q.
fn predicted<const N: usize>(phi: &Square<N>, p: &Square<N>, q: &Square<N>) -> Square<N> {
    let left: Square<N> =
        std::array::from_fn(|i| std::array::from_fn(|j| (0..N).map(|k| phi[i][k] * p[k][j]).sum()));
    std::array::from_fn(|i| {
        std::array::from_fn(|j| q[i][j] + (0..N).map(|k| left[i][k] * phi[j][k]).sum::<f64>())
    })
}

/// One pass over up to `LANES` columns with N states.
fn pass<const N: usize>(
    time: &[f64],
    used: &[bool],
    columns: &mut [f64],
    joint: &Joint,
    kicks: &[Kick],
    task: &Task,
) -> Result<f64, Error> {
    let rows = time.len();
    let count = columns.len() / rows;
    let c: [f64; N] = std::array::from_fn(|i| joint.c[i]);
    let mut states = [[0.0; LANES]; N];
    let mut p = square::<N>(&joint.start);
    let (mut phi, mut q) = ([[0.0; N]; N], [[0.0; N]; N]);
    let mut gain = [0.0; N];
    let (mut step, mut steady) = (f64::NAN, false);
    let mut variance = f64::INFINITY;
    let (mut factor, mut log_variance, mut log_det) = (0.0, 0.0, 0.0);
    let mut kicks = kicks.iter().peekable();
    for row in 0..rows {
        if row % CHECKED == CHECKED - 1 {
            task.check()?;
        }
        if row > 0 {
            let between = time[row] - time[row - 1];
            if !((between - step).abs() <= SAME * time[row].abs() + SAME_STEP * between) {
                let made = Propagation::new(&joint.a, &joint.noise, between);
                (phi, q) = (square(&made.phi), square(&made.q));
                (step, steady) = (between, false);
            }
            if !steady {
                p = predicted(&phi, &p, &q);
            }
            while let Some(kick) = kicks.next_if(|kick| kick.row <= row) {
                if steady {
                    p = predicted(&phi, &p, &q);
                    steady = false;
                }
                for (p, left) in p.iter_mut().zip(&kick.state) {
                    for (p, right) in p.iter_mut().zip(&kick.state) {
                        *p += left * right;
                    }
                }
            }
            let mut moved = [[0.0; LANES]; N];
            for (moved, phi) in moved.iter_mut().zip(&phi) {
                for (phi, state) in phi.iter().zip(&states) {
                    for (moved, state) in moved.iter_mut().zip(state) {
                        *moved += phi * state;
                    }
                }
            }
            states = moved;
        }
        if !used[row] {
            steady = false;
            for column in 0..count {
                columns[column * rows + row] = 0.0;
            }
            continue;
        }
        if !steady {
            let pc: [f64; N] = std::array::from_fn(|i| dot(&p[i], &c));
            let now = 1.0 + dot(&pc, &c);
            steady = (now - variance).abs() <= CONVERGED * now;
            variance = now;
            (factor, log_variance) = (1.0 / now.sqrt(), now.ln());
            gain = pc.map(|pc| pc / now);
            for (p, left) in p.iter_mut().zip(&pc) {
                for (p, right) in p.iter_mut().zip(&gain) {
                    *p -= left * right;
                }
            }
        }
        log_det += log_variance;
        let mut innovation = [0.0; LANES];
        for (column, innovation) in innovation.iter_mut().enumerate().take(count) {
            *innovation = columns[column * rows + row];
        }
        for (c, state) in c.iter().zip(&states) {
            for (innovation, state) in innovation.iter_mut().zip(state) {
                *innovation -= c * state;
            }
        }
        for (gain, state) in gain.iter().zip(&mut states) {
            for (state, innovation) in state.iter_mut().zip(&innovation) {
                *state += gain * innovation;
            }
        }
        for (column, innovation) in innovation.iter().enumerate().take(count) {
            columns[column * rows + row] = innovation * factor;
        }
    }
    Ok(log_det)
}
