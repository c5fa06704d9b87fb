//! The characteristic function of a continuous loop, with two numbers free or none.

use deadtime::Error;
use deadtime::quasipoly::QuasiPolynomial;
use deadtime::stability::{Affine, Family, Term};

use crate::control_loop::{ControlLoop, Number};
use crate::polynomial::Polynomial;

impl ControlLoop {
    /// a g + b f e^(−s T) over these numbers.
    ///
    /// # Errors
    /// [`Error::Argument`] for the sample time, or a number given twice.
    pub(crate) fn family(&self, free: [Number; 2]) -> Result<Family, Error> {
        if free.contains(&Number::SampleTime) {
            return Err(Error::argument("a continuous loop has no sample time"));
        }
        let parts = self.polynomials(&free);
        let mut terms = Vec::new();
        let still = Affine {
            constant: 0.0,
            slopes: vec![0.0; free.len()],
        };
        put(&mut terms, &parts.a.times(&parts.g), &still);
        let is_free = free.contains(&Number::Delay);
        let late = Affine {
            constant: if is_free {
                0.0
            } else {
                self.number(Number::Delay)
            },
            slopes: free
                .iter()
                .map(|number| f64::from(u8::from(*number == Number::Delay)))
                .collect(),
        };
        put(&mut terms, &parts.b.times(&parts.f), &late);
        Family::new(
            free.iter().map(|number| format!("{number:?}")).collect(),
            terms,
        )
    }

    /// a g and b f e^(−s T): the loop gain is the second over the first.
    ///
    /// # Errors
    /// [`Error::Argument`] where a coefficient is beyond double precision.
    pub(crate) fn loop_gain(&self) -> Result<(QuasiPolynomial, QuasiPolynomial), Error> {
        let parts = self.polynomials(&[]);
        let one = |polynomial: &Polynomial, delay: f64| {
            let mut ascending = polynomial.numbers();
            ascending.reverse();
            QuasiPolynomial::new(vec![ascending], vec![delay])
        };
        Ok((
            one(&parts.a.times(&parts.g), 0.0)?,
            one(&parts.b.times(&parts.f), self.number(Number::Delay))?,
        ))
    }

    /// The characteristic function.
    ///
    /// # Errors
    /// As [`loop_gain`](Self::loop_gain).
    pub(crate) fn characteristic(&self) -> Result<QuasiPolynomial, Error> {
        let (d, n) = self.loop_gain()?;
        d.add(&n)
    }
}

fn put(terms: &mut Vec<Term>, polynomial: &Polynomial, delay: &Affine) {
    for (power, coefficient) in (0..).zip(&polynomial.0) {
        for one in &coefficient.0 {
            terms.push(Term {
                coefficient: one.factor,
                exponents: one.powers.to_vec(),
                power,
                delay: delay.clone(),
            });
        }
    }
}
