//! The minima of every class under every noise that may be the true one.

use super::class::{Class, Numbers};
use super::model::{Model, Point};
use super::noise::Noise;
use super::rows::{Part, Rows, Start};
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
        let penalty = log(model.rows.count().max(2) as f64);
        Self {
            model,
            point,
            deviance,
            bic: deviance + penalty * model.parameters() as f64,
        }
    }

    /// The number at the end of its range, if one is.
    pub(super) fn limit(&self) -> Option<&'static str> {
        let (rows, class, x) = (self.model.rows, self.model.class, &self.point.x);
        let zero = || x[1 + class.order].abs() >= RANGES.slowest_zero * rows.span;
        if x[0] >= rows.largest_delay {
            Some("delay")
        } else if class.order > 0 && x[1] >= log(RANGES.slowest * rows.span) {
            Some("lag")
        } else if class.has_zero && zero() {
            Some("zero")
        } else {
            None
        }
    }
}

/// What is fitted.
pub(super) struct Plan<'a> {
    pub(super) rows: &'a Rows,
    /// Fewer rows, for grids.
    pub(super) thin: &'a Rows,
    pub(super) classes: &'a [Class],
    /// Those that are fitted under white noise, for others may start at them.
    pub(super) begun: &'a [Class],
    pub(super) noises: &'a [Noise],
    /// Numbers of minima that are known; a grid takes the place of those of a class that has none.
    pub(super) seeds: &'a [(Class, Numbers)],
    /// Are grids searched where noise is coloured?
    pub(super) grids: bool,
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
    let mut simpler = Vec::new();
    let near = least(&out) + EVIDENCE.reach;
    for found in &mut out {
        let closely = found.bic < near;
        if let Some(without) = without_level(found, closely, task)? {
            if without.bic < found.bic {
                *found = without;
            } else {
                simpler.push(without);
            }
        }
    }
    out.extend(simpler);
    out.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    Ok(kept(out))
}

/// Of each class the minima of its best model, and the best of a simpler one that may be true too;
/// without those that a zero at its limit alone explains, if there are others.
fn kept(sorted: Vec<Minimum<'_>>) -> Vec<Minimum<'_>> {
    let mut out: Vec<Minimum<'_>> = Vec::new();
    for found in sorted {
        let model = |one: &Minimum<'_>| (one.model.noise, one.model.level);
        let own = || {
            out.iter()
                .filter(|one| one.model.class == found.model.class)
        };
        let Some(best) = own().next() else {
            out.push(found);
            continue;
        };
        let is_simpler = |one: &Minimum<'_>| one.model.parameters() < best.model.parameters();
        let is_new = if is_simpler(&found) {
            found.bic < best.bic + EVIDENCE.reach && !own().any(is_simpler)
        } else {
            let alike = own().filter(|one| model(one) == model(&found));
            let x = &found.point.x;
            model(&found) == model(best)
                && alike.clone().count() < best.model.class.starts(STARTS.kept)
                && alike
                    .clone()
                    .all(|one| are_apart(&found.model, &one.point.x, x))
        };
        if is_new {
            out.push(found);
        }
    }
    if out.iter().any(|one| one.limit() != Some("zero")) {
        out.retain(|one| one.limit() != Some("zero"));
    }
    out
}

/// The minimum without a level, where that may be: the output is zero where the command is.
/// Not `closely`, it is searched only if it begins nearly as likely.
fn without_level<'a>(
    found: &Minimum<'a>,
    closely: bool,
    task: &Task,
) -> Result<Option<Minimum<'a>>, Error> {
    let model = Model {
        level: false,
        ..found.model
    };
    let is_at_rest = |part: &Part| part.start == Start::Rest;
    if model.rows.parts.iter().any(is_at_rest) {
        return Ok(None);
    }
    let start = model.at(found.point.x.clone());
    if !closely && model.deviance(&start) > found.deviance + EVIDENCE.hopeless {
        return Ok(None);
    }
    let hopeless = found.deviance + EVIDENCE.hopeless;
    minimum(&model, start, hopeless, task).map(|point| Some(Minimum::new(model, point)))
}

