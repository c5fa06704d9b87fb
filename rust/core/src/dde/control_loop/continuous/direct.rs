//! The loop without a delay: w = sat(K x + L w + M r) holds at one and the same instant.
//!
//! For L < 1, or for any L ≠ 1 without a limit, w = sat(v) with v = (K x + M r)/(1 − L) is its one
//! solution. The loop is then linear where |v| ≤ limit and has a constant command elsewhere; an
//! element ends where v crosses the limit. The two fields agree there, so that the state passes
//! through and never slides. v is known up to the rounding errors of its parts. A crossing
//! therefore counts only if v leaves the limit by more than these errors; otherwise rounding errors
//! could change the mode without end, in steps of time too short to change the state.

use crate::dde::control_loop::linear_loop::{LinearLoop, Start, dot, saturate};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::limits::{check_growth, slack};
use crate::dde::scalar::Scalar;
use crate::{Error, Task};

use super::effort::watch;
use super::expansion::Expansion;
use super::saturation::{Mode, Stretch, stretches};
use crate::dde::control_loop::series::{BLOCK, Series};

/// Changes of mode without progress in time after which the mode is kept, because only rounding
/// errors at the limit cause them.
const MOST_CHANGES: u32 = 2;

/// Factor on the length of a shortened element.
const MARGIN: f64 = 0.95;

/// Rounding error of v, relative to the sum of its parts.
const NOISE: f64 = 16.0 * f64::EPSILON;

/// Parts of an interval at which v is compared with the limit.
const PROBES: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// Does v leave the limit that `mode` and the mode of the stretch share by more than `noise`?
fn is_clear<S: Scalar>(
    v: &Series<S>,
    stretch: &Stretch,
    mode: Mode,
    limit: f64,
    noise: f64,
) -> bool {
    PROBES.into_iter().any(|part| {
        let sigma = stretch.start + part * (stretch.end - stretch.start);
        let v = v.at(S::from(sigma)).value();
        match (mode, stretch.mode) {
            (Mode::High, _) => v < limit - noise,
            (Mode::Low, _) => v > -limit + noise,
            (Mode::Free, Mode::High) => v > limit + noise,
            (Mode::Free, _) => v < -limit - noise,
        }
    })
}

