//! The response of a plant to a held input over steps of many lengths:
//!
//!   x(h) = x + F x + Γ u,   F = e^{A h} − I,   Γ = ∫₀ʰ e^{A s} ds b.
//!
//! As in `dde::propagator`, with the size known when this is compiled and the norm of A computed
//! once: the times of a log jitter, and then nearly every row has a step length of its own.

use super::kept::Kept;
use super::plant::PlantSpace;
use super::propagation::{Square, add, product, scaled};
use crate::linear_algebra::balance::balanced_norm;

/// Largest ‖A‖₁ h, of A balanced, for which the series is summed without doubling.
const REACH: f64 = 0.5;

/// Number of terms: 0.5^17/17! is below 1e-19.
const TERMS: u32 = 17;

/// Most doublings.
const DOUBLINGS: u32 = 1100;

/// F and Γ of one step length.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Step<const N: usize> {
    growth: Square<N>,
    gamma: [f64; N],
}

impl<const N: usize> Step<N> {
    pub(super) fn apply(&self, state: &[f64; N], input: f64) -> [f64; N] {
        std::array::from_fn(|i| {
            let change = self.growth[i].iter().zip(state).map(|(f, x)| f * x);
            state[i] + (self.gamma[i] * input + change.sum::<f64>())
        })
    }

    fn double(&mut self) {
        let once = self.growth;
        let moved = moved(&once, &self.gamma);
        for (gamma, moved) in self.gamma.iter_mut().zip(moved) {
            *gamma = 2.0 * *gamma + moved;
        }
        add(&mut self.growth, &once);
        add(&mut self.growth, &product(&once, &once));
    }
}

/// A, b and the norm of A of a plant.
struct Equations<const N: usize> {
    a: Square<N>,
    b: [f64; N],
    norm: f64,
}

/// Steps of M plants, in which they take the same ones.
pub(super) struct Steps<const N: usize, const M: usize> {
    plants: [Equations<N>; M],
    kept: Kept<[Step<N>; M]>,
}

impl<const N: usize, const M: usize> Steps<N, M> {
    /// For plants of N states.
    pub(super) fn new(plants: [&PlantSpace; M]) -> Self {
        let equations = |plant: &PlantSpace| Equations {
            a: std::array::from_fn(|i| std::array::from_fn(|j| plant.a[i * N + j])),
            b: std::array::from_fn(|i| plant.b[i]),
            norm: balanced_norm(&plant.a, N),
        };
        Self {
            plants: plants.map(equations),
            kept: Kept::new(),
        }
    }

    /// The step of each plant of this length that ends at `time`.
    #[inline(always)]
    pub(super) fn at(&mut self, length: f64, time: f64) -> &[Step<N>; M] {
        let plants = &self.plants;
        self.kept.at(length, time, || {
            plants
                .each_ref()
                .map(|Equations { a, b, norm }| made(a, b, *norm, length))
        })
    }
}

fn made<const N: usize>(a: &Square<N>, b: &[f64; N], norm: f64, length: f64) -> Step<N> {
    let (mut halved, mut doublings) = (norm * length, 0);
    while halved > REACH && doublings < DOUBLINGS {
        halved *= 0.5;
        doublings += 1;
    }
    let step = length * 0.5_f64.powi(doublings as i32);
    let mut growth = scaled(a, step);
    let mut gamma = b.map(|b| b * step);
    let (mut term, mut column) = (growth, gamma);
    for j in 2..=TERMS {
        let factor = step / f64::from(j);
        term = scaled(&product(a, &term), factor);
        column = moved(a, &column).map(|entry| entry * factor);
        let mut changed = add(&mut growth, &term);
        for (gamma, entry) in gamma.iter_mut().zip(column) {
            let sum = *gamma + entry;
            changed |= sum != *gamma;
            *gamma = sum;
        }
        if !changed {
            break;
        }
    }
    let mut found = Step { growth, gamma };
    for _ in 0..doublings {
        found.double();
    }
    found
}

fn moved<const N: usize>(a: &Square<N>, x: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i].iter().zip(x).map(|(a, x)| a * x).sum())
}

#[cfg(test)]
mod tests {
    use super::super::plant::Plant;
    use super::*;
    use crate::dde::propagator::Propagator;

    #[test]
    fn a_step_is_that_of_the_general_propagator() {
        let plant = Plant::new(&[0.4, 2.0], &[1.0, 0.6, 0.0]).unwrap();
        let space = plant.space(&[0.3], 0.0);
        let mut steps = Steps::<3, 1>::new([&space]);
        for k in 0..60 {
            let length = 1e-4 * 1.3_f64.powi(k);
            let expected = Propagator::new(&space.a, &[&space.b], length);
            let (state, input) = ([0.7, -1.3, 0.2], 0.9);
            let mut there = vec![0.0; 3];
            expected.apply(&state, &[input], &mut there);
            let found = steps.at(length, length)[0].apply(&state, input);
            for (found, there) in found.iter().zip(&there) {
                assert!(
                    (found - there).abs() <= 1e-13 * (1.0 + there.abs()),
                    "{length}"
                );
            }
        }
    }

    #[test]
    fn a_plant_without_states_has_steps_that_do_nothing() {
        let space = Plant::new(&[1.0], &[1.0]).unwrap().space(&[], 0.0);
        assert_eq!(
            Steps::<0, 1>::new([&space]).at(0.1, 1.0)[0].apply(&[], 3.0),
            []
        );
    }
}
