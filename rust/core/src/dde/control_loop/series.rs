//! Polynomials in a local coordinate σ ∈ [0, 1].

use crate::dde::scalar::Scalar;

/// A last coefficient below this share of the largest one is smaller than rounding errors, and so
/// is the remainder of the series.
pub(crate) const NEGLIGIBLE: f64 = 1e-17;

/// Degree of the polynomials. With elements as long as [`NEGLIGIBLE`] allows, about 1.9 over the
/// fastest rate of the loop, 24 terms cost least for each unit of time.
pub(crate) const DEGREE: usize = 24;

/// Share of [`NEGLIGIBLE`] below which last coefficients are dropped.
pub(crate) const TRIMMED: f64 = 1e-3;

/// Rounding errors of slopes relative to those of values.
const SLOPE_ROUNDING: f64 = 1e4;

/// Σ c_j σ^j, with c_j at `offset` + `stride` j of `terms`. Even and odd powers are summed
/// separately, because each step of one sum waits for the step before.
#[inline]
pub(crate) fn horner<S: Scalar>(
    terms: &[S],
    offset: usize,
    stride: usize,
    degree: usize,
    sigma: S,
) -> S {
    let square = sigma * sigma;
    let (mut even, mut odd) = (S::default(), S::default());
    for j in (0..=degree / 2).rev() {
        let place = offset + 2 * j * stride;
        even = even * square + terms[place];
        if 2 * j < degree {
            odd = odd * square + terms[place + stride];
        }
    }
    even + odd * sigma
}

/// Number of values that are computed at once.
pub(crate) const BLOCK: usize = 4;

/// Coefficients of σ^j; those above `degree` are zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Series<S = f64> {
    pub(crate) coefficients: [S; DEGREE + 1],
    pub(crate) degree: usize,
}

impl<S: Scalar> Series<S> {
    pub(crate) fn constant(value: S) -> Self {
        let mut coefficients = [S::default(); DEGREE + 1];
        coefficients[0] = value;
        Self {
            coefficients,
            degree: 0,
        }
    }

    pub(crate) fn terms(&self) -> &[S] {
        &self.coefficients[..=self.degree]
    }

    /// Values at several σ, each with the bits of [`Series::at`]: the sums of one do not wait for
    /// those of another.
    #[inline]
    pub(crate) fn at_each(&self, sigmas: [S; BLOCK]) -> [S; BLOCK] {
        let squares = sigmas.map(|sigma| sigma * sigma);
        let (mut even, mut odd) = ([S::default(); BLOCK], [S::default(); BLOCK]);
        let (pairs, rest) = self.terms().as_chunks::<2>();
        if let [last] = rest {
            even = [*last; BLOCK];
        }
        for [first, second] in pairs.iter().rev() {
            for i in 0..BLOCK {
                even[i] = even[i] * squares[i] + *first;
                odd[i] = odd[i] * squares[i] + *second;
            }
        }
        for ((even, odd), sigma) in even.iter_mut().zip(odd).zip(sigmas) {
            *even += odd * sigma;
        }
        even
    }

    /// Value at σ.
    pub(crate) fn at(&self, sigma: S) -> S {
        horner(&self.coefficients, 0, 1, self.degree, sigma)
    }

    /// Bounds of the values on [0, 1].
    pub(crate) fn range(&self) -> (f64, f64) {
        let (mut low, mut high) = (self.coefficients[0].value(), self.coefficients[0].value());
        for c in self.terms()[1..].iter().map(|c| c.value()) {
            if c > 0.0 {
                high += c;
            } else {
                low += c;
            }
        }
        (low, high)
    }

    /// The polynomial's values alone.
    pub(crate) fn values(&self) -> Series {
        Series {
            coefficients: self.coefficients.map(S::value),
            degree: self.degree,
        }
    }

    /// d/dσ.
    pub(crate) fn derivative(&self) -> Self {
        let mut out = Self::constant(S::default());
        out.degree = self.degree.saturating_sub(1);
        for j in 1..=self.degree {
            out.coefficients[j - 1] = S::from(j as f64) * self.coefficients[j];
        }
        out
    }

    /// Set `degree` to the last coefficient that is not negligible.
    pub(crate) fn trim(&mut self) {
        // Slopes have rounding errors of products with values.
        let value = TRIMMED * NEGLIGIBLE * largest(self.terms(), S::value);
        let slope = if S::MOVES {
            (TRIMMED * NEGLIGIBLE * largest(self.terms(), S::slope)).max(SLOPE_ROUNDING * value)
        } else {
            0.0
        };
        while self.degree > 0
            && self.coefficients[self.degree].value().abs() <= value
            && self.coefficients[self.degree].slope().abs() <= slope
        {
            self.coefficients[self.degree] = S::default();
            self.degree -= 1;
        }
    }

    /// Become a copy of another; only terms that are not zero are written.
    #[inline]
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.set_degree(other.degree);
        self.coefficients[..=other.degree].copy_from_slice(other.terms());
    }

    /// Become a constant.
    pub(crate) fn set_constant(&mut self, value: S) {
        self.set_degree(0);
        self.coefficients[0] = value;
    }

    /// Add terms up to `degree`, which the caller writes; those above become zero.
    #[inline]
    pub(crate) fn set_degree(&mut self, degree: usize) {
        if self.degree > degree {
            self.coefficients[degree + 1..=self.degree].fill(S::default());
        }
        self.degree = degree;
    }

    /// Become the polynomial in σ′ with σ = `offset` + `ratio` σ′.
    #[inline]
    pub(crate) fn shift(&mut self, offset: S, ratio: S) {
        if !offset.is_nothing() {
            // Repeated synthetic division by σ − offset.
            let degree = self.degree;
            let terms = &mut self.coefficients[..=degree];
            for first in 0..degree {
                for j in (first..degree).rev() {
                    let above = terms[j + 1];
                    terms[j] += offset * above;
                }
            }
        }
        self.stretch(ratio);
    }

    #[inline]
    fn stretch(&mut self, ratio: S) {
        // Four powers at a time, which wait for each other a fourth as often.
        let square = ratio * ratio;
        let mut powers = [S::from(1.0), ratio, square, square * ratio];
        let fourth = square * square;
        for chunk in self.coefficients[..=self.degree].chunks_mut(powers.len()) {
            for (c, power) in chunk.iter_mut().zip(&mut powers) {
                *c *= *power;
                *power *= fourth;
            }
        }
    }
}

/// The largest modulus of the numbers that `read` returns.
fn largest<S: Scalar>(terms: &[S], read: impl Fn(S) -> f64) -> f64 {
    // Not `f64::max`, whose rule for NaN costs more than the rest of the loop.
    let larger = |a: f64, b: f64| if b > a { b } else { a };
    let (fours, rest) = terms.as_chunks::<4>();
    let mut most = [0.0; 4];
    for four in fours {
        for (most, &c) in most.iter_mut().zip(four) {
            *most = larger(*most, read(c).abs());
        }
    }
    let rest = rest.iter().map(|&c| read(c).abs());
    most.into_iter().chain(rest).fold(0.0, larger)
}

#[cfg(test)]
impl Series {
    /// The polynomial with these coefficients.
    pub(crate) fn of(coefficients: &[f64]) -> Self {
        let mut out = Self::constant(0.0);
        out.coefficients[..coefficients.len()].copy_from_slice(coefficients);
        out.degree = coefficients.len() - 1;
        out
    }
}
