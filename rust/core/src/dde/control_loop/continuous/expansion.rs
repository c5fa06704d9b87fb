//! The Taylor expansion of the state on one element.

use crate::dde::control_loop::series::{DEGREE, NEGLIGIBLE, Series, horner};
use crate::dde::scalar::Scalar;

/// A state this small throughout its element counts as zero, so that subnormal numbers, which have
/// no relative precision, do not shorten the element.
const NOTHING: f64 = 1e-280;

/// Length of the first element tried, times the norm of the balanced A. A longer one would let
/// coefficients overflow.
const TRIAL: f64 = 16.0;

/// Part of an element below which it is not shortened further.
const SHORTEST: f64 = 1e-9;

/// Largest factor of one shortening, so that the approach from above ends.
const LEAST_SHORTENING: f64 = 0.999;

/// 1/1, 1/2, …: factors of an integration.
const PARTS: [f64; DEGREE] = {
    let mut parts = [1.0; DEGREE];
    let mut j = 1;
    while j < DEGREE {
        parts[j] = 1.0 / (j + 1) as f64;
        j += 1;
    }
    parts
};

/// x on one element, and the length of the element.
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
    /// For x′ = A x + …, where A is that of the equations or of the closed loop.
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

    /// Expand x′ = A x + B w + g over an element of length `h` that starts at `x`. Returns the part
    /// of the element, in (0, 1], on which the truncated series is exact to rounding.
    pub(crate) fn expand(
        &mut self,
        a: &[S],
        b: &[S],
        g: &[S],
        x: &[S],
        w: &Series<S>,
        h: S,
    ) -> f64 {
        // The same code for every n; small n are compiled as constants.
        match self.n {
            1 if a[0].is_nothing() => self.integrate(b[0], g[0], x[0], w, h),
            1 => self.fill(1, a, b, g, x, w, h),
            2 => self.fill(2, a, b, g, x, w, h),
            3 => self.fill(3, a, b, g, x, w, h),
            n => self.fill(n, a, b, g, x, w, h),
        }
        self.sound_part()
    }

    /// The recursion for one state without feedback, in which no term depends on the one before.
    fn integrate(&mut self, b: S, g: S, x: S, w: &Series<S>, h: S) {
        self.degree = (w.degree + 1).min(DEGREE);
        let input = b * h;
        self.terms[0] = x;
        for ((term, &w), part) in self.terms[1..=self.degree]
            .iter_mut()
            .zip(&w.coefficients)
            .zip(&PARTS)
        {
            *term = input * w * S::from(*part);
        }
        self.terms[1] += g * h;
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "one argument a symbol of the recursion"
    )]
    #[inline(always)]
    fn fill(&mut self, n: usize, a: &[S], b: &[S], g: &[S], x: &[S], w: &Series<S>, h: S) {
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
    }

    /// Largest part of the element on which the last coefficients, and their slopes, are negligible
    /// relative to the largest one.
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

    /// `part` of the element, shortened until the last coefficients are negligible. Both they and
    /// the largest coefficient shrink with the element, so that several rounds are needed. `read`
    /// returns what has to be negligible relative to `beside`.
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
                // Steps of one thousandth end the approach from above.
                if ratio >= 1.0 || part < SHORTEST {
                    break;
                }
                part *= ratio.min(LEAST_SHORTENING);
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
        for (i, x) in x.iter_mut().enumerate() {
            *x = self.state(i, part);
        }
    }

    /// State `i` at σ.
    fn state(&self, i: usize, sigma: S) -> S {
        match self.n {
            1 => horner(&self.terms, 0, 1, self.degree, sigma),
            n => horner(&self.terms, i, n, self.degree, sigma),
        }
    }

    /// Make a series `row` x + `gain` w + `constant`.
    #[inline]
    pub(crate) fn combine(
        &self,
        row: &[S],
        gain: S,
        w: &Series<S>,
        constant: S,
        out: &mut Series<S>,
    ) {
        out.set_degree(if gain.is_nothing() {
            self.degree
        } else {
            self.degree.max(w.degree)
        });
        out.coefficients[..=out.degree].fill(S::default());
        out.coefficients[0] = constant;
        match self.n {
            1 => self.weigh(1, row, out),
            2 => self.weigh(2, row, out),
            3 => self.weigh(3, row, out),
            n => self.weigh(n, row, out),
        }
        if !gain.is_nothing() {
            for (sum, &w) in out.coefficients.iter_mut().zip(w.terms()) {
                *sum += gain * w;
            }
        }
    }

    /// Add `row` x to `out`.
    #[inline(always)]
    fn weigh(&self, n: usize, row: &[S], out: &mut Series<S>) {
        let terms = self.terms[..(self.degree + 1) * n].chunks_exact(n.max(1));
        for (sum, x) in out.coefficients.iter_mut().zip(terms) {
            for (&k, &x) in row[..n].iter().zip(x) {
                *sum += k * x;
            }
        }
    }

    /// Σ |k_i| max |x_i| on the element, or slightly more. The rounding error of `row` x is
    /// relative to it.
    pub(crate) fn size(&self, row: &[S]) -> f64 {
        (0..=self.degree)
            .map(|j| {
                let terms = row.iter().zip(&self.terms[j * self.n..]);
                terms.map(|(&k, &x)| (k * x).value().abs()).sum::<f64>()
            })
            .sum()
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
            let mut shifted = series;
            shifted.shift(offset, ratio);
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
