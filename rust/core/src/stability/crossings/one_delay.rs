//! Crossings of the imaginary axis as one delay T varies.
//!
//! h = A + e^(−s d) B, where d grows with T and A and B do not depend on it, has a root jω for some
//! d only where |A| = |B|, which are the zeros of F (`pencil`), and there
//!     ω d = arg(−B/A) + 2πn   (Cooke and van den Driessche 1986; Walton and Marshall 1987).
//! As d grows a simple pair goes to the right where F′ > 0 and to the left where F′ < 0: with h = 0,
//! 1/(ds/dd) = −(A′/A − B′/B + d)/s, whose real part at s = jω is F′/(2ω|A|²).
//!
//! Where |A(0)| = |B(0)| there is a zero of F at ω = 0. If A(0) ≠ −B(0) no delay up to D makes a
//! root of it: |A + e^(−jωd) B| ≥ |A + B| − ω D |B|, which stays above 0 over some length.
//!
//! Delays are counted from the first one of A and from that of B, so that the proofs do not depend
//! on how long they are. Each delay has an interval that is proved to contain it, as gains have:
//! with |A − Â| ≤ δA and |B − B̂| ≤ δB the angle changes by asin(e) ≤ 1.6 e at most, e = (δA/|Â| +
//! δB/|B̂|)/(1 − δB/|B̂|) ≤ 0.9.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::crossing::{Crossing, ENLARGED, SHARE, STARTS, Search, Varied, crossings};
use super::one_gain::radius_of_members;
use super::pencil::{Factor, Pencil, Point};
use crate::elementary::angle;
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::stability::specification::Piece;
use crate::{Error, Task};

/// Largest e: see above.
const FARTHEST: f64 = 0.9;

/// Bound on the change of an angle, in e.
const TURNED: f64 = 1.6;

/// Rounding of an angle, and of a delay relative to it.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Upper limits on the delays of one frequency, and on the turns in one of them, which are counted in
/// doubles.
const MOST: f64 = 1e5;
const LARGEST: f64 = 1e15;

/// The values of T in `range` at which a + e^(−s σ (T − T₀)) b has a root on the imaginary axis, σ
/// the `slope`, T₀ the start of the range; `None` where they cannot be found.
///
/// # Errors
/// [`Error::Interrupted`] alone.
pub(super) fn crossings_of_delay(
    a: &QuasiPolynomial,
    b: &QuasiPolynomial,
    slope: f64,
    range: (f64, f64),
    task: &Task,
) -> Result<Option<Vec<Crossing>>, Error> {
    let first = |h: &QuasiPolynomial| h.delays().first().copied().unwrap_or(0.0);
    let nearest = first(b) - first(a);
    // Otherwise the terms in b would lead, and roots might come from infinity as their delay grows.
    if nearest < 0.0 {
        return Ok(None);
    }
    let (Ok(a), Ok(b)) = (from_first(a), from_first(b)) else {
        return Ok(None);
    };
    // |e^(−s d)| ≤ 1 right of the axis.
    let Ok(top) = radius_of_members(&a, &b, (-1.0, 1.0), "T") else {
        return Ok(None);
    };
    if top == 0.0 {
        return Ok(Some(Vec::new()));
    }
    let axis = Piece {
        from: Complex64::ZERO,
        along: Complex64::I,
        length: top,
    };
    let delays = (nearest, nearest + slope * (range.1 - range.0));
    let Some(pencil) = Pencil::new(&a, &b, axis, Factor::Delay, None) else {
        return Ok(None);
    };
    let found = crossings(&pencil, false, top, Varied::Delay(delays), task)?;
    let value = |d: f64| range.0 + (d - nearest) / slope;
    let rounding = ROUNDING * (range.0.abs() + range.1.abs() + delays.1 / slope);
    Ok(found.map(|all| {
        let all = all.into_iter().map(|at| Crossing {
            gain: value(at.gain),
            low: value(at.low) - rounding,
            high: value(at.high) + rounding,
            ..at
        });
        all.collect()
    }))
}

/// h with its delays counted from the first.
fn from_first(h: &QuasiPolynomial) -> Result<QuasiPolynomial, Error> {
    let first = h.delays().first().copied().unwrap_or(0.0);
    let delays = h.delays().iter().map(|delay| delay - first).collect();
    QuasiPolynomial::new(h.coefficients().to_vec(), delays)
}

