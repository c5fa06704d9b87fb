//! The linear loop with one delay, an optional limit and an optional hold.
//!
//!   x′ = A x + B w + E r,   u = K x + L w + M r,   y = C x + D w,   w(t) = sat(u(t − Td)).
//!
//! x holds the states of plant and controller, u is the command, w the command that reaches the
//! plant, r the reference, y the output. L = 0 is the retarded loop; L ≠ 0 (an ideal derivative of
//! y, or direct feedthrough) the neutral one, whose jumps do not become smoother. With a sample
//! time Ts the command is u_k = sat(K x(t_k) + L w(t_k−) + M r(t_k)) and w = u_k on [t_k + Td,
//! t_{k+1} + Td); controller states see the reference held in the same way. An ideal derivative of
//! r is zero except for an impulse at each jump of r, which arrives at the plant like the rest of
//! the command and, where L ≠ 0, returns with weight L. Time counts from the start of the run;
//! every signal is scalar, x has any length. The last states may be inputs that jump ([`Kick`]).
//!
//! The command may have unequal bounds and a bound on its rate. With v the command after all bounds, an
//! integral need not wind up: by back-calculation x′ gains G (v − u), by conditional integration the
//! integral stops where the command is out of its bounds and the integral would drive it further out
//! (Åström and Hägglund, Advanced PID Control, 2006, sections 3.5 and 3.6).

use crate::Error;
use crate::dde::limits::{countable, finite};
use crate::dde::propagator::Propagator;
use crate::dde::scalar::Scalar;

/// The matrices of the loop, row-major; n is the length of `b`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Equations<S = f64> {
    /// State matrix A, n × n.
    pub a: Vec<S>,
    /// Input column B, n.
    pub b: Vec<S>,
    /// Reference column E, n.
    pub e: Vec<S>,
    /// Feedback row K, n.
    pub k: Vec<S>,
    /// Feedback L of the delayed command.
    pub l: S,
    /// Gain M of the reference.
    pub m: S,
    /// Output row C, n.
    pub c: Vec<S>,
    /// Feedthrough D.
    pub d: S,
    /// Weight of the impulse in u per unit jump of the reference: the gain of an ideal derivative
    /// of r. A limited or sampled command has none.
    pub impulse: S,
    /// The same per unit jump of each of the last states, which are inputs.
    pub impulses: Vec<S>,
    /// Column G of the back-calculation, n; empty where there is none.
    pub excess: Vec<S>,
}

impl<S: Scalar> Equations<S> {
    /// Number of states.
    pub fn states(&self) -> usize {
        self.b.len()
    }

    /// u before the limit.
    pub(crate) fn command(&self, x: &[S], w: S, r: f64) -> S {
        dot(&self.k, x) + self.l * w + self.m * S::from(r)
    }

    /// y.
    pub(crate) fn output(&self, x: &[S], w: S) -> S {
        dot(&self.c, x) + self.d * w
    }

    /// The change of the states over a time `h` with constant w, r and, of a back-calculation, v − u.
    pub(crate) fn over(&self, h: S) -> Propagator<S> {
        let columns = [&self.b[..], &self.e, &self.excess];
        let present = columns.get(..self.inputs()).unwrap_or(&columns);
        Propagator::new(&self.a, present, h)
    }

    /// Number of columns that drive the states: B, E and, where it is, G.
    pub(crate) fn inputs(&self) -> usize {
        if self.excess.is_empty() { 2 } else { 3 }
    }

    /// x′ of a state, without back-calculation.
    pub(crate) fn slope(&self, state: usize, x: &[S], w: S, r: S) -> S {
        let n = self.states();
        let row = self.a.get(state * n..(state + 1) * n).unwrap_or_default();
        let entry = |column: &[S]| column.get(state).copied().unwrap_or_default();
        dot(row, x) + entry(&self.b) * w + entry(&self.e) * r
    }

    /// The same with a state that does not move.
    pub(crate) fn stopped(&self, state: usize) -> Self {
        let n = self.states();
        let mut other = self.clone();
        let row = other.a.iter_mut().skip(state * n).take(n);
        row.for_each(|entry| *entry = S::default());
        for column in [&mut other.b, &mut other.e, &mut other.excess] {
            if let Some(entry) = column.get_mut(state) {
                *entry = S::default();
            }
        }
        other
    }
}

