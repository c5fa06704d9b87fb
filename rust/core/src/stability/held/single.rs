//! One loop with a hold, at its own delay or another one.

use num_complex::Complex64;

use super::interval::HeldInterval;
use super::model::{LoopPolynomials, share_of_errors};
use super::poles::Poles;
use super::zeros::Held;
use crate::dde::control_loop::sampled;
use crate::dde::{Equations, LinearLoop, Update};
use crate::elementary::Enclosed;
use crate::linear_algebra::balance::balanced_norm;
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::{Region, RootSet};
use crate::stability::branches::rightmost;
use crate::stability::cell::Cell;
use crate::stability::crossings::{Crossing, count, crossings};
use crate::stability::hold::Hold;
use crate::stability::specification::Specification;
use crate::status::CellStatus;
use crate::{Error, Task};

/// Samples in the delay up to which eigenvalues are computed.
const FEW: f64 = 10.0;

/// A rate this small beside the largest one is that of an integrator.
const AT_REST: f64 = 1e-9;

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
            None => refuse!("a continuous loop has no hold: give the loop a sample_time"),
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

    /// The frequency of the fastest oscillation of plant and controller that does not decay by more
    /// than e^(−`decay`) in a sample, rad/s.
    pub fn fastest_oscillation(&self, decay: f64) -> f64 {
        let modes = self.modes();
        let lasting = modes.iter().filter(|s| s.re * self.sample_time > -decay);
        lasting.fold(0.0, |most, s| most.max(s.im.abs()))
    }

    /// The same loop with another delay.
    pub(crate) fn with_delay(&self, delay: f64) -> LinearLoop {
        self.plant.clone().with_delay(delay)
    }

    /// The loop with every fraction of a sample between two, from 0 to 1, in its delay.
    pub(crate) fn within_sample(&self, (low, high): (f64, f64)) -> HeldInterval {
        let exact = |entries: &[f64]| -> Vec<Enclosed> {
            entries.iter().map(|x| Enclosed::from(*x)).collect()
        };
        let own = self.plant.equations();
        let equations = Equations {
            a: exact(&own.a),
            b: exact(&own.b),
            k: exact(&own.k),
            l: own.l.into(),
            ..Equations::default()
        };
        let update = self.plant.update().map(|update| Update {
            states: exact(&update.states),
            command: exact(&update.command),
            reference: Vec::new(),
        });
        let period = Enclosed::from(self.sample_time);
        let early = Enclosed::between(low, high) * period;
        HeldInterval::new(&equations, update.as_ref(), [early, period - early])
    }

    /// The longest time constant of plant and controller that decays or grows, s.
    pub fn slowest(&self) -> f64 {
        let modes = self.modes();
        let largest = modes.iter().fold(0.0f64, |most, s| most.max(modulus(*s)));
        let rates = modes.iter().map(|s| s.re.abs());
        let least = rates.filter(|rate| *rate > AT_REST * largest);
        1.0 / least.fold(f64::INFINITY, f64::min)
    }

    fn modes(&self) -> Vec<Complex64> {
        let equations = self.plant.equations();
        eigenvalues(&equations.a, equations.states()).unwrap_or_default()
    }

    /// Does the command act on the feedback at once when it arrives?
    pub fn is_direct(&self) -> bool {
        self.plant.equations().l != 0.0
    }

    /// ln(ρ)/Ts, ρ the spectral radius. With few samples in the delay, and where the search of
    /// `rightmost` finds none, from the eigenvalues of the transition matrix.
    ///
    /// # Errors
    /// As [`at`](Self::at); [`Error::TooMuch`] and [`Error::Convergence`] of the eigenvalues.
    pub fn abscissa(&self, task: &Task) -> Result<f64, Error> {
        if self.delay() > FEW * self.sample_time {
            let numbers = self.at(self.delay())?;
            let found = rightmost(&numbers.h()?, numbers.hold, task)?;
            if let Some(abscissa) = found.abscissa {
                return Ok(abscissa);
            }
        }
        let found = sampled::poles(self.plant)?;
        Ok(found.first().map_or(f64::NEG_INFINITY, |pole| pole.re))
    }

    /// All poles s = ln(z)/Ts, without a proof; z = 0 is none. With few samples in the delay they are
    /// the eigenvalues of the transition matrix.
    ///
    /// # Errors
    /// As [`abscissa`](Self::abscissa).
    pub fn poles(&self) -> Result<Vec<Complex64>, Error> {
        let samples = (self.delay() / self.sample_time).ceil();
        if samples <= FEW {
            return sampled::poles(self.plant);
        }
        let numbers = self.at(self.delay());
        match numbers.ok().and_then(|numbers| numbers.zeros()) {
            None => sampled::poles(self.plant),
            Some(found) => {
                let pole =
                    |z: &Complex64| Complex64::new(z.norm().ln(), z.arg()) / self.sample_time;
                Ok(found.iter().map(pole).collect())
            }
        }
    }

    /// The poles s = ln(z)/Ts in a region, in discs that are proved to hold them; z = 0 is none.
    ///
    /// # Errors
    /// [`Error::OnEdge`] where a disc meets the edge; [`Error::Argument`] and [`Error::Convergence`]
    /// where numbers are beyond double precision; [`Error::TooMuch`] for too many samples of delay.
    pub fn poles_in(&self, region: &Region) -> Result<RootSet, Error> {
        Poles::of(self.plant, self.sample_time)?.within(region)
    }

    /// The `n` rightmost of them and their mirror images.
    ///
    /// # Errors
    /// As [`poles_in`](Self::poles_in).
    pub fn rightmost_poles(&self, n: usize) -> Result<RootSet, Error> {
        Ok(Poles::of(self.plant, self.sample_time)?.rightmost(n))
    }

    /// Are all poles inside the circle, by a proved count, or by discs where a pole is close to it?
    /// `None` where rounding decides.
    ///
    /// # Errors
    /// As [`at`](Self::at); [`Error::Interrupted`]; [`Error::TooMuch`] for too many samples of delay.
    pub fn is_stable(&self, task: &Task) -> Result<Option<bool>, Error> {
        match self.at(self.delay())?.is_stable(task)? {
            None => self.are_inside(),
            known => Ok(known),
        }
    }

    /// The same by discs alone, which lose fewer digits than the count.
    ///
    /// # Errors
    /// As [`poles_in`](Self::poles_in).
    pub fn are_inside(&self) -> Result<Option<bool>, Error> {
        Ok(Poles::of(self.plant, self.sample_time)?.are_inside())
    }

    /// The values in `range` of a gain, whose factor is the feedback of `slope`, at which a pole of
    /// this loop and it together is on the circle; `None` where that is beyond double precision.
    ///
    /// # Errors
    /// As [`at`](Self::at); [`Error::Interrupted`].
    pub fn gain_crossings(
        &self,
        slope: &LinearLoop,
        range: (f64, f64),
        task: &Task,
    ) -> Result<Option<Vec<Crossing>>, Error> {
        let model = LoopPolynomials::of_loop(self.plant, self.delay(), self.sample_time)?;
        let [constant, factor] = [self.plant, slope].map(|of| {
            let equations = of.equations();
            model.feedback(&equations.k, equations.l)
        });
        let coefficients = share_of_errors(
            &[&model.a, &constant, &factor],
            model.delay,
            self.sample_time,
        );
        if !coefficients.is_finite() {
            return Ok(None);
        }
        let negative = |row: &[f64]| row.iter().map(|c| -c).collect::<Vec<f64>>();
        let a = vec![
            model.a.coefficients.clone(),
            negative(&constant.coefficients),
        ];
        let a = QuasiPolynomial::new(a, vec![0.0, model.delay])?;
        let b = QuasiPolynomial::new(vec![negative(&factor.coefficients)], vec![model.delay])?;
        if b.is_zero() {
            return Ok(Some(Vec::new()));
        }
        let hold = Hold {
            sample_time: self.sample_time,
            coefficients,
        };
        crossings(&a, &b, Specification::default(), hold, range, task)
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
            "the coefficients of this sampled loop exceed double precision: choose other units \
             for its gains and time constants"
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

    /// Ts, s.
    pub fn sample_time(&self) -> f64 {
        self.hold.sample_time
    }

    /// d, s.
    pub fn delay(&self) -> f64 {
        self.delay
    }

    /// Errors of the coefficients, relative to sums of moduli.
    pub fn errors(&self) -> f64 {
        self.hold.coefficients
    }

    /// σ at s = jω.
    pub fn variable(&self, omega: f64) -> Complex64 {
        self.hold.at(Complex64::new(0.0, omega)).0
    }

    /// The zeros z of the characteristic polynomial; none where they are not found.
    fn zeros(&self) -> Option<Vec<Complex64>> {
        let held = Held {
            a: &self.a,
            b: &self.b,
            samples: (self.delay / self.hold.sample_time).round() as usize,
            sample_time: self.hold.sample_time,
        };
        held.zeros()
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

    /// Are all poles inside the circle, by the proved count? `None` where rounding decides.
    ///
    /// # Errors
    /// As [`count`](Self::count).
    pub fn is_stable(&self, task: &Task) -> Result<Option<bool>, Error> {
        let cell = self.count(Specification::default(), task)?;
        Ok((cell.status == CellStatus::Ok).then_some(cell.unstable == 0))
    }

    /// The places on the circle, with factors k in `range`, at which k L = −1; `None` where that is
    /// beyond double precision. Common powers of σ are left out.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn factors(&self, range: (f64, f64), task: &Task) -> Result<Option<Vec<Crossing>>, Error> {
        if self.b.iter().all(|c| *c == 0.0) {
            return Ok(Some(Vec::new()));
        }
        let common = self.common_powers();
        let b = self.b[common..].iter().map(|c| -c).collect();
        let a = QuasiPolynomial::new(vec![self.a[common..].to_vec()], vec![0.0])?;
        let b = QuasiPolynomial::new(vec![b], vec![self.delay])?;
        crossings(&a, &b, Specification::default(), self.hold, range, task)
    }

    /// Powers of σ that a and b have in common.
    fn common_powers(&self) -> usize {
        let zeros = |row: &[f64]| row.iter().take_while(|c| **c == 0.0).count();
        zeros(&self.a).min(zeros(&self.b))
    }

    /// The loop gain at s = jω; infinite at a pole.
    pub fn gain(&self, omega: f64) -> Complex64 {
        let common = self.common_powers();
        let (of_a, of_b) = self.parts_of(&self.a[common..], &self.b[common..], omega);
        if of_a == Complex64::ZERO {
            return Complex64::new(f64::INFINITY, 0.0);
        }
        -of_b / of_a
    }

    /// a and e^(−s d) b at s = jω: the loop gain is minus their ratio.
    pub fn parts(&self, omega: f64) -> (Complex64, Complex64) {
        self.parts_of(&self.a, &self.b, omega)
    }

    fn parts_of(&self, a: &[f64], b: &[f64], omega: f64) -> (Complex64, Complex64) {
        let sigma = self.variable(omega);
        let value = |row: &[f64]| {
            row.iter()
                .rev()
                .fold(Complex64::ZERO, |sum, c| sum * sigma + c)
        };
        let (sine, cosine) = crate::elementary::sin_cos(omega * self.delay);
        (value(a), value(b) * Complex64::new(cosine, -sine))
    }
}