fn least(found: &[Minimum<'_>]) -> f64 {
    found
        .iter()
        .fold(f64::INFINITY, |least, one| least.min(one.bic))
}

fn under_white<'a>(plan: &Plan<'a>, task: &Task) -> Result<Vec<Minimum<'a>>, Error> {
    let mut all: Vec<Minimum<'a>> = Vec::new();
    for class in plan.begun.iter().copied() {
        let model = Model {
            rows: plan.rows,
            class,
            noise: Noise::White,
            responds: true,
            zero: None,
            level: true,
        };
        let mut starts = seeded(&model, plan);
        if starts.is_empty() {
            starts = grid(&on(plan.thin, &model), task)?;
        }
        for known in &all {
            let numbers = known.model.numbers(&known.point.x);
            let own = nested(&model, known.model.class, &numbers);
            starts.extend(own.iter().map(|numbers| model.point_of(numbers, &[])));
        }
        let follow = if plan.seeds.is_empty() {
            STARTS.followed
        } else {
            STARTS.refined
        };
        let best = most_likely(&all);
        all.extend(distinct(&model, starts, (follow, best), task)?);
    }
    all.retain(|found| plan.classes.contains(&found.model.class));
    Ok(all)
}

/// The model on other rows.
fn on<'a>(rows: &'a Rows, model: &Model<'_>) -> Model<'a> {
    Model { rows, ..*model }
}

/// Points of the minima of this class that are known.
fn seeded(model: &Model<'_>, plan: &Plan<'_>) -> Vec<Vec<f64>> {
    let own = plan.seeds.iter().filter(|(class, _)| *class == model.class);
    own.map(|(_, numbers)| model.point_of(numbers, &[]))
        .collect()
}

fn most_likely(found: &[Minimum<'_>]) -> f64 {
    found
        .iter()
        .fold(f64::INFINITY, |least, one| least.min(one.deviance))
}

/// The minima from these starts, the best first: so many are followed, and −2 ln L of the best class
/// so far says which are hopeless.
fn distinct<'a>(
    model: &Model<'a>,
    starts: Vec<Vec<f64>>,
    (follow, best): (usize, f64),
    task: &Task,
) -> Result<Vec<Minimum<'a>>, Error> {
    let mut points: Vec<Point> = Vec::with_capacity(starts.len());
    for start in starts {
        task.check()?;
        points.push(model.at(start));
    }
    points.sort_by(|a, b| a.squares.total_cmp(&b.squares));
    let mut found: Vec<Minimum<'a>> = Vec::new();
    for point in points.into_iter().take(model.class.starts(follow)) {
        let hopeless = best + EVIDENCE.hopeless;
        let point = minimum(model, point, hopeless, task)?;
        found.push(Minimum::new(*model, point));
    }
    found.sort_by(|a, b| a.deviance.total_cmp(&b.deviance));
    let mut out: Vec<Minimum<'a>> = Vec::new();
    for one in found {
        let is_new = out
            .iter()
            .all(|known| are_apart(model, &known.point.x, &one.point.x));
        if is_new && out.len() < model.class.starts(STARTS.kept) {
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
            zero: None,
            level: true,
        };
        let mut starts = if kind == Noise::Arma11 && plan.grids {
            grid(&on(plan.thin, &model), task)?
        } else {
            Vec::new()
        };
        let own = before.iter().filter(|known| known.model.class == class);
        let hopeful = |known: &&Minimum<'a>| {
            known.model.noise == Noise::White || known.bic < best + EVIDENCE.hopeless
        };
        for known in own.filter(hopeful) {
            let plant = known.model.plant_numbers();
            let (numbers, own) = known.point.x.split_at(plant);
            // A number at its limit is left by no step: a start without it stands beside.
            let begins = if own.is_empty() {
                vec![own]
            } else {
                vec![own, &[]]
            };
            for own in begins {
                let mut x = numbers.to_vec();
                x.extend(noise(&model, &known.point, own));
                starts.push(x);
            }
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
        // Richer noise makes no class less likely; the richest may begin far from where it ends.
        let best = if kind == Noise::Arma22 {
            most_likely(&all)
        } else {
            most_likely(&all).min(most_likely(before))
        };
        let follow = if kind == Noise::Arma22 {
            STARTS.coloured
        } else {
            STARTS.refined
        };
        all.extend(distinct(&model, starts, (follow, best), task)?);
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
            zero: None,
        };
        let start = model.at(vec![0.0; model.searched()]);
        let x = noise(&model, &start, &known);
        let found = Minimum::new(model, minimum(&model, model.at(x), f64::INFINITY, task)?);
        known.clone_from(&found.point.x);
        least = least.min(found.bic);
    }
    Ok(least)
}

/// Classes and numbers of minima.
pub(super) fn seeds_of(found: &[Minimum<'_>]) -> Vec<(Class, Numbers)> {
    let numbers = |one: &Minimum<'_>| (one.model.class, one.model.numbers(&one.point.x));
    found.iter().map(numbers).collect()
}
