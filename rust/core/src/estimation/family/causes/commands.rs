//! What reaches the plant of a command, behind an actuator that is not linear.

use std::sync::Arc;

use super::super::aside::{Aside, Signal};
use super::super::cause::CauseKind;
use super::super::class::Numbers;
use super::super::rows::{Part, Rows};
use crate::elementary::exp;

/// Sizes of play and dead zone that are tried: the least and the largest, as shares of what the
/// command moves, and how many. More see each size better and take longer.
const SIZES: (f64, f64, usize) = (0.005, 0.6, 14);

/// The same for stiction, whose likelihood has many minima: sizes at equal distances.
const STUCK: (f64, f64, usize) = (0.01, 0.6, 60);

/// The same for limits, as shares of the largest command of their side.
const LIMITS: (f64, f64, usize) = (0.3, 0.97, 14);

/// The same for limits of a slope, as shares of what the command moves in a row.
const SLOPES: (f64, f64, usize) = (0.015, 1.0, 14);

/// Time in which a signal jumps, in rows.
const JUMP: f64 = 1e-6;

/// Step of the derivative over a size, as a share.
const STEP: f64 = 0.02;

/// A cause that the command passes.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Shape {
    pub(super) kind: CauseKind,
    pub(super) size: f64,
    /// The lag of the plant, s.
    pub(super) lag: f64,
}

impl Shape {
    /// What is behind it of the command of a record.
    fn passed(&self, part: &Part) -> Signal {
        let full = part.full();
        if !self.kind.limits_slope() {
            return Signal {
                sent: part.sent.clone(),
                value: behind(self.kind, self.size, &full),
                straight: part.straight,
            };
        }
        let lag = if self.kind == CauseKind::SlopeLimit {
            self.lag
        } else {
            0.0
        };
        let points = slow(&part.sent, &full, self.size, lag, JUMP * part.row);
        let (sent, value) = points.into_iter().unzip();
        Signal {
            sent,
            value,
            straight: true,
        }
    }

    fn of_size(self, size: f64) -> Self {
        Self { size, ..self }
    }
}

/// The command that a linear lag needs so that its output v goes where that of a held command goes whose
/// slope is limited: v + lag v′, a ramp while the limit is reached. Without a lag, the command itself ramps.
fn slow(sent: &[f64], command: &[f64], most: f64, lag: f64, jump: f64) -> Vec<(f64, f64)> {
    let mut v = command.first().copied().unwrap_or(0.0);
    let mut end = v;
    let mut out: Vec<(f64, f64)> = Vec::with_capacity(2 * sent.len());
    for (at, (time, u)) in sent.iter().zip(command).enumerate() {
        let long = sent.get(at + 1).map_or(f64::INFINITY, |next| next - time);
        let off = u - v;
        let ramp = (off.abs() / most - lag).max(0.0);
        let slope = most.copysign(off);
        let start = if ramp > 0.0 { v + lag * slope } else { *u };
        out.push((*time, end));
        if (start - end).abs() > 0.0 {
            out.push((time + jump, start));
        }
        if ramp >= long {
            v += slope * long;
            end = v + lag * slope;
            continue;
        }
        if ramp > jump {
            out.push((time + ramp, *u));
            v += slope * ramp;
        }
        end = *u;
        if long.is_finite() {
            let decay = if lag > 0.0 {
                exp(-(long - ramp) / lag)
            } else {
                0.0
            };
            v = u - (u - v) * decay;
        }
    }
    if let Some((time, _)) = out.last().copied() {
        out.push((time + 1.0, end));
    }
    out
}

/// The command behind a cause of this size, at the same times.
fn behind(kind: CauseKind, size: f64, command: &[f64]) -> Vec<f64> {
    let mut last = command.first().copied().unwrap_or(0.0);
    let each = |u: &f64| match kind {
        CauseKind::DeadZone => u - u.clamp(-size, size),
        CauseKind::UpperLimit => u.min(size),
        CauseKind::LowerLimit => u.max(-size),
        CauseKind::Play => {
            last = last.clamp(u - 0.5 * size, u + 0.5 * size);
            last
        }
        CauseKind::Stiction => {
            if (u - last).abs() > size {
                last = *u;
            }
            last
        }
        _ => *u,
    };
    command.iter().map(each).collect()
}

