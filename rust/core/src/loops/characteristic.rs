//! The characteristic function and the transfer functions of a continuous loop, its limit left out.
//!
//! With the plant b/a, the feedback F = f/g and the reference path R = r/g of the controller, the loop
//! has the characteristic function a g + b f e^(−s T).

use crate::Error;
use crate::quasipoly::QuasiPolynomial;
use crate::stability::{Affine, Family, Term};

use super::control_loop::{ControlLoop, Place, Values};
use super::controller::Paths;
use super::drive::Drive;
use super::entry::Entry;
use super::plant::Plant;
use super::polynomial::product;
use super::symbol::Symbol;

/// Sums of polynomials in s (descending) times e^(−s τ), by τ.
type Sums<S> = Vec<(f64, Vec<S>)>;

impl ControlLoop {
    /// b and a.
    fn ratio<S: Entry>(&self, values: &Values<S>) -> Result<[Sums<S>; 2], Error> {
        let (num, den) = match self.plant() {
            Plant::Delayed(num, den) => (num, den),
            rational => {
                let found = rational.fraction(&values.plant, values.given.as_ref())?;
                return Ok([vec![(0.0, found.num)], vec![(0.0, found.den)]]);
            }
        };
        let gain = values
            .plant
            .first()
            .cloned()
            .unwrap_or_else(|| S::from(1.0));
        let sums = |of: &QuasiPolynomial, factor: Option<&S>| -> Sums<S> {
            let entry = |c: &f64| match factor {
                Some(factor) => factor.clone() * S::from(*c),
                None => S::from(*c),
            };
            of.terms()
                .map(|(row, delay)| (delay, row.iter().rev().map(entry).collect()))
                .collect()
        };
        Ok([sums(num, Some(&gain)), sums(den, None)])
    }

    /// a g + b f e^(−s T) over these numbers.
    ///
    /// # Errors
    /// [`Error::Argument`] for the sample time or the limit, or a number given twice.
    pub fn family(
        &self,
        names: Vec<String>,
        places: &[Place],
        values: &Values<Symbol>,
    ) -> Result<Family, Error> {
        Family::new(names, self.terms(places, values)?)
    }

    /// The terms of [`family`](Self::family), their parameters in the order of `places`, which are free
    /// in `values`.
    ///
    /// # Errors
    /// As [`family`](Self::family).
    pub fn terms(&self, places: &[Place], values: &Values<Symbol>) -> Result<Vec<Term>, Error> {
        let none = places.iter().find(|place| {
            matches!(
                place,
                Place::SampleTime | Place::Limit | Place::Low | Place::Rate
            )
        });
        if let Some(place) = none {
            refuse!(
                "{place:?} is not a parameter of the characteristic function of a continuous loop"
            );
        }
        let [b, a] = self.ratio(values)?;
        let Paths { f, g, .. } = self.controller().paths(&values.controller);
        let free: Vec<f64> = places
            .iter()
            .map(|place| f64::from(u8::from(*place == Place::Delay)))
            .collect();
        let own = if places.contains(&Place::Delay) {
            0.0
        } else {
            self.values().delay
        };
        let mut terms = Vec::new();
        for (delay, a) in &a {
            let still = Affine {
                constant: *delay,
                slopes: vec![0.0; places.len()],
            };
            put(&mut terms, &product(a, &g), &still);
        }
        for (delay, b) in &b {
            let late = Affine {
                constant: own + delay,
                slopes: free.clone(),
            };
            put(&mut terms, &product(b, &f), &late);
        }
        Ok(terms)
    }

    /// The numbers with these of them free.
    pub fn free(&self, places: &[Place]) -> Values<Symbol> {
        let mut values = self.values().entries::<Symbol>();
        for (index, place) in places.iter().enumerate() {
            values.set(*place, Symbol::free(index));
        }
        values
    }

    /// b f e^(−s T) and a g: the loop gain is the first over the second.
    ///
    /// # Errors
    /// [`Error::Argument`] where a coefficient is beyond double precision.
    pub fn loop_gain(&self) -> Result<(QuasiPolynomial, QuasiPolynomial), Error> {
        let [b, a] = self.ratio(self.values())?;
        let Paths { f, g, .. } = self.controller().paths(&self.values().controller);
        Ok((times(&b, &f, self.values().delay)?, times(&a, &g, 0.0)?))
    }

    /// b and a.
    ///
    /// # Errors
    /// As [`loop_gain`](Self::loop_gain).
    pub fn plant_ratio(&self) -> Result<(QuasiPolynomial, QuasiPolynomial), Error> {
        let [b, a] = self.ratio(self.values())?;
        Ok((times(&b, &[1.0], 0.0)?, times(&a, &[1.0], 0.0)?))
    }

    /// The characteristic function.
    ///
    /// # Errors
    /// As [`loop_gain`](Self::loop_gain).
    pub fn characteristic(&self) -> Result<QuasiPolynomial, Error> {
        let (fed, open) = self.loop_gain()?;
        open.add(&fed)
    }

    /// From an input besides the reference to output and command, over the characteristic function:
    /// b g and −b f of a load, a g and −a f of the output, −b f e^(−s T) and −a f of noise; what passes
    /// the delay is delayed.
    ///
    /// # Errors
    /// As [`loop_gain`](Self::loop_gain).
    pub fn from_input(&self, of: Drive) -> Result<[QuasiPolynomial; 2], Error> {
        let [b, a] = self.ratio(self.values())?;
        let Paths { f, g, r } = self.controller().paths(&self.values().controller);
        let back: Vec<f64> = f.iter().map(|c| -c).collect();
        let lead = self.output_lead();
        let late = self.values().delay - lead;
        let (to_output, to_command) = match of {
            Drive::Reference => (times(&b, &r, late)?, times(&a, &r, 0.0)?),
            Drive::Load => (times(&b, &g, 0.0)?, times(&b, &back, lead)?),
            Drive::Output => (times(&a, &g, 0.0)?, times(&a, &back, lead)?),
            Drive::Noise => (times(&b, &back, late)?, times(&a, &back, 0.0)?),
        };
        Ok([to_output, to_command])
    }
}

/// Each polynomial times another one and e^(−s `late`).
fn times(sums: &Sums<f64>, other: &[f64], late: f64) -> Result<QuasiPolynomial, Error> {
    let rows = sums.iter().map(|(_, row)| {
        let mut ascending = product(row, other);
        ascending.reverse();
        ascending
    });
    let delays = sums.iter().map(|(delay, _)| delay + late).collect();
    QuasiPolynomial::new(rows.collect(), delays)
}

fn put(terms: &mut Vec<Term>, descending: &[Symbol], delay: &Affine) {
    for (power, coefficient) in (0..).zip(descending.iter().rev()) {
        for monomial in &coefficient.0 {
            let mut exponents = monomial.powers.clone();
            exponents.resize(delay.slopes.len(), 0);
            terms.push(Term {
                coefficient: monomial.factor,
                exponents,
                power,
                delay: delay.clone(),
            });
        }
    }
}
