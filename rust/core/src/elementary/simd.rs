//! [`exp`](super::exp) and [`sin_cos`](super::sin_cos) in lanes: the operations of `exponential`
//! and `circular` in their order, hence their bits and their bounds.
//!
//! Entries of tables are read lane by lane. Where one argument needs the longer branch of these
//! functions, all lanes are computed one by one, which gives the others the same bits.

use super::nearest::ROUNDER;
use super::tables::{POWERS, SINES};
use super::{circular, exponential};
use crate::simd::{Real, Simd};

/// Largest argument for which the power of two needs no second factor.
const LARGEST_EXPONENT: f64 = 700.0;

/// The entry n + `ahead` of a table in each lane, modulo its length, a power of two; `carried` is
/// n + [`ROUNDER`].
#[inline(always)]
fn fetched<S: Simd, const N: usize>(
    carried: Real<S>,
    ahead: u64,
    table: &[(f64, f64); N],
) -> (Real<S>, Real<S>) {
    let (mut high, mut low) = (carried, carried);
    let places = high.numbers_mut().iter_mut().zip(low.numbers_mut());
    for (sum, (high, low)) in carried.numbers().iter().zip(places) {
        // The last bits of the sum are those of n.
        (*high, *low) = table[(sum.to_bits().wrapping_add(ahead) % N as u64) as usize];
    }
    (high, low)
}

/// [`super::exp`] in every lane.
#[inline(always)]
pub(crate) fn exp<S: Simd>(x: Real<S>) -> Real<S> {
    let [first, second] = exponential::STEP;
    let carried = x * exponential::STEPS_PER_UNIT + ROUNDER;
    let k = carried - ROUNDER;
    let r = (x - k * first) - k * second;
    let square = r * r;
    let tail = (r * (1.0 / 6.0) + 0.5)
        + square * ((r * (1.0 / 120.0) + 1.0 / 24.0) + square * (1.0 / 720.0));
    let p = r + square * tail;
    let (high, low) = fetched(carried, 0, &POWERS);
    let factor = high + (low + high * p);
    // k = 32 m + j with j from 0 to 31.
    let m = ((k - 15.5) * (1.0 / 32.0)).nearest();
    let mut power = factor * m.power_of_two();
    if (!x.abs().le(LARGEST_EXPONENT)).any() {
        exp_one_by_one(x.numbers(), power.numbers_mut());
    }
    power
}

#[cold]
fn exp_one_by_one(x: &[f64], power: &mut [f64]) {
    for (x, power) in x.iter().zip(power) {
        *power = exponential::exp(*x);
    }
}

/// [`super::sin_cos`] in every lane.
#[inline(always)]
pub(crate) fn sin_cos<S: Simd>(y: Real<S>) -> (Real<S>, Real<S>) {
    let [first, second, third] = circular::STEP;
    let carried = y * circular::STEPS_PER_UNIT + ROUNDER;
    let n = carried - ROUNDER;
    let r = ((y - n * first) - n * second) - n * third;
    let square = r * r;
    let fourth = square * square;
    let sine =
        r + (r * square) * ((square * (1.0 / 120.0) + -1.0 / 6.0) + fourth * (-1.0 / 5040.0));
    let drop = square
        * ((square * (1.0 / 24.0) + -0.5) + fourth * (square * (1.0 / 40_320.0) + -1.0 / 720.0));
    let (s, s_low) = fetched(carried, 0, &SINES);
    let (c, c_low) = fetched(carried, 16, &SINES);
    let mut value = (
        s + (s_low + (c * sine + s * drop)),
        c + (c_low + (c * drop - s * sine)),
    );
    if (!y.abs().lt(circular::LARGE)).any() {
        sin_cos_one_by_one(y.numbers(), value.0.numbers_mut(), value.1.numbers_mut());
    }
    value
}

#[cold]
fn sin_cos_one_by_one(y: &[f64], sines: &mut [f64], cosines: &mut [f64]) {
    for ((y, sine), cosine) in y.iter().zip(sines).zip(cosines) {
        (*sine, *cosine) = circular::sin_cos(*y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Columns, Instructions, Kernel, sweep_on};

    struct Both;

    impl Kernel<1, 3> for Both {
        #[inline(always)]
        fn lanes<S: Simd>(&self, [x]: [Real<S>; 1]) -> [Real<S>; 3] {
            let (sine, cosine) = sin_cos(x);
            [exp(x), sine, cosine]
        }
    }

    #[test]
    fn lanes_have_the_bits_of_single_elements() {
        let special = [
            0.0,
            -0.0,
            1e-300,
            700.0,
            -700.0,
            709.9,
            711.0,
            -745.0,
            -800.0,
            1_048_575.9,
            1_048_576.0,
            -3e9,
            1e300,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ];
        let spread = (0..4000).map(|i| (f64::from(i) - 2000.0) * 0.348_734_5);
        let steps = (-70..70).map(|n| f64::from(n) * std::f64::consts::PI / 64.0);
        let all: Vec<f64> = spread.chain(steps).chain(special).collect();
        for instructions in Instructions::available() {
            for block in all.chunks(64) {
                let mut arguments: Columns<1, 64> = [[0.0; 64]];
                arguments[0][..block.len()].copy_from_slice(block);
                let mut values: Columns<3, 64> = [[0.0; 64]; 3];
                sweep_on(instructions, &Both, &arguments, &mut values, block.len());
                for (place, x) in block.iter().enumerate() {
                    let (sine, cosine) = circular::sin_cos(*x);
                    let expected = [exponential::exp(*x), sine, cosine];
                    let got = values.map(|column| column[place]);
                    assert_eq!(
                        got.map(f64::to_bits),
                        expected.map(f64::to_bits),
                        "{x:e} with {}: {got:?}",
                        instructions.name()
                    );
                }
            }
        }
    }
}
