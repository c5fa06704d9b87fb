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
        refuse!("the time {} follows {}: give increasing times", pair[1], pair[0]);
    }
    let mut columns = crate::memory::copied("the whitened columns", columns)?;
    let joint = Joint::new(plant, disturbances)?;
    let used = vec![true; time.len()];
    let log_det = whiten_in_place(time, &used, &mut columns, &joint, task)?;
    Ok(Whitened { columns, log_det })
}

/// Whiten the columns in place; rows that are not `used` become zero. Returns ln det V.
pub(super) fn whiten_in_place(
    time: &[f64],
    used: &[bool],
    columns: &mut [f64],
    joint: &Joint,
    task: &Task,
) -> Result<f64, Error> {
    let rows = time.len();
    let n = joint.c.len();
    let mut states = vec![0.0; n * (columns.len() / rows)];
    let mut p = joint.start.clone();
    let mut log_det = 0.0;
    let mut gain = vec![0.0; n];
    let mut pc = vec![0.0; n];
    let mut moved = vec![0.0; n];
    let (mut step, mut steady) = (f64::NAN, false);
    let mut propagation = Propagation::none();
    let mut variance = f64::INFINITY;
    let mut factor = 0.0;
    let mut log_variance = 0.0;
    for row in 0..rows {
        if row % CHECKED == CHECKED - 1 {
            task.check()?;
        }
        if row > 0 {
            let between = time[row] - time[row - 1];
            if !((between - step).abs() <= SAME * time[row].abs() + SAME_STEP * between) {
                propagation = Propagation::new(&joint.a, &joint.noise, between);
                (step, steady) = (between, false);
            }
            if !steady {
                p = propagation.moved(&p);
                for (p, q) in p.iter_mut().zip(&propagation.q) {
                    *p += q;
                }
            }
            for state in states.chunks_exact_mut(n.max(1)) {
                for (moved, phi) in moved.iter_mut().zip(propagation.phi.chunks_exact(n)) {
                    *moved = dot(phi, state);
                }
                state.copy_from_slice(&moved);
            }
        }
        if !used[row] {
            steady = false;
            columns.iter_mut().skip(row).step_by(rows).for_each(|entry| *entry = 0.0);
            continue;
        }
        if !steady {
            for (pc, p) in pc.iter_mut().zip(p.chunks_exact(n.max(1))) {
                *pc = dot(p, &joint.c);
            }
            let now = 1.0 + dot(&pc, &joint.c);
            steady = (now - variance).abs() <= CONVERGED * now;
            variance = now;
            (factor, log_variance) = (1.0 / now.sqrt(), now.ln());
            for (gain, pc) in gain.iter_mut().zip(&pc) {
                *gain = pc / now;
            }
            for (p, left) in p.chunks_exact_mut(n.max(1)).zip(&pc) {
                for (p, right) in p.iter_mut().zip(&gain) {
                    *p -= left * right;
                }
            }
        }
        log_det += log_variance;
        for (state, column) in states.chunks_exact_mut(n.max(1)).zip(columns.chunks_exact_mut(rows)) {
            let innovation = column[row] - dot(&joint.c, state);
            for (state, gain) in state.iter_mut().zip(&gain) {
                *state += gain * innovation;
            }
            column[row] = innovation * factor;
        }
    }
    Ok(log_det)
}
