//! Causes fitted with the whole family of plants, and adopted where they explain the record clearly better.

use super::super::answer::Family;
use super::super::cause::{Cause, CauseKind};
use super::super::class::{Class, Numbers};
use super::super::flexible::flexible;
use super::super::minima::{Minimum, Plan, minima, seeds_of};
use super::super::model::Model;
use super::super::noise::Noise;
use super::super::rows::Rows;
use super::super::search::minimum;
use super::super::tolerances::{CAUSES, EVIDENCE, STARTS};
use super::jitter::jitter;
use super::screen::{Suspect, begins_again, suspects};
use super::suspected::{beside, nearer, with_suspect};
use crate::elementary::log;
use crate::{Error, Task};

/// Makes an answer of minima.
pub(crate) type Answer<'f> = dyn Fn(&[Minimum<'_>]) -> Result<Family, Error> + 'f;

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
        named: lead >= CAUSES.named,
        rivals: Vec::new(),
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

/// A suspect with its rows, and minima to begin at.
struct Tried<'s> {
    suspect: Suspect,
    rows: Rows,
    thin: Rows,
    seeds: &'s [(Class, Numbers)],
}

impl<'s> Tried<'s> {
    fn new(suspect: Suspect, rows: Rows, seeds: &'s [(Class, Numbers)]) -> Self {
        let thin = rows.thinned(STARTS.thin);
        Self {
            suspect,
            rows,
            thin,
            seeds,
        }
    }

    fn all(tried: Vec<(Suspect, Rows)>, seeds: &'s [(Class, Numbers)]) -> Vec<Self> {
        let each = tried.into_iter();
        each.map(|(suspect, rows)| Self::new(suspect, rows, seeds))
            .collect()
    }
}

/// The family with a suspect.
struct Fitted<'a> {
    plan: Plan<'a>,
    minima: Vec<Minimum<'a>>,
    family: Family,
}

impl Fitted<'_> {
    fn bic(&self) -> f64 {
        let own = self.minima.first().map_or(f64::INFINITY, |one| one.bic);
        own.min(self.family.least())
    }
}

/// What is fitted beside no further cause.
struct Known<'k, 'p> {
    plan: &'k Plan<'p>,
    causes: &'k [Cause],
    /// The least BIC.
    linear: f64,
}

/// Suspects of other sizes, with minima to begin at.
type Far = Vec<(Suspect, Vec<(Class, Numbers)>)>;

impl<'p> Known<'_, 'p> {
    /// The families with each of these, without those far from the size that the commands passed, which are
    /// to be passed anew.
    fn fitted<'a>(
        &self,
        tried: &'a [Tried<'_>],
        answer: &Answer<'_>,
        task: &Task,
    ) -> Result<(Vec<Fitted<'a>>, Far), Error>
    where
        'p: 'a,
    {
        let (mut out, mut far) = (Vec::new(), Vec::new());
        for one in tried {
            let plan = Plan {
                rows: &one.rows,
                thin: &one.thin,
                seeds: one.seeds,
                grids: false,
                ..*self.plan
            };
            let minima = minima(&plan, task)?;
            let mut family = answer(&minima)?;
            if let Some(first) = minima.first() {
                let lead = self.linear - family.least().min(first.bic);
                family.causes = causes_of(self.causes, &one.suspect, first, lead);
                if is_far(&family.causes, first.model.rows) {
                    let size = family.causes.last().map_or(f64::NAN, |cause| cause.size);
                    let next = nearer(&one.suspect, first, size);
                    far.extend(next.map(|suspect| (suspect, seeds_of(&minima))));
                    continue;
                }
            }
            out.push(Fitted {
                plan,
                minima,
                family,
            });
        }
        Ok((out, far))
    }
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
    let known = Known {
        plan,
        causes: &own.causes,
        linear,
    };
    let seeds = seeds_of(found);
    let tried = Tried::all(tried, &seeds);
    let (mut fits, far) = known.fitted(&tried, answer, task)?;
    let again = far.iter().map(|(suspect, seeds)| {
        let rows = with_suspect(&mut suspect.clone(), plan.rows, task)?;
        Ok(Tried::new(suspect.clone(), rows, seeds))
    });
    let again = again.collect::<Result<Vec<_>, Error>>()?;
    fits.extend(known.fitted(&again, answer, task)?.0);
    let bic = |at: usize| fits[at].bic();
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
        && is_there(&fits[at].family.causes, &fits[at].minima, plan, task)?
    {
        adopted = Some(at);
    }
    let (mut out, floor) = match adopted {
        Some(at) => {
            let mut family = fits[at].family.clone();
            let named = matters(&own, &family, task)?;
            if let Some(cause) = family.causes.last_mut() {
                cause.named &= named;
            }
            let deeper = with_causes(family, &fits[at].plan, &fits[at].minima, answer, task)?;
            (deeper, bic(at) + EVIDENCE.reach)
        }
        None => (own.clone(), linear),
    };
    if adopted.is_some_and(|at| best.bic < bic(at) + CAUSES.certain) {
        out.add_within(&own, f64::INFINITY);
    }
    for (at, Fitted { family, .. }) in fits.iter().enumerate() {
        if Some(at) != adopted {
            out.add_within(family, floor);
            let is_rival = adopted.is_some_and(|own| bic(at) < bic(own) + EVIDENCE.likely);
            let last = family.causes.last().filter(|_| is_rival);
            if let Some(adopted) = out.causes.get_mut(own.causes.len()) {
                adopted.rivals.extend(last.map(|cause| cause.kind));
            }
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
    use super::super::super::shape::Shape;
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
            named: true,
            rivals: Vec::new(),
        };
        assert!(!is_far(&[of(1.2)], &rows));
        assert!(!is_far(&[of(1.0)], &rows));
        assert!(is_far(&[of(240.0)], &rows));
        assert!(is_far(&[of(-1.2)], &rows));
    }
}
