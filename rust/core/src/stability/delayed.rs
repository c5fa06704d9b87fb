//! How fast loops decay, their limits left out.
//!
//! Loops with a hold are those of `held`. Of continuous ones the poles are the zeros of a(s) − (L a(s) + K adj(s − A) B) e^(−s T), where a(s) = det(s − A) and
//! the adjugate follow from the recursion of Faddeev and LeVerrier (Gantmacher 1959).

use crate::dde::ensemble::Sets;
use crate::dde::{Equations, LinearLoop};
use crate::lambertw::dde_root;
use crate::parallel;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::spectral_abscissa;
use crate::{Error, Task};

use super::held::HeldLoop;
use super::one_delay::are_left_of;

/// The largest real part of a pole of each loop, 1/s; NaN where it is not found.
pub fn abscissae(sets: &Sets<'_>, task: &Task) -> Result<Vec<f64>, Error> {
    each(sets, task, |_, plant| {
        if plant.sample_time().is_some() {
            return HeldLoop::new(plant)?.abscissa(task);
        }
        let function = match Poles::of(plant) {
            Poles::Root(abscissa) => return Ok(abscissa),
            Poles::Function(function) => function,
        };
        function.abscissa(task)
    })
    .map(|found| {
        found
            .into_iter()
            .map(|one| one.unwrap_or(f64::NAN))
            .collect()
    })
}

/// Does each continuous loop decay at its rate in 1/s at least? Not where that is not found.
pub fn decay(sets: &Sets<'_>, rates: &[f64], task: &Task) -> Result<Vec<bool>, Error> {
    let found = each(sets, task, |set, plant| {
        let least = rates.get(set).copied().unwrap_or(f64::INFINITY);
        Ok(match Poles::of(plant) {
            Poles::Root(abscissa) => abscissa <= -least,
            Poles::Function(function) => match function.are_left_of(-least) {
                Some(known) => known,
                None => function.abscissa(task)? <= -least,
            },
        })
    })?;
    Ok(found.into_iter().map(|one| one.unwrap_or(false)).collect())
}

/// What `work` finds for each loop; none where it fails or the numbers are not those of a loop.
fn each<T: Send>(
    sets: &Sets<'_>,
    task: &Task,
    work: impl Fn(usize, &LinearLoop) -> Result<T, Error> + Sync + Send,
) -> Result<Vec<Option<T>>, Error> {
    parallel::results(
        "the poles of the sweep",
        sets.len(),
        || (),
        |(), set| {
            task.check()?;
            let Some(plant) = sets.loop_of(set)? else {
                return Ok(None);
            };
            match work(set, &plant) {
                Err(error) if error.ends_all() => Err(error),
                found => Ok(found.ok()),
            }
        },
    )
}

/// The poles of a loop.
enum Poles {
    /// The rightmost one is known.
    Root(f64),
    Function(Delayed),
}

/// a(s) + b(s) e^(−s T).
struct Delayed {
    a: Vec<f64>,
    b: Vec<f64>,
    delay: f64,
}

impl Poles {
    fn of(plant: &LinearLoop) -> Self {
        let (equations, delay) = (plant.equations(), plant.delay());
        if let ([a], [b], [k]) = (&*equations.a, &*equations.b, &*equations.k)
            && equations.l == 0.0
            && delay > 0.0
            && b * k != 0.0
        {
            return Self::Root(dde_root(*a, b * k, delay, 0).re);
        }
        let (a, mut b) = polynomials(equations);
        for c in &mut b {
            *c = -*c;
        }
        Self::Function(Delayed { a, b, delay })
    }
}

impl Delayed {
    /// See [`are_left_of`].
    fn are_left_of(&self, line: f64) -> Option<bool> {
        are_left_of(&self.a, &self.b, self.delay, line)
    }

    fn abscissa(self, task: &Task) -> Result<f64, Error> {
        let function = QuasiPolynomial::new(vec![self.a, self.b], vec![0.0, self.delay])?;
        spectral_abscissa(&function, true, task)
    }
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
