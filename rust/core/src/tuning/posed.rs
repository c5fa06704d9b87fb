//! Loops whose gains are sought, and the rays of gains on which they are.
//!
//! A shape holds the ratios of the gains: the logarithm of the integral time, Kp/Ki, in units of one over
//! the phase crossover of the plant, and the inverse hyperbolic sine of the derivative time in tenths of
//! that unit. It gives a ray, gains `offset` + k `along`.

use super::candidates::with_gains;
use super::demands::Demands;
use super::open::Scale;
use super::survey;
use crate::Error;
use crate::elementary::exp;
use crate::frequency::{Margins, first_term};
use crate::loops::{ControlLoop, Place};

/// Integral times of the grid in units of one over the phase crossover of the plant, as logarithms, and
/// how many: wider and more find stranger best gains and take time in proportion.
const INTEGRAL: (f64, f64, usize) = (-3.0, 6.2, 33);

/// Derivative times in tenths of that unit, as inverse hyperbolic sines, and how many.
const DERIVATIVE: (f64, f64, usize) = (-1.5, 5.5, 15);

/// What is made best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wish {
    /// Weight of the response to a load, between 0 and 1; the rest is that of a set point.
    pub load: f64,
    /// Is the integral of the error of a load what counts, and not that of its modulus?
    pub by_integral: bool,
    /// Is the settling time of a set point what counts, and not the integral of the modulus?
    pub by_settling: bool,
}

/// Loops that differ in what is not known of them, the first one the nominal.
#[derive(Debug, Clone)]
pub struct Posed {
    /// All have the same controller, whose free gains do not matter.
    pub loops: Vec<ControlLoop>,
    /// How many of them the search begins with.
    pub first: usize,
    /// Places of the free gains.
    pub free: Vec<usize>,
    /// What is made best.
    pub wish: Wish,
    /// What must hold.
    pub demands: Demands,
    /// Where each free gain may be, if that is given.
    pub bounds: Option<Vec<(f64, f64)>>,
    /// The ratios of the gains, if they are given: only the size of the gains is sought.
    pub shape: Option<Vec<f64>>,
    /// Part of the best value that neighbours may lose.
    pub slack: f64,
}

/// Gains beside the best ones, with the largest Ms in the loops that the search saw.
#[derive(Debug, Clone)]
pub struct Neighbour {
    /// The ratios.
    pub shape: Vec<f64>,
    /// The free gains.
    pub gains: Vec<f64>,
    /// What is made best.
    pub value: f64,
}

/// What was found.
#[derive(Debug, Clone)]
pub struct Best {
    /// The free gains.
    pub gains: Vec<f64>,
    /// What was made best, in the worst of the loops that the search saw.
    pub value: f64,
    /// The loop with the largest Ms.
    pub worst: usize,
    /// The exact margins of the loops in which they may be least, that one first.
    pub margins: Vec<Margins>,
    /// Those that lose no more than the slack.
    pub neighbours: Vec<Neighbour>,
}

/// Gains on a ray.
pub(super) struct Ray {
    pub(super) offset: Vec<f64>,
    pub(super) along: Vec<f64>,
}

impl Posed {
    /// All gains for the response to a load, under a largest Ms; the search begins with all loops.
    pub fn for_loads(loops: Vec<ControlLoop>, max_sensitivity: f64, slack: f64) -> Self {
        let gains = loops.first().map(|of| of.controller().kind.gains().len());
        Self {
            first: loops.len(),
            free: (0..gains.unwrap_or(0)).collect(),
            loops,
            wish: Wish {
                load: 1.0,
                by_integral: false,
                by_settling: false,
            },
            demands: Demands {
                max_sensitivity,
                gain_margin: 0.0,
                phase_margin: 0.0,
                delay_margin: 0.0,
                noise_gain: f64::INFINITY,
                bandwidth: 1.0,
                settling_time: f64::INFINITY,
            },
            bounds: None,
            shape: None,
            slack,
        }
    }

    /// A loop with these free gains.
    pub(super) fn with(&self, of: &ControlLoop, gains: &[f64]) -> ControlLoop {
        with_gains(of, &self.free, gains)
    }

    /// The loop in a place with these free gains.
    pub(super) fn at(&self, place: usize, gains: &[f64]) -> ControlLoop {
        self.with(&self.loops[place], gains)
    }