/// The sizes of a cause that may be in these rows.
pub(super) fn sizes(kind: CauseKind, rows: &Rows) -> Vec<f64> {
    let ends = rows.parts.iter().map(Part::ends);
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |all, own| {
        (all.0.min(own.0), all.1.max(own.1))
    });
    let even = |(least, most, count): (f64, f64, usize), scale: f64| -> Vec<f64> {
        let step = (most - least) / (count - 1) as f64;
        (0..count)
            .map(|at| scale * (least + step * at as f64))
            .collect()
    };
    let ratio = |(least, most, count): (f64, f64, usize), scale: f64| -> Vec<f64> {
        let growth = (most / least).powf(1.0 / (count - 1) as f64);
        (0..count)
            .map(|at| scale * least * growth.powi(at as i32))
            .collect()
    };
    match kind {
        CauseKind::Play => ratio(SIZES, high - low),
        CauseKind::DeadZone if low < 0.0 && high > 0.0 => ratio(SIZES, high.max(-low)),
        CauseKind::Stiction => even(STUCK, high - low),
        CauseKind::UpperLimit if high > 0.0 => even(LIMITS, high),
        CauseKind::LowerLimit if low < 0.0 => even(LIMITS, -low),
        // One of both: behind one, a command is no longer held.
        CauseKind::RateLimit | CauseKind::SlopeLimit
            if !rows.straight && !rows.causes.iter().any(|known| known.limits_slope()) =>
        {
            ratio(SLOPES, (high - low) / rows.row)
        }
        _ => Vec::new(),
    }
}

/// The distance from one size to the next, as a factor or of a scale.
pub(super) fn neighbours(sizes: &[f64], at: usize) -> (f64, f64) {
    let before = at
        .checked_sub(1)
        .map_or(0.5 * sizes[at], |place| sizes[place]);
    let after = sizes.get(at + 1).copied().unwrap_or(1.3 * sizes[at]);
    (before, after)
}

impl Part {
    /// The least and the largest command.
    fn ends(&self) -> (f64, f64) {
        let each = self.command.iter().map(|u| u + self.base);
        each.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| {
            (low.min(u), high.max(u))
        })
    }

    /// The command itself.
    pub(super) fn full(&self) -> Vec<f64> {
        self.command.iter().map(|u| u + self.base).collect()
    }

    /// With the command behind all of these; the slopes over their sizes stand aside, in the order of the causes.
    fn through(&self, causes: &[CauseKind], shapes: &[Option<Shape>]) -> Self {
        let mut out = self.clone();
        let given = self.given.clone().unwrap_or_else(|| {
            Arc::new(Signal {
                sent: self.sent.clone(),
                value: self.full(),
                straight: self.straight,
            })
        });
        out.take(Signal::clone(&given));
        let mut passed = shapes.iter().flatten();
        let slope = passed.find(|shape| shape.kind == CauseKind::SlopeLimit);
        out.slope = slope.map(|shape| shape.size);
        let mut old = self.asides.iter().cloned();
        out.asides = Vec::new();
        for (kind, shape) in causes.iter().zip(shapes) {
            let own: Vec<Option<Aside>> = old.by_ref().take(kind.columns()).collect();
            match shape {
                Some(shape) => out.pass(*shape),
                None => out.asides.extend(own),
            }
        }
        out.given = Some(given);
        out
    }

    fn take(&mut self, signal: Signal) {
        let first = signal.value.first().copied().unwrap_or(0.0);
        self.base = first;
        self.command = signal.value.iter().map(|u| u - first).collect();
        (self.sent, self.straight) = (signal.sent, signal.straight);
    }

    /// Let the command pass a cause.
    fn pass(&mut self, shape: Shape) {
        if shape.kind == CauseKind::SlopeLimit {
            self.asides.push(Some(Aside::Slope(STEP)));
            return;
        }
        let moved = shape.passed(self);
        let first = moved.value.first().copied().unwrap_or(0.0);
        if shape.kind.remembers() {
            // From where it was at first, until it moves.
            let moves = moved.value.iter().map(|u| f64::from(u8::from(*u != first)));
            let began = Aside::input(moved.sent.clone(), moves.collect(), false);
            self.asides.push(Some(began));
        }
        // What sticks does not move with the size by little and little.
        let slope = (shape.kind != CauseKind::Stiction).then(|| {
            let more = shape.of_size(shape.size * (1.0 + STEP)).passed(self);
            let less = shape.of_size(shape.size * (1.0 - STEP)).passed(self);
            more.less(less, 0.5 / (STEP * shape.size), self.slope.is_none())
        });
        self.asides.push(slope);
        self.take(moved);
    }

    /// What a linear plant needs in place of a command that is held, so that it moves as one whose lag has a limited
    /// slope.
    pub(in super::super) fn behind_slope(
        &self,
        sent: &[f64],
        command: &[f64],
        most: f64,
        numbers: &Numbers,
    ) -> (Vec<f64>, Vec<f64>) {
        let points = slow(sent, command, most, numbers.lag(), JUMP * self.row);
        points.into_iter().unzip()
    }
}

