//! Plants: what the delayed command w acts on.
//!
//! A rational plant b/a has the observable canonical form: with a monic of degree n and D = b₀,
//!
//! ```text
//! x_i′ = −a_i x₁ + x_{i+1} + (b_i − a_i D) w,   y = x₁ + D w,
//! ```
//!
//! in which the first state is y − D w, and a plant at rest is found by inspection.

use crate::Error;
use crate::quasipoly::QuasiPolynomial;

use super::entry::{Entry, Number};
use super::polynomial::{entries, led, product, scaled};
use super::symbol::Symbol;

/// Numerator and denominator, descending.
#[derive(Debug, Clone, PartialEq)]
pub struct Fraction<S> {
    /// b.
    pub num: Vec<S>,
    /// a.
    pub den: Vec<S>,
}

/// gain num/den · (zero s + 1) / (Π (lag_i s + 1) (s²/ω² + 2 d s/ω + 1)).
///
/// Its numbers are the gain, the lags, the zero, ω and d, in this order.
#[derive(Debug, Clone, PartialEq)]
pub struct Factors {
    /// num.
    pub num: Vec<f64>,
    /// den.
    pub den: Vec<f64>,
    /// How many lags.
    pub lags: usize,
    /// Is there a zero?
    pub has_zero: bool,
    /// Is there a pair of complex poles?
    pub has_pair: bool,
}

/// The form of a plant.
#[derive(Debug, Clone, PartialEq)]
pub enum Plant {
    /// A rational one by its factors.
    Factors(Factors),
    /// gain num/den, num and den given along with its numbers, of which the gain is the first.
    Given,
    /// gain num/den with delays inside; its number is the gain.
    Delayed(QuasiPolynomial, QuasiPolynomial),
}

/// x′ = A x + B w, y = x₁ + D w.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace<S> {
    /// A, n × n.
    pub a: Vec<S>,
    /// B, n.
    pub b: Vec<S>,
    /// D.
    pub d: S,
}

impl Factors {
    /// The polynomials for these numbers.
    fn fraction<S: Entry>(&self, numbers: &[S]) -> Fraction<S> {
        let mut left = numbers.iter().cloned();
        let mut next = || left.next().unwrap_or_else(|| S::from(0.0));
        let one = || S::from(1.0);
        let mut num = scaled(&next(), &entries(&self.num));
        let mut den = entries(&self.den);
        let lags: Vec<S> = (0..self.lags).map(|_| next()).collect();
        let zero = self.has_zero.then(&mut next);
        if self.has_pair {
            let (frequency, damping) = (next(), next());
            let square = frequency.clone() * frequency.clone();
            num = scaled(&square, &num);
            let middle = S::from(2.0) * damping * frequency;
            den = product(&den, &[one(), middle, square]);
        }
        for lag in lags {
            den = product(&den, &[lag, one()]);
        }
        if let Some(zero) = zero {
            num = product(&num, &[zero, one()]);
        }
        Fraction { num, den }
    }
}

impl Fraction<Symbol> {
    /// Where the first free number is this one.
    pub(super) fn at<S: Entry>(&self, number: &S) -> Fraction<S> {
        let each = |row: &[Symbol]| row.iter().map(|c| c.at(number)).collect();
        Fraction {
            num: each(&self.num),
            den: each(&self.den),
        }
    }
}

impl Plant {
    /// The polynomials for these numbers; `given` are those of [`Given`](Self::Given).
    ///
    /// # Errors
    /// [`Error::Argument`] for a plant with delays inside, or one whose polynomials are missing.
    pub fn fraction<S: Entry>(
        &self,
        numbers: &[S],
        given: Option<&Fraction<S>>,
    ) -> Result<Fraction<S>, Error> {
        match self {
            Self::Factors(factors) => Ok(factors.fraction(numbers)),
            Self::Given => match (given, numbers.first()) {
                (Some(given), Some(gain)) => Ok(Fraction {
                    num: scaled(gain, &given.num),
                    den: given.den.clone(),
                }),
                _ => refuse!("the polynomials of this plant are not known without its parameters"),
            },
            Self::Delayed(..) => refuse!(
                "the plant has delays inside, so it has no finite state space, which this \
                 function needs: give a plant that is rational except for one delay in series"
            ),
        }
    }
}

impl Plant {
    /// The number of states for these numbers.
    ///
    /// # Errors
    /// As [`fraction`](Self::fraction).
    pub(super) fn order<S: Entry>(
        &self,
        numbers: &[S],
        given: Option<&Fraction<S>>,
    ) -> Result<usize, Error> {
        let fraction = self.fraction(numbers, given)?;
        Ok(led(&fraction.den).len().saturating_sub(1))
    }
}

impl<S: Number> Fraction<S> {
    /// The observable canonical form.
    ///
    /// # Errors
    /// [`Error::Argument`] where the numerator has the larger degree.
    pub fn state_space(&self) -> Result<StateSpace<S>, Error> {
        let (a, b) = (led(&self.den), led(&self.num));
        let Some((lead, poles)) = a.split_first() else {
            refuse!("the plant has no denominator: give at least one coefficient");
        };
        let n = poles.len();
        refuse_if!(
            b.len() > n + 1,
            "the numerator has degree {}, and the denominator only {n}, but a plant cannot \
             differentiate its command",
            b.len() - 1
        );
        let poles: Vec<S> = poles.iter().map(|c| c.clone() / lead.clone()).collect();
        let (d, drive) = if b.len() > n {
            let d = b[0].clone() / lead.clone();
            let pairs = b[1..].iter().zip(&poles);
            let drive =
                pairs.map(|(gain, pole)| gain.clone() / lead.clone() - pole.clone() * d.clone());
            (d.clone(), drive.collect())
        } else {
            let before = std::iter::repeat_n(S::from(0.0), n - b.len());
            let drive = before.chain(b.iter().map(|gain| gain.clone() / lead.clone()));
            (S::from(0.0), drive.collect())
        };
        let mut flat = vec![S::from(0.0); n * n];
        for (i, pole) in poles.into_iter().enumerate() {
            flat[i * n] = S::from(0.0) - pole;
            if i > 0 {
                flat[(i - 1) * n + i] = S::from(1.0);
            }
        }
        Ok(StateSpace {
            a: flat,
            b: drive,
            d,
        })
    }

    /// The state in which the plant rests with this output, and the command that holds it there.
    ///
    /// # Errors
    /// [`Error::Argument`] where it rests at zero only.
    pub fn rest(&self, space: &StateSpace<S>, output: f64) -> Result<(Vec<S>, S), Error> {
        let last = |p: &[S]| p.last().cloned().unwrap_or_else(|| S::from(0.0));
        let (zeros, poles) = (last(&self.num), last(&self.den));
        let output_entry = S::from(output);
        let command = if poles.is_zero() || output == 0.0 {
            S::from(0.0)
        } else if zeros.is_zero() {
            refuse!(
                "initial_output={output}: this plant has no steady gain, so it rests only at \
                 zero. Give 0"
            );
        } else {
            output_entry.clone() * poles / zeros
        };
        let n = space.b.len();
        let mut state: Vec<S> = Vec::with_capacity(n);
        if n > 0 {
            let first = output_entry - space.d.clone() * command.clone();
            state.push(first.clone());
            for i in 0..n - 1 {
                let held = space.a[i * n].clone() * first.clone();
                state.push(-(held + space.b[i].clone() * command.clone()));
            }
        }
        Ok((state, command))
    }
}
