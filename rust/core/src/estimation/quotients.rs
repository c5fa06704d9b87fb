//! The function of a search, the bounds of its variables, and its difference quotients.
//!
//! Quotients are central, for which the function may have kinks in its second derivative, and of the same
//! order from one side at a bound. Close to a bound on several variables, one of them moves away from
//! it, and the others along it.

use std::ops::Range;

use super::likelihood::Wanted;
use crate::Error;

/// Largest change of the gradient over a step of difference quotients, times that step: where the
/// function is steep, a long step sees its third derivative.
const STEEPEST: f64 = 0.04;

/// Smallest second derivative by the units of difference quotients.
const FLATTEST: f64 = 1e-4;

/// A bound on several variables is near where so many steps of difference quotients reach it.
const NEAR: f64 = 2.0;

/// A variable: where it starts and may go, the longest step of its difference quotients, and that of
/// the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Variable {
    pub(super) start: f64,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) step: f64,
    pub(super) longest: f64,
}

/// The function, and the known part of its slope and curvature by the first variables, which need not
/// be there where the value alone is wanted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Value {
    pub(super) value: f64,
    pub(super) slope: Vec<f64>,
    /// Row-major.
    pub(super) curvature: Vec<f64>,
}

impl Value {
    /// Flat in the first `count` variables.
    pub(super) fn new(value: f64, count: usize) -> Self {
        Self {
            value,
            slope: vec![0.0; count],
            curvature: vec![0.0; count * count],
        }
    }

    /// Add the slope and curvature by a variable of a part of the value that has these values a step up
    /// and down.
    pub(super) fn bend(&mut self, variable: usize, step: f64, far: &[f64]) {
        let n = self.slope.len();
        if let [up, down] = far
            && up.is_finite()
            && down.is_finite()
        {
            self.slope[variable] += (up - down) / (2.0 * step);
            let bend = (up - 2.0 * self.value + down) / (step * step);
            self.curvature[variable * n + variable] += bend.max(0.0);
        }
    }

    /// Add another function of the same variables.
    pub(super) fn add(&mut self, other: &Self) {
        self.value += other.value;
        let to = self.slope.iter_mut().chain(&mut self.curvature);
        for (to, from) in to.zip(other.slope.iter().chain(&other.curvature)) {
            *to += from;
        }
    }
}

/// A concave function of some of the first variables that may not be below zero, such as a time that
/// is the difference of others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Slack {
    pub(super) value: f64,
    /// By each variable.
    pub(super) slope: Vec<f64>,
}

/// The function of a search.
pub(super) trait Function {
    /// What is left up to a bound on several variables; none where there is no such bound.
    fn slack(&self, _place: &[f64]) -> Option<Slack> {
        None
    }

    /// Its values at some places, with slope and curvature if wanted. Neighbours that differ in the
    /// last variables alone may be computed together.
    fn at(&mut self, places: &[Vec<f64>], wanted: Wanted) -> Result<Vec<Value>, Error>;
}

impl<F: FnMut(&[f64], Wanted) -> Result<Value, Error>> Function for F {
    fn at(&mut self, places: &[Vec<f64>], wanted: Wanted) -> Result<Vec<Value>, Error> {
        places.iter().map(|place| self(place, wanted)).collect()
    }
}

/// Most steps of Newton's to a bound.
const CORRECTIONS: usize = 8;

/// Move a place beyond the bound on several variables onto it.
pub(super) fn keep_within(variables: &[Variable], place: &mut [f64], function: &impl Function) {
    if let Some(slack) = function.slack(place).filter(|slack| slack.value < 0.0) {
        let pivot = slack.pivot(variables);
        keep_slack(variables, place, pivot, 0.0, function);
    }
}

/// Move one variable, which has a part in it, until so much is left up to the bound.
fn keep_slack(
    variables: &[Variable],
    place: &mut [f64],
    pivot: usize,
    left: f64,
    function: &impl Function,
) {
    for _ in 0..CORRECTIONS {
        let Some(slack) = function.slack(place) else {
            return;
        };
        let before = place[pivot];
        let Variable { low, high, .. } = variables[pivot];
        place[pivot] = (before - (slack.value - left) / slack.slope[pivot]).clamp(low, high);
        if place[pivot] == before {
            return;
        }
    }
}

impl Slack {
    /// The variable that moves the bound most.
    fn pivot(&self, variables: &[Variable]) -> usize {
        let reach = |i: &usize| self.slope[*i].abs() * variables[*i].longest;
        let all = 0..self.slope.len();
        all.max_by(|i, j| reach(i).total_cmp(&reach(j)))
            .unwrap_or(0)
    }

