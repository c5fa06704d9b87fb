//! Quasi-polynomials whose coefficients and delays depend on named parameters.
//!
//! A family is a sum of terms c · Π p_i^e_i · s^k · e^(−s τ(p)) with whole e_i and k and delays
//! τ(p) = τ_0 + Σ σ_i p_i affine in the parameters p. It is what sums, differences and products of
//! gains, s and e^(−s T) lead to. [`Family::at`] puts numbers in. The coefficients and delays of a
//! member have only the rounding errors of that evaluation. Delays that agree to 4 ulp are the same
//! sum in another order and are merged, as in products of quasi-polynomials; a delay that is
//! negative only by rounding errors is zero.

use crate::Error;
use crate::quasipoly::{QuasiPolynomial, equate_close_delays};

/// Upper limit on a power of s or of a parameter. A larger one is most likely a typing error.
const MAX_POWER: u32 = 1000;

/// Upper limit on the number of terms (bounds memory and time).
const MAX_TERMS: usize = 100_000;

/// constant + Σ `slopes[i]` · p_i.
#[derive(Debug, Clone, PartialEq)]
pub struct Affine {
    /// Value where all parameters are zero.
    pub constant: f64,
    /// One slope for each parameter.
    pub slopes: Vec<f64>,
}

impl Affine {
    /// The value at `values` and the sum of the moduli of its summands.
    fn evaluate(&self, values: &[f64]) -> (f64, f64) {
        let mut sum = (self.constant, self.constant.abs());
        for (slope, value) in self.slopes.iter().zip(values) {
            if *slope != 0.0 {
                sum.0 += slope * value;
                sum.1 += (slope * value).abs();
            }
        }
        sum
    }
}

/// One summand of a family.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// The numerical factor.
    pub coefficient: f64,
    /// The power of each parameter.
    pub exponents: Vec<u32>,
    /// The power of s.
    pub power: u32,
    /// The delay in seconds.
    pub delay: Affine,
}

/// A quasi-polynomial with named parameters.
///
/// ```
/// use deadtime::stability::{Affine, Family, Term};
/// // s + Kp e^(−s T)
/// let term = |exponents: [u32; 2], power, slope| Term {
///     coefficient: 1.0,
///     exponents: exponents.to_vec(),
///     power,
///     delay: Affine { constant: 0.0, slopes: vec![0.0, slope] },
/// };
/// let names = vec!["Kp".into(), "T".into()];
/// let family = Family::new(names, vec![term([0, 0], 1, 0.0), term([1, 0], 0, 1.0)])?;
/// let h = family.at(&[2.0, 0.36])?;
/// assert_eq!(h.delays(), [0.0, 0.36]);
/// assert_eq!(h.coefficients(), [vec![0.0, 1.0], vec![2.0]]);
/// # Ok::<(), deadtime::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Family {
    names: Vec<String>,
    /// Distinct delays.
    delays: Vec<Affine>,
    /// Terms that share a delay, by its index.
    terms: Vec<Vec<Term>>,
}

impl Family {
    /// Check the terms and group them by delay.
    ///
    /// # Errors
    /// [`Error::Argument`] where a name occurs twice, a term does not have one exponent and one
    /// slope for each parameter, a number is not finite, or a power is above its limit;
    /// [`Error::TooMuch`] for too many terms.
    pub fn new(names: Vec<String>, terms: Vec<Term>) -> Result<Self, Error> {
        if let Some(name) = repeated(&names) {
            refuse!("the parameter {name} is given twice: give every parameter its own name");
        }
        if terms.len() > MAX_TERMS {
            return Err(Error::TooMuch {
                what: "the family",
                limit: MAX_TERMS as u64,
                unit: "terms",
                advice: "keep the factors separate, because the roots of a product are the roots \
                    of its factors"
                    .into(),
            });
        }
        let mut family = Self {
            names,
            delays: Vec::new(),
            terms: Vec::new(),
        };
        for term in terms {
            family.check(&term)?;
            let known = family.delays.iter().position(|delay| *delay == term.delay);
            match known.and_then(|index| family.terms.get_mut(index)) {
                Some(row) => row.push(term),
                None => {
                    family.delays.push(term.delay.clone());
                    family.terms.push(vec![term]);
                }
            }
        }
        Ok(family)
    }

