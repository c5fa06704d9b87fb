//! How well the noise is known: air that may be there unseen, and degrees of freedom of a variance.

use super::super::likelihood::{Evaluation, Noise};
use super::covariance::{Common, variance};
use super::fit::FlightFit;
use super::search::airs_of;
use super::tolerances::INTERVALS;
use crate::linear_algebra::symmetric::Symmetric;
use crate::{Error, Task};

/// −2 ln L under noises of the recordings, and the variance of each quantity.
type Under = (f64, Vec<f64>);

/// −2 ln L under each of these noises of the recordings, and the variance of each quantity.
fn under(
    fit: &FlightFit,
    common: &Common<'_>,
    noises: &[Vec<Noise>],
    weights: &[Vec<f64>],
    task: &Task,
) -> Result<Vec<Under>, Error> {
    let mut each: Vec<Vec<Evaluation>> = vec![Vec::new(); noises.len()];
    for run in 0..fit.runs.len() {
        let own: Vec<Noise> = noises.iter().map(|noises| noises[run]).collect();
        let parts = fit.model().under(run, &fit.fit.point, &own, task)?;
        for (parts, part) in each.iter_mut().zip(parts) {
            parts.push(part);
        }
    }
    let of = |parts: &Vec<Evaluation>| {
        let cov = common.covariance(parts);
        let objective = parts.iter().map(|part| part.objective).sum();
        let variances = weights.iter().map(|weights| variance(&cov, weights));
        (objective, variances.collect())
    };
    Ok(each.iter().map(of).collect())
}

/// Mean variance of each quantity over slow air, weighted by its likelihood, over these squares.
///
/// An estimate of no air does not mean that there is none. The prior density of its deviation falls
/// with the square root of it: with a constant one intervals cover too much without air, with one that
/// falls with the deviation too little in the weakest air.
pub(super) fn unseen_air(
    fit: &FlightFit,
    common: &Common<'_>,
    weights: &[Vec<f64>],
    squares: &[f64],
    task: &Task,
) -> Result<Vec<f64>, Error> {
    if !fit.plant.integrates() || fit.noises().iter().any(|noise| noise.air > 0.0) {
        return Ok(vec![1.0; weights.len()]);
    }
    let [_, slow] = airs_of(&fit.plant, &fit.runs);
    let sizes = INTERVALS.unseen.map(|power| f64::powi(2.0, power));
    let noises = sizes.map(|size| {
        let pairs = fit.noises().iter().zip(&slow);
        let moved = pairs.map(|(noise, air)| Noise {
            air: size * air.air,
            air_time: air.air_time,
            ..*noise
        });
        moved.collect()
    });
    let (mut total, mut sums) = (0.0, vec![0.0; weights.len()]);
    let found = under(fit, common, &noises, weights, task)?;
    for (size, (objective, variances)) in sizes.iter().zip(found) {
        let rise = (objective - fit.fit.objective).max(INTERVALS.falls);
        let likely = size.sqrt() * (-0.5 * rise).exp();
        total += likely;
        for (sum, variance) in sums.iter_mut().zip(variances) {
            *sum += likely * variance;
        }
    }
    let means = sums.iter().zip(squares);
    Ok(means
        .map(|(sum, square)| (sum / total / square).max(1.0))
        .collect())
}

/// Where a number of a noise is.
type Place = fn(&mut Noise) -> &mut f64;

/// The numbers of a noise that are not zero: how to move each in its logarithm.
fn moves_of(noise: &Noise) -> Vec<Place> {
    let all: [(bool, Place); 6] = [
        (noise.air > 0.0, |noise| &mut noise.air_time),
        (noise.air > 0.0, |noise| &mut noise.air),
        (noise.sensor > 0.0, |noise| &mut noise.sensor_time),
        (noise.sensor > 0.0, |noise| &mut noise.sensor),
        (noise.stamps > 0.0, |noise| &mut noise.stamps),
        (noise.arrivals > 0.0, |noise| &mut noise.arrivals),
    ];
    all.into_iter()
        .filter(|(is, _)| *is)
        .map(|(_, of)| of)
        .collect()
}

/// ν = 2/var(ln V) of the variance V of each quantity, over the numbers of the noise.
pub(super) fn degrees_of_freedom(
    fit: &FlightFit,
    common: &Common<'_>,
    weights: &[Vec<f64>],
    rows: f64,
    task: &Task,
) -> Result<Vec<f64>, Error> {
    let base = fit.noises();
    let mut places = Vec::new();
    for (run, noise) in base.iter().enumerate() {
        places.extend(moves_of(noise).into_iter().map(|of| (run, of)));
    }
    let count = places.len();
    if count == 0 {
        return Ok(vec![rows; weights.len()]);
    }
    let h = INTERVALS.step;
    let at = |steps: &[(usize, f64)]| {
        let mut noise = base.to_vec();
        for (place, step) in steps {
            let (run, of) = places[*place];
            *of(&mut noise[run]) *= step.exp();
        }
        noise
    };
    let pairs: Vec<(usize, usize)> = (0..count)
        .flat_map(|i| (i + 1..count).map(move |j| (i, j)))
        .collect();
    let mut noises = vec![at(&[])];
    for step in [h, -h] {
        noises.extend((0..count).map(|i| at(&[(i, step)])));
    }
    noises.extend(pairs.iter().map(|(i, j)| at(&[(*i, h), (*j, h)])));
    let found = under(fit, common, &noises, weights, task)?;
    if !found.iter().all(|(objective, _)| objective.is_finite()) {
        // At some noise near by one unknown cannot be told from others.
        return Ok(vec![INTERVALS.least_freedom; weights.len()]);
    }
    let (middle, above, below) = (found[0].0, &found[1..=count], &found[count + 1..]);
    let mut curvature = vec![0.0; count * count];
    for i in 0..count {
        curvature[i * (count + 1)] = (above[i].0 - 2.0 * middle + below[i].0) / (h * h);
    }
    for ((i, j), both) in pairs.iter().zip(&below[count..]) {
        let mixed = (both.0 - above[*i].0 - above[*j].0 + middle) / (h * h);
        curvature[i * count + j] = mixed;
        curvature[j * count + i] = mixed;
    }
    curvature.iter_mut().for_each(|entry| *entry *= 0.5);
    let directions = Symmetric::new(&curvature, count);
    let freedom = |quantity: usize| {
        let log = |under: &Under| under.1[quantity].max(1e-300).ln();
        let slope = |i: usize| (log(&above[i]) - log(&below[i])) / (2.0 * h);
        let slopes: Vec<f64> = (0..count).map(slope).collect();
        let spread = directions.inverse_square(&slopes, INTERVALS.least_curvature);
        (2.0 / (2.0 / rows + spread)).max(INTERVALS.least_freedom)
    };
    Ok((0..weights.len()).map(freedom).collect())
}
