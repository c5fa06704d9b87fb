//! Plants with lags in front: 1/(T₁ s + 1) … (z s + 1)/(T_m s + 1) · num(s)/den(s).
//!
//! The lags come first, the last of them with the zero; num/den follows in its controllable
//! canonical form. A lag of zero has no state. Without lags the zero is a factor of num.

use crate::Error;

/// Most states of plant and noise.
pub(super) const MOST_STATES: usize = 8;

/// A plant x′ = A x + B u, y = C x + D u; A row-major.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlantSpace {
    /// Shape (n, n).
    pub(super) a: Vec<f64>,
    /// Shape (n,).
    pub(super) b: Vec<f64>,
    /// Shape (n,).
    pub(super) c: Vec<f64>,
    /// Direct part.
    pub(super) d: f64,
    /// What moving air drives in the place of b, shape (n,).
    pub(super) air: Vec<f64>,
    /// The direct part of air.
    pub(super) air_direct: f64,
    /// Number of the lags, which are the first states: each depends on those before it.
    pub(super) lags: usize,
}

/// The given part of a plant, of unit gain: num(s)/den(s), proper.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    /// Numerator over the leading coefficient of den, ascending, as long as den.
    num: Vec<f64>,
    /// Denominator, monic, ascending.
    den: Vec<f64>,
    /// Does air act behind the lags, as forces and torques do, and not through them?
    air_behind_lags: bool,
}

impl Plant {
    /// From coefficients in descending powers of s.
    ///
    /// # Errors
    ///
    /// For a coefficient that is not finite, a denominator that is empty, zero or of too high a
    /// degree, and a numerator of a higher degree.
    pub fn new(num: &[f64], den: &[f64]) -> Result<Self, Error> {
        if let Some(c) = num.iter().chain(den).find(|c| !c.is_finite()) {
            refuse!("a coefficient of the plant is {c}: give finite numbers");
        }
        let lead = den.iter().position(|c| *c != 0.0);
        let Some(den) = lead.map(|lead| &den[lead..]) else {
            refuse!("the denominator of the plant is zero")
        };
        refuse_if!(
            den.len() > MOST_STATES + 1,
            "the denominator of the plant has degree {}, but the likelihood can use at most \
             {MOST_STATES}",
            den.len() - 1
        );
        let num = &num[num.iter().position(|c| *c != 0.0).unwrap_or(num.len())..];
        refuse_if!(
            num.len() > den.len(),
            "the numerator of the plant has degree {}, and the denominator only {}",
            num.len() - 1,
            den.len() - 1
        );
        let monic = |part: &[f64]| part.iter().rev().map(|c| c / den[0]).collect::<Vec<f64>>();
        let mut numerator = monic(num);
        numerator.resize(den.len(), 0.0);
        Ok(Self {
            num: numerator,
            den: monic(den),
            air_behind_lags: false,
        })
    }

    /// The same with air that acts behind the lags, or through them.
    #[must_use]
    pub fn with_air_behind_lags(mut self, behind: bool) -> Self {
        self.air_behind_lags = behind;
        self
    }

    /// Number of states behind so many lags.
    pub(super) const fn states(&self, lags: usize) -> usize {
        self.den.len() - 1 + lags
    }

    /// Does its response have no jumps with a zero, without lags?
    pub(super) fn takes_zero(&self) -> bool {
        self.num.len() > 2 && self.num.iter().rev().take(2).all(|c| *c == 0.0)
    }

    /// The output by a constant input at rest; none where it grows without end.
    pub(super) fn rest_gain(&self) -> Option<f64> {
        (self.den[0] != 0.0).then(|| self.num[0] / self.den[0])
    }

    /// Does a constant input let the output grow without end?
    pub(super) fn integrates(&self) -> bool {
        self.den.len() > 1 && self.den[0] == 0.0
    }

    /// Whether air passes the lags.
    pub(super) fn lags_move_air(&self) -> bool {
        !self.air_behind_lags
    }

