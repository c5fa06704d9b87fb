//! An equation h(s; p) in which one number p varies, by the terms in which it stands.

use crate::quasipoly::QuasiPolynomial;
use crate::roots::is_stable;
use crate::stability::{Family, Term};
use crate::{Error, Task};

/// A family with one parameter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Equation<'a> {
    pub(super) family: &'a Family,
    pub(super) name: &'a str,
}

impl<'a> Equation<'a> {
    /// # Errors
    /// [`Error::Argument`] unless there is one parameter.
    pub(super) fn new(family: &'a Family) -> Result<Self, Error> {
        match family.names() {
            [name] => Ok(Self { family, name }),
            names => refuse!(
                "{} parameters have no value ({}), but only one can vary: give the others a value",
                names.len(),
                names.join(", ")
            ),
        }
    }

    fn terms(&self) -> impl Iterator<Item = (&'a Term, f64)> {
        let rows = self.family.rows();
        rows.flat_map(|(delay, terms)| {
            let slope = delay.slopes.first().copied().unwrap_or(0.0);
            terms.iter().map(move |term| (term, slope))
        })
    }

    /// The largest power of p.
    pub(super) fn highest_power(&self) -> u32 {
        self.terms()
            .map(|(term, _)| power_of(term))
            .max()
            .unwrap_or(0)
    }

    /// The slopes of the delays, distinct and increasing.
    pub(super) fn slopes(&self) -> Vec<f64> {
        let mut slopes: Vec<f64> = self.terms().map(|(_, slope)| slope).collect();
        slopes.sort_by(f64::total_cmp);
        slopes.dedup();
        slopes
    }

    /// Is p a delay, and not a factor?
    ///
    /// # Errors
    /// [`Error::Argument`] where it is both.
    pub(super) fn is_delay(&self) -> Result<bool, Error> {
        let is_delay = self.slopes().iter().any(|slope| *slope != 0.0);
        refuse_if!(
            is_delay && self.highest_power() > 0,
            "{} is both a factor and a delay, but crossings need a parameter that is only one of \
             the two. A map over this parameter and a second one is possible",
            self.name
        );
        Ok(is_delay)
    }

    /// What stands with p to the `power`.
    ///
    /// # Errors
    /// As [`QuasiPolynomial::new`].
    pub(super) fn factor(&self, power: u32) -> Result<QuasiPolynomial, Error> {
        self.part(|term, _| power_of(term) == power, 0.0)
    }

    /// The terms whose delays grow at this slope, without e^(−s `slope` p) and a common delay.
    ///
    /// # Errors
    /// As [`QuasiPolynomial::new`].
    pub(super) fn with_slope(&self, slope: f64) -> Result<QuasiPolynomial, Error> {
        let constants = self.terms().map(|(term, _)| term.delay.constant);
        let least = constants.fold(f64::INFINITY, f64::min);
        self.part(|_, own| own == slope, least)
    }

    fn part(
        &self,
        wanted: impl Fn(&Term, f64) -> bool,
        early: f64,
    ) -> Result<QuasiPolynomial, Error> {
        let (mut rows, mut delays) = (vec![vec![0.0]], vec![0.0]);
        for (term, _) in self.terms().filter(|(term, slope)| wanted(term, *slope)) {
            let mut row = vec![0.0; term.power as usize + 1];
            row[term.power as usize] = term.coefficient;
            rows.push(row);
            delays.push(term.delay.constant - early);
        }
        QuasiPolynomial::new(rows, delays)
    }

    /// Modulus of the leading coefficient of the smallest delay, and the sum of all others of that
    /// power, for p from `low` on.
    ///
    /// # Errors
    /// [`Error::Argument`] where the smallest delay has no such coefficient or is not the same up to
    /// `high`.
    pub(super) fn leading(&self, low: f64, high: f64) -> Result<(f64, f64), Error> {
        let degree = self.terms().map(|(term, _)| term.power).max().unwrap_or(0);
        let delay = |term: &Term, slope: f64, p: f64| term.delay.constant + slope * p;
        // What is first just above the low end and just below the high end is first between them.
        let mut ends = [(f64::INFINITY, 0.0); 2];
        for (term, slope) in self.terms() {
            for (best, (p, sign)) in ends.iter_mut().zip([(low, 1.0), (high, -1.0)]) {
                let found = (delay(term, slope, p), sign * slope);
                if found < *best {
                    *best = found;
                }
            }
        }
        let [(first, slope), (last, negative)] = ends;
        let (mut lead, mut all) = (0.0, 0.0);
        let is_one = slope == -negative
            && self.terms().all(|(term, own)| {
                let is_first = delay(term, own, low) == first && own == slope;
                is_first == (delay(term, own, high) == last && own == slope)
            });
        for (term, own) in self.terms().filter(|(term, _)| term.power == degree) {
            all += term.coefficient.abs();
            if delay(term, own, low) == first && own == slope {
                lead += term.coefficient;
            }
        }
        let lead = f64::abs(lead);
        refuse_if!(
            !is_one || lead == 0.0,
            "for some {} from {low} on, the highest power of s appears only with a delay. Such an \
             equation is not causal, and has infinitely many unstable roots",
            self.name
        );
        Ok((lead * (1.0 - super::chains::ROOM), all - lead))
    }

    /// Is the member at `value` strongly stable?
    ///
    /// # Errors
    /// As [`is_stable`].
    pub(super) fn is_stable_at(&self, value: f64, task: &Task) -> Result<bool, Error> {
        is_stable(&self.family.at(&[value])?, true, task)
    }

    /// A delay well beyond `value`, and beyond those at which the order of the delays may change.
    pub(super) fn far_delay(&self, value: f64) -> f64 {
        let constants = self.terms().map(|(term, _)| term.delay.constant);
        2.0 * value + 2.0 * constants.fold(0.0, f64::max) + 1.0
    }
}

fn power_of(term: &Term) -> u32 {
    term.exponents.first().copied().unwrap_or(0)
}
