//! The minima of every class under every noise that may be the true one.

use super::class::Class;
use super::model::{Model, Point};
use super::noise::Noise;
use super::rows::{Rows, Start};
use super::search::minimum;
use super::starts::{are_apart, grid, nested, noise};
use super::tolerances::{EVIDENCE, RANGES, STARTS};
use crate::elementary::log;
use crate::{Error, Task};

/// A minimum of one class under one noise.
#[derive(Debug, Clone)]
pub(super) struct Minimum<'a> {
    pub(super) model: Model<'a>,
    pub(super) point: Point,
    pub(super) deviance: f64,
    pub(super) bic: f64,
}

impl<'a> Minimum<'a> {
    pub(super) fn new(model: Model<'a>, point: Point) -> Self {
        let deviance = model.deviance(&point);
        let penalty = log(model.rows.used.len().max(2) as f64);
        Self {
            model,
            point,
            deviance,
            bic: deviance + penalty * model.parameters() as f64,
        }
    }

    /// Is the delay the largest that is allowed, or a lag the slowest?
    pub(super) fn is_at_limit(&self) -> bool {
        let (rows, x) = (self.model.rows, &self.point.x);
        let slowest = log(RANGES.slowest * rows.span);
        x[0] >= rows.largest_delay || self.model.class.order > 0 && x[1] >= slowest
    }
}

/// What is fitted.
pub(super) struct Plan<'a> {
    pub(super) rows: &'a Rows,
    pub(super) classes: &'a [Class],
    pub(super) noises: &'a [Noise],
}

/// The minima of all classes, best first; each class under the noise that suits it best.
pub(super) fn minima<'a>(plan: &Plan<'a>, task: &Task) -> Result<Vec<Minimum<'a>>, Error> {
    let mut out: Vec<Minimum<'a>> = Vec::new();
    let mut before: Vec<Minimum<'a>> = under_white(plan, task)?;
    if plan.noises.contains(&Noise::White) {
        out.clone_from(&before);
    }
    for kind in [Noise::Arma11, Noise::Arma22] {
        if !plan.noises.contains(&kind)
            && plan.noises.iter().all(|noise| noise.order() < kind.order())
        {
            continue;
        }
        let found = under(plan, kind, &before, task)?;
        let (old, new) = (least(&before), least(&found));
        before = found;
        if plan.noises.contains(&kind) {
            out.extend(before.iter().cloned());
        }
        // Where a richer noise is no better, a still richer one is not tried.
        if new >= old && plan.noises.len() > 1 {
            break;
        }
    }
    for found in &mut out {
        if let Some(without) = without_level(found, task)?
            && without.bic < found.bic
        {
            *found = without;
        }
    }
    out.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    let mut kept: Vec<Minimum<'a>> = Vec::new();
    for found in out {
        let own = kept
            .iter()
            .filter(|known| known.model.class == found.model.class);
        let is_new = own.clone().all(|known| {
            known.model.noise == found.model.noise
                && are_apart(&found.model, &known.point.x, &found.point.x)
        });
        if is_new && own.count() < STARTS.kept {
            kept.push(found);
        }
    }
    Ok(kept)
}

/// The minimum without a level, where that may be: the output is zero where the command is.
fn without_level<'a>(found: &Minimum<'a>, task: &Task) -> Result<Option<Minimum<'a>>, Error> {
    let model = Model {
        level: false,
        ..found.model
    };
    if model.rows.start == Start::Rest {
        return Ok(None);
    }
    let start = model.at(found.point.x.clone());
    // Where a level is plain to see, it is not searched further.
    if model.deviance(&start) > found.deviance + EVIDENCE.hopeless {
        return Ok(None);
    }
    minimum(&model, start, task).map(|point| Some(Minimum::new(model, point)))
}

