//! One set of lags: the states of plant and noise and what moves them.

use super::super::disturbance::Joint;
use super::super::kept::Kept;
use super::super::propagation::{Propagation, Square};
use super::response::StepResponse;
use super::settings::{Lags, Settings};
use crate::Error;

/// Plant, noise and level for one set of lags.
pub(super) struct Layer<const N: usize> {
    pub(super) a: Square<N>,
    pub(super) noise: Square<N>,
    pub(super) seen: [f64; N],
    pub(super) direct: f64,
    pub(super) response: StepResponse<N>,
    pub(super) steps: Kept<Propagation<N>>,
    pub(super) start: Square<N>,
    /// Number of plant states.
    pub(super) plant: usize,
    pub(super) total: f64,
}

impl<const N: usize> Layer<N> {
    pub(super) fn new(settings: &Settings, one: &Lags) -> Result<Self, Error> {
        let space = settings.plant.space(&one.lags, one.zero);
        let joint = Joint::new(&space, &settings.disturbances)?;
        let (own, plant) = (joint.c.len(), space.b.len());
        let embedded = |flat: &[f64]| -> Square<N> {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    if i < own && j < own {
                        flat[i * own + j]
                    } else {
                        0.0
                    }
                })
            })
        };
        let mut a = embedded(&joint.a);
        let mut b = [0.0; N];
        let mut seen = [0.0; N];
        b[..plant].copy_from_slice(&space.b);
        seen[..own].copy_from_slice(&joint.c);
        let response = StepResponse::new(a, b);
        if settings.trim > 0.0 {
            for i in 0..plant {
                a[i][own + 1] = b[i];
            }
            seen[own + 1] = space.d;
        }
        if settings.has_offset() {
            seen[settings.states() - 1] = 1.0;
        }
        let direct = space.d;
        Ok(Self {
            noise: embedded(&joint.noise),
            start: embedded(&joint.start),
            a,
            seen,
            direct,
            response,
            steps: Kept::new(),
            plant,
            total: one.lags.iter().sum::<f64>() - one.zero + settings.own_lag,
        })
    }

    /// The state that holds the level of a plant that integrates.
    pub(super) fn integrates(&self, settings: &Settings) -> usize {
        self.plant - settings.plant.states(0)
    }
}
