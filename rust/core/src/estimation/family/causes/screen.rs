//! Which causes may be in a record: every size of each, scored against what plants without one leave.
//!
//! The score is that of a further column times a free number, beside the numbers of the plant to first
//! order. It asks little, so that what is large and no small change is found too.

use super::super::aside::Aside;
use super::super::cause::CauseKind;
use super::super::class::Class;
use super::super::flexible::flexible;
use super::super::minima::Minimum;
use super::super::model::{Model, Point};
use super::super::noise::Noise;
use super::super::projection::Projection;
use super::super::rows::{Part, Rows};
use super::super::shape::Shape;
use super::super::tolerances::{CAUSES, EVIDENCE};
use super::asides::{from_time, moving};
use super::commands::{neighbours, sizes};
use crate::elementary::log;
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// A cause that may be in the record.
#[derive(Debug, Clone)]
pub(super) struct Suspect {
    pub(super) kind: CauseKind,
    /// Its size, of causes that the command passes, and the sizes beside it.
    pub(super) size: f64,
    pub(super) between: (f64, f64),
    /// The record and the time at which it begins.
    pub(super) record: usize,
    pub(super) time: f64,
    /// BIC to expect.
    pub(super) bic: f64,
    /// The plant beside which it is most likely.
    pub(super) class: Class,
    pub(super) x: Vec<f64>,
    pub(super) noise: Noise,
}

/// A plant beside which causes are scored.
pub(super) struct Frame<'a> {
    pub(super) model: Model<'a>,
    pub(super) point: Point,
    slopes: Projection,
    pub(super) left: Vec<f64>,
    pub(super) squares: f64,
    pub(super) bic: f64,
}

impl<'a> Frame<'a> {
    pub(super) fn new(model: Model<'a>, point: Point) -> Self {
        let slopes = Projection::new(model.slopes(&point));
        let mut left = point.whitened.clone();
        slopes.taken(&mut left);
        let squares = dot(&left, &left);
        let rows = model.rows.count() as f64;
        let fall = rows * log(dot(&point.whitened, &point.whitened) / squares);
        let penalty = log(rows) * model.parameters() as f64;
        Self {
            bic: model.deviance(&point) - fall + penalty,
            model,
            point,
            slopes,
            left,
            squares,
        }
    }

    /// The same of a class with its error, if the record shows one.
    fn with_error(found: &Minimum<'a>) -> Option<Self> {
        let own = flexible(found).filter(|own| own.bic < found.bic)?;
        let model = Model {
            noise: own.noise,
            ..found.model
        };
        let point = model.at(own.x.clone());
        let (columns, left) = own.columns();
        let slopes = Projection::new(columns.cloned());
        let mut left = left.to_vec();
        slopes.taken(&mut left);
        Some(Self {
            bic: own.bic,
            squares: dot(&left, &left),
            model,
            point,
            slopes,
            left,
        })
    }

    /// A column, whitened and beside the numbers of the plant.
    pub(super) fn beside(&self, raw: &[f64]) -> Vec<f64> {
        let mut column = self.model.whitener(&self.point.x).whiten(raw);
        self.point.projection.taken(&mut column);
        self.slopes.taken(&mut column);
        column
    }

    /// The fall of −2 ln L by a further column, and its factor.
    fn score(&self, raw: &[f64]) -> (f64, f64) {
        let mut column = self.model.whitener(&self.point.x).whiten(raw);
        let before = dot(&column, &column);
        self.point.projection.taken(&mut column);
        self.slopes.taken(&mut column);
        let size = dot(&column, &column);
        if size.is_nan() || size <= CAUSES.own * before {
            return (0.0, 0.0);
        }
        let factor = dot(&column, &self.left) / size;
        let after = (self.squares - factor * factor * size).max(CAUSES.least * self.squares);
        (self.left.len() as f64 * log(self.squares / after), factor)
    }

    /// What asides add to the output of all records.
    fn raw(&self, asides: &[Option<Aside>], factor: f64) -> Vec<f64> {
        let numbers = self.model.numbers(&self.point.x);
        let mut out = Vec::with_capacity(self.left.len());
        for (part, aside) in self.model.rows.parts.iter().zip(asides) {
            match aside {
                None => out.resize(out.len() + part.used.len(), 0.0),
                Some(aside) => {
                    let own = aside.response(part, self.model.class, &numbers);
                    out.extend(own.value.iter().map(|value| factor * value));
                }
            }
        }
        out
    }

