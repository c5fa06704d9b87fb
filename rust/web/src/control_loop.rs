//! A loop as a page describes it, and its polynomials.
//!
//! Plant b/a = gain num/(den (lag s + 1)), feedback F = f/g of u = R r − F y, delay T: the
//! characteristic function is a g + b f e^(−s T).

use deadtime::Error;

use crate::polynomial::{Coefficient, Polynomial};
use crate::request::Request;

/// The numbers of a loop that may be an axis of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    Kp,
    Ki,
    Kd,
    Gain,
    Lag,
    Delay,
    SampleTime,
}

impl Number {
    const ALL: [Self; 7] = [
        Self::Kp,
        Self::Ki,
        Self::Kd,
        Self::Gain,
        Self::Lag,
        Self::Delay,
        Self::SampleTime,
    ];

    /// # Errors
    /// [`Error::Argument`] where there is no such number.
    pub(crate) fn read(request: &mut Request<'_>) -> Result<Self, Error> {
        let index = request.whole()?;
        let found = Self::ALL.get(index).copied();
        found.ok_or_else(|| Error::argument(format!("number {index} of a loop: there are 7")))
    }

    /// Is the feedback linear in it?
    pub(crate) fn is_gain(self) -> bool {
        matches!(self, Self::Kp | Self::Ki | Self::Kd | Self::Gain)
    }
}

/// What the controller does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Terms {
    pub(crate) integrates: bool,
    pub(crate) differentiates: bool,
    /// Is the derivative that of the error, not of the output?
    pub(crate) derivative_of_error: bool,
    /// ω and ζ of the filter ω² s/(s² + 2 ζ ω s + ω²) of the derivative.
    pub(crate) filter: Option<(f64, f64)>,
}

/// One loop.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ControlLoop {
    pub(crate) terms: Terms,
    numbers: [f64; Number::ALL.len()],
    /// On the size of the command.
    pub(crate) limit: Option<f64>,
    /// Descending.
    num: Vec<f64>,
    den: Vec<f64>,
}

/// a, b, f and g.
pub(crate) struct Polynomials {
    pub(crate) a: Polynomial,
    pub(crate) b: Polynomial,
    pub(crate) f: Polynomial,
    pub(crate) g: Polynomial,
}

impl ControlLoop {
    /// Read: does it integrate, differentiate, is the derivative that of the error (0 or 1); ω (0 for
    /// no filter) and ζ; Kp, Ki, Kd, gain, lag, delay, sample time (0 for none); limit (infinite for
    /// none); the lists num and den, descending.
    ///
    /// # Errors
    /// [`Error::Argument`] for a request that ends too early or numbers without sense.
    pub(crate) fn read(request: &mut Request<'_>) -> Result<Self, Error> {
        let (integrates, differentiates) = (request.flag()?, request.flag()?);
        let derivative_of_error = request.flag()?;
        let (omega, damping) = (request.number()?, request.number()?);
        let mut numbers = [0.0; Number::ALL.len()];
        for number in &mut numbers {
            *number = request.number()?;
        }
        let limit = request.number()?;
        let made = Self {
            terms: Terms {
                integrates,
                differentiates,
                derivative_of_error,
                filter: (differentiates && omega > 0.0).then_some((omega, damping)),
            },
            numbers,
            limit: limit.is_finite().then_some(limit),
            num: request.list()?.to_vec(),
            den: request.list()?.to_vec(),
        };
        made.check()?;
        Ok(made)
    }

    fn check(&self) -> Result<(), Error> {
        let mut numbers = self.numbers.iter().chain(&self.num).chain(&self.den);
        if let Some(number) = numbers.find(|number| !number.is_finite()) {
            return Err(Error::argument(format!(
                "{number} in a loop: its numbers must be finite"
            )));
        }
        let leads = |list: &[f64]| list.first().is_some_and(|first| *first != 0.0);
        if !leads(&self.num) || !leads(&self.den) || self.num.len() > self.den.len() {
            return Err(Error::argument(
                "a plant is num/den with leading coefficients other than zero and a degree of den \
                 at least that of num",
            ));
        }
        for number in [Number::Delay, Number::Lag, Number::SampleTime] {
            let value = self.number(number);
            if value < 0.0 {
                return Err(Error::argument(format!(
                    "{number:?} = {value}: give zero or more"
                )));
            }
        }
        Ok(())
    }

    pub(crate) fn number(&self, number: Number) -> f64 {
        self.numbers.get(number as usize).copied().unwrap_or(0.0)
    }

    /// The same loop with another number.
    pub(crate) fn with(&self, number: Number, value: f64) -> Self {
        let mut other = self.clone();
        if let Some(place) = other.numbers.get_mut(number as usize) {
            *place = value;
        }
        other
    }

    pub(crate) fn sample_time(&self) -> Option<f64> {
        let sample_time = self.number(Number::SampleTime);
        (sample_time > 0.0).then_some(sample_time)
    }

    /// A number of the loop, or the free number itself where it is one of `free`.
    fn coefficient(&self, number: Number, free: &[Number]) -> Coefficient {
        match free.iter().position(|one| *one == number) {
            Some(place) => Coefficient::free(place),
            None => Coefficient::number(self.number(number)),
        }
    }

    /// The polynomials, with these numbers free.
    pub(crate) fn polynomials(&self, free: &[Number]) -> Polynomials {
        let number = |number| self.coefficient(number, free);
        let lag = Polynomial(vec![Coefficient::number(1.0), number(Number::Lag)]);
        let terms = self.terms;
        let integral = if terms.integrates {
            Polynomial::descending(&[1.0, 0.0])
        } else {
            Polynomial::one()
        };
        let (rolled_off, slope) = match terms.filter {
            Some((omega, damping)) => (
                Polynomial::descending(&[1.0, 2.0 * (damping * omega), omega * omega]),
                Coefficient::number(omega * omega),
            ),
            None => (Polynomial::one(), Coefficient::number(1.0)),
        };
        let g = integral.times(&rolled_off);
        let mut f = g.scaled(&number(Number::Kp));
        if terms.differentiates {
            let slope = slope.times(&number(Number::Kd));
            let derivative = Polynomial(vec![Coefficient::default(), slope]);
            f = f.plus(&integral.times(&derivative));
        }
        if terms.integrates {
            f = f.plus(&rolled_off.scaled(&number(Number::Ki)));
        }
        Polynomials {
            a: Polynomial::descending(&self.den).times(&lag),
            b: Polynomial::descending(&self.num).scaled(&number(Number::Gain)),
            f,
            g,
        }
    }
}
