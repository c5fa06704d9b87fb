//! Spectral abscissae of continuous loops, their limits left out.
//!
//! The poles are the zeros of a(s) − (L a(s) + K adj(s − A) B) e^(−s T), where a(s) = det(s − A) and
//! the adjugate follow from the recursion of Faddeev and LeVerrier (Gantmacher 1959).

use crate::dde::ensemble::Sets;
use crate::dde::{Equations, LinearLoop};
use crate::lambertw::dde_root;
use crate::memory::in_parallel;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::spectral_abscissa;
use crate::{Error, Task};

/// The largest real part of a pole of each loop, 1/s; NaN where it is not found.
pub fn abscissae(sets: &Sets<'_>, task: &Task) -> Result<Vec<f64>, Error> {
    let what = "the poles of the sweep";
    in_parallel(
        what,
        sets.len(),
        || (),
        |(), set| {
            task.check()?;
            let Some(plant) = sets.loop_of(set)? else {
                return Ok(f64::NAN);
            };
            match abscissa(&plant, task) {
                Err(error) if error.ends_all() => Err(error),
                found => Ok(found.unwrap_or(f64::NAN)),
            }
        },
    )
}

fn abscissa(plant: &LinearLoop, task: &Task) -> Result<f64, Error> {
    let (equations, delay) = (plant.equations(), plant.delay());
    if let ([a], [b], [k]) = (&*equations.a, &*equations.b, &*equations.k)
        && equations.l == 0.0
        && delay > 0.0
        && b * k != 0.0
    {
        return Ok(dde_root(*a, b * k, delay, 0).re);
    }
    let (open, feedback) = polynomials(equations);
    let feedback = feedback.into_iter().map(|c| -c).collect();
    let function = QuasiPolynomial::new(vec![open, feedback], vec![0.0, delay])?;
    spectral_abscissa(&function, true, task)
}

/// Coefficients of a(s) and of L a(s) + K adj(s − A) B, ascending.
fn polynomials(equations: &Equations) -> (Vec<f64>, Vec<f64>) {
    let n = equations.b.len();
    let mut open = vec![0.0; n + 1];
    let mut feedback = vec![0.0; n + 1];
    // Coefficient of s^(n−j) of the adjugate.
    let mut adjugate = vec![0.0; n * n];
    let mut coefficient = 1.0;
    for j in 1..=n {
        open[n + 1 - j] = coefficient;
        for i in 0..n {
            adjugate[i * n + i] += coefficient;
        }
        let column =
            |i: usize| -> f64 { (0..n).map(|k| adjugate[i * n + k] * equations.b[k]).sum() };
        feedback[n - j] = (0..n).map(|i| equations.k[i] * column(i)).sum();
        let old = adjugate.clone();
        for (place, entry) in adjugate.iter_mut().enumerate() {
            let (i, k) = (place / n, place % n);
            *entry = (0..n)
                .map(|m| equations.a[i * n + m] * old[m * n + k])
                .sum();
        }
        let trace: f64 = (0..n).map(|i| adjugate[i * n + i]).sum();
        coefficient = -trace / j as f64;
    }
    open[0] = coefficient;
    for (sum, c) in feedback.iter_mut().zip(&open) {
        *sum += equations.l * c;
    }
    (open, feedback)
}
