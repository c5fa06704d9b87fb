//! Transition and process noise of x′ = A x + G ξ over a step h, ξ white of unit intensity:
//!
//!   Φ = e^{A h},   Q = ∫₀ʰ e^{A s} G Gᵀ e^{Aᵀ s} ds.
//!
//! Both are summed by Taylor for h / 2^k with ‖A‖₁ h / 2^k ≤ 1/4 and doubled k times:
//! Φ(2h) = Φ(h)², Q(2h) = Q(h) + Φ(h) Q(h) Φ(h)ᵀ. Every term of the doubling of Q is positive
//! semidefinite, so that states that decay fast lose no digits. They do in the block exponential of
//! Van Loan (1978), which holds e^{−A h}.

/// Largest ‖A‖₁ h for which the series is summed without doubling.
const REACH: f64 = 0.25;

/// Most terms. Those of Q shrink by 2 ‖A‖₁ h / k, and 0.5^17 / 17! is below 1e-19.
const TERMS: u32 = 17;

/// Most doublings.
const DOUBLINGS: i32 = 1000;

/// A matrix by rows.
pub(super) type Square<const N: usize> = [[f64; N]; N];

/// Φ and Q of one step length.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Propagation<const N: usize> {
    pub(super) phi: Square<N>,
    pub(super) q: Square<N>,
}

impl<const N: usize> Propagation<N> {
    /// For A, the intensity G Gᵀ of the noise, and a step `h` above zero.
    pub(super) fn new(a: &Square<N>, noise: &Square<N>, h: f64) -> Self {
        let doublings = doublings(norm(a) * h);
        let step = h * 0.5_f64.powi(doublings);
        let mut phi: Square<N> =
            std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
        let mut term = phi;
        for k in 1..=TERMS {
            term = scaled(&product(a, &term), step / f64::from(k));
            if !add(&mut phi, &term) {
                break;
            }
        }
        let mut term = scaled(noise, step);
        let mut q = term;
        for k in 2..=TERMS {
            let half = product(a, &term);
            let both = std::array::from_fn(|i| std::array::from_fn(|j| half[i][j] + half[j][i]));
            term = scaled(&both, step / f64::from(k));
            if !add(&mut q, &term) {
                break;
            }
        }
        let mut found = Self { phi, q };
        for _ in 0..doublings {
            let moved = found.moved(&found.q);
            add(&mut found.q, &moved);
            found.phi = product(&found.phi, &found.phi);
        }
        found
    }

    /// Φ P Φᵀ + Q for a symmetric P.
    #[expect(
        clippy::needless_range_loop,
        reason = "entries of two matrices by the same numbers"
    )]
    #[inline(always)]
    pub(super) fn predicted(&self, p: &Square<N>) -> Square<N> {
        let left = product(&self.phi, p);
        let mut next = self.q;
        for i in 0..N {
            for j in 0..=i {
                for (x, y) in left[i].iter().zip(&self.phi[j]) {
                    next[i][j] += x * y;
                }
                next[j][i] = next[i][j];
            }
        }
        next
    }

    /// Φ P Φᵀ for a symmetric P.
    #[inline(always)]
    fn moved(&self, p: &Square<N>) -> Square<N> {
        let left = product(&self.phi, p);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| left[i].iter().zip(&self.phi[j]).map(|(x, y)| x * y).sum())
        })
    }
}

/// Add a matrix; has any entry changed?
#[inline(always)]
pub(super) fn add<const N: usize>(to: &mut Square<N>, what: &Square<N>) -> bool {
    let mut changed = false;
    for (to, what) in to.iter_mut().flatten().zip(what.iter().flatten()) {
        let sum = *to + what;
        changed |= sum != *to;
        *to = sum;
    }
    changed
}

pub(super) fn scaled<const N: usize>(a: &Square<N>, factor: f64) -> Square<N> {
    a.map(|row| row.map(|entry| entry * factor))
}

#[inline(always)]
pub(super) fn product<const N: usize>(a: &Square<N>, b: &Square<N>) -> Square<N> {
    let mut out = [[0.0; N]; N];
    for (out, row) in out.iter_mut().zip(a) {
        for (factor, b) in row.iter().zip(b) {
            for (out, b) in out.iter_mut().zip(b) {
                *out += factor * b;
            }
        }
    }
    out
}

/// Largest column sum.
fn norm<const N: usize>(a: &Square<N>) -> f64 {
    (0..N)
        .map(|j| a.iter().map(|row| row[j].abs()).sum())
        .fold(0.0, f64::max)
}

