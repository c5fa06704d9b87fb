//! Where chains of infinitely many roots may reach the imaginary axis as a factor k varies.
//!
//! With a_i + k b_i the coefficients of the highest power of s by delay, a_0 + k b_0 that of the
//! smallest one, a neutral equation is strongly stable only where
//!     |a_0 + k b_0| > Σ_{i>0} |a_i + k b_i|
//! (Hale and Verduyn Lunel 2002). The difference is linear in k between the zeros of its terms, so
//! that its sign is known from there on. The ends carry the rounding of these sums.

use crate::quasipoly::QuasiPolynomial;

/// Part of the leading modulus that is kept for the rounding of such sums.
pub(super) const ROOM: f64 = 1e-12;

/// The coefficients (a_i, b_i) of the highest power, by increasing delay.
#[derive(Debug, Clone)]
pub(super) struct Lead {
    pairs: Vec<(f64, f64)>,
    /// Part of the first modulus that is kept for the rounding of the sum.
    margin: f64,
}

impl Lead {
    /// Those of a + k b.
    pub(super) fn of(a: &QuasiPolynomial, b: &QuasiPolynomial, margin: f64) -> Self {
        let degree = a.degree().max(b.degree());
        let mut delays: Vec<f64> = a.delays().iter().chain(b.delays()).copied().collect();
        delays.sort_by(f64::total_cmp);
        delays.dedup();
        let at = |h: &QuasiPolynomial, delay: f64| {
            let place = h.delays().iter().position(|known| *known == delay);
            let row = place.and_then(|index| h.coefficients().get(index));
            row.and_then(|row| row.get(degree)).copied().unwrap_or(0.0)
        };
        let pairs = delays.into_iter().map(|delay| (at(a, delay), at(b, delay)));
        Self {
            pairs: pairs.collect(),
            margin,
        }
    }

    /// |a_0 + k b_0| − Σ |a_i + k b_i|.
    pub(super) fn reserve(&self, k: f64) -> f64 {
        let mut sizes = self.pairs.iter().map(|(a, b)| (a + k * b).abs());
        let first = sizes.next().unwrap_or(0.0);
        first * (1.0 - self.margin) - sizes.sum::<f64>()
    }

    /// The parts of `low` ≤ k ≤ `high` in which the reserve is not above zero.
    pub(super) fn lost(&self, low: f64, high: f64) -> Vec<(f64, f64)> {
        let mut nodes = vec![low, high];
        nodes.extend(self.bends().filter(|k| low < *k && *k < high));
        nodes.sort_by(f64::total_cmp);
        let mut found = Vec::new();
        for (mut start, mut end) in nodes.iter().copied().zip(nodes.iter().copied().skip(1)) {
            let (first, last) = (self.reserve(start), self.reserve(end));
            if first > 0.0 && last > 0.0 {
                continue;
            }
            if first > 0.0 {
                start += (end - start) * first / (first - last);
            } else if last > 0.0 {
                end = start + (end - start) * -first / (last - first);
            }
            found.push((start, end));
        }
        found
    }

    /// The first k beyond one at which the reserve is lost; infinite where there is none.
    pub(super) fn lost_above_one(&self) -> f64 {
        let far = self.bends().fold(1.0, f64::max);
        // Beyond the last bend the reserve is linear.
        let slope = self.reserve(far + 1.0) - self.reserve(far);
        let beyond = if slope < 0.0 {
            self.reserve(far).max(0.0) / -slope
        } else {
            0.0
        };
        let lost = self.lost(1.0, far + 1.0 + beyond);
        lost.first().map_or(f64::INFINITY, |part| part.0)
    }

    /// The first k on the way from one down to zero; zero where there is none.
    pub(super) fn lost_below_one(&self) -> f64 {
        self.lost(0.0, 1.0).last().map_or(0.0, |part| part.1)
    }

    /// Is it lost for any further delay, whatever its length, of the terms b?
    pub(super) fn is_lost_by_delay(&self) -> bool {
        let lead = self
            .pairs
            .iter()
            .find(|(a, _)| *a != 0.0)
            .map_or(0.0, |(a, _)| a.abs());
        let (all_a, all_b) = self.pairs.iter().fold((0.0, 0.0), |(a, b), pair| {
            (a + pair.0.abs(), b + pair.1.abs())
        });
        all_b > 0.0 && lead <= (all_a - lead) + all_b
    }

    /// The largest |Σ b_i z_i|/|Σ a_i z_i| over all |z_i| = 1, where |a_0| > Σ |a_i|; `None` where it
    /// is not known.
    ///
    /// |Σ a_i z_i| is least at z_0 = 1, z_i = −sign(a_i a_0). Where that makes all b_i z_i of one sign
    /// as well, the ratio is largest there; of two terms it is monotone in Re z_1.
    pub(super) fn largest_ratio(&self) -> Option<f64> {
        let first = self.pairs.first().map_or(0.0, |(a, _)| *a);
        let turn = |place: usize, a: f64| {
            if place > 0 && a * first > 0.0 {
                -1.0
            } else {
                1.0
            }
        };
        let shared = self.pairs.iter().enumerate();
        let shared = shared.filter(|(_, (a, b))| *a != 0.0 && *b != 0.0);
        let signs: Vec<bool> = shared.map(|(i, (a, b))| turn(i, *a) * b > 0.0).collect();
        let all: f64 = self.pairs.iter().map(|(_, b)| b.abs()).sum();
        if signs.iter().all(|sign| Some(sign) == signs.first()) {
            return Some(all / self.reserve(0.0));
        }
        let &[(a, b), (p, q)] = &self.pairs[..] else {
            return None;
        };
        let at = |z: f64| ((b + q * z) / (a + p * z)).abs();
        Some(at(1.0).max(at(-1.0)))
    }

    fn bends(&self) -> impl Iterator<Item = f64> + '_ {
        let terms = self.pairs.iter().filter(|(_, b)| *b != 0.0);
        terms.map(|(a, b)| -a / b)
    }
}
