//! Causes fitted with the whole family of plants, and adopted where they explain the record clearly better.

use super::super::answer::Family;
use super::super::cause::{Cause, CauseKind};
use super::super::flexible::flexible;
use super::super::minima::{Minimum, Plan, minima, seeds_of};
use super::super::model::{Model, Point};
use super::super::noise::Noise;
use super::super::rows::Rows;
use super::super::search::minimum;
use super::super::shape::Shape;
use super::super::tolerances::{CAUSES, EVIDENCE, STARTS};
use super::asides::{columns_from, moving};
use super::jitter::jitter;
use super::screen::{Suspect, begins_again, suspects};
use crate::elementary::log;
use crate::{Error, Task};

/// Makes an answer of minima.
pub(crate) type Answer<'f> = dyn Fn(&[Minimum<'_>]) -> Result<Family, Error> + 'f;

/// The rows with a suspect.
fn with_suspect(suspect: &mut Suspect, rows: &Rows, task: &Task) -> Result<Rows, Error> {
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
fn beside<'a>(suspect: &Suspect, rows: &'a Rows) -> Model<'a> {
    Model {
        rows,
        class: suspect.class,
        noise: suspect.noise,
        responds: true,
        zero: None,
        level: true,
    }
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

/// The causes of a minimum.
fn causes_of(known: &[Cause], suspect: &Suspect, best: &Minimum<'_>, lead: f64) -> Vec<Cause> {
    let (model, point) = (&best.model, &best.point);
    let gain = model.gain(point);
    let mut out = known.to_vec();
    out.push(Cause {
        kind: suspect.kind,
        size: 0.0,
        error: 0.0,
        time: suspect.time,
        record: suspect.record,
        lead,
    });
    let (count, mut end) = (out.len(), 0);
    for (at, cause) in out.iter_mut().enumerate() {
        end += cause.kind.columns();
        let passed = model.rows.shapes[at].map_or(0.0, |shape| shape.size);
        let scale = if cause.kind == CauseKind::OutputStep {
            1.0
        } else {
            gain
        };
        if cause.kind == CauseKind::Stiction {
            cause.size = passed;
            if at + 1 == count {
                let step = (suspect.between.1 - suspect.between.0) / CAUSES.between as f64;
                cause.error = step / 12.0_f64.sqrt();
            }
            continue;
        }
        cause.size = passed + point.of_causes()[end - 1] / scale;
        cause.error = model.error_of_cause(point, end - 1) / scale.abs();
    }
    out
}

/// Is one of these causes far from the size that the commands passed? A change of it is no longer what its column
/// says.
fn is_far(causes: &[Cause], rows: &Rows) -> bool {
    let mut pairs = causes.iter().zip(&rows.shapes);
    pairs.any(|(cause, shape)| {
        let factor = shape.map_or(1.0, |shape| cause.size / shape.size);
        !(1.0 / CAUSES.factor..=CAUSES.factor).contains(&factor)
    })
}

