//! The rows with one suspect more: at its likeliest time, of its likeliest size, as the plant moves with it.

use super::super::cause::CauseKind;
use super::super::minima::Minimum;
use super::super::model::{Model, Point};
use super::super::rows::Rows;
use super::super::search::minimum;
use super::super::shape::Shape;
use super::super::tolerances::CAUSES;
use super::asides::{columns_from, moving};
use super::screen::Suspect;
use crate::{Error, Task};

/// The rows with a suspect.
pub(super) fn with_suspect(suspect: &mut Suspect, rows: &Rows, task: &Task) -> Result<Rows, Error> {
    let kind = suspect.kind;
    if kind.begins() {
        return beginning(suspect, rows, task);
    }
    if kind.is_passed() {
        return with_size(suspect, rows, task);
    }
    // As the plant moves without it, and then as it moves with it.
    let mut own = rows.clone();
    let mut x = suspect.x.clone();
    for round in 0..=CAUSES.rounds {
        let model = beside(suspect, &own);
        let point = if round == 0 {
            model.at(x)
        } else {
            minimum(&model, model.at(x), f64::INFINITY, task)?
        };
        let each = 0..rows.parts.len();
        let asides = each.map(|at| moving(kind, &model, &point, at).map(|own| vec![own]));
        let asides = asides.collect();
        x = point.x;
        own = rows.with_asides(kind, asides);
    }
    Ok(own)
}

/// The rows with something that begins, at the likeliest time beside that of the score.
fn beginning(suspect: &mut Suspect, rows: &Rows, task: &Task) -> Result<Rows, Error> {
    let with = |time: f64| {
        let mut asides = vec![None; rows.parts.len()];
        let part = &rows.parts[suspect.record];
        asides[suspect.record] = Some(columns_from(suspect.kind, part, time));
        rows.with_asides(suspect.kind, asides)
    };
    let mut x = suspect.x.clone();
    let mut best = (f64::INFINITY, suspect.time, 0.0);
    let mut time = suspect.time;
    if suspect.kind == CauseKind::Load {
        for _ in 0..CAUSES.refined {
            let own = with(time);
            let model = beside(suspect, &own);
            let point = minimum(&model, model.at(x.clone()), f64::INFINITY, task)?;
            let deviance = model.deviance(&point);
            let later = match point.of_causes() {
                [.., slope, size] => -slope / size,
                _ => 0.0,
            };
            if deviance < best.0 {
                best = (deviance, time, later);
                x = point.x;
            } else {
                // Too far.
                best.2 *= 0.5;
            }
            let step = best.2.clamp(-suspect.between.1, suspect.between.1);
            if !step.is_finite() || step.abs() < CAUSES.near * rows.parts[suspect.record].row {
                break;
            }
            time = best.1 + step;
        }
        time = best.1;
    }
    let out = with(time);
    suspect.time = time;
    Ok(out)
}

/// The plant beside which a suspect is likeliest.
pub(super) fn beside<'a>(suspect: &Suspect, rows: &'a Rows) -> Model<'a> {
    Model {
        rows,
        class: suspect.class,
        noise: suspect.noise,
        responds: true,
        zero: None,
        level: true,
    }
}

/// A suspect with the size that a fit of its plant found, which is far from the one that the commands passed.
pub(super) fn nearer(suspect: &Suspect, found: &Minimum<'_>, size: f64) -> Option<Suspect> {
    let passed = found.model.rows.shapes.last().copied().flatten()?.size;
    let (low, high) = (passed / CAUSES.factor, CAUSES.factor * passed);
    let size = size.clamp(low, high);
    size.is_finite().then(|| Suspect {
        size,
        between: (size / CAUSES.factor, CAUSES.factor * size),
        class: found.model.class,
        x: found.point.x.clone(),
        noise: found.model.noise,
        ..*suspect
    })
}

/// The rows with a suspect of the likeliest size, and those of what the commands pass besides.
fn with_size(suspect: &Suspect, rows: &Rows, task: &Task) -> Result<Rows, Error> {
    let first = Shape {
        kind: suspect.kind,
        size: suspect.size,
        lag: 0.0,
    };
    if first.kind == CauseKind::Stiction {
        return sticking(suspect, first, rows, task);
    }
    let mut own = rows.behind(first);
    let mut x = suspect.x.clone();
    let mut best = (f64::INFINITY, own.clone());
    for _ in 0..CAUSES.refined {
        let model = beside(suspect, &own);
        let point = minimum(&model, model.at(x.clone()), f64::INFINITY, task)?;
        let deviance = model.deviance(&point);
        let sizes = own.sizes();
        let mut next = with_changes(&own, &point, model.gain(&point));
        if deviance < best.0 {
            best = (deviance, own.clone());
            x.clone_from(&point.x);
        }
        let (low, high) = suspect.between;
        let reach = 0.5 * (high - low);
        for (at, (next, size)) in next.iter_mut().zip(&sizes).enumerate() {
            let most = if at + 1 == sizes.len() {
                size + reach
            } else {
                CAUSES.factor * size
            };
            let least = if at + 1 == sizes.len() {
                size - reach
            } else {
                0.0
            };
            *next = next.clamp(least.max(size / CAUSES.factor), most);
        }
        let mut pairs = next.iter().zip(&sizes);
        let is_settled = |(next, size): (&f64, &f64)| (next - size).abs() < CAUSES.settled * size;
        if next.iter().any(|size| !size.is_finite()) || pairs.all(is_settled) {
            break;
        }
        own = own.with_sizes(&next);
    }
    Ok(best.1)
}

/// The sizes of what the commands pass with the changes that the columns beside them show.
fn with_changes(rows: &Rows, point: &Point, gain: f64) -> Vec<f64> {
    let mut end = 0;
    let mut out = Vec::new();
    for (kind, shape) in rows.causes.iter().zip(&rows.shapes) {
        end += kind.columns();
        if let Some(shape) = shape {
            let change = point.of_causes()[end - 1] / gain;
            let changes = *kind != CauseKind::Stiction;
            out.push(if changes {
                shape.size + change
            } else {
                shape.size
            });
        }
    }
    out
}

/// The same of what sticks, whose likelihood jumps between sizes.
fn sticking(suspect: &Suspect, first: Shape, rows: &Rows, task: &Task) -> Result<Rows, Error> {
    let (low, high) = suspect.between;
    let mut best = (f64::INFINITY, rows.behind(first));
    for step in 1..CAUSES.between {
        let size = low + (high - low) * step as f64 / CAUSES.between as f64;
        let own = rows.behind(Shape { size, ..first });
        let model = beside(suspect, &own);
        let point = minimum(&model, model.at(suspect.x.clone()), f64::INFINITY, task)?;
        let deviance = model.deviance(&point);
        if deviance < best.0 {
            best = (deviance, own);
        }
    }
    Ok(best.1)
}