    fn check(&self, term: &Term) -> Result<(), Error> {
        let count = self.names.len();
        refuse_if!(
            term.exponents.len() != count || term.delay.slopes.len() != count,
            "a term has {} exponents and {} slopes of its delay for {count} parameters: give \
             one of each for every parameter",
            term.exponents.len(),
            term.delay.slopes.len()
        );
        let mut numbers = std::iter::once(&term.coefficient)
            .chain([&term.delay.constant])
            .chain(&term.delay.slopes);
        if let Some(number) = numbers.find(|number| !number.is_finite()) {
            refuse!("a term contains {number}, but coefficients and delays must be finite");
        }
        let highest = term.exponents.iter().fold(term.power, |a, b| a.max(*b));
        refuse_if!(
            highest > MAX_POWER,
            "a parameter has the power {highest}: give powers up to {MAX_POWER}"
        );
        Ok(())
    }

    /// The names of the parameters, in the order of the values.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Distinct delays with the terms that share them.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&Affine, &[Term])> {
        self.delays.iter().zip(self.terms.iter().map(Vec::as_slice))
    }

    /// The member of the family at `values`, one for each parameter.
    ///
    /// # Errors
    /// [`Error::Argument`] for a wrong number of values, values that are not finite, a delay that
    /// is negative there, or a coefficient that overflows.
    pub fn at(&self, values: &[f64]) -> Result<QuasiPolynomial, Error> {
        self.check_values(values)?;
        let mut rows = Vec::with_capacity(self.terms.len());
        for (delay, terms) in self.delays.iter().zip(&self.terms) {
            let mut row = Vec::new();
            for term in terms {
                let place = term.power as usize;
                if row.len() <= place {
                    row.resize(place + 1, 0.0);
                }
                if let Some(total) = row.get_mut(place) {
                    *total += value_of(term, values);
                }
            }
            rows.push((row, self.delay_at(delay, values)?));
        }
        if rows.is_empty() {
            return Ok(QuasiPolynomial::zero());
        }
        equate_close_delays(&mut rows);
        let (coefficients, delays) = rows.into_iter().unzip();
        QuasiPolynomial::new(coefficients, delays)
    }

    /// A and B with h = A + p B, neither depending on the parameter p; `None` where h is not affine
    /// in it.
    pub fn split(&self, parameter: usize) -> Option<(Self, Self)> {
        let exponent = |term: &Term| term.exponents.get(parameter).copied().unwrap_or(0);
        let part = |wanted: u32| {
            let terms = self.terms.iter().flatten();
            let terms = terms.filter(|term| exponent(term) == wanted).map(|term| {
                let mut term = term.clone();
                if let Some(exponent) = term.exponents.get_mut(parameter) {
                    *exponent = 0;
                }
                term
            });
            Self::new(self.names.clone(), terms.collect()).ok()
        };
        let fixed = |delay: &Affine| {
            delay
                .slopes
                .get(parameter)
                .is_none_or(|slope| *slope == 0.0)
        };
        let affine = self.terms.iter().flatten().all(|term| exponent(term) <= 1);
        if !(affine && self.delays.iter().all(fixed)) {
            return None;
        }
        part(0).zip(part(1))
    }

    /// A, B and σ > 0 with h = A + e^(−s σ p) B, where the parameter p enters A not at all and B only
    /// by its delays; `None` where h is not of this form.
    pub(super) fn split_delay(&self, parameter: usize) -> Option<(Self, Self, f64)> {
        let slope_of = |delay: &Affine| delay.slopes.get(parameter).copied().unwrap_or(0.0);
        let slope = self.delays.iter().map(slope_of).find(|s| *s != 0.0)?;
        let all = || self.terms.iter().flatten();
        let enters_otherwise = all().any(|term| {
            let power = term.exponents.get(parameter).copied().unwrap_or(0);
            let own = slope_of(&term.delay);
            power > 0 || (own != 0.0 && own != slope)
        });
        if enters_otherwise || slope < 0.0 {
            return None;
        }
        let part = |varies: bool| {
            let terms = all().filter(|term| (slope_of(&term.delay) != 0.0) == varies);
            Self::new(self.names.clone(), terms.cloned().collect()).ok()
        };
        Some((part(false)?, part(true)?, slope))
    }

    /// The highest power of s for any parameters.
    pub(super) fn degree(&self) -> u32 {
        let terms = self.terms.iter().flatten();
        terms.fold(0, |highest, term| highest.max(term.power))
    }

    /// Is there a term without s?
    pub(super) fn has_constant(&self) -> bool {
        self.terms.iter().flatten().any(|term| term.power == 0)
    }

    /// Check that no delay becomes negative where each parameter lies in its range.
    ///
    /// # Errors
    /// [`Error::Argument`] with a corner of the ranges where one does.
    pub fn check_delays(&self, ranges: &[(f64, f64)]) -> Result<(), Error> {
        let lows: Vec<f64> = ranges.iter().map(|range| range.0).collect();
        self.check_values(&lows)?;
        for delay in &self.delays {
            // An affine function is least at a corner.
            let corner: Vec<f64> = delay
                .slopes
                .iter()
                .zip(ranges)
                .map(|(slope, (low, high))| if *slope > 0.0 { *low } else { *high })
                .collect();
            self.check_values(&corner)?;
            self.delay_at(delay, &corner)?;
        }
        Ok(())
    }

    fn check_values(&self, values: &[f64]) -> Result<(), Error> {
        refuse_if!(
            values.len() != self.names.len(),
            "{} values are given for {} parameters ({}): give one value for each parameter",
            values.len(),
            self.names.len(),
            self.names.join(", ")
        );
        match self.names.iter().zip(values).find(|(_, v)| !v.is_finite()) {
            Some((name, value)) => refuse!("{name}={value}: give a finite value"),
            None => Ok(()),
        }
    }

    fn delay_at(&self, delay: &Affine, values: &[f64]) -> Result<f64, Error> {
        let (value, size) = delay.evaluate(values);
        let rounding = f64::EPSILON * (delay.slopes.len() + 1) as f64 * size;
        if value >= 0.0 {
            // Infinite values are refused with the quasi-polynomial.
            return Ok(value);
        }
        if value >= -rounding {
            return Ok(0.0);
        }
        let place: Vec<String> = self
            .names
            .iter()
            .zip(values)
            .zip(&delay.slopes)
            .filter(|(_, slope)| **slope != 0.0)
            .map(|((name, value), _)| format!("{name}={value}"))
            .collect();
        let place = if place.is_empty() {
            String::new()
        } else {
            format!(" at {}", place.join(", "))
        };
        refuse!("a delay is {value} s{place}, but delays must not be negative")
    }
}

fn repeated(names: &[String]) -> Option<&String> {
    let mut rest = names;
    while let Some((name, others)) = rest.split_first() {
        if others.contains(name) {
            return Some(name);
        }
        rest = others;
    }
    None
}

/// The term's coefficient with numbers put in.
fn value_of(term: &Term, values: &[f64]) -> f64 {
    let mut product = term.coefficient;
    for (value, exponent) in values.iter().zip(&term.exponents) {
        // Repeated products instead of powi, whose bits differ between machines.
        for _ in 0..*exponent {
            product *= value;
        }
    }
    product
}
