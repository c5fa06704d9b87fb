//! The order of a root at 0, without rounding.
//!
//! h⁽ⁱ⁾(0) = Σ_j Σ_k c_jk k! C(i, k) (−τ_j)^(i−k). Coefficients and delays are whole numbers times
//! powers of two, and so is the sum: computed in integers, the test for zero is exact.

use num_bigint::BigInt;

use super::quasi_polynomial::QuasiPolynomial;

/// Upper limit on the bits of a sum: numbers that differ so much in size are not meant to cancel.
const MOST_BITS: u32 = 100_000;

/// A whole number times a power of two.
#[derive(Debug, Clone)]
struct Dyadic {
    whole: BigInt,
    exponent: i64,
}

impl Dyadic {
    fn of(value: f64) -> Self {
        let bits = value.abs().to_bits();
        let (fraction, biased) = (bits & ((1 << 52) - 1), (bits >> 52) as i64);
        let (mantissa, exponent) = if biased == 0 {
            (fraction, -1074)
        } else {
            (fraction | (1 << 52), biased - 1075)
        };
        let whole = BigInt::from(mantissa);
        Self {
            whole: if value < 0.0 { -whole } else { whole },
            exponent,
        }
    }

    fn times(&self, other: &Self) -> Self {
        Self {
            whole: &self.whole * &other.whole,
            exponent: self.exponent + other.exponent,
        }
    }

    /// The sum; `None` where it would be too long.
    fn plus(self, other: Self) -> Option<Self> {
        let (low, high) = if self.exponent <= other.exponent {
            (self, other)
        } else {
            (other, self)
        };
        if low.whole == BigInt::ZERO || high.whole == BigInt::ZERO {
            return Some(if low.whole == BigInt::ZERO { high } else { low });
        }
        let shift = u32::try_from(high.exponent - low.exponent).ok()?;
        (shift < MOST_BITS).then(|| Self {
            whole: low.whole + (high.whole << shift),
            exponent: low.exponent,
        })
    }
}

impl QuasiPolynomial {
    /// The multiplicity of 0 as a root, exactly, up to `most`.
    ///
    /// ```
    /// # use deadtime::quasipoly::QuasiPolynomial;
    /// // s − 1 + e^(−s) = s²/2 − …
    /// let h = QuasiPolynomial::new(vec![vec![-1.0, 1.0], vec![1.0]], vec![0.0, 1.0])?;
    /// assert_eq!(h.order_at_zero(9), 2);
    /// # Ok::<(), deadtime::Error>(())
    /// ```
    pub fn order_at_zero(&self, most: u32) -> u32 {
        (0..most)
            .take_while(|i| self.vanishes_at_zero(*i))
            .count()
            .try_into()
            .unwrap_or(most)
    }

    /// Is the `i`-th derivative exactly zero at 0?
    fn vanishes_at_zero(&self, i: u32) -> bool {
        let mut total = Dyadic::of(0.0);
        for (row, delay) in self.terms() {
            // (−τ)^(i−k) and k! C(i, k) = i (i − 1) … (i − k + 1), from k = i down to 0.
            let mut powers = vec![Dyadic::of(1.0)];
            for _ in 0..i {
                let next = powers.last().map(|last| last.times(&Dyadic::of(-delay)));
                powers.extend(next);
            }
            let mut falling = BigInt::from(1);
            for (k, (c, power)) in (0..=i).zip(row.iter().zip(powers.iter().rev())) {
                let mut term = Dyadic::of(*c).times(power);
                term.whole *= &falling;
                falling *= i - k;
                match total.plus(term) {
                    Some(sum) => total = sum,
                    None => return false,
                }
            }
        }
        total.whole == BigInt::ZERO
    }
}

#[cfg(test)]
mod tests {
    use crate::quasipoly::make;

    fn order(rows: &[&[f64]], delays: &[f64]) -> u32 {
        make(rows, delays).order_at_zero(20)
    }

    #[test]
    fn orders_are_exact() {
        assert_eq!(order(&[&[0.0, 1.0], &[1.0]], &[0.0, 1.0]), 0);
        assert_eq!(order(&[&[0.0, 0.0, 1.0]], &[0.7]), 2);
        // One ulp beside the double root.
        let (above, below) = (1.0 + f64::EPSILON, 1.0 - f64::EPSILON);
        assert_eq!(order(&[&[-1.0, 1.0], &[1.0]], &[0.0, above]), 1);
        assert_eq!(order(&[&[-1.0, 1.0], &[below]], &[0.0, 1.0]), 0);
        // s³ − 12 s² + 60 s − 120 + (120 + 60 s + 12 s² + s³) e^(−s): Padé's remainder, O(s⁷).
        let rows: &[&[f64]] = &[&[-120.0, 60.0, -12.0, 1.0], &[120.0, 60.0, 12.0, 1.0]];
        assert_eq!(order(rows, &[0.0, 1.0]), 7);
        assert_eq!(order(rows, &[3.0, 4.0]), 7);
        assert_eq!(order(&[&[0.0, 1e300], &[1e-300]], &[0.0, 1e-300]), 0);
    }
}
