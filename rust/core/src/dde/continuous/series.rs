//! Taylor polynomials in a local coordinate σ ∈ [0, 1], and the state's expansion in them.

use crate::dde::linear::Equations;
use crate::dde::scalar::Scalar;

/// Degree of the polynomials. With the elements as long as [`NEGLIGIBLE`] allows, about 1.9 over
/// the fastest rate of the loop, 24 terms cost least per unit of time.
pub(crate) const DEGREE: usize = 24;

/// A last coefficient below this part of the largest one is below rounding, with the remainder
/// of the series behind it.
const NEGLIGIBLE: f64 = 1e-17;

/// A state this small throughout its element is as good as zero; it keeps subnormal numbers, which
/// have no relative precision, from shortening the element.
const NOTHING: f64 = 1e-280;

/// An element is tried no longer than this over the norm of A balanced, which keeps coefficients
/// from overflowing.
const TRIAL: f64 = 16.0;

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

    /// Value at σ.
    pub(crate) fn at(&self, sigma: S) -> S {
        self.terms()
            .iter()
            .rev()
            .fold(S::default(), |sum, &c| sum * sigma + c)
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

    /// Set `degree` to the last coefficient that matters.
    pub(crate) fn trim(&mut self) {
        // Slopes carry the rounding of products with values.
        let value = 1e-3 * NEGLIGIBLE * largest(self.terms(), S::value);
        let slope = 1e-3 * NEGLIGIBLE * largest(self.terms(), S::slope);
        let slope = slope.max(1e4 * value);
        while self.degree > 0
            && self.coefficients[self.degree].value().abs() <= value
            && self.coefficients[self.degree].slope().abs() <= slope
        {
            self.coefficients[self.degree] = S::default();
            self.degree -= 1;
        }
    }

    /// The polynomial in σ′ with σ = `offset` + `ratio` σ′.
    pub(crate) fn shifted(&self, offset: S, ratio: S) -> Self {
        let mut out = *self;
        if !offset.is_nothing() {
            // Repeated synthetic division by σ − offset.
            let terms = &mut out.coefficients[..=self.degree];
            for first in 0..self.degree {
                for j in (first..self.degree).rev() {
                    let above = terms[j + 1];
                    terms[j] += offset * above;
                }
            }
        }
        out.stretch(ratio);
        out
    }

    fn stretch(&mut self, ratio: S) {
        let mut power = S::from(1.0);
        for c in &mut self.coefficients[..=self.degree] {
            *c *= power;
            power *= ratio;
        }
    }
}

/// The largest modulus of what `read` reads.
fn largest<S: Scalar>(terms: &[S], read: impl Fn(S) -> f64) -> f64 {
    terms.iter().fold(0.0, |m, &c| f64::max(m, read(c).abs()))
}

/// x on one element, and how long the element is.
#[derive(Debug)]
pub(crate) struct Expansion<S = f64> {
    n: usize,
    /// Coefficient j of state i at j n + i.
    terms: Vec<S>,
    degree: usize,
    /// Longest element to try, s.
    pub(crate) trial: f64,
}

impl<S: Scalar> Expansion<S> {
    /// For x′ = A x + …, A being the equations' own or a closed-loop one.
    pub(crate) fn new(a: &[S], n: usize) -> Self {
        let norm = crate::dde::propagator::balanced_norm(a, n);
        Self {
            n,
            terms: vec![S::default(); (DEGREE + 1) * n],
            degree: 0,
            trial: if norm > 0.0 {
                TRIAL / norm
            } else {
                f64::INFINITY
            },
        }
    }

    /// Expand x′ = A x + B w + g over an element of length `h` that starts at `x`; the part of
    /// the element, in (0, 1], on which the truncated series is exact to rounding.
    pub(crate) fn expand(
        &mut self,
        a: &[S],
        b: &[S],
        g: &[S],
        x: &[S],
        w: &Series<S>,
        h: S,
    ) -> f64 {
        let n = self.n;
        self.terms[..n].copy_from_slice(x);
        self.degree = 0;
        for j in 0..DEGREE {
            let (known, rest) = self.terms.split_at_mut((j + 1) * n);
            let (old, new) = (&known[j * n..], &mut rest[..n]);
            let factor = h / S::from((j + 1) as f64);
            let input = w.coefficients[j];
            let mut alive = j < w.degree;
            for (i, new) in new.iter_mut().enumerate() {
                let mut slope = b[i] * input;
                for (&a, &x) in a[i * n..(i + 1) * n].iter().zip(old) {
                    slope += a * x;
                }
                if j == 0 {
                    slope += g[i];
                }
                *new = slope * factor;
                alive |= !new.is_nothing();
            }
            self.degree = j + 1;
            if !alive {
                break;
            }
        }
        self.sound_part()
    }