fn least(found: &[Minimum<'_>]) -> f64 {
    found
        .iter()
        .fold(f64::INFINITY, |least, one| least.min(one.bic))
}

fn under_white<'a>(plan: &Plan<'a>, task: &Task) -> Result<Vec<Minimum<'a>>, Error> {
    let mut all: Vec<Minimum<'a>> = Vec::new();
    // Classes that are contained in those asked for are fitted too: they are starts.
    for class in Class::all() {
        let model = Model {
            rows: plan.rows,
            class,
            noise: Noise::White,
            responds: true,
            level: true,
        };
        let mut starts = grid(&model, task)?;
        for known in &all {
            let numbers = known.model.numbers(&known.point.x);
            let own = nested(&model, known.model.class, &numbers);
            starts.extend(own.iter().map(|numbers| model.point_of(numbers, &[])));
        }
        all.extend(distinct(&model, starts, task)?);
    }
    all.retain(|found| plan.classes.contains(&found.model.class));
    Ok(all)
}

/// The minima from these starts, the best first.
fn distinct<'a>(
    model: &Model<'a>,
    starts: Vec<Vec<f64>>,
    task: &Task,
) -> Result<Vec<Minimum<'a>>, Error> {
    let mut points: Vec<Point> = Vec::with_capacity(starts.len());
    for start in starts {
        task.check()?;
        points.push(model.at(start));
    }
    points.sort_by(|a, b| a.squares.total_cmp(&b.squares));
    let mut found: Vec<Minimum<'a>> = Vec::new();
    for point in points.into_iter().take(STARTS.followed) {
        found.push(Minimum::new(*model, minimum(model, point, task)?));
    }
    found.sort_by(|a, b| a.deviance.total_cmp(&b.deviance));
    let mut out: Vec<Minimum<'a>> = Vec::new();
    for one in found {
        let is_new = out
            .iter()
            .all(|known| are_apart(model, &known.point.x, &one.point.x));
        if is_new && out.len() < STARTS.kept {
            out.push(one);
        }
    }
    Ok(out)
}

/// The minima under a richer noise, from those under a simpler one.
fn under<'a>(
    plan: &Plan<'a>,
    kind: Noise,
    before: &[Minimum<'a>],
    task: &Task,
) -> Result<Vec<Minimum<'a>>, Error> {
    let best = least(before);
    let mut all: Vec<Minimum<'a>> = Vec::new();
    for class in Class::all().filter(|class| plan.classes.contains(class)) {
        let model = Model {
            rows: plan.rows,
            class,
            noise: kind,
            responds: true,
            level: true,
        };
        let mut starts = if kind == Noise::Arma11 {
            grid(&model, task)?
        } else {
            Vec::new()
        };
        let own = before.iter().filter(|known| known.model.class == class);
        let hopeful = |known: &&Minimum<'a>| {
            known.model.noise == Noise::White || known.bic < best + EVIDENCE.hopeless
        };
        for known in own.filter(hopeful) {
            let plant = known.model.plant_numbers();
            let mut x = known.point.x[..plant].to_vec();
            x.extend(noise(&model, &known.point, &known.point.x[plant..]));
            starts.push(x);
        }
        // The best of those that it contains, under this noise.
        let contained = all.iter().filter_map(|known: &Minimum<'a>| {
            let numbers = known.model.numbers(&known.point.x);
            let noise = &known.point.x[known.model.plant_numbers()..];
            let own = nested(&model, known.model.class, &numbers);
            own.first()
                .map(|numbers| (known.deviance, model.point_of(numbers, noise)))
        });
        let contained = contained.min_by(|a, b| a.0.total_cmp(&b.0));
        starts.extend(contained.map(|(_, x)| x));
        all.extend(distinct(&model, starts, task)?);
    }
    Ok(all)
}

/// The best model in which the command does nothing.
pub(super) fn without_plant<'a>(plan: &Plan<'a>, task: &Task) -> Result<f64, Error> {
    let mut least = f64::INFINITY;
    let mut known: Vec<f64> = Vec::new();
    for kind in plan.noises {
        let model = Model {
            rows: plan.rows,
            class: Class {
                integrating: true,
                order: 0,
                has_zero: false,
            },
            noise: *kind,
            responds: false,
            level: true,
        };
        let start = model.at(vec![0.0; model.searched()]);
        let x = noise(&model, &start, &known);
        let found = Minimum::new(model, minimum(&model, model.at(x), task)?);
        known.clone_from(&found.point.x);
        least = least.min(found.bic);
    }
    Ok(least)
}
