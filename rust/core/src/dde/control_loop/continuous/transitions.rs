//! The mode of the command: after a jump, where an element ends, and which follows.
//!
//! A mode ends where the command reaches or leaves a bound, its rate reaches the bound on that, a limited
//! rate has caught up, an integral stops or runs again. The signals that show this are polynomials, whose
//! zeros are isolated. A zero counts only if the signal then leaves the mode by more than the rounding
//! errors of its parts, because these could otherwise change the mode without end.
//!
//! An integral that stops makes the right-hand side jump at a bound. Where it would drive the command out
//! while it runs and lets it back in while it stops, the command stays at the bound: the integral then
//! follows from that (Filippov 1960).

use crate::dde::control_loop::level_crossings::{in_order, value_at};
use crate::dde::control_loop::series::Series;
use crate::dde::scalar::Scalar;

use super::field::{Integral, Mode, Signal};
use super::motion::{NOISE, Run};
use super::saturation::{Side, side_of};

/// Changes of mode without progress in time after which the mode is kept, because only rounding
/// errors at a bound cause them.
const MOST_CHANGES: u32 = 4;

/// Parts of an interval at which a signal is looked at.
const PROBES: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// A mode that follows, and where on the element.
#[derive(Clone, Copy)]
pub(super) struct Change<S> {
    pub(super) at: f64,
    /// The slope of that, of value zero.
    pub(super) later: S,
    mode: Mode,
}

impl<S: Scalar> Run<'_, '_, S> {
    /// Find the mode after a jump.
    pub(super) fn settle(&mut self, w: S) {
        let mut slew = 0;
        self.enter(Mode {
            slew: i8::from(self.plant.rate().is_some()),
            ..Mode::FREE
        });
        let u = self.field().u.at(&self.z, w, self.r).value();
        let side = side_of(u, self.bounds());
        if self.plant.rate().is_some() {
            let aim = match (side, self.plant.bounds()) {
                (1, Some((_, high))) => high.value(),
                (-1, Some((low, _))) => low.value(),
                _ => u,
            };
            let v = self.z.last().map_or(0.0, |v| v.value());
            let noise = NOISE * (aim.abs() + v.abs());
            slew = i8::from(aim > v + noise) - i8::from(aim < v - noise);
        }
        let integral = self.integral(side, slew, w);
        self.enter(Mode {
            side,
            integral,
            slew,
        });
    }

    /// Whether the integral stops beyond a bound.
    fn integral(&mut self, side: Side, slew: Side, w: S) -> Integral {
        if side == 0 || self.plant.stops().is_none() {
            return Integral::Runs;
        }
        self.enter(Mode {
            side,
            integral: Integral::Runs,
            slew,
        });
        let drive = self.field().drive.at(&self.z, w, self.r).value();
        if drive * f64::from(side) > 0.0 {
            Integral::Stops
        } else {
            Integral::Runs
        }
    }

    /// The first change of mode on the element.
    pub(super) fn change(&self, h: S) -> Option<Change<S>> {
        if self.is_cut || (self.plant.bounds().is_none() && self.plant.rate().is_none()) {
            return None;
        }
        let mode = self.field().mode;
        let mut first: Option<Change<S>> = None;
        let mut note = |series: &Series<S>, noise: f64, to: Mode| {
            if let Some(at) = self.left(series, noise)
                && first.is_none_or(|known| at < known.at)
            {
                let later = later(series, at);
                first = Some(Change {
                    at,
                    later,
                    mode: to,
                });
            }
        };
        let field = self.field();
        let u = self.series(&field.u);
        let (least, most) = u.range();
        let bounds = self.plant.bounds();
        let is_inside =
            bounds.is_none_or(|(low, high)| least >= low.value() && most <= high.value());
        if is_inside && mode == Mode::FREE && self.plant.rate().is_none() {
            return None;
        }
        let noise = self.noise(&field.u);
        if let Some((low, high)) = bounds {
            for (side, bound) in [(1, high), (-1, low)] {
                if !bound.value().is_finite() || mode.integral == Integral::Slides {
                    continue;
                }
                // Within: the bound less u; beyond: u less the bound.
                let sign = if mode.side == side { 1.0 } else { -1.0 };
                if mode.side == side || mode.side == 0 {
                    let distance = against(&u, bound, sign * f64::from(side));
                    let next = Mode {
                        side: if mode.side == 0 { side } else { 0 },
                        integral: Integral::Runs,
                        ..mode
                    };
                    note(&distance, noise + NOISE * bound.value().abs(), next);
                }
            }
        }
        if mode.side != 0 && self.plant.stops().is_some() {
            self.integrals(f64::from(mode.side), &mut note);
        }
        if let Some(rate) = self.plant.rate() {
            if mode.slew != 0 {
                let aim = self.aim();
                let mut left = self.series(&aim);
                let v = self.series(&field.v);
                add(&mut left, -1.0, &v);
                let noise = self.noise(&aim) + self.noise(&field.v);
                let next = Mode { slew: 0, ..mode };
                note(&scaled(&left, f64::from(mode.slew)), noise, next);
            } else if mode.side == 0 {
                let slope = scaled(&u.derivative(), 1.0 / h.value());
                let noise = noise * slope.degree.max(1) as f64 / h.value();
                for slew in [1, -1] {
                    let distance =
                        against(&slope, S::from(f64::from(slew)) * rate, -f64::from(slew));
                    note(
                        &distance,
                        noise + NOISE * rate.value(),
                        Mode { slew, ..mode },
                    );
                }
            }
        }
        first
    }

