//! Polynomials in s whose coefficients are polynomials in two free numbers of the loop.

/// Number of free numbers: those on the axes of a map.
pub(crate) const FREE: usize = 2;

/// A factor, and the power of each free number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Monomial {
    pub(crate) factor: f64,
    pub(crate) powers: [u32; FREE],
}

/// A sum of monomials; none is zero.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Coefficient(pub(crate) Vec<Monomial>);

impl Coefficient {
    pub(crate) fn number(factor: f64) -> Self {
        let powers = [0; FREE];
        Self(if factor == 0.0 {
            Vec::new()
        } else {
            vec![Monomial { factor, powers }]
        })
    }

    /// A free number itself.
    pub(crate) fn free(place: usize) -> Self {
        let powers = std::array::from_fn(|i| u32::from(i == place));
        Self(vec![Monomial {
            factor: 1.0,
            powers,
        }])
    }

    fn plus(mut self, other: &Self) -> Self {
        for one in &other.0 {
            match self.0.iter_mut().find(|known| known.powers == one.powers) {
                Some(known) => known.factor += one.factor,
                None => self.0.push(*one),
            }
        }
        self.0.retain(|one| one.factor != 0.0);
        self
    }

    pub(crate) fn times(&self, other: &Self) -> Self {
        let mut product = Self::default();
        for one in &self.0 {
            for two in &other.0 {
                let powers = std::array::from_fn(|i| one.powers[i] + two.powers[i]);
                let factor = one.factor * two.factor;
                product = product.plus(&Self(vec![Monomial { factor, powers }]));
            }
        }
        product
    }
}

/// Ascending coefficients of the powers of s.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Polynomial(pub(crate) Vec<Coefficient>);

impl Polynomial {
    /// Numbers in descending order, as they are written.
    pub(crate) fn descending(numbers: &[f64]) -> Self {
        Self(
            numbers
                .iter()
                .rev()
                .map(|c| Coefficient::number(*c))
                .collect(),
        )
    }

    pub(crate) fn one() -> Self {
        Self(vec![Coefficient::number(1.0)])
    }

    pub(crate) fn plus(mut self, other: &Self) -> Self {
        if self.0.len() < other.0.len() {
            self.0.resize(other.0.len(), Coefficient::default());
        }
        for (mine, c) in self.0.iter_mut().zip(&other.0) {
            *mine = std::mem::take(mine).plus(c);
        }
        self
    }

    pub(crate) fn times(&self, other: &Self) -> Self {
        let length = (self.0.len() + other.0.len()).saturating_sub(1);
        let mut product = vec![Coefficient::default(); length];
        for (i, a) in self.0.iter().enumerate() {
            for (j, b) in other.0.iter().enumerate() {
                if let Some(place) = product.get_mut(i + j) {
                    *place = std::mem::take(place).plus(&a.times(b));
                }
            }
        }
        Self(product)
    }

    pub(crate) fn scaled(&self, factor: &Coefficient) -> Self {
        Self(self.0.iter().map(|c| c.times(factor)).collect())
    }

    /// The coefficients of a polynomial without free numbers, descending, leading zeros left out.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        let value = |c: &Coefficient| c.0.iter().map(|one| one.factor).sum();
        let mut numbers: Vec<f64> = self.0.iter().map(value).collect();
        while numbers.len() > 1 && numbers.last() == Some(&0.0) {
            numbers.pop();
        }
        numbers.reverse();
        numbers
    }
}
