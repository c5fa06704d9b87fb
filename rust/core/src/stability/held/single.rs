//! One loop with a hold, at its own delay or another one.

use num_complex::Complex64;

use super::model::{LoopPolynomials, share_of_errors};
use crate::dde::LinearLoop;
use crate::dde::control_loop::sampled;
use crate::linear_algebra::balance::balanced_norm;
use crate::quasipoly::QuasiPolynomial;
use crate::stability::branches::rightmost;
use crate::stability::cell::Cell;
use crate::stability::crossings::{Crossing, count, crossings};
use crate::stability::hold::Hold;
use crate::stability::specification::Specification;
use crate::status::CellStatus;
use crate::{Error, Task};

/// Samples in the delay up to which eigenvalues are computed.
const FEW: f64 = 10.0;

/// A sampled loop whose polynomials can be formed at any delay.
#[derive(Debug, Clone, Copy)]
pub struct HeldLoop<'a> {
    plant: &'a LinearLoop,
    sample_time: f64,
}

/// a and b of a loop at one delay: its loop gain is −b(σ) e^(−s d)/a(σ).
#[derive(Debug, Clone)]
pub struct HeldNumbers {
    hold: Hold,
    delay: f64,
    a: Vec<f64>,
    b: Vec<f64>,
}

impl<'a> HeldLoop<'a> {
    /// # Errors
    /// [`Error::Argument`] for a continuous loop.
    pub fn new(plant: &'a LinearLoop) -> Result<Self, Error> {
        match plant.sample_time() {
            Some(sample_time) => Ok(Self { plant, sample_time }),
            None => refuse!("a continuous loop has no hold: give it a sample_time"),
        }
    }

    /// Ts, s.
    pub fn sample_time(&self) -> f64 {
        self.sample_time
    }

    /// The delay of the loop, s.
    pub fn delay(&self) -> f64 {
        self.plant.delay()
    }

    /// A bound on the moduli of the poles of plant and controller, 1/s.
    pub fn fastest(&self) -> f64 {
        let equations = self.plant.equations();
        balanced_norm(&equations.a, equations.states())
    }

    /// Does the command act on the feedback at once when it arrives?
    pub fn is_direct(&self) -> bool {
        self.plant.equations().l != 0.0
    }

    /// ln(ρ)/Ts, ρ the spectral radius; `None` where it is not found. With few samples in the delay
    /// the eigenvalues of the transition matrix cost least, with many the search of `rightmost`.
    ///
    /// # Errors
    /// As [`at`](Self::at); [`Error::Convergence`] where the QR algorithm fails.
    pub fn abscissa(&self, task: &Task) -> Result<Option<f64>, Error> {
        if self.delay() <= FEW * self.sample_time {
            let found = sampled::poles(self.plant)?;
            return Ok(found.first().map(|pole| pole.re));
        }
        let numbers = self.at(self.delay())?;
        Ok(rightmost(&numbers.h()?, numbers.hold, task)?.abscissa)
    }

    /// The polynomials at another delay. Factors that both have in common are left out where they
    /// are powers of σ.
    ///
    /// # Errors
    /// [`Error::Argument`] where coefficients are beyond double precision.
    pub fn at(&self, delay: f64) -> Result<HeldNumbers, Error> {
        let model = LoopPolynomials::of_loop(self.plant, delay, self.sample_time)?;
        let equations = self.plant.equations();
        let b = model.feedback(&equations.k, equations.l);
        let coefficients = share_of_errors(&[&model.a, &b], model.delay, self.sample_time);
        let known = coefficients.is_finite()
            && [&model.a, &b]
                .iter()
                .all(|p| p.coefficients.iter().all(|c| c.is_finite()));
        refuse_if!(
            !known,
            "the coefficients of this sampled loop are beyond double precision: choose units in \
             which its gains and time constants are moderate"
        );
        Ok(HeldNumbers {
            hold: Hold {
                sample_time: self.sample_time,
                coefficients,
            },
            delay: model.delay,
            a: model.a.coefficients,
            b: b.coefficients,
        })
    }
}

impl HeldNumbers {
    /// a and b, ascending powers of σ.
    pub fn polynomials(&self) -> (&[f64], &[f64]) {
        (&self.a, &self.b)
    }

    fn h(&self) -> Result<QuasiPolynomial, Error> {
        let b = self.b.iter().map(|c| -c).collect();
        QuasiPolynomial::new(vec![self.a.clone(), b], vec![0.0, self.delay])
    }

    /// The number of poles right of −`decay`, with what is known of it.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; [`Error::Argument`] for a decay that is not finite.
    pub fn count(&self, specification: Specification, task: &Task) -> Result<Cell, Error> {
        specification.check()?;
        count(&self.h()?, specification, self.hold, task)
    }

    /// Are all poles inside the circle? By the proved count, and by the abscissa of the eigenvalues
    /// where a pole is too close to the circle for a proof.
    ///
    /// # Errors
    /// As [`count`](Self::count).
    pub fn is_stable(&self, task: &Task) -> Result<bool, Error> {
        let cell = self.count(Specification::default(), task)?;
        if cell.status == CellStatus::Ok {
            return Ok(cell.unstable == 0);
        }
        let found = rightmost(&self.h()?, self.hold, task)?;
        Ok(found.abscissa.is_some_and(|abscissa| abscissa < 0.0))
    }

    /// The places on the circle, with factors k in `range`, at which k L = −1; `None` where that is
    /// beyond double precision. Common powers of σ are left out.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn factors(&self, range: (f64, f64), task: &Task) -> Result<Option<Vec<Crossing>>, Error> {
        let zeros = |row: &[f64]| row.iter().take_while(|c| **c == 0.0).count();
        if self.b.iter().all(|c| *c == 0.0) {
            return Ok(Some(Vec::new()));
        }
        let common = zeros(&self.a).min(zeros(&self.b));
        let b = self.b[common..].iter().map(|c| -c).collect();
        let a = QuasiPolynomial::new(vec![self.a[common..].to_vec()], vec![0.0])?;
        let b = QuasiPolynomial::new(vec![b], vec![self.delay])?;
        crossings(&a, &b, Specification::default(), self.hold, range, task)
    }

    /// The loop gain L at s = jω.
    pub fn gain(&self, omega: f64) -> Complex64 {
        let s = Complex64::new(0.0, omega);
        let (sigma, _) = self.hold.at(s);
        let value = |row: &[f64]| {
            row.iter()
                .rev()
                .fold(Complex64::ZERO, |sum, c| sum * sigma + c)
        };
        let (sine, cosine) = crate::elementary::sin_cos(omega * self.delay);
        -value(&self.b) / value(&self.a) * Complex64::new(cosine, -sine)
    }
}