    /// Changes of the integral beyond a bound.
    fn integrals(&self, side: f64, note: &mut impl FnMut(&Series<S>, f64, Mode)) {
        let field = self.field();
        let mode = field.mode;
        let to = |integral| Mode { integral, ..mode };
        let mut out = field.drift.clone();
        match mode.integral {
            Integral::Runs => {
                let drive = scaled(&self.series(&field.drive), -side);
                note(&drive, self.noise(&field.drive), to(Integral::Stops));
            }
            Integral::Stops => {
                let drive = scaled(&self.series(&field.drive), side);
                note(&drive, self.noise(&field.drive), to(Integral::Runs));
            }
            Integral::Slides => {
                let drift = scaled(&self.series(&out), -side);
                note(&drift, self.noise(&out), to(Integral::Stops));
                out.add(S::from(1.0), &field.drive);
                let free = Mode {
                    side: 0,
                    integral: Integral::Runs,
                    ..mode
                };
                note(&scaled(&self.series(&out), side), self.noise(&out), free);
            }
        }
    }

    /// What the command would be without a bound on its rate.
    fn aim(&self) -> Signal<S> {
        let field = self.field();
        match (field.mode.side, self.plant.bounds()) {
            (1, Some((_, high))) => Signal::constant(self.z.len(), high),
            (-1, Some((low, _))) => Signal::constant(self.z.len(), low),
            _ => field.u.clone(),
        }
    }

    /// Where a signal becomes clearly negative.
    fn left(&self, series: &Series<S>, noise: f64) -> Option<f64> {
        let (least, _) = series.range();
        if least >= -noise {
            return None;
        }
        let mut zeros = in_order(series, [0.0], vec![0.0]);
        zeros.push(1.0);
        zeros.windows(2).find_map(|pair| {
            let (from, to) = (pair[0], pair[1]);
            let at = |part: f64| value_at(series, from + part * (to - from));
            let is_left = PROBES.into_iter().any(|part| at(part) < -noise);
            (is_left && (from > 0.0 || self.changes < MOST_CHANGES)).then_some(from)
        })
    }

    /// Go to another mode, at the end of the element.
    pub(super) fn leave(&mut self, change: Change<S>) {
        let w = self.w.at(S::from(change.at));
        let mut mode = change.mode;
        let last = self.field().mode;
        if self.plant.stops().is_some() && mode.side != last.side {
            mode = self.across(last, mode, w);
        }
        self.enter(mode);
    }

    /// Go to another mode where the present one has just begun. A limited rate that takes over then does so later or
    /// earlier as the change before it does, and v has moved by the difference of both rates.
    pub(super) fn leave_at_once(&mut self, change: Change<S>) {
        let slew = change.mode.slew;
        self.leave(change);
        let (later, before) = self.last_change;
        if let (true, Some(rate), Some(v)) = (slew != 0, self.plant.rate(), self.z.last_mut()) {
            *v += later * (S::from(before) - S::from(f64::from(slew)) * rate);
        }
    }

    /// The slope of v at a part of the element of length `h`.
    pub(super) fn slope(&self, h: S, part: f64) -> f64 {
        let v = self.series(&self.field().v);
        v.derivative().at(S::from(part)).value() / h.value()
    }

    /// The mode at a bound that the command reaches or leaves, of an integral that may stop.
    fn across(&mut self, last: Mode, mode: Mode, w: S) -> Mode {
        let side = if mode.side == 0 { last.side } else { mode.side };
        let beyond = Mode {
            side,
            integral: Integral::Runs,
            ..mode
        };
        self.enter(beyond);
        let field = self.field();
        let sign = f64::from(side);
        let drive = sign * field.drive.at(&self.z, w, self.r).value();
        let drift = sign * field.drift.at(&self.z, w, self.r).value();
        let to = |integral| Mode { integral, ..beyond };
        if last.integral == Integral::Slides {
            mode
        } else if drive <= 0.0 {
            if mode.side == 0 { mode } else { beyond }
        } else if drift > 0.0 {
            to(Integral::Stops)
        } else if drift + drive > 0.0 {
            to(Integral::Slides)
        } else {
            Mode { side: 0, ..mode }
        }
    }
}

/// How a zero of a signal moves with the numbers: −ġ/g′, of value zero.
fn later<S: Scalar>(series: &Series<S>, at: f64) -> S {
    let slope = series.derivative().at(S::from(at)).value();
    let moved = series.at(S::from(at)) / S::from(-slope);
    if slope == 0.0 {
        S::default()
    } else {
        moved.pinned(0.0)
    }
}

/// `sign` (u − bound).
fn against<S: Scalar>(u: &Series<S>, bound: S, sign: f64) -> Series<S> {
    let mut out = *u;
    out.coefficients[0] = out.coefficients[0] - bound;
    scaled(&out, sign)
}

fn scaled<S: Scalar>(u: &Series<S>, gain: f64) -> Series<S> {
    let mut out = *u;
    let terms = out.coefficients.iter_mut().take(out.degree + 1);
    terms.for_each(|c| *c *= S::from(gain));
    out
}

fn add<S: Scalar>(sum: &mut Series<S>, gain: f64, other: &Series<S>) {
    sum.degree = sum.degree.max(other.degree);
    for (c, o) in sum.coefficients.iter_mut().zip(&other.coefficients) {
        *c += S::from(gain) * *o;
    }
}
