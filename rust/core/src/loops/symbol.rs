//! Polynomials in the free numbers of a loop.

use std::ops::{Add, Mul};

use super::entry::Entry;

/// A factor, and the power of each free number; powers that are left out at the end are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Monomial {
    /// The factor, not zero.
    pub factor: f64,
    /// The powers.
    pub powers: Vec<u32>,
}

/// A sum of monomials, each with other powers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Symbol(pub Vec<Monomial>);

impl Symbol {
    /// A free number itself.
    pub fn free(place: usize) -> Self {
        let mut powers = vec![0; place];
        powers.push(1);
        Self(vec![Monomial {
            factor: 1.0,
            powers,
        }])
    }

    /// Its value where the first free number is this one.
    pub(super) fn at<S: Entry>(&self, number: &S) -> S {
        let terms = self.0.iter().map(|monomial| {
            let power = monomial.powers.first().copied().unwrap_or(0);
            (0..power).fold(S::from(monomial.factor), |product, _| {
                product * number.clone()
            })
        });
        terms.fold(S::from(0.0), |sum, term| sum + term)
    }

    fn put(&mut self, new: Monomial) {
        match self.0.iter_mut().find(|known| known.powers == new.powers) {
            Some(known) => known.factor += new.factor,
            None => self.0.push(new),
        }
    }
}

impl From<f64> for Symbol {
    fn from(factor: f64) -> Self {
        let powers = Vec::new();
        Self(if factor == 0.0 {
            Vec::new()
        } else {
            vec![Monomial { factor, powers }]
        })
    }
}

impl Add for Symbol {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        for monomial in other.0 {
            self.put(monomial);
        }
        self.0.retain(|monomial| monomial.factor != 0.0);
        self
    }
}

impl Mul for Symbol {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let mut product = Self::default();
        for x in &self.0 {
            for y in &other.0 {
                product.put(Monomial {
                    factor: x.factor * y.factor,
                    powers: joined(&x.powers, &y.powers),
                });
            }
        }
        product.0.retain(|monomial| monomial.factor != 0.0);
        product
    }
}

/// The powers of a product.
fn joined(x: &[u32], y: &[u32]) -> Vec<u32> {
    let power = |of: &[u32], i: usize| of.get(i).copied().unwrap_or(0);
    let length = x.len().max(y.len());
    (0..length).map(|i| power(x, i) + power(y, i)).collect()
}

impl Entry for Symbol {
    fn is_zero(&self) -> bool {
        self.0.is_empty()
    }
}