/// Change of the states at a sample, after the command is computed: x becomes J x + G w + H r.
///
/// The states of a controller that runs in samples, such as a discretised filter, change in this
/// way and are constant in between; the rows of J of all other states are those of the identity.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Update<S = f64> {
    /// J, n × n.
    pub states: Vec<S>,
    /// G, n.
    pub command: Vec<S>,
    /// H, n.
    pub reference: Vec<S>,
}

/// A validated loop.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearLoop<S = f64> {
    equations: Equations<S>,
    delay: S,
    sample_time: Option<S>,
    bounds: Option<Bounds<S>>,
    rate: Option<S>,
    stops: Option<usize>,
    update: Option<Update>,
}

/// The least and the greatest command.
pub type Bounds<S = f64> = (S, S);

/// Initial values of a run, at time 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Start<S = f64> {
    /// x(0), n.
    pub state: Vec<S>,
    /// The command before time 0, constant.
    pub command: S,
    /// Sampled loops: commands issued at the samples before time 0, latest last; `command`
    /// stands for all earlier ones.
    pub command_history: Vec<f64>,
    /// Sampled loops: time of the first sample, in [0, Ts).
    pub sample_phase: f64,
    /// Jumps of the states that are inputs, in order of time, none before the start.
    pub kicks: Vec<Kick>,
}

/// A jump of a state that is an input: to a value, so that rounding errors of many do not add up.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Kick {
    /// Since the start, s.
    pub time: f64,
    /// Which of the inputs, from the first on.
    pub input: usize,
    /// The value to which it jumps.
    pub to: f64,
}

impl<S: Scalar> LinearLoop<S> {
    /// Check the arguments.
    pub fn new(
        equations: Equations<S>,
        delay: S,
        sample_time: Option<S>,
        limit: Option<S>,
    ) -> Result<Self, Error> {
        let n = equations.states();
        let (excess, inputs) = (equations.excess.len(), equations.impulses.len());
        let columns = [
            ("A", &equations.a, n * n),
            ("B", &equations.b, n),
            ("E", &equations.e, n),
            ("K", &equations.k, n),
            ("C", &equations.c, n),
            ("G", &equations.excess, if excess > 0 { n } else { 0 }),
            ("impulses", &equations.impulses, inputs.min(n)),
        ];
        for (name, entries, wanted) in columns {
            refuse_if!(
                entries.len() != wanted,
                "{name} has {} elements, but {wanted} are needed for {n} states",
                entries.len()
            );
            finite(name, entries)?;
        }
        finite(
            "L, M, D, impulse",
            &[equations.l, equations.m, equations.d, equations.impulse],
        )?;
        refuse_if!(
            !(delay.is_finite() && delay.value() >= 0.0),
            "delay={}: give a finite number of seconds, zero or more",
            delay.value()
        );
        if let Some(ts) = sample_time
            && !(ts.is_finite() && ts.value() > 0.0)
        {
            refuse!(
                "sample_time={}: give a time in s above zero, or none for continuous time",
                ts.value()
            );
        }
        if let Some(ts) = sample_time {
            countable(delay.value(), ts.value())?;
        }
        if let Some(limit) = limit
            && (limit.value().is_nan() || limit.value() <= 0.0)
        {
            refuse!(
                "limit={}: give a limit of the command above zero, or none for no limit",
                limit.value()
            );
        }
        Ok(Self {
            equations,
            delay,
            sample_time,
            bounds: limit
                .filter(|limit| limit.is_finite())
                .map(|limit| (-limit, limit)),
            rate: None,
            stops: None,
            update: None,
        })
    }

    /// The same loop with other bounds of its command, which hold zero, infinite where there is none.
    ///
    /// # Errors
    /// [`Error::Argument`] where they do not hold zero.
    pub fn with_bounds(mut self, low: S, high: S) -> Result<Self, Error> {
        let (least, most) = (low.value(), high.value());
        refuse_if!(
            !(least < most && least <= 0.0 && most >= 0.0),
            "limit=({least}, {most}): give the least and the greatest command, zero between them"
        );
        let is_bounded = least.is_finite() || most.is_finite();
        self.bounds = is_bounded.then_some((low, high));
        Ok(self)
    }

