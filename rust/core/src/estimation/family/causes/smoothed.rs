//! How long the moving mean is that a record's readings are, if they are one.

use super::super::answer::Family;
use super::super::minima::{Minimum, Plan, minima, seeds_of};
use super::super::model::Model;
use super::super::noise::Noise;
use super::super::rows::Rows;
use super::super::search::minimum;
use super::super::sensors::{SensorFault, SensorKind};
use super::super::smoothing::Smoothing;
use super::super::tolerances::{CAUSES, EVIDENCE, MEANS, Means, STARTS};
use super::adopt::{Answer, with_causes};
use super::screen::Frame;
use crate::elementary::log;
use crate::{Error, Task};

/// Rows whose readings are found back from means of this length.
struct Smoothed {
    rows: Rows,
    length: f64,
}

/// A place of the search.
struct Place {
    length: f64,
    added: f64,
    bic: f64,
    x: Vec<f64>,
}

/// The answer with what the plant lacks, of readings found back from their means where the record shows
/// that they are means.
pub(crate) fn with_smoothing(
    own: Family,
    plan: &Plan<'_>,
    found: &[Minimum<'_>],
    answer: &Answer<'_>,
    task: &Task,
) -> Result<Family, Error> {
    let Some(mean) = smoothed(plan.rows, found, task)? else {
        return with_causes(own, plan, found, answer, task);
    };
    let (thin, seeds) = (mean.rows.thinned(STARTS.thin), seeds_of(found));
    let behind = Plan {
        rows: &mean.rows,
        thin: &thin,
        noises: &[Noise::White],
        seeds: &seeds,
        grids: false,
        ..*plan
    };
    let fit = minima(&behind, task)?;
    let family = answer(&fit)?;
    let (without, with) = (own.least(), family.least());
    let best = found.first().map_or(without, |best| best.bic);
    let is_smoothed = with < without - CAUSES.adopted.max(MEANS.beyond * (best - without));
    let (mut out, other) = if is_smoothed {
        let out = with_causes(family, &behind, &fit, answer, task)?;
        (out, own)
    } else {
        (with_causes(own, plan, found, answer, task)?, family)
    };
    out.add_within(&other, with.min(without) + EVIDENCE.reach);
    if is_smoothed {
        for (record, part) in mean.rows.parts.iter().enumerate() {
            out.sensor.push(SensorFault {
                kind: SensorKind::Smoothed,
                record,
                rows: part.used.len(),
                size: mean.length,
                from: part.time[0],
                to: part.time[part.time.len() - 1],
            });
        }
    }
    out.rehull(task)?;
    Ok(out)
}

/// The likeliest mean, if one may be. A wrong length leaves waves that no mean of it would, so that little of the
/// noise may be added afterwards only where the length is known well.
fn smoothed(rows: &Rows, found: &[Minimum<'_>], task: &Task) -> Result<Option<Smoothed>, Error> {
    if rows.parts.iter().any(|part| !part.is_whole()) {
        return Ok(None);
    }
    let Some((mut place, model)) = scanned(rows, found, task)? else {
        return Ok(None);
    };
    let mut reach = (place.length - 1.0) * (MEANS.growth() - 1.0);
    place.bic = f64::INFINITY;
    for (added, fine) in MEANS.added {
        // Each by itself: with less noise, lengths are worse until they are right.
        let mut own = Place {
            bic: f64::INFINITY,
            x: place.x.clone(),
            ..place
        };
        let length = own.length;
        try_at(&mut own, rows, &model, (length, added), task)?;
        while reach > fine * own.length {
            reach *= 0.5;
            for length in [own.length - reach, own.length + reach] {
                try_at(&mut own, rows, &model, (length, added), task)?;
            }
        }
        reach = MEANS.again * fine * own.length;
        if own.bic >= place.bic {
            break;
        }
        place = own;
    }
    // Whole rows around each are usual.
    let whole = 2.0 * (0.5 * (place.length - 1.0)).round() + 1.0;
    if (whole - place.length).abs() < MEANS.whole * place.length {
        for (added, _) in MEANS.added {
            try_at(&mut place, rows, &model, (whole, added), task)?;
        }
    }
    let own = rows.smoothed(place.length, place.added);
    Ok(own.map(|rows| Smoothed {
        rows,
        length: place.length,
    }))
}

/// The likeliest of some lengths beside some classes, if it is likelier than no mean.
fn scanned<'a>(
    rows: &'a Rows,
    found: &[Minimum<'a>],
    task: &Task,
) -> Result<Option<(Place, Model<'a>)>, Error> {
    let mut whites: Vec<(Model<'_>, Vec<f64>)> = Vec::new();
    for one in found {
        let is_new = whites.iter().all(|own| own.0.class != one.model.class);
        if is_new && whites.len() < CAUSES.classes {
            let model = Model {
                noise: Noise::White,
                ..one.model
            };
            let x = one.point.x[..one.model.plant_numbers()].to_vec();
            whites.push((model, x));
        }
    }
    let (mut best, mut model) = (None, None);
    let mut least = f64::INFINITY;
    for (white, x) in &whites {
        least = least.min(Frame::new(*white, white.at(x.clone())).bic);
    }
    least += log(rows.count() as f64) - EVIDENCE.adds;
    let mut length = 1.0 + MEANS.least;
    while length < 1.0 + MEANS.most {
        task.check()?;
        let added = MEANS.added[0].0;
        let Some(own) = rows.smoothed(length, added) else {
            break;
        };
        for (white, x) in &whites {
            let behind = Model {
                rows: &own,
                ..*white
            };
            let bic = Frame::new(behind, behind.at(x.clone())).bic;
            if bic < least {
                least = bic;
                let x = x.clone();
                best = Some(Place {
                    length,
                    added,
                    bic,
                    x,
                });
                model = Some(*white);
            }
        }
        length = 1.0 + (length - 1.0) * MEANS.growth();
    }
    Ok(best.zip(model))
}

impl Means {
    fn growth(&self) -> f64 {
        (self.most / self.least).powf(1.0 / (self.lengths - 1) as f64)
    }
}

/// Take this length and noise if the plant is likelier with it.
fn try_at(
    place: &mut Place,
    rows: &Rows,
    model: &Model<'_>,
    (length, added): (f64, f64),
    task: &Task,
) -> Result<(), Error> {
    if length <= 1.0 {
        return Ok(());
    }
    let Some(own) = rows.smoothed(length, added) else {
        return Ok(());
    };
    let model = Model {
        rows: &own,
        ..*model
    };
    let point = minimum(&model, model.at(place.x.clone()), f64::INFINITY, task)?;
    let there = Minimum::new(model, point);
    if there.bic < place.bic {
        *place = Place {
            length,
            added,
            bic: there.bic,
            x: there.point.x,
        };
    }
    Ok(())
}

impl Rows {
    /// With readings that are found back from means over so many rows.
    fn smoothed(&self, length: f64, added: f64) -> Option<Self> {
        let mut out = self.clone();
        for part in &mut out.parts {
            let smoothing = Smoothing::new(&part.output, length, added)?;
            part.output = smoothing.found_back()?;
            part.smoothing = Some(smoothing);
        }
        Some(out)
    }
}