    /// BIC to expect with a cause, and the factor of its column.
    fn bic_with(&self, kind: CauseKind, asides: &[Option<Aside>], factor: f64) -> (f64, f64) {
        let (fall, found) = self.score(&self.raw(asides, factor));
        let penalty = log(self.left.len() as f64) * kind.parameters() as f64;
        (self.bic - fall + penalty, found)
    }
}

/// Plants beside which causes are scored: the best of some classes, also under white noise, for coloured
/// noise may stand for what the plant lacks.
pub(super) fn frames<'a>(found: &[Minimum<'a>]) -> Vec<Frame<'a>> {
    let Some(best) = found.first() else {
        return Vec::new();
    };
    let mut classes: Vec<Class> = Vec::new();
    let mut out = Vec::new();
    for one in found {
        let class = one.model.class;
        if classes.contains(&class)
            || classes.len() >= CAUSES.classes
            || one.bic > best.bic + EVIDENCE.hopeless
        {
            continue;
        }
        classes.push(class);
        out.extend(frames_of(one));
    }
    if best.model.rows.flexible {
        out.extend(Frame::with_error(best));
    }
    out
}

/// A plant under its noise and under white noise.
fn frames_of<'a>(one: &Minimum<'a>) -> impl Iterator<Item = Frame<'a>> {
    let own = Frame::new(one.model, one.point.clone());
    let is_coloured = one.model.noise != Noise::White;
    let white = is_coloured.then(|| {
        let model = Model {
            noise: Noise::White,
            ..one.model
        };
        let x = one.point.x[..model.plant_numbers()].to_vec();
        Frame::new(model, model.at(x))
    });
    std::iter::once(own).chain(white)
}

/// The likeliest plants with one lag that are in no frame: the slope of one lag is limited, and without the limit more
/// lags may come far nearer.
fn lagging<'a>(found: &[Minimum<'a>], frames: &[Frame<'a>]) -> Vec<Frame<'a>> {
    let is_new = |one: &&Minimum<'a>| {
        let class = one.model.class;
        class.order == 1 && frames.iter().all(|frame| frame.model.class != class)
    };
    let best = found.iter().find(is_new);
    best.into_iter().flat_map(frames_of).collect()
}

/// The fall of −2 ln L by a second beginning, far from the first one.
pub(super) fn begins_again(kind: CauseKind, time: f64, best: &Minimum<'_>) -> f64 {
    let frame = Frame::new(best.model, best.point.clone());
    let apart = CAUSES.apart * best.model.rows.span;
    let far = |other: f64| (other - time).abs() > apart;
    let again = beginning(kind, best.model.rows, std::slice::from_ref(&frame), &far);
    let penalty = log(best.model.rows.count() as f64) * kind.parameters() as f64;
    again.map_or(0.0, |one| best.bic + penalty - one.bic)
}