    /// The same loop with a bound on the rate of its command, in its unit a second.
    ///
    /// # Errors
    /// [`Error::Argument`] where it is not positive.
    pub fn with_rate(mut self, rate: S) -> Result<Self, Error> {
        refuse_if!(
            rate.value().is_nan() || rate.value() <= 0.0,
            "rate_limit={}: give a positive rate of the command, or none for no limit",
            rate.value()
        );
        self.rate = rate.is_finite().then_some(rate);
        Ok(self)
    }

    /// The same loop with an integral, by its state, that stops while it would drive the command further
    /// out of its bounds.
    #[must_use]
    pub fn with_stop(mut self, state: usize) -> Self {
        self.stops = Some(state);
        self
    }

    /// The same loop with states that change at samples.
    pub fn with_update(mut self, update: Update) -> Result<Self, Error> {
        let n = self.equations.states();
        let lengths = (
            update.states.len(),
            update.command.len(),
            update.reference.len(),
        );
        refuse_if!(
            lengths != (n * n, n, n),
            "the update of a sample has {lengths:?} elements, but {:?} are needed for {n} states",
            (n * n, n, n)
        );
        refuse_if!(
            self.sample_time.is_none(),
            "states that change at samples need a sample_time"
        );
        finite("the update of a sample", &update.states)?;
        finite("the update of a sample", &update.command)?;
        finite("the update of a sample", &update.reference)?;
        self.update = Some(update);
        Ok(self)
    }

    /// The same loop with another delay.
    pub(crate) fn with_delay(self, delay: S) -> Self {
        Self { delay, ..self }
    }

    /// The change of the states at a sample; none where there is none.
    pub fn update(&self) -> Option<&Update> {
        self.update.as_ref()
    }

    /// The same loop with another feedback u = K x + L w.
    #[must_use]
    pub fn with_feedback(mut self, k: Vec<S>, l: S) -> Self {
        (self.equations.k, self.equations.l) = (k, l);
        self
    }

    /// Has another loop the same poles, as far as its matrices say, with its delay and samples alike?
    pub fn has_poles_of(&self, other: &Self) -> bool
    where
        S: PartialEq,
    {
        let (own, its) = (&self.equations, &other.equations);
        let moved = |plant: &Self| {
            let update = plant.update.clone();
            update.map(|update| (update.states, update.command))
        };
        (&own.a, &own.b, &own.k, &own.l) == (&its.a, &its.b, &its.k, &its.l)
            && moved(self) == moved(other)
    }

    /// The matrices.
    pub fn equations(&self) -> &Equations<S> {
        &self.equations
    }

    /// Td, s.
    pub fn delay(&self) -> S {
        self.delay
    }

    /// Ts, s; none in continuous time.
    pub fn sample_time(&self) -> Option<S> {
        self.sample_time
    }

    /// The least and the greatest command; none where there is no bound.
    pub fn bounds(&self) -> Option<Bounds<S>> {
        self.bounds
    }

    /// Bound of |u′|; none where there is no bound.
    pub fn rate(&self) -> Option<S> {
        self.rate
    }

    /// The integral that stops; none where none does.
    pub fn stops(&self) -> Option<usize> {
        self.stops
    }

    /// Does the command at its bounds change how the states move, or is its rate bounded?
    pub fn is_watched(&self) -> bool {
        let is_bounded = self.bounds.is_some() || self.rate.is_some();
        let winds = self.stops.is_some() || !self.equations.excess.is_empty();
        self.rate.is_some() || (is_bounded && winds)
    }
}

/// Clip to bounds.
pub(crate) fn saturate<S: Scalar>(u: S, bounds: Option<Bounds<S>>) -> S {
    match bounds {
        Some((_, high)) if u.value() > high.value() => high,
        Some((low, _)) if u.value() < low.value() => low,
        _ => u,
    }
}

/// Σ a_i b_i.
pub(crate) fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    let products = a.iter().zip(b).map(|(&a, &b)| a * b);
    products
        .reduce(|sum, product| sum + product)
        .unwrap_or_default()
}