    /// The variable that is moved to stay as far from the bound, where a step of a difference quotient
    /// might cross it.
    fn near(&self, variables: &[Variable], steps: &[f64]) -> Option<usize> {
        let most = steps.iter().zip(&self.slope);
        let most = most.map(|(step, slope)| (step * slope).abs());
        (self.value < NEAR * most.fold(0.0, f64::max)).then(|| self.pivot(variables))
    }
}

/// The places around another one at which difference quotients by some of the variables need the
/// function.
pub(super) struct Around<'a> {
    variables: &'a [Variable],
    steps: &'a [f64],
    which: Range<usize>,
    /// The bound on several variables that is close, and the variable that moves away from it; the
    /// others move along it.
    bound: Option<(Slack, usize)>,
    /// The two steps of each variable: to both sides, or one and two to one side.
    moves: Vec<[f64; 2]>,
    /// A place for each step.
    pub(super) places: Vec<Vec<f64>>,
}

/// Difference quotients by some of the variables, from one side at a bound.
pub(super) struct Quotients {
    pub(super) slope: Vec<f64>,
    pub(super) curvature: Vec<f64>,
}

impl<'a> Around<'a> {
    pub(super) fn new(
        variables: &'a [Variable],
        steps: &'a [f64],
        x: &[f64],
        which: Range<usize>,
        function: &impl Function,
    ) -> Self {
        let bound = function.slack(x).and_then(|slack| {
            let pivot = slack.near(variables, steps)?;
            which.contains(&pivot).then_some((slack, pivot))
        });
        let (mut moves, mut places) = (Vec::new(), Vec::new());
        for i in which.clone() {
            let (variable, step) = (variables[i], steps[i]);
            let (mut up, mut down) = (
                step.min(variable.high - x[i]),
                step.min(x[i] - variable.low),
            );
            if let Some((slack, _)) = bound.as_ref().filter(|(_, pivot)| *pivot == i) {
                *(if slack.slope[i] > 0.0 {
                    &mut down
                } else {
                    &mut up
                }) = 0.0;
            }
            let both = if up <= 0.0 {
                [-down, -2.0 * down]
            } else if down <= 0.0 {
                [up, 2.0 * up]
            } else {
                [up, -down]
            };
            for distance in both {
                let mut place = x.to_vec();
                place[i] += distance;
                if let Some((slack, pivot)) = bound.as_ref().filter(|(slack, pivot)| {
                    *pivot != i && slack.slope.get(i).is_some_and(|by| *by != 0.0)
                }) {
                    keep_slack(variables, &mut place, *pivot, slack.value, function);
                }
                places.push(place);
            }
            moves.push(both);
        }
        Self {
            variables,
            steps,
            which,
            bound,
            moves,
            places,
        }
    }

    /// From the function at its own place and at `places`.
    pub(super) fn quotients(self, value: f64, values: &[Value]) -> Quotients {
        let (mut slope, mut curvature) = (Vec::new(), Vec::new());
        for ((i, values), [a, b]) in self
            .which
            .clone()
            .zip(values.chunks_exact(2))
            .zip(self.moves)
        {
            let step = self.variables[i].step;
            let flattest = FLATTEST / (step * step);
            let [by_a, by_b] =
                [(a, &values[0]), (b, &values[1])].map(|(d, far)| (far.value - value) / d);
            if by_a.is_finite() && by_b.is_finite() {
                slope.push((a * by_b - b * by_a) / (a - b));
                curvature.push((2.0 * (by_a - by_b) / (a - b)).max(flattest));
            } else {
                let only = if by_a.is_finite() { by_a } else { by_b };
                slope.push(if only.is_finite() { only } else { 0.0 });
                curvature.push((only.abs() / self.steps[i]).max(flattest));
            }
        }
        if let Some((slack, pivot)) = self.bound {
            let start = self.which.start;
            let by_pivot = slope[pivot - start] / slack.slope[pivot];
            for i in self.which.filter(|i| *i != pivot) {
                slope[i - start] += slack.slope.get(i).unwrap_or(&0.0) * by_pivot;
            }
        }
        Quotients { slope, curvature }
    }
}

impl Quotients {
    pub(super) fn new(
        variables: &[Variable],
        steps: &[f64],
        x: &[f64],
        found: &Value,
        which: Range<usize>,
        function: &mut impl Function,
    ) -> Result<Self, Error> {
        let around = Around::new(variables, steps, x, which, function);
        let values = function.at(&around.places, Wanted::Value)?;
        Ok(around.quotients(found.value, &values))
    }
}

/// Fit the steps of difference quotients to these second derivatives; is one much shorter?
pub(super) fn shorten(variables: &[Variable], curvature: &[f64], steps: &mut [f64]) -> bool {
    let mut is_shorter = false;
    for ((variable, bend), step) in variables.iter().zip(curvature).zip(steps) {
        let before = *step;
        *step = variable.step.min((STEEPEST / bend).sqrt());
        is_shorter |= *step < 0.5 * before;
    }
    is_shorter
}
