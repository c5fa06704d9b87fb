//! Plants that some rows have left, on more rows of the same plant: searched beside their numbers alone.

use super::class::{Class, Numbers};
use super::minima::Minimum;
use super::model::{Model, Point};
use super::noise::Noise;
use super::rows::Rows;
use super::search::minimum;
use super::starts::{are_apart, nested, noise};
use crate::{Error, Task};

/// Starts that are followed beside a candidate: more find more and take longer.
const BESIDE: usize = 2;

/// A plant to search beside, and its noise.
pub(super) type Seed = (Class, Numbers, Noise);

/// The minima beside these plants on other rows, each under its own noise or a richer one, the best
/// first. A class that contains another begins at that one too, and so is no less likely.
pub(super) fn beside<'a>(
    known: &[Seed],
    rows: &'a Rows,
    task: &Task,
) -> Result<Vec<Minimum<'a>>, Error> {
    let mut out: Vec<Minimum<'a>> = Vec::new();
    for class in Class::all() {
        for one in known.iter().filter(|(own, ..)| *own == class) {
            let mut best: Option<Minimum<'a>> = None;
            for kind in Noise::ALL {
                if kind.order() < one.2.order() {
                    continue;
                }
                let found = beside_one(one, kind, best.as_ref(), &out, rows, task)?;
                if best.as_ref().is_some_and(|best| best.bic <= found.bic) {
                    break;
                }
                best = Some(found);
            }
            let is_new = |found: &Minimum<'a>| {
                let alike = out.iter().filter(|other| other.model.class == class);
                alike
                    .clone()
                    .all(|other| are_apart(&found.model, &other.point.x, &found.point.x))
            };
            out.extend(best.filter(is_new));
        }
    }
    out.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    Ok(out)
}

/// The minimum of a plant under a noise: from its own numbers, from the minimum under a simpler
/// noise, and from the best class that it contains.
fn beside_one<'a>(
    (class, numbers, _): &Seed,
    kind: Noise,
    simpler: Option<&Minimum<'a>>,
    others: &[Minimum<'a>],
    rows: &'a Rows,
    task: &Task,
) -> Result<Minimum<'a>, Error> {
    let model = Model {
        rows,
        class: *class,
        noise: kind,
        responds: true,
        zero: None,
        level: true,
    };
    let plant = model.plant_numbers();
    let white = Model {
        noise: Noise::White,
        ..model
    };
    let own = white.point_of(numbers, &[]);
    let mut begins = vec![(white.at(own.clone()), own)];
    begins.extend(simpler.map(|found| (found.point.clone(), found.point.x.clone())));
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for (point, x) in &begins {
        let mut start = x[..plant].to_vec();
        start.extend(noise(&model, point, &x[plant..]));
        starts.push(start);
    }
    let contained = others.iter().filter(|other| {
        other.model.noise == kind
            && other.model.class != *class
            && class.contains(other.model.class)
    });
    if let Some(other) = contained.min_by(|a, b| a.deviance.total_cmp(&b.deviance)) {
        let numbers = other.model.numbers(&other.point.x);
        let noise = &other.point.x[other.model.plant_numbers()..];
        let own = nested(&model, other.model.class, &numbers);
        starts.extend(own.iter().map(|numbers| model.point_of(numbers, noise)));
    }
    let mut points: Vec<Point> = starts.into_iter().map(|start| model.at(start)).collect();
    points.sort_by(|a, b| a.squares.total_cmp(&b.squares));
    let mut best: Option<Minimum<'a>> = None;
    for point in points.into_iter().take(BESIDE) {
        let hopeless = best.as_ref().map_or(f64::INFINITY, |best| best.deviance);
        let found = Minimum::new(model, minimum(&model, point, hopeless, task)?);
        if best
            .as_ref()
            .is_none_or(|best| found.deviance < best.deviance)
        {
            best = Some(found);
        }
    }
    best.ok_or_else(|| Error::argument("a plant has no starting values"))
}