/// The answer with what the plant lacks: a cause that is clearly better is adopted, and then a second one is
/// looked for; those that the record does not rule out widen the intervals.
pub(crate) fn with_causes(
    own: Family,
    plan: &Plan<'_>,
    found: &[Minimum<'_>],
    answer: &Answer<'_>,
    task: &Task,
) -> Result<Family, Error> {
    let known_kinds = plan.rows.causes.len();
    let known = plan.rows.causes.iter().map(|kind| kind.parameters());
    if known.sum::<usize>() >= CAUSES.most {
        return Ok(own);
    }
    let Some(best) = found.first() else {
        return Ok(own);
    };
    // Plants whose class is in error explain what a cause would.
    let linear = own.least().min(best.bic);
    let mut tried: Vec<(Suspect, Rows)> = Vec::new();
    for mut suspect in suspects(plan.rows, found, task)? {
        let rows = with_suspect(&mut suspect, plan.rows, task)?;
        suspect.bic = beside_best(&suspect, &rows, best, linear + CAUSES.hopeful, task)?;
        tried.push((suspect, rows));
    }
    // As likely as the plants without a cause may be, and not far behind another cause.
    let bics = tried.iter().map(|(suspect, _)| suspect.bic);
    let first = bics.fold(f64::INFINITY, f64::min);
    let most = (linear + CAUSES.hopeful).min(first + EVIDENCE.hopeless);
    tried.retain(|(suspect, _)| suspect.bic < most);
    let seeds = seeds_of(found);
    let thinned = tried.iter().map(|(_, rows)| rows.thinned(STARTS.thin));
    let thin: Vec<Rows> = thinned.collect();
    let pairs = tried.iter().zip(&thin);
    let plans: Vec<Plan<'_>> = pairs
        .map(|((_, rows), thin)| Plan {
            rows,
            thin,
            seeds: &seeds,
            grids: false,
            ..*plan
        })
        .collect();
    let (mut fits, mut families, mut kept) = (Vec::new(), Vec::new(), Vec::new());
    for (plan, (suspect, _)) in plans.iter().zip(&tried) {
        let fit = minima(plan, task)?;
        let mut family = answer(&fit)?;
        if let Some(first) = fit.first() {
            let lead = linear - family.least().min(first.bic);
            family.causes = causes_of(&own.causes, suspect, first, lead);
            if is_far(&family.causes, first.model.rows) {
                continue;
            }
        }
        families.push(family);
        fits.push(fit);
        kept.push(plan);
    }
    let bic = |at: usize| {
        let own = fits[at]
            .first()
            .map_or(f64::INFINITY, |one: &Minimum<'_>| one.bic);
        own.min(families[at].least())
    };
    let winner = (0..fits.len()).min_by(|a, b| bic(*a).total_cmp(&bic(*b)));
    let goal = linear - CAUSES.adopted.max(CAUSES.beyond * (best.bic - linear));
    let shaken = if known_kinds == 0 {
        jitter(found)
    } else {
        None
    };
    let shaken = shaken.filter(|(_, with)| {
        *with < goal && winner.is_none_or(|at| *with < bic(at) - CAUSES.adopted)
    });
    let mut adopted = None;
    if shaken.is_none()
        && let Some(at) = winner.filter(|at| bic(*at) < goal)
        && is_there(&families[at].causes, &fits[at], plan, task)?
    {
        adopted = Some(at);
    }
    let (mut out, floor) = match adopted {
        Some(at) => {
            let mut family = families[at].clone();
            if !matters(&own, &family, task)? {
                family.causes.pop();
            }
            let deeper = with_causes(family, kept[at], &fits[at], answer, task)?;
            (deeper, bic(at) + EVIDENCE.reach)
        }
        None => (own.clone(), linear),
    };
    if adopted.is_some_and(|at| best.bic < bic(at) + CAUSES.certain) {
        out.add_within(&own, f64::INFINITY);
    }
    for (at, family) in families.iter().enumerate() {
        if Some(at) != adopted {
            out.add_within(family, floor);
            let is_rival = adopted.is_some_and(|own| bic(at) < bic(own) + EVIDENCE.likely);
            let last = family.causes.last().filter(|_| is_rival);
            out.rivals.extend(last.map(|cause| cause.kind));
        }
    }
    out.causes.extend(shaken.map(|(cause, _)| cause));
    out.rehull(task)?;
    Ok(out)
}

/// BIC of a minimum, with the error of its class where that may be.
fn with_error(found: &Minimum<'_>) -> f64 {
    let own = if found.model.rows.flexible {
        flexible(found)
    } else {
        None
    };
    own.map_or(found.bic, |own| own.bic.min(found.bic))
}

/// BIC of a plant with this suspect, under its own noise or that of the best one; with the error of its class where it is
/// above a limit.
fn beside_best(
    suspect: &Suspect,
    rows: &Rows,
    best: &Minimum<'_>,
    most: f64,
    task: &Task,
) -> Result<f64, Error> {
    let own = beside(suspect, rows);
    let mut coloured = suspect.x[..own.plant_numbers()].to_vec();
    coloured.extend_from_slice(&best.point.x[best.model.plant_numbers()..]);
    let other = Model {
        noise: best.model.noise,
        ..own
    };
    let mut found = Vec::new();
    for (model, x) in [(own, suspect.x.clone()), (other, coloured)] {
        let point = minimum(&model, model.at(x), f64::INFINITY, task)?;
        found.push(Minimum::new(model, point));
    }
    let least = found
        .iter()
        .fold(f64::INFINITY, |least, one| least.min(one.bic));
    if least < most {
        return Ok(least);
    }
    let all = found.iter().map(with_error);
    Ok(all.fold(f64::INFINITY, f64::min))
}

/// Does the last cause move gain or phase at crossover by a part of their intervals? One that does not is in the
/// model, and is not worth a name.
fn matters(without: &Family, with: &Family, task: &Task) -> Result<bool, Error> {
    let Some(crossover) = with.hull.iter().find(|one| one.name == "crossover") else {
        return Ok(true);
    };
    let seen = |family: &Family| family.at(&[crossover.value], CAUSES.level, task);
    let (before, after) = (seen(without)?, seen(with)?);
    let pairs = before.iter().flatten().zip(after.iter().flatten());
    let mut moves = pairs.map(|(before, after)| {
        let half = 0.5 * (after.2 - after.1);
        (after.0 - before.0).abs() / half
    });
    Ok(moves.any(|share| share.is_nan() || share > CAUSES.matters))
}

/// Is the last of these causes there: of a size that is not zero, beside others of possible sizes, better than the
/// same plant under the same noise without it, and no beginning of many?
fn is_there(
    causes: &[Cause],
    fit: &[Minimum<'_>],
    plan: &Plan<'_>,
    task: &Task,
) -> Result<bool, Error> {
    let (Some(cause), Some(best)) = (causes.last(), fit.first()) else {
        return Ok(false);
    };
    let first = causes.first().map_or(0.0, |first| first.lead);
    if causes.len() > 1 && cause.lead < CAUSES.further * first {
        return Ok(false);
    }
    let size = if cause.kind.is_positive() {
        cause.size
    } else {
        cause.size.abs()
    };
    let is_impossible = |one: &Cause| one.kind.is_positive() && one.size <= 0.0;
    if size.is_nan() || size < CAUSES.sure * cause.error || causes.iter().any(is_impossible) {
        return Ok(false);
    }
    let model = Model {
        rows: plan.rows,
        ..best.model
    };
    let start = model.at(best.point.x.clone());
    let without = Minimum::new(model, minimum(&model, start, f64::INFINITY, task)?);
    if with_error(best) > with_error(&without) - CAUSES.adopted {
        return Ok(false);
    }
    if !cause.kind.begins() {
        return Ok(true);
    }
    let again = begins_again(cause.kind, cause.time, best);
    let rows = plan.rows.count() as f64;
    let penalty = log(rows) * cause.kind.parameters() as f64;
    let most = if best.model.noise == Noise::White {
        penalty + CAUSES.adopted
    } else {
        CAUSES.again * (cause.lead + penalty)
    };
    Ok(again < most)
}

#[cfg(test)]
mod tests {
    use super::super::super::rows::{Record, Start};
    use super::*;

    #[test]
    fn a_size_far_from_the_one_that_was_passed_is_none() {
        let record = Record {
            time: (0..60).map(f64::from).collect(),
            output: vec![0.0; 60],
            command: (0..60).map(|row| f64::from(row / 20 % 2)).collect(),
            earlier: 0,
            sent: None,
            hold: 0.0,
        };
        let rows = Rows::new(&[record], &[Start::Held], 5.0, false, false);
        let rows = rows.behind(Shape {
            kind: CauseKind::RateLimit,
            size: 1.2,
            lag: 0.0,
        });
        let of = |size: f64| Cause {
            kind: CauseKind::RateLimit,
            size,
            error: 0.1,
            time: f64::NAN,
            record: 0,
            lead: 80.0,
        };
        assert!(!is_far(&[of(1.2)], &rows));
        assert!(!is_far(&[of(1.0)], &rows));
        assert!(is_far(&[of(240.0)], &rows));
        assert!(is_far(&[of(-1.2)], &rows));
    }
}