/// The causes that may be in the record, the likeliest first.
pub(super) fn suspects(
    rows: &Rows,
    found: &[Minimum<'_>],
    task: &Task,
) -> Result<Vec<Suspect>, Error> {
    let frames = frames(found);
    let lagging = lagging(found, &frames);
    let least = found.first().map_or(f64::INFINITY, |best| best.bic);
    let mut out: Vec<Suspect> = Vec::new();
    for kind in CauseKind::ALL {
        task.check()?;
        if rows.causes.contains(&kind) {
            continue;
        }
        let one = if kind.begins() {
            beginning(kind, rows, &frames, &|_| true)
        } else {
            let mut some = lasting(kind, rows, &frames);
            if kind.limits_slope() {
                some.extend(lasting(kind, rows, &lagging));
            }
            some.into_iter().min_by(|a, b| a.bic.total_cmp(&b.bic))
        };
        out.extend(one.filter(|one| one.bic < least));
    }
    out.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    out.truncate(CAUSES.followed);
    let hopeless = out.first().map_or(f64::INFINITY, |one| one.bic) + EVIDENCE.hopeless;
    out.retain(|one| one.bic < hopeless);
    Ok(out)
}

fn suspect(kind: CauseKind, frame: &Frame<'_>, bic: f64) -> Suspect {
    Suspect {
        kind,
        size: f64::NAN,
        between: (f64::NAN, f64::NAN),
        record: 0,
        time: f64::NAN,
        bic,
        class: frame.model.class,
        x: frame.point.x.clone(),
        noise: frame.model.noise,
    }
}

/// Sizes of a cause that is there all the time, each with its BIC.
fn lasting(kind: CauseKind, rows: &Rows, frames: &[Frame<'_>]) -> Vec<Suspect> {
    let mut out = Vec::new();
    let tried = sizes(kind, rows);
    for frame in frames {
        if tried.is_empty() {
            out.extend(moved(kind, rows, frame));
            continue;
        }
        let gain = frame.model.gain(&frame.point);
        let lag = frame.model.numbers(&frame.point.x).lag();
        for (place, size) in tried.iter().enumerate() {
            let shape = Shape {
                kind,
                size: *size,
                lag,
            };
            let each = rows.parts.iter();
            let asides: Vec<_> = each.map(|part| Some(shape.taken(part))).collect();
            let (bic, factor) = frame.bic_with(kind, &asides, gain);
            if factor > CAUSES.share {
                let mut one = suspect(kind, frame, bic);
                (one.size, one.between) = (*size, neighbours(&tried, place));
                out.push(one);
            }
        }
    }
    out
}

/// A cause that follows from how the plant moves.
fn moved(kind: CauseKind, rows: &Rows, frame: &Frame<'_>) -> Option<Suspect> {
    let each = 0..rows.parts.len();
    let asides: Vec<_> = each
        .map(|at| moving(kind, &frame.model, &frame.point, at))
        .collect();
    if asides.iter().all(Option::is_none) {
        return None;
    }
    let (bic, factor) = frame.bic_with(kind, &asides, 1.0);
    let gain = frame.model.gain(&frame.point);
    (kind != CauseKind::Drag || factor * gain > 0.0).then(|| suspect(kind, frame, bic))
}

/// The likeliest beginning of what begins: on a grid of rows, then between those beside the best.
fn beginning(
    kind: CauseKind,
    rows: &Rows,
    frames: &[Frame<'_>],
    may_be: &dyn Fn(f64) -> bool,
) -> Option<Suspect> {
    let mut best: Option<(Suspect, usize)> = None;
    for (record, part) in rows.parts.iter().enumerate() {
        let (first, last) = inside(part);
        let step = ((last - first) / CAUSES.beginnings).max(1);
        for (place, frame) in frames.iter().enumerate() {
            for row in (first..last)
                .step_by(step)
                .filter(|row| may_be(part.time[*row]))
            {
                let bic = bic_from(kind, frame, record, part.time[row]);
                if best.as_ref().is_none_or(|(known, _)| bic < known.bic) {
                    let mut one = suspect(kind, frame, bic);
                    (one.record, one.time) = (record, part.time[row]);
                    (one.between.0, one.between.1) = (one.time, step as f64 * part.row);
                    best = Some((one, place));
                }
            }
        }
    }
    let (mut one, place) = best?;
    let mut reach = one.between.1;
    while reach > CAUSES.fine * rows.parts[one.record].row {
        reach *= 0.5;
        for time in [one.time - reach, one.time + reach] {
            let bic = bic_from(kind, &frames[place], one.record, time);
            if bic < one.bic {
                (one.time, one.bic) = (time, bic);
            }
        }
    }
    Some(one)
}

fn bic_from(kind: CauseKind, frame: &Frame<'_>, record: usize, time: f64) -> f64 {
    let parts = &frame.model.rows.parts;
    let mut asides: Vec<Option<Aside>> = vec![None; parts.len()];
    asides[record] = Some(from_time(kind, &parts[record], time));
    frame.bic_with(kind, &asides, 1.0).0
}

/// Rows at which something may begin: with some before and after it.
fn inside(part: &Part) -> (usize, usize) {
    let first = part.used.first().copied().unwrap_or(0);
    let last = part.used.last().copied().unwrap_or(0);
    let margin = CAUSES.margin.min((last - first) / 4);
    (
        first + margin,
        last.saturating_sub(margin).max(first + margin),
    )
}