    /// The plant behind these lags, s, the last of them with the zero (`zero` s + 1).
    pub(super) fn space(&self, lags: &[f64], zero: f64) -> PlantSpace {
        let lags: Vec<f64> = lags.iter().copied().filter(|lag| *lag != 0.0).collect();
        let (count, order) = (lags.len(), self.den.len() - 1);
        let n = count + order;
        let mut a = vec![0.0; n * n];
        let mut b = vec![0.0; n];
        // The signal before the next part: `from` times the states, and `direct` times the input.
        let (mut from, mut direct) = (vec![0.0; n], 1.0);
        for (i, lag) in lags.iter().enumerate() {
            let rate = 1.0 / lag;
            for (place, from) in a[i * n..(i + 1) * n].iter_mut().zip(&from) {
                *place = rate * from;
            }
            a[i * n + i] -= rate;
            b[i] = rate * direct;
            let through = if i + 1 == count { zero * rate } else { 0.0 };
            from.iter_mut().for_each(|from| *from *= through);
            direct *= through;
            from[i] += 1.0 - through;
        }
        let mut num = self.num.clone();
        if count == 0 && self.takes_zero() {
            for i in (1..=order).rev() {
                num[i] += zero * num[i - 1];
            }
        }
        let last = num[order];
        let mut c: Vec<f64> = from.iter().map(|from| last * from).collect();
        for i in 0..order {
            let row = (count + i) * n;
            if i + 1 < order {
                a[row + count + i + 1] = 1.0;
            } else {
                for (place, from) in a[row..row + n].iter_mut().zip(&from) {
                    *place = *from;
                }
                b[count + i] = direct;
                for j in 0..order {
                    a[row + count + j] -= self.den[j];
                }
            }
            c[count + i] += num[i] - last * self.den[i];
        }
        let (mut air, mut air_direct) = (b.clone(), last * direct);
        if self.air_behind_lags && count > 0 {
            air = vec![0.0; n];
            if let Some(end) = air.last_mut().filter(|_| order > 0) {
                *end = 1.0;
            }
            air_direct = last;
        }
        PlantSpace {
            a,
            b,
            c,
            d: last * direct,
            air,
            air_direct,
            lags: count,
        }
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;

    /// C (s − A)⁻¹ B + D by Cramer's rule on two or three states.
    fn transfer(space: &PlantSpace, s: Complex64) -> Complex64 {
        let n = space.b.len();
        let mut m: Vec<Vec<Complex64>> = (0..n)
            .map(|i| {
                (0..n)
                    .map(|j| s * f64::from(u8::from(i == j)) - space.a[i * n + j])
                    .chain([Complex64::from(space.b[i])])
                    .collect()
            })
            .collect();
        for i in 0..n {
            let pivot = (i..n)
                .max_by(|x, y| m[*x][i].norm().total_cmp(&m[*y][i].norm()))
                .unwrap_or(i);
            m.swap(i, pivot);
            for k in 0..n {
                if k != i {
                    let factor = m[k][i] / m[i][i];
                    let above = m[i].clone();
                    for (entry, above) in m[k].iter_mut().zip(above).skip(i) {
                        *entry -= factor * above;
                    }
                }
            }
        }
        (0..n)
            .map(|i| m[i][n] / m[i][i] * space.c[i])
            .sum::<Complex64>()
            + space.d
    }

    #[test]
    fn the_state_space_has_the_transfer_function() {
        let s = Complex64::new(0.3, 1.7);
        let plants: [(&[f64], &[f64]); 5] = [
            (&[3.0], &[1.0, 0.4, 4.0]),
            (&[1.0], &[1.0, 0.0]),
            (&[1.0], &[1.0]),
            (&[0.15265, 5.1529], &[1.0, 5.82, 0.0]),
            (&[2.0, 1.0, 3.0], &[2.0, 0.4, 4.0]),
        ];
        for (num, den) in plants {
            let value = |c: &[f64]| c.iter().fold(Complex64::ZERO, |sum, c| sum * s + c);
            for lags in [&[] as &[f64], &[0.2], &[0.3, 0.0, 0.1]] {
                let takes_zero = num.len() + 1 < den.len();
                let zero = if lags.is_empty() && !takes_zero {
                    0.0
                } else {
                    0.25
                };
                let mut expected = value(num) / value(den) * (zero * s + 1.0);
                for lag in lags {
                    expected /= lag * s + 1.0;
                }
                let space = Plant::new(num, den).map(|plant| plant.space(lags, zero));
                let found = space.map(|space| transfer(&space, s));
                assert!(found.is_ok_and(|found| (found - expected).norm() < 1e-13));
            }
        }
    }

    #[test]
    fn air_behind_the_lags_goes_through_the_rest_alone() {
        let s = Complex64::new(0.3, 1.7);
        let plants: [(&[f64], &[f64]); 3] = [
            (&[1.0], &[1.0, 0.0]),
            (&[1.0], &[1.0]),
            (&[2.0, 1.0, 3.0], &[2.0, 0.4, 4.0]),
        ];
        for (num, den) in plants {
            let behind = |lags: &[f64]| {
                let plant = Plant::new(num, den).unwrap().with_air_behind_lags(true);
                let mut space = plant.space(lags, 0.0);
                (space.b, space.d) = (space.air.clone(), space.air_direct);
                transfer(&space, s)
            };
            let alone = behind(&[]);
            assert!((behind(&[0.2]) - alone).norm() < 1e-13);
            assert!((behind(&[0.3, 0.1]) - alone).norm() < 1e-13);
        }
    }

    #[test]
    fn improper_and_empty_plants_are_refused() {
        assert!(Plant::new(&[1.0, 0.0], &[1.0]).is_err());
        assert!(Plant::new(&[1.0], &[0.0]).is_err());
    }
}