/// Number of halvings that bring `size` to the reach of the series.
fn doublings(size: f64) -> i32 {
    let mut count = 0;
    let mut size = size;
    while size > REACH && count < DOUBLINGS {
        size *= 0.5;
        count += 1;
    }
    count
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const DEVIATION: f64 = 0.7;

    /// Largest difference, entry by entry, as a share of the deviations of the two states.
    fn apart<const N: usize>(found: &Square<N>, expected: &Square<N>) -> f64 {
        let entries = found.iter().flatten().zip(expected.iter().flatten());
        entries
            .map(|(x, y)| (x - y).abs() / y.abs().max(f64::MIN_POSITIVE))
            .fold(0.0, f64::max)
    }

    fn noise(rate: f64) -> Square<2> {
        [[0.0, 0.0], [0.0, 2.0 * rate * DEVIATION * DEVIATION]]
    }

    /// ∫₀ʰ e^{−rate s} ds.
    fn decayed(rate: f64, h: f64) -> f64 {
        -(-rate * h).exp_m1() / rate
    }

    #[test]
    fn an_integrator_behind_coloured_noise_has_its_closed_form() {
        for (rate, h) in [(0.5, 0.4), (2.0, 3.0), (8.0, 0.1), (30.0, 50.0)] {
            let e = decayed(rate, h);
            let v = DEVIATION * DEVIATION;
            let cross = v * rate * e * e;
            let phi = [[1.0, e], [0.0, (-rate * h).exp()]];
            let own = 2.0 * v / rate * (h - 2.0 * e + decayed(2.0 * rate, h));
            let q = [
                [own, cross],
                [cross, 2.0 * rate * v * decayed(2.0 * rate, h)],
            ];
            let found = Propagation::new(&[[0.0, 1.0], [0.0, -rate]], &noise(rate), h);
            assert!(apart(&found.phi, &phi) < 1e-13, "{found:?}, not {phi:?}");
            assert!(apart(&found.q, &q) < 1e-12, "{found:?}, not {q:?}");
        }
    }

    #[test]
    fn a_short_step_of_slow_noise_keeps_its_digits() {
        // The first terms of the series: at rate h = 1e-6 the closed form has no digit left.
        let (rate, h) = (1e-4, 1e-2);
        let density = 2.0 * rate * DEVIATION * DEVIATION;
        let x: f64 = rate * h;
        let found = Propagation::new(&[[0.0, 1.0], [0.0, -rate]], &noise(rate), h);
        let cross = density * h * h * (0.5 - x / 2.0 + 7.0 / 24.0 * x * x);
        let q = [
            [
                density * h.powi(3) * (1.0 / 3.0 - x / 4.0 + 7.0 / 60.0 * x * x),
                cross,
            ],
            [cross, density * h * (1.0 - x + 2.0 / 3.0 * x * x)],
        ];
        assert!(apart(&found.q, &q) < 1e-14, "{found:?}, not {q:?}");
    }

    #[test]
    fn a_lag_behind_coloured_noise_has_its_closed_form() {
        // The last is stiff: the lag forgets within a thousandth of the step.
        for (lag, rate, h) in [
            (5.0, 0.5, 0.4),
            (1.0, 6.0, 2.0),
            (-0.5, 2.0, 0.7),
            (1e4, 1.0, 1.0),
        ] {
            let (part, v) = (lag / (lag - rate), DEVIATION * DEVIATION);
            let (own, both, fast) = (
                decayed(2.0 * rate, h),
                decayed(lag + rate, h),
                decayed(2.0 * lag, h),
            );
            let phi = [
                [
                    (-lag * h).exp(),
                    part * ((-rate * h).exp() - (-lag * h).exp()),
                ],
                [0.0, (-rate * h).exp()],
            ];
            let cross = 2.0 * rate * v * part * (own - both);
            let q = [
                [
                    2.0 * rate * v * part * part * (own - 2.0 * both + fast),
                    cross,
                ],
                [cross, 2.0 * rate * v * own],
            ];
            let found = Propagation::new(&[[-lag, lag], [0.0, -rate]], &noise(rate), h);
            assert!(apart(&found.phi, &phi) < 1e-11, "{found:?}, not {phi:?}");
            assert!(apart(&found.q, &q) < 1e-11, "{found:?}, not {q:?}");
        }
    }

    #[test]
    fn a_step_of_nothing_changes_nothing() {
        let found = Propagation::new(&[[0.0, 1.0], [0.0, -2.0]], &noise(2.0), 0.0);
        assert_eq!(found.phi, [[1.0, 0.0], [0.0, 1.0]]);
        assert_eq!(found.q, [[0.0; 2]; 2]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn two_steps_are_one_of_their_sum(
            entries in proptest::array::uniform9(-3.0..3.0_f64),
            drive in proptest::array::uniform3(-1.0..1.0_f64),
            first in 1e-3..1.5_f64,
            second in 1e-3..1.5_f64,
        ) {
            let a: Square<3> = std::array::from_fn(|i| std::array::from_fn(|j| entries[3 * i + j]));
            let noise: Square<3> = std::array::from_fn(|i| drive.map(|g| g * drive[i]));
            let [one, two, both] = [first, second, first + second]
                .map(|h| Propagation::new(&a, &noise, h));
            let size = |m: &Square<3>| m.iter().flatten().fold(0.0_f64, |x, y| x.max(y.abs()));
            let (phi, q) = (product(&two.phi, &one.phi), two.predicted(&one.q));
            // What is rounded on the way grows as the states do until the end.
            let grown = (1..=16)
                .map(|part| size(&Propagation::new(&a, &noise, (first + second) * f64::from(part) / 16.0).phi))
                .fold(1.0, f64::max);
            let scale = grown * grown;
            let scale_q = scale * size(&noise) * (first + second);
            for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                prop_assert!((phi[i][j] - both.phi[i][j]).abs() <= 1e-12 * scale);
                prop_assert!((q[i][j] - both.q[i][j]).abs() <= 1e-12 * scale_q);
            }
        }
    }
}
