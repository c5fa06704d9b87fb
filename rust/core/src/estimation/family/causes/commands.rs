//! Records whose commands pass causes, and the sizes of these that are tried.

use std::sync::Arc;

use super::super::aside::{Aside, Signal};
use super::super::cause::CauseKind;
use super::super::rows::{Part, Rows};
use super::super::shape::Shape;

/// Sizes of play and dead zone that are tried: the least and the largest, as shares of what the
/// command moves, and how many. More see each size better and take longer.
const SIZES: (f64, f64, usize) = (0.005, 0.6, 14);

/// The same for stiction, whose likelihood has many minima: sizes at equal distances.
const STUCK: (f64, f64, usize) = (0.01, 0.6, 60);

/// The same for limits, as shares of the largest command of their side.
const LIMITS: (f64, f64, usize) = (0.3, 0.97, 14);

/// The same for limits of a slope, as shares of what the command moves in a row.
const SLOPES: (f64, f64, usize) = (0.015, 1.0, 14);

/// Step of the derivative over a size, as a share.
const STEP: f64 = 0.02;

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
    fn signal(&self) -> Signal {
        Signal {
            sent: self.sent.clone(),
            value: self.command.iter().map(|u| u + self.base).collect(),
            straight: self.straight,
        }
    }

    /// With the command behind all of these; the slopes over their sizes stand aside, in the order of the causes.
    fn through(&self, causes: &[CauseKind], shapes: &[Option<Shape>]) -> Self {
        let mut out = self.clone();
        let given = self.given.clone();
        let given = given.unwrap_or_else(|| Arc::new(self.signal()));
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
        let (given, row) = (self.signal(), self.row);
        let moved = shape.passed(&given, row);
        let first = moved.value.first().copied().unwrap_or(0.0);
        if shape.kind.remembers() {
            // From where it was at first, until it moves.
            let moves = moved.value.iter().map(|u| f64::from(u8::from(*u != first)));
            let began = Aside::input(moved.sent.clone(), moves.collect(), false);
            self.asides.push(Some(began));
        }
        // What sticks does not move with the size by little and little.
        let slope = (shape.kind != CauseKind::Stiction).then(|| {
            let near = |share: f64| Shape {
                size: shape.size * (1.0 + share),
                ..shape
            };
            let more = near(STEP).passed(&given, row);
            let less = near(-STEP).passed(&given, row);
            more.less(less, 0.5 / (STEP * shape.size), self.slope.is_none())
        });
        self.asides.push(slope);
        self.take(moved);
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
        let given = part.signal();
        let passed = self.passed(&given, part.row);
        passed.less(given, 1.0, part.slope.is_none())
    }
}