    /// Largest part of the element on which the last coefficients are negligible beside the
    /// largest one, and the same of their slopes.
    fn sound_part(&self) -> f64 {
        if self.degree < DEGREE - 1 {
            return 1.0;
        }
        let part = self.shortened(1.0, S::value, |c| c.value().abs());
        if S::MOVES {
            self.shortened(part, S::slope, |c| c.value().abs().max(c.slope().abs()))
        } else {
            part
        }
    }

    /// What remains of `part` of the element when the last coefficients are made negligible;
    /// both they and the largest shrink with the element, so the bound takes a few rounds. `read`
    /// gives what is to be negligible `beside` what.
    fn shortened(&self, mut part: f64, read: impl Fn(S) -> f64, beside: impl Fn(S) -> f64) -> f64 {
        for i in 0..self.n {
            loop {
                let (mut largest, mut power, mut ratio) = (0.0_f64, 1.0_f64, 1.0_f64);
                for j in 0..=self.degree {
                    let term = self.terms[j * self.n + i];
                    let size = read(term).abs() * power;
                    if j >= DEGREE - 1 && largest > NOTHING && size > NEGLIGIBLE * largest {
                        ratio = ratio.min((NEGLIGIBLE * largest / size).powf(1.0 / j as f64));
                    }
                    largest = largest.max(beside(term) * power);
                    power *= part;
                }
                // A step of a thousandth ends the approach from above.
                if ratio >= 1.0 || part < 1e-9 {
                    break;
                }
                part *= ratio.min(0.999);
            }
        }
        part
    }

    /// Shorten the element to `part` of its length.
    pub(crate) fn shorten(&mut self, part: f64) {
        let mut power = 1.0;
        for row in self.terms.chunks_exact_mut(self.n.max(1)) {
            for c in row {
                *c *= S::from(power);
            }
            power *= part;
        }
    }

    /// x at the end of `part` of the element.
    pub(crate) fn end(&self, part: S, x: &mut [S]) {
        x.fill(S::default());
        for j in (0..=self.degree).rev() {
            for (x, &c) in x.iter_mut().zip(&self.terms[j * self.n..]) {
                *x = *x * part + c;
            }
        }
    }

    /// The series of `row` x + `gain` w + `constant`.
    pub(crate) fn combine(&self, row: &[S], gain: S, w: &Series<S>, constant: S) -> Series<S> {
        let mut out = Series::constant(constant);
        out.degree = if gain.is_nothing() {
            self.degree
        } else {
            self.degree.max(w.degree)
        };
        for j in 0..=out.degree {
            if j <= self.degree {
                for (&k, &x) in row.iter().zip(&self.terms[j * self.n..]) {
                    out.coefficients[j] += k * x;
                }
            }
            out.coefficients[j] += gain * w.coefficients[j];
        }
        out.trim();
        out
    }

    /// Σ |k_i| max |x_i| on the element, or somewhat more: what rounding of `row` x is relative to.
    pub(crate) fn size(&self, row: &[S]) -> f64 {
        (0..=self.degree)
            .map(|j| {
                let terms = row.iter().zip(&self.terms[j * self.n..]);
                terms.map(|(&k, &x)| (k * x).value().abs()).sum::<f64>()
            })
            .sum()
    }

    /// u on the element.
    pub(crate) fn command(&self, equations: &Equations<S>, w: &Series<S>, r: f64) -> Series<S> {
        self.combine(&equations.k, equations.l, w, equations.m * S::from(r))
    }

    /// y on the element.
    pub(crate) fn output(&self, equations: &Equations<S>, w: &Series<S>) -> Series<S> {
        self.combine(&equations.c, equations.d, w, S::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_shifted_series_is_the_same_function(
            scaled in prop::collection::vec(-1.0..1.0, 1..=DEGREE + 1),
            (offset, part, sigma) in (0.0..1.0, 0.0..1.0, 0.0..1.0),
        ) {
            // Coefficients that decay as those of an element do.
            let mut series = Series::constant(0.0);
            series.degree = scaled.len() - 1;
            let mut size = 1.0;
            for (j, c) in scaled.iter().enumerate() {
                series.coefficients[j] = c * size;
                size *= 2.0 / (j + 1) as f64;
            }
            let ratio = part * (1.0 - offset);
            let shifted = series.shifted(offset, ratio);
            let truth = series.at(offset + ratio * sigma);
            prop_assert!((shifted.at(sigma) - truth).abs() < 2e-14);
        }
    }

    #[test]
    fn an_exponential_is_summed_to_rounding_on_the_part_that_is_offered() {
        let a = [-40.0];
        let mut expansion = Expansion::new(&a, 1);
        let part = expansion.expand(&a, &[0.0], &[0.0], &[1.0], &Series::constant(0.0), 0.3);
        assert!(part < 0.25, "e^-12 is not summed in one element: {part}");
        let mut x = [0.0];
        expansion.end(part, &mut x);
        let truth = (-12.0 * part).exp();
        assert!((x[0] - truth).abs() < 4.0 * f64::EPSILON * truth.max(1.0));
    }
}