    /// The gain that all others are in proportion to: the first free one.
    pub(super) fn lead(&self) -> usize {
        self.free.first().copied().unwrap_or(0)
    }

    /// The gain from which the response to a load follows at rest.
    pub(super) fn lead_of_load(&self) -> usize {
        let integrates = self
            .loops
            .first()
            .map(|of| of.controller().kind.integrates());
        usize::from(integrates == Some(true))
    }

    fn name(&self, place: usize) -> &'static str {
        let names = self.loops.first().map(|of| of.controller().kind.gains());
        names
            .and_then(|names| names.get(place))
            .copied()
            .unwrap_or("")
    }

    /// Ends and numbers of points of each ratio.
    pub(super) fn axes(&self) -> Vec<(f64, f64, usize)> {
        let others = self.free.iter().skip(1);
        others
            .map(|place| match self.name(*place) {
                "Ki" => INTEGRAL,
                _ => DERIVATIVE,
            })
            .collect()
    }

    /// The ray of a shape. With the proportional gain free all others are in proportion to it; where
    /// it is given, the derivative gain is in proportion to that and the integral gain is sought.
    pub(super) fn ray(&self, shape: &[f64], scale: Scale) -> Ray {
        let (lead, unit) = (self.lead(), 1.0 / scale.omega);
        let mut ray = Ray {
            offset: vec![0.0; self.free.len()],
            along: vec![0.0; self.free.len()],
        };
        if let Some(first) = ray.along.first_mut() {
            *first = scale.sign;
        }
        let given = self
            .loops
            .first()
            .and_then(|of| of.values().controller.first().copied());
        let derivative = |x: f64| 0.05 * unit * (exp(x) - exp(-x));
        for ((index, place), x) in self.free.iter().enumerate().skip(1).zip(shape) {
            match (self.name(*place), self.name(lead)) {
                ("Ki", _) => ray.along[index] = scale.sign * exp(-x) / unit,
                (_, "Kp") => ray.along[index] = scale.sign * derivative(*x),
                _ => ray.offset[index] = given.unwrap_or(0.0) * derivative(*x),
            }
        }
        ray
    }

    /// The k with which a ray is within the bounds.
    pub(super) fn within(&self, ray: &Ray) -> (f64, f64) {
        let mut ends = (f64::NEG_INFINITY, f64::INFINITY);
        let Some(bounds) = &self.bounds else {
            return ends;
        };
        for ((offset, along), (low, high)) in ray.offset.iter().zip(&ray.along).zip(bounds) {
            if *along == 0.0 {
                if offset < low || offset > high {
                    return (0.0, 0.0);
                }
                continue;
            }
            let [a, b] = [(low - offset) / along, (high - offset) / along];
            ends = (ends.0.max(a.min(b)), ends.1.min(a.max(b)));
        }
        ends
    }
}

impl Ray {
    pub(super) fn at(&self, k: f64) -> Vec<f64> {
        let pairs = self.offset.iter().zip(&self.along);
        pairs.map(|(offset, along)| offset + k * along).collect()
    }
}

/// What a unit load leaves: the integral of the error, 1/|Ki|, or without an integral the deviation at
/// rest, |P/(1 + P Kp)| with the steady gain P of the plant.
pub fn lasting(of: &ControlLoop) -> Result<f64, Error> {
    let gains = &of.values().controller;
    if of.controller().kind.integrates() {
        return Ok(1.0 / gains.get(1).copied().unwrap_or(0.0).abs());
    }
    let (n, d) = of.with_number(Place::Controller(0), 1.0).loop_gain()?;
    let ((above, zeros), (below, poles)) = (first_term(&n), first_term(&d));
    let gain = gains.first().copied().unwrap_or(0.0);
    Ok(match zeros.cmp(&poles) {
        std::cmp::Ordering::Less => 1.0 / gain.abs(),
        std::cmp::Ordering::Equal => 1.0 / (below / above + gain).abs(),
        std::cmp::Ordering::Greater => 0.0,
    })
}

/// All points of the axes.
pub(super) fn grid(axes: &[(f64, f64, usize)]) -> Vec<Vec<f64>> {
    let values = |(low, high, count): &(f64, f64, usize)| {
        let step = |k: usize| low + (high - low) * k as f64 / (*count - 1) as f64;
        (0..*count).map(step).collect()
    };
    survey::grid(&axes.iter().map(values).collect::<Vec<Vec<f64>>>())
}