impl Rows {
    /// With the commands behind one cause more.
    pub(super) fn behind(&self, shape: Shape) -> Self {
        let mut out = self.clone();
        out.causes.push(shape.kind);
        out.shapes.push(Some(shape));
        out.passed_again()
    }

    /// The sizes of what the commands pass.
    pub(super) fn sizes(&self) -> Vec<f64> {
        let shapes = self.shapes.iter().flatten();
        shapes.map(|shape| shape.size).collect()
    }

    /// With other sizes of what the commands pass.
    pub(super) fn with_sizes(&self, sizes: &[f64]) -> Self {
        let mut out = self.clone();
        for (shape, size) in out.shapes.iter_mut().flatten().zip(sizes) {
            shape.size = *size;
        }
        out.passed_again()
    }

    fn passed_again(mut self) -> Self {
        let (causes, shapes) = (&self.causes, &self.shapes);
        let parts = self.parts.iter();
        self.parts = parts.map(|part| part.through(causes, shapes)).collect();
        self
    }
}

impl Shape {
    /// What it takes from the commands of a record, as an input of its own.
    pub(super) fn taken(&self, part: &Part) -> Aside {
        let full = Signal {
            sent: part.sent.clone(),
            value: part.full(),
            straight: part.straight,
        };
        self.passed(part).less(full, 1.0, part.slope.is_none())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_actuator_with_play_follows_behind_half_of_it() {
        let command = [0.0, 1.0, 2.0, 1.5, 0.0, 0.4];
        assert_eq!(
            behind(CauseKind::Play, 1.0, &command),
            [0.0, 0.5, 1.5, 1.5, 0.5, 0.5]
        );
        assert_eq!(
            behind(CauseKind::Stiction, 0.9, &command),
            [0.0, 1.0, 2.0, 2.0, 0.0, 0.0]
        );
        assert_eq!(
            behind(CauseKind::DeadZone, 0.5, &[-1.0, 0.2, 0.7]),
            [-0.5, 0.0, 0.7 - 0.5]
        );
    }

    #[test]
    fn a_lag_behind_the_ramps_moves_as_one_whose_slope_is_limited() {
        let (sent, command) = ([0.0, 1.0, 2.0, 3.2], [0.0, 2.0, 1.5, -1.0]);
        for (lag, most) in [(0.4, 1.5), (0.0, 1.5), (0.4, 100.0)] {
            let points = slow(&sent, &command, most, lag, 1e-7);
            assert!(points.windows(2).all(|two| two[0].0 < two[1].0));
            let at = |time: f64| {
                let next = points.partition_point(|point| point.0 <= time);
                let ((a, x), (b, y)) = (points[next - 1], points[next]);
                x + (y - x) * (time - a) / (b - a)
            };
            // Both by small steps.
            let (step, mut limited, mut linear) = (1e-4, 0.0, 0.0);
            for count in 0..40_000 {
                let time = (f64::from(count) + 0.5) * step;
                let held = command[sent.partition_point(|own| *own <= time) - 1];
                if lag > 0.0 {
                    limited += step * ((held - limited) / lag).clamp(-most, most);
                    linear += step * (at(time) - linear) / lag;
                } else {
                    limited += (held - limited).clamp(-most * step, most * step);
                    linear = at(time);
                }
                assert!(
                    f64::abs(limited - linear) < 2e-3,
                    "{time} {limited} {linear}"
                );
            }
        }
    }
}
