//! How the states move in each mode of the command, as rows of linear equations.
//!
//! With z = (x, v), v only where the rate of the command is bounded, every signal is a row
//!
//!   f = a·z + b w + e r + c.
//!
//! The command v that is issued is u, a bound, or a state of slope ±R. Without a delay it is w, which is
//! eliminated. A back-calculation adds G (v − u) to x′. An integral that stops does not move; one that
//! slides moves so that u stays at its bound.

use crate::dde::control_loop::linear_loop::LinearLoop;
use crate::dde::scalar::Scalar;

use super::expansion::Expansion;
use super::saturation::Side;
use crate::dde::control_loop::series::Series;

/// A signal of the loop.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Signal<S> {
    pub(super) states: Vec<S>,
    pub(super) w: S,
    pub(super) r: S,
    pub(super) constant: S,
}

impl<S: Scalar> Signal<S> {
    fn nothing(size: usize) -> Self {
        Self {
            states: vec![S::default(); size],
            w: S::default(),
            r: S::default(),
            constant: S::default(),
        }
    }

    pub(super) fn constant(size: usize, constant: S) -> Self {
        Self {
            constant,
            ..Self::nothing(size)
        }
    }

    fn state(size: usize, place: usize) -> Self {
        let mut out = Self::nothing(size);
        if let Some(entry) = out.states.get_mut(place) {
            *entry = S::from(1.0);
        }
        out
    }

    /// Add `gain` times another one.
    pub(super) fn add(&mut self, gain: S, other: &Self) {
        for (sum, entry) in self.states.iter_mut().zip(&other.states) {
            *sum += gain * *entry;
        }
        self.w += gain * other.w;
        self.r += gain * other.r;
        self.constant += gain * other.constant;
    }

    fn scaled(mut self, gain: S) -> Self {
        self.states.iter_mut().for_each(|entry| *entry *= gain);
        self.w *= gain;
        self.r *= gain;
        self.constant *= gain;
        self
    }

    /// With another signal in the place of w.
    fn with_w(mut self, w: &Self) -> Self {
        let gain = std::mem::take(&mut self.w);
        self.add(gain, w);
        self
    }

    /// Its value.
    pub(super) fn at(&self, z: &[S], w: S, r: f64) -> S {
        let states = self.states.iter().zip(z);
        let sum = states.fold(self.constant, |sum, (&a, &z)| sum + a * z);
        sum + self.w * w + self.r * S::from(r)
    }

    /// Make `out` its series on an element.
    pub(super) fn on(&self, x: &Expansion<S>, w: &Series<S>, r: f64, out: &mut Series<S>) {
        x.combine(&self.states, self.w, w, self.forced(r), out);
    }

    /// What does not change with the states or w.
    pub(super) fn forced(&self, r: f64) -> S {
        self.constant + self.r * S::from(r)
    }
}

/// What the integral does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Integral {
    Runs,
    Stops,
    /// It keeps the command at its bound.
    Slides,
}

/// The mode of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mode {
    pub(super) side: Side,
    pub(super) integral: Integral,
    /// The sign of v′ while its rate is at its bound; 0 otherwise.
    pub(super) slew: Side,
}

impl Mode {
    pub(super) const FREE: Self = Self {
        side: 0,
        integral: Integral::Runs,
        slew: 0,
    };

    /// Is v other than u?
    pub(super) fn is_limited(self) -> bool {
        self.side != 0 || self.slew != 0
    }
}

/// The signals in one mode.
#[derive(Debug, Clone)]
pub(super) struct Field<S> {
    pub(super) mode: Mode,
    /// z′.
    pub(super) slopes: Vec<Signal<S>>,
    /// z′ as the matrix and the column of w that an expansion takes.
    pub(super) a: Vec<S>,
    pub(super) b: Vec<S>,
    pub(super) u: Signal<S>,
    pub(super) v: Signal<S>,
    pub(super) y: Signal<S>,
    /// How the integral changes u while it runs; nothing where none stops.
    pub(super) drive: Signal<S>,
    /// u′ with the integral stopped, but for that of w; nothing where none stops.
    pub(super) drift: Signal<S>,
}

impl<S: Scalar> Field<S> {
    /// The signals of a loop in this mode.
    pub(super) fn new(plant: &LinearLoop<S>, mode: Mode, is_delayed: bool) -> Self {
        let equations = plant.equations();
        let n = equations.states();
        let size = n + usize::from(plant.rate().is_some());
        let signal = |row: &[S], w: S, r: S| Signal {
            states: (0..size)
                .map(|i| row.get(i).copied().unwrap_or_default())
                .collect(),
            w,
            r,
            constant: S::default(),
        };
        let mut u = signal(&equations.k, equations.l, equations.m);
        let bound = |side: Side| {
            let (low, high) = plant.bounds().unwrap_or_default();
            Signal::constant(size, if side > 0 { high } else { low })
        };
        let mut v = match mode {
            Mode { slew: 1 | -1, .. } => Signal::state(size, n),
            Mode { side: 0, .. } => u.clone(),
            Mode { side, .. } => bound(side),
        };
        let mut w = Signal::nothing(size);
        w.w = S::from(1.0);
        if !is_delayed {
            if mode.is_limited() {
                u = u.with_w(&v);
            } else {
                let gain = S::from(1.0) / (S::from(1.0) - u.w);
                u.w = S::default();
                u = u.scaled(gain);
                v = u.clone();
            }
            w = v.clone();
        }
        let row = |i: usize| equations.a.get(i * n..(i + 1) * n).unwrap_or_default();
        let mut slopes: Vec<Signal<S>> = (0..n)
            .map(|i| signal(row(i), equations.b[i], equations.e[i]).with_w(&w))
            .collect();
        if mode.is_limited() {
            for (slope, &gain) in slopes.iter_mut().zip(&equations.excess) {
                slope.add(gain, &v);
                slope.add(-gain, &u);
            }
        }
        if let Some(rate) = plant.rate() {
            slopes.push(Signal::constant(size, rate * S::from(f64::from(mode.slew))));
        }
        let (mut drive, mut drift) = (Signal::nothing(size), Signal::nothing(size));
        if let Some(state) = plant.stops().filter(|state| *state < n) {
            let gain = u.states[state];
            for (i, slope) in slopes.iter().enumerate() {
                let part = if i == state { &mut drive } else { &mut drift };
                part.add(u.states[i], slope);
            }
            slopes[state] = match mode.integral {
                Integral::Runs => slopes[state].clone(),
                Integral::Stops => Signal::nothing(size),
                Integral::Slides => drift.clone().scaled(S::from(-1.0) / gain),
            };
        }
        Self {
            mode,
            a: slopes.iter().flat_map(|s| s.states.clone()).collect(),
            b: slopes.iter().map(|s| s.w).collect(),
            y: signal(&equations.c, equations.d, S::default()).with_w(&w),
            slopes,
            u,
            v,
            drive,
            drift,
        }
    }
}