pub(super) fn run<S: Scalar>(
    plant: &LinearLoop<S>,
    start: &Start<S>,
    reference: &Reference,
    mut requested: RequestedOutput<'_, S>,
    task: &Task,
) -> Result<Trajectory<S>, Error> {
    let closed = Closed::new(plant)?;
    let equations = plant.equations();
    let limit = plant.limit();
    let horizon = 1.0 + 2.0 * requested.last();
    let nothing = Series::constant(S::default());
    let n = equations.states();
    let mut free = Expansion::new(&closed.a, n);
    let mut driven = Expansion::new(&equations.a, n);
    let mut cursor = reference.cursor();
    cursor.advance(0.0, -f64::MIN_POSITIVE);
    let mut modes: Vec<Stretch> = Vec::new();
    let mut x = start.state.clone();
    let mut forcing = vec![S::default(); n];
    let mut mode = Mode::Free;
    let mut changes = 0;
    let mut t = S::default();
    let mut elements = 0;
    while !requested.is_done() {
        watch(elements, task)?;
        elements += 1;
        let tolerance = slack(t, S::default());
        let jumps = elements == 1 || cursor.next_jump() <= t.value() + tolerance;
        let before = cursor.value();
        let r = cursor.advance(t.value(), tolerance);
        if jumps {
            requested.input_break(t)?;
            let struck = closed.impulse * S::from(r - before);
            if !struck.is_nothing() {
                requested.output_break(t)?;
                for (x, &b) in x.iter_mut().zip(&equations.b) {
                    *x += b * struck;
                }
            }
            let v = (dot(&closed.k, &x) + closed.m * S::from(r)).value();
            mode = limit.map_or(Mode::Free, |limit| Mode::of(v, limit.value()));
        }
        let held = match mode {
            Mode::Free => None,
            Mode::High => limit,
            Mode::Low => limit.map(|limit| -limit),
        };
        let (a, expansion) = match held {
            None => (&closed.a, &mut free),
            Some(_) => (&equations.a, &mut driven),
        };
        for (i, forcing) in forcing.iter_mut().enumerate() {
            *forcing = match held {
                None => closed.e[i] * S::from(r),
                Some(w) => equations.e[i] * S::from(r) + equations.b[i] * w,
            };
        }
        let left = S::from(cursor.next_jump().min(horizon)) - t;
        let mut h = left.pinned(left.value().max(tolerance));
        let mut next = t + h;
        if h.value() > expansion.trial {
            h = S::from(expansion.trial);
            next = t + h;
        }
        let part = MARGIN * expansion.expand(a, &equations.b, &forcing, &x, &nothing, h);
        if part < MARGIN {
            expansion.shorten(part);
            h *= S::from(part);
            next = t + h;
        }
        let v = expansion.combine(&closed.k, S::default(), &nothing, closed.m * S::from(r));
        let mut end = 1.0;
        if let Some(limit) = limit.map(S::value) {
            stretches(&v, limit, &mut modes);
            let noise = NOISE * (expansion.size(&closed.k) + (closed.m.value() * r).abs() + limit);
            let leaves = |stretch: &&Stretch| {
                stretch.mode != mode
                    && (stretch.start > 0.0 || changes < MOST_CHANGES)
                    && is_clear(&v, stretch, mode, limit, noise)
            };
            if let Some(other) = modes.iter().find(leaves).copied() {
                end = other.start;
                next = t + S::from(end) * h;
                mode = other.mode;
            }
        }
        if next.value() <= t.value() {
            changes += 1;
            continue;
        }
        changes = 0;
        let y = match held {
            None => expansion.combine(&closed.c, S::default(), &nothing, closed.d * S::from(r)),
            Some(w) => expansion.combine(&equations.c, S::default(), &nothing, equations.d * w),
        };
        if requested.is_measured() {
            requested.measure(t.value(), h.value(), end, &y.values());
        }
        if held.is_some() {
            requested.limited(t, next);
        }
        requested.output_blocks(next.value() - tolerance, |times| {
            y.at_each(times.map(|time| (time - t) / h))
        });
        requested.input_blocks(next.value() - tolerance, |times| match held {
            Some(held) => [held; BLOCK],
            None => {
                let values = v.at_each(times.map(|time| (time - t) / h));
                values.map(|v| saturate(v, limit))
            }
        });
        if end < 1.0 {
            requested.input_break(next)?;
            requested.output_break(next)?;
        }
        expansion.end(S::from(end), &mut x);
        check_growth(&x, S::default(), next)?;
        t = next;
    }
    Ok(requested.trajectory)
}

/// The loop with w = v substituted.
struct Closed<S> {
    a: Vec<S>,
    /// Gain of r in x′.
    e: Vec<S>,
    k: Vec<S>,
    m: S,
    c: Vec<S>,
    d: S,
    /// Weight of the impulse in w per unit jump of r.
    impulse: S,
}

impl<S: Scalar> Closed<S> {
    fn new(plant: &LinearLoop<S>) -> Result<Self, Error> {
        let equations = plant.equations();
        let denominator = S::from(1.0) - equations.l;
        let sign = denominator.value();
        refuse_if!(
            sign == 0.0 || (sign < 0.0 && plant.limit().is_some()),
            "without a delay the command depends on itself with gain L = {}, which {}: give \
             the loop a delay or filter the derivative",
            equations.l.value(),
            if sign == 0.0 {
                "no command satisfies"
            } else {
                "several limited commands satisfy"
            }
        );
        let k: Vec<S> = equations.k.iter().map(|&k| k / denominator).collect();
        let m = equations.m / denominator;
        let n = equations.states();
        let mut a = equations.a.clone();
        for i in 0..n {
            for j in 0..n {
                a[i * n + j] += equations.b[i] * k[j];
            }
        }
        let along = |base: &[S], gain: S| -> Vec<S> {
            let pairs = base.iter().zip(&k);
            pairs.map(|(&c, &k)| c + gain * k).collect()
        };
        Ok(Self {
            a,
            e: equations
                .e
                .iter()
                .zip(&equations.b)
                .map(|(&e, &b)| e + b * m)
                .collect(),
            c: along(&equations.c, equations.d),
            d: equations.d * m,
            impulse: if plant.limit().is_none() {
                equations.impulse / denominator
            } else {
                S::default()
            },
            k,
            m,
        })
    }
}