impl Search<'_> {
    /// The first point, at ω = 0 or beyond a zero there that no delay up to `longest` makes a root.
    pub(super) fn start_at_rest(&self, longest: f64) -> Option<Point> {
        let zero = self.pencil.at(0.0);
        if self.is_clear(&zero) {
            return Some(zero);
        }
        let bounds = &self.bounds;
        let excess = modulus(zero.a + zero.b) - bounds.rounding * (bounds.a[0] + bounds.b[0]);
        let rate = bounds.a[1] + bounds.b[1] + longest * bounds.b[0];
        let length = (SHARE * excess / rate).min(self.top).min(bounds.reach);
        if length.is_nan() || length <= 0.0 {
            return None;
        }
        let mut points = STARTS.iter().map(|share| self.pencil.at(share * length));
        points.find(|point| self.is_clear(point))
    }

    /// Store the delays for which a root lies within `radius` of `point`, where they may lie in
    /// `range`; `off` bounds the errors of A and B there.
    pub(super) fn record_delays(
        &mut self,
        point: &Point,
        radius: f64,
        off: (f64, f64),
        range: (f64, f64),
        jump: Option<i32>,
    ) -> Option<()> {
        let (a, b) = (modulus(point.a), modulus(point.b));
        let least = point.t - radius;
        if !(b * SHARE > off.1 && a > 0.0 && least > 0.0) {
            return None;
        }
        let error = (off.0 / a + off.1 / b) / (1.0 - off.1 / b) * ENLARGED;
        if error.is_nan() || error > FARTHEST {
            return None;
        }
        let turned = -(point.b * point.a.conj());
        let first = angle(turned.im, turned.re);
        let turns = |d: f64| (d * point.t - first) / TAU;
        // Those whose interval reaches into the range, too.
        let most = (TURNED * error + ROUNDING + range.1 * radius) * ENLARGED / least;
        let beyond = (most * point.t / TAU).ceil();
        let (from, to) = (
            turns(range.0).floor() - beyond,
            turns(range.1).ceil() + beyond,
        );
        let usable = to - from <= MOST && from.abs().max(to.abs()) < LARGEST;
        if !usable {
            return None;
        }
        let mut n = from;
        while n <= to {
            let whole = first + TAU * n;
            let delay = whole / point.t;
            let spread =
                (TURNED * error + ROUNDING + delay.abs() * radius) / least + ROUNDING * delay.abs();
            let (low, high) = (delay - spread * ENLARGED, delay + spread * ENLARGED);
            if high >= range.0 && low <= range.1 {
                self.found.push(Crossing {
                    omega: point.s.im,
                    gain: delay,
                    low,
                    high,
                    jump,
                    slope_at_zero: None,
                });
            }
            n += 1.0;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::roots::count_right_of;

    fn member(a: &QuasiPolynomial, b: &QuasiPolynomial, d: f64) -> QuasiPolynomial {
        let rows = a.coefficients().iter().chain(b.coefficients());
        let delays = a.delays().iter().copied();
        let delays = delays.chain(b.delays().iter().map(|delay| delay + d));
        QuasiPolynomial::new(rows.cloned().collect(), delays.collect()).unwrap()
    }

    #[test]
    fn an_integrator_crosses_at_quarter_turns() {
        // s + K e^(−sT): ω = K, T = (π/2 + 2πn)/K.
        let a = QuasiPolynomial::new(vec![vec![0.0, 1.0]], vec![0.0]).unwrap();
        let b = QuasiPolynomial::new(vec![vec![2.5]], vec![0.1]).unwrap();
        let found = crossings_of_delay(&a, &b, 1.0, (0.1, 6.0), &Task::new()).unwrap();
        let found = found.unwrap();
        assert_eq!(found.len(), 3);
        for (n, at) in found.iter().enumerate() {
            let exact = (0.25 * TAU + TAU * n as f64) / 2.5;
            assert!((at.gain - exact).abs() < 1e-14 && (at.omega - 2.5).abs() < 1e-14);
            assert!(at.low <= exact && exact <= at.high && at.high - at.low < 1e-12);
            assert_eq!(at.jump, Some(2));
        }
    }

    #[test]
    fn equal_moduli_at_zero_are_no_crossing() {
        // |jω + 1| = 1 at ω = 0 alone, where A + B = 2; with −1 a root stays at 0.
        let a = QuasiPolynomial::new(vec![vec![1.0, 1.0]], vec![0.0]).unwrap();
        for (value, expected) in [(1.0, Some(vec![])), (-1.0, None)] {
            let b = QuasiPolynomial::new(vec![vec![value]], vec![0.0]).unwrap();
            let found = crossings_of_delay(&a, &b, 1.0, (0.0, 9.0), &Task::new()).unwrap();
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn roots_that_may_come_from_infinity_are_left_alone() {
        let of = |row: Vec<f64>, delay: f64| QuasiPolynomial::new(vec![row], vec![delay]).unwrap();
        let found = |a: QuasiPolynomial, b: QuasiPolynomial| {
            crossings_of_delay(&a, &b, 1.0, (0.0, 1.0), &Task::new()).unwrap()
        };
        // The delayed terms lead; chains at the axis.
        assert_eq!(found(of(vec![1.0, 1.0], 0.5), of(vec![0.2], 0.0)), None);
        assert_eq!(
            found(of(vec![1.0, 1.0], 0.0), of(vec![0.2, 1.0], 0.1)),
            None
        );
        assert!(found(of(vec![1.0, 1.0], 0.0), of(vec![2.0, 0.9], 0.1)).is_some());
    }

    proptest! {
        #[test]
        fn counts_at_both_ends_differ_by_the_jumps(
            a in prop::array::uniform3(-3.0..3.0f64), b in prop::array::uniform2(-3.0..3.0f64),
            c in -0.9..0.9f64, tau in 0.05..2.0f64, other in 0.0..2.0f64, slope in 0.3..2.0f64,
            low in 0.0..1.0f64, length in 0.1..5.0f64,
        ) {
            let h = |rows, delays| QuasiPolynomial::new(rows, delays).unwrap();
            let a = h(vec![vec![a[0], a[1], 1.0], vec![a[2]]], vec![0.0, tau]);
            let b = h(vec![vec![b[0]], vec![0.0, b[1], c]], vec![slope * low, slope * low + other]);
            let task = Task::new();
            let found = crossings_of_delay(&a, &b, slope, (low, low + length), &task).unwrap();
            if let Some(found) = found {
                let jumps: Option<i32> = found.iter().map(|place| place.jump).sum();
                let count = |d| count_right_of(&member(&a, &b, d), 0.0, &task);
                if let (Some(jumps), Ok(low), Ok(high)) = (jumps, count(0.0), count(slope * length)) {
                    prop_assert_eq!(high as i64 - low as i64, i64::from(jumps));
                }
            }
        }
    }
}
